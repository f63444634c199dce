"""When an error becomes an observation and what stands in its row, on a target that moves evenly."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import ObservationJournal, SectorRule
from rf_pointing.core import JointReading, PointingError, Target
from rf_pointing.station.campaign.log import CalibrationLog

BEGIN_S = 2000.0
PLACE, RATE = np.array([3.0, 0.8]), np.array([0.002, -0.001])
SIGMA_RAD = 3e-5


def target(t_s: float, name: str = "A") -> Target:
    since = t_s - BEGIN_S
    azimuth, elevation = (PLACE + RATE * since).tolist()
    return Target(
        t_s=t_s, name=name, azimuth_rad=azimuth, elevation_rad=elevation, azimuth_rate_rad_s=RATE[0],
        elevation_rate_rad_s=RATE[1], azimuth_acceleration_rad_s2=1e-7, elevation_acceleration_rad_s2=-2e-7,
        range_m=1e6 - 5e3 * since, range_rate_m_s=-5e3 + 10.0 * since, refraction_rad=0.0,
    )  # fmt: skip


def error(
    t_s: float, right: float = 1e-4, up: float = -2e-4, sensor: str = "monopulse", **changes: Any
) -> PointingError:
    given = {"covariance_rad2": np.array([[4e-10, 1e-10], [1e-10, 9e-10]])} | changes
    return PointingError(t_s=t_s, sensor=sensor, cross_elevation_rad=right, elevation_rad=up, **given)


def collecting(spacing_s: float = 1.0, **changes: Any) -> CalibrationLog:
    return CalibrationLog("Mine", "X", spacing_s, SIGMA_RAD, **changes)


def feed(collected: CalibrationLog, t_s: float, name: str = "A", **changes: Any) -> Any:
    """Give the target around a time, encoders on it, and an error; return the observation."""
    for ahead_s in (-0.5, 0.5):
        collected.take_target(target(t_s + ahead_s, name))
    here = PLACE + RATE * (t_s - BEGIN_S)
    collected.take_joints(JointReading(t_s=t_s, position_rad=here, velocity_rad_s=RATE))
    return collected.take_error(error(t_s, **changes))


# The row


@pytest.mark.parametrize("over", [False, True])
def test_a_row_is_the_encoders_with_the_error_against_the_direct_or_the_other_angles_of_the_target(over: bool) -> None:
    collected = collecting()
    for since_s in (0.0, 1.0):
        collected.take_target(target(BEGIN_S + since_s))
    place = np.array([3.01 - math.pi, math.pi - 0.79]) if over else np.array([3.01 + 2.0 * math.pi, 0.79])
    # Read 60 ms before the middle of the error, and moving.
    collected.take_joints(JointReading(t_s=BEGIN_S + 0.24, position_rad=place, velocity_rad_s=[0.01, 0.02]))
    row = collected.take_error(error(BEGIN_S + 0.3))
    then = place + 0.06 * np.array([0.01, 0.02])
    assert (row.station, row.band, row.t_s[0], row.pass_id.tolist()) == ("Mine", "X", BEGIN_S + 0.3, [0])
    assert row.observed_azimuth_rad[0] == pytest.approx(then[0] + 1e-4 / abs(math.cos(then[1])), abs=1e-12)
    assert row.observed_elevation_rad[0] == pytest.approx(then[1] - (-2e-4 if over else 2e-4), abs=1e-12)
    true = PLACE + 0.3 * RATE
    # On the turn of the encoders; the quintic between its samples is off by less than 1 urad.
    azimuth, elevation = (true[0] - math.pi, math.pi - true[1]) if over else (true[0] + 2.0 * math.pi, true[1])
    assert row.true_azimuth_rad[0] == pytest.approx(azimuth, abs=1e-6)
    assert row.true_elevation_rad[0] == pytest.approx(elevation, abs=1e-6)
    sign = -1.0 if over else 1.0
    assert row.azimuth_rate_rad_s[0] == pytest.approx(RATE[0], abs=1e-6)
    assert row.elevation_rate_rad_s[0] == pytest.approx(sign * RATE[1], abs=1e-6)
    assert np.sign(row.elevation_acceleration_rad_s2[0] * row.azimuth_acceleration_rad_s2[0]) == -sign
    # The sensor's own sigma and what servo and wind add.
    assert row.sigma_azimuth_rad[0] == pytest.approx(math.sqrt(4e-10 + SIGMA_RAD**2) / math.cos(true[1]), rel=1e-6)
    assert row.sigma_elevation_rad[0] == pytest.approx(math.sqrt(9e-10 + SIGMA_RAD**2))
    assert row.range_m[0] == pytest.approx(1e6 - 1500.0)
    assert row.range_rate_m_s[0] == pytest.approx(-5e3 + 3.0)


def test_a_campaign_that_begins_with_a_temperature_stores_one_with_every_row(tmp_path: Path) -> None:
    journal = ObservationJournal(tmp_path / "points.csv", "Mine", "X")
    collected = collecting(journal=journal)
    collected.take_temperature(BEGIN_S, 290.0)
    assert feed(collected, BEGIN_S).temperature_k.tolist() == [290.0]
    collected.take_temperature(BEGIN_S + 5.0, 291.5)
    assert feed(collected, BEGIN_S + 5.0) is not None
    again = collecting(journal=ObservationJournal(journal.path, "Mine", "X"))
    assert again.observations().temperature_k.tolist() == [290.0, 291.5]
    # A file has the column for all rows: without a thermometer the campaign waits.
    assert feed(again, BEGIN_S + 10.0) is None
    assert "no temperature for 3600 s, which this campaign stores" in again.reasons()
    again.take_temperature(BEGIN_S + 11.0, 292.0)
    assert feed(again, BEGIN_S + 12.0) is not None
    again.take_temperature(BEGIN_S + 14.0 - 3601.0, 292.0)
    assert feed(again, BEGIN_S + 14.0) is None
    # Anew without one it stores none.
    again.begin_anew("later")
    assert feed(again, BEGIN_S + 15.0).temperature_k is None
    again.take_temperature(BEGIN_S + 16.0, 290.0)
    assert feed(again, BEGIN_S + 17.0).temperature_k is None
    assert again.observations().temperature_k is None


# When one is due


def test_scans_have_a_spacing_of_their_own_that_is_never_the_shorter_one() -> None:
    for given_s, spacing_s in ((4.0, 4.0), (0.5, 1.0)):
        collected, taken = collecting(scan_spacing_s=given_s), []
        for k in range(90):
            t_s = BEGIN_S + 0.1 * k
            collected.take_status(t_s, PLACE, np.zeros(2), "conscan", "conscan")
            if feed(collected, t_s, sensor="conscan") is not None:
                taken.append(0.1 * k)
        # Stamps of 2000 s are rounded to 0.2 ps.
        assert np.diff(taken) == pytest.approx([spacing_s] * (len(taken) - 1), abs=0.11)
        assert min(np.diff(taken)) > spacing_s - 0.01


@pytest.mark.parametrize(
    ("sensor", "mode", "centre", "reason"),
    [
        ("monopulse", "conscan", True, "the beam scans (mode conscan)"), ("monopulse", "monopulse", True, ""),
        ("monopulse", "program_track", True, ""), ("conscan", "conscan", True, ""),
        ("conscan", "steptrack", True, "conscan does not track (mode steptrack)"),
        ("conscan", "conscan", False, "the centre of the scan at its time is not known"),
    ],
)  # fmt: skip
def test_the_mode_rules_which_angles_an_error_belongs_to(sensor: str, mode: str, centre: bool, reason: str) -> None:
    collected = collecting()
    collected.take_status(BEGIN_S if centre else BEGIN_S + 1.0, PLACE + 0.001, np.zeros(2), mode, sensor)
    row = feed(collected, BEGIN_S, sensor=sensor)
    if reason:
        assert row is None
        assert collected.reasons() == f"1 errors: {reason}"
    else:
        of = PLACE + (0.001 if sensor == "conscan" else 0.0)
        assert row.observed_elevation_rad[0] == pytest.approx(of[1] - 2e-4)


def test_an_error_that_is_not_valid_names_its_reason_or_its_sensor() -> None:
    collected = collecting()
    feed(collected, BEGIN_S, valid=False, reason="weak")
    feed(collected, BEGIN_S, valid=False)
    assert collected.reasons() == "1 errors: not valid (weak); 1 errors: not valid (monopulse)"


# What is kept


def test_sectors_of_the_sky_are_filled_by_true_directions() -> None:
    collected, rule = collecting(), SectorRule()
    empty = collected.coverage(rule)
    assert empty.counts.shape == (rule.count,)
    assert not empty.counts.any()
    feed(collected, BEGIN_S)
    counts = collected.coverage(rule).counts
    assert counts.sum() == 1
    wanted = rule.coverage(np.array([PLACE[0]]), np.array([PLACE[1]])).counts
    np.testing.assert_array_equal(counts, wanted)
