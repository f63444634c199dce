"""The loss of a crossing in closed form, the travel and the model of a case, and which orbits are flown."""

import math

import numpy as np
import pytest

from rf_pointing.ephemeris import TopocentricTrack, find_elements, first_pass_above, site, verification_elements
from rf_pointing.papers.keyhole import Loss
from rf_pointing.papers.keyhole_passes import KeyholeCase, station_mount
from rf_pointing.station.antenna.mount import MountParams

BEAM_RAD = math.radians(0.5)


@pytest.fixture(scope="module")
def case() -> KeyholeCase:
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    window = first_pass_above(track, elements.epoch_t_s, math.radians(30.0), math.radians(5.0), 172800.0)
    return KeyholeCase(track=track, window=window, beamwidth_rad=BEAM_RAD)


def test_loss_of_half_a_beamwidth_is_half_of_the_signal() -> None:
    loss = Loss.of(np.array([0.0, 0.5, 0.5]) * BEAM_RAD, 0.2, BEAM_RAD)
    three_db = 10.0 * math.log10(2.0)
    assert loss.signal_s == pytest.approx(0.2)
    assert loss.db_s == pytest.approx(0.4 * three_db)
    # Half power is 3.01 dB.
    assert loss.below_s == pytest.approx(0.4)


def test_a_deep_loss_counts_60_db_and_a_small_one_no_time_below_half_power() -> None:
    deep = Loss.of(np.array([10.0]) * BEAM_RAD, 0.1, BEAM_RAD)
    assert (deep.signal_s, deep.below_s, deep.db_s) == pytest.approx((0.1, 0.1, 6.0))
    # 2.99 dB.
    assert Loss.of(np.array([0.4985]) * BEAM_RAD, 0.1, BEAM_RAD).below_s == 0.0


def test_a_case_may_go_to_the_zenith_or_beyond_it(case: KeyholeCase) -> None:
    over = KeyholeCase(track=case.track, window=case.window, beamwidth_rad=BEAM_RAD, over=True)
    for limits, top_deg in ((case.limits, 90.0), (over.limits, 176.0)):
        assert (limits.azimuth_min_rad, limits.azimuth_max_rad) == (-6.0, 12.0)
        assert math.degrees(limits.elevation_max_rad) == pytest.approx(top_deg)


def test_the_calibrated_model_takes_the_average_of_rates_for_an_acceleration_lag(case: KeyholeCase) -> None:
    """A rate averaged over T of steady acceleration is late by T / 2 on either side: -T of the velocity lag."""
    mount = station_mount()
    found = KeyholeCase(track=case.track, window=case.window, beamwidth_rad=BEAM_RAD, mount=mount).calibrated
    assert found.coefficients["azimuth_velocity_lag"] == -1.022
    assert found.coefficients["azimuth_acceleration_lag"] == pytest.approx(0.02 + 5.0 * 1.022)
    assert found.coefficients["elevation_acceleration_lag"] == pytest.approx(0.02 + 5.0 * 1.907)
    assert set(KeyholeCase.calibrated.fget(case).coefficients.values()) == {0.0}  # type: ignore[attr-defined]
    assert MountParams() == case.mount


def test_the_mount_of_the_station_is_that_of_satcal_table_1() -> None:
    degrees = {
        "azimuth_offset": 0.178, "non_orthogonality": 0.062, "collimation": -0.010, "azimuth_encoder_sine": -0.194,
        "azimuth_encoder_cosine": -0.048, "mislevel_east": 0.039, "mislevel_north": -0.007, "elevation_offset": -0.202,
        "droop": -0.089, "elevation_encoder_sine": -0.009,
    }  # fmt: skip
    known = station_mount().model().coefficients
    assert {name: math.degrees(known[name]) for name in degrees} == pytest.approx(degrees)
    assert (known["azimuth_velocity_lag"], known["elevation_velocity_lag"]) == (-1.022, -1.907)
