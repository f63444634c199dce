"""What the controller counts as held: from the sensor, the carrier, the plan of a crossing, or the axes alone."""

import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG, PointingError
from rf_pointing.station.pointing.antenna_watch import AxisState
from rf_pointing.station.pointing.outcome import BeamEvidence, CarrierLevels, PassStatistics
from rf_pointing.tracking.sensors import NO_SENSOR

WIDTH_RAD = 65.0 * MDEG


def error(right_mdeg: float = 0.0, up_mdeg: float = 0.0, sensor: str = "monopulse", **changes: Any) -> PointingError:
    return PointingError(
        t_s=changes.pop("t_s", 0.0), sensor=sensor, cross_elevation_rad=right_mdeg * MDEG,
        elevation_rad=up_mdeg * MDEG, **changes,
    )  # fmt: skip


def axes(right_mdeg: float = 0.0, up_mdeg: float = 0.0, doubt: str = "") -> AxisState:
    off = np.array([right_mdeg, up_mdeg]) * MDEG
    return AxisState(age_s=0.1, error_rad=off, distance_rad=float(np.hypot(*off)), doubt=doubt)


@pytest.mark.parametrize(
    ("evidence", "error_mdeg"),
    [
        ({"sensor": NO_SENSOR, "axes": axes(30.0, 40.0)}, 50.0),
        ({"sensor": NO_SENSOR, "axes": axes(3.0, 4.0), "power": 0.5}, 32.5),
        ({"sensor": NO_SENSOR, "axes": axes(30.0, 40.0), "power": 1.0}, 50.0),
        ({"sensor": "monopulse", "axes": axes(30.0, 40.0), "sensed": error(6.0, 8.0)}, 10.0),
        ({"sensor": "monopulse", "axes": axes(), "power": 0.5**4}, 65.0),
        ({"sensor": "monopulse", "axes": axes()}, None),
        ({"sensor": "monopulse", "axes": AxisState(), "sensed": error()}, None),
        ({"sensor": NO_SENSOR, "axes": axes(doubt="joint_states has been silent for 1.1 s")}, None),
        ({"sensor": "monopulse", "axes": axes(0.0, 2.0), "planned_rad": 100.0 * MDEG, "sensed": error()}, 102.0),
    ],
)
def test_the_error_of_the_beam_is_the_best_that_is_known(evidence: dict[str, Any], error_mdeg: float | None) -> None:
    found = BeamEvidence(**evidence).error_rad(WIDTH_RAD)
    assert (None if found is None else found / MDEG) == (None if error_mdeg is None else pytest.approx(error_mdeg))


def test_a_scan_measures_its_centre_so_the_axes_off_it_are_added() -> None:
    """The centre is 3 mdeg left of the target, the beam another 6 mdeg beyond it on the circle."""
    evidence = BeamEvidence(
        sensor="conscan", axes=axes(), sensed=error(3.0, 0.0, "conscan"), off_centre_rad=np.array([6.0, 0.0]) * MDEG
    )
    assert evidence.error_rad(WIDTH_RAD) == pytest.approx(9.0 * MDEG)


def test_the_level_is_the_mean_power_of_the_last_second_over_that_on_the_axis() -> None:
    levels = CarrierLevels()
    for t_s, level in ((8.0, 10.0), (9.5, 60.0), (9.7, 57.0), (9.99, 0.0)):
        levels.take(error(t_s=t_s, carrier_to_noise_db_hz=level))
    levels.take(error(t_s=9.6, sensor="radar", carrier_to_noise_db_hz=90.0))
    assert levels.power(9.9, 9.0, 60.0) == pytest.approx(0.5 * (1.0 + 10.0**-0.3))
    assert levels.power(9.9, 9.8, 60.0) is None
    assert levels.power(9.9, 9.0, math.inf) is None, "a link of unknown range"


def test_seconds_are_counted_once_and_a_gap_is_lost() -> None:
    tally = PassStatistics()
    for k in range(100):
        tally.count(0.1 * k, 0.1, 0.0, WIDTH_RAD)
    assert (tally.outcome.tracked_s, tally.outcome.lost_s) == (pytest.approx(10.0), 0.0)
    tally.count(15.0, 0.1, 0.0, WIDTH_RAD)
    assert tally.outcome.duration_s == pytest.approx(15.1)
    assert tally.outcome.lost_s == pytest.approx(5.1 - 0.15)
    tally.count(15.1, 0.1, None, WIDTH_RAD)
    assert not tally.held
    assert tally.held_t_s == 15.0
    assert tally.outcome.lost_s == pytest.approx(5.1 - 0.15 + 0.1)


def test_the_rms_is_that_of_the_valid_errors() -> None:
    tally = PassStatistics()
    assert tally.rms_rad == (0.0, 0.0)
    tally.note(error(3.0, -4.0))
    assert tally.rms_rad == (pytest.approx(3.0 * MDEG), pytest.approx(4.0 * MDEG))
    assert tally.samples == 1
    for k in range(100):
        tally.note(error(3.0 if k % 2 else -3.0, 4.0))
        tally.note(None)
    assert tally.rms_rad == (pytest.approx(3.0 * MDEG), pytest.approx(4.0 * MDEG))
