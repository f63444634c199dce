"""A table of the sky's motion made finer, or cut, against the propagator itself, zenith included."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack, find_elements, first_pass_above, site, verification_elements
from rf_pointing.planning.profile import MOST_STEPS, PassProfile
from rf_pointing.station.pointing.certificates import pass_profile


def test_the_refined_table_is_the_propagators_motion_even_at_the_zenith() -> None:
    """A pass through 89.90 deg: azimuth turns at 300 deg/s between two of the seconds that are known."""
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    window = first_pass_above(track, elements.epoch_t_s, math.radians(89.0), math.radians(5.0), 3.0 * 86400.0)
    fine = pass_profile(track, window).resampled()
    truth = track.sample(fine.t_s)
    apart = angular_distance_rad(*fine.position_rad.T, truth.azimuth_rad, truth.elevation_rad)
    assert np.max(apart) < 0.001 * MDEG
    gentle = truth.elevation_rad < math.radians(85.0)
    rates = np.column_stack([truth.azimuth_rate_rad_s, truth.elevation_rate_rad_s])
    bends = np.column_stack([truth.azimuth_acceleration_rad_s2, truth.elevation_acceleration_rad_s2])
    np.testing.assert_allclose(fine.velocity_rad_s[gentle], rates[gentle], atol=1e-8)
    np.testing.assert_allclose(fine.acceleration_rad_s2[gentle], bends[gentle], atol=1e-7)
    np.testing.assert_allclose(fine.position_rad[0], pass_profile(track, window).position_rad[0], atol=1e-12)


def test_a_pass_of_many_hours_has_longer_steps_and_is_as_true() -> None:
    """Molniya over Goldstone, 10.9 h: at 0.1 s its certificate takes 8 times as long."""
    elements = find_elements(verification_elements(), "8195")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    window = first_pass_above(track, elements.epoch_t_s, math.radians(40.0), math.radians(5.0), 3.0 * 86400.0)
    assert window.duration_s > 10.0 * 3600.0
    fine = pass_profile(track, window).resampled()
    assert len(fine.t_s) == MOST_STEPS + 1
    some = fine.t_s[:: MOST_STEPS // 500]
    truth = track.sample(some)
    apart = angular_distance_rad(*fine.position_rad[:: MOST_STEPS // 500].T, truth.azimuth_rad, truth.elevation_rad)
    assert np.max(apart) < 0.001 * MDEG


def test_a_piece_of_a_pass_is_the_propagators_motion_between_its_ends() -> None:
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    window = first_pass_above(track, elements.epoch_t_s, math.radians(40.0), math.radians(5.0), 3.0 * 86400.0)
    piece = pass_profile(track, window).between(window.aos_t_s + 200.3, window.los_t_s - 100.7)
    assert (piece.t_s[0], piece.t_s[-1]) == (window.aos_t_s + 200.3, window.los_t_s - 100.7)
    truth = track.sample(piece.t_s)
    apart = angular_distance_rad(*piece.position_rad.T, truth.azimuth_rad, truth.elevation_rad)
    assert np.max(apart) < 0.001 * MDEG
    assert np.max(np.abs(np.diff(piece.position_rad[:, 0]))) < math.pi


def profile(**changes: object) -> PassProfile:
    still = [[0.0, 0.0]] * 3
    table: dict[str, object] = {
        "name": "P", "t_s": [0, 1, 2], "position_rad": [[0.1, 0.2]] * 3, "velocity_rad_s": still,
        "acceleration_rad_s2": still, "sun_rad": still, "range_m": [1e6] * 3, "satellite_gain_db": [0.0] * 3,
    }  # fmt: skip
    return PassProfile(**{**table, **changes})  # type: ignore[arg-type]


def test_columns_of_a_profile_become_arrays_of_numbers() -> None:
    made = profile()
    for name in ("t_s", "position_rad", "velocity_rad_s", "acceleration_rad_s2", "sun_rad", "range_m"):
        assert getattr(made, name).dtype == np.float64
    assert made.t_s.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(("changes", "message"), [
    ({"t_s": [0.0, math.nan, 2.0]}, "t_s=.* must be finite"),
    ({"t_s": [[0.0, 1.0, 2.0]]}, "t_s has shape"),
    ({"t_s": [0.0, 1.0, 1.0]}, "t_s must have at least 2 increasing times"),
    ({"velocity_rad_s": [[0.0, 0.0]] * 2}, "velocity_rad_s has shape"),
    ({"satellite_gain_db": [0.0, math.inf, 0.0]}, "satellite_gain_db=.* must be finite"),
    ({"range_m": [1e6, 0.0, 1e6]}, "range_m=0.0 must be >= 1"),
])  # fmt: skip
def test_a_profile_that_no_pass_has_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        profile(**changes)


def smooth(t_s: np.ndarray, turn: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Azimuth and elevation with all of their derivatives different."""
    azimuth = (0.4 + turn + 0.3 * t_s - 0.2 * t_s**2, 0.3 - 0.4 * t_s, np.full_like(t_s, -0.4))
    elevation = (0.7 - 0.25 * t_s + 0.15 * t_s**2, -0.25 + 0.3 * t_s, np.full_like(t_s, 0.3))
    position, velocity, acceleration = (np.column_stack(pair) for pair in zip(azimuth, elevation, strict=True))
    return position, velocity, acceleration


def table(t_s: np.ndarray, turn: float = 0.0) -> PassProfile:
    position, velocity, acceleration = smooth(t_s, turn)
    return PassProfile(
        name="P", t_s=t_s, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration,
        sun_rad=np.column_stack([1.0 + 0.004 * t_s, 0.8 - 0.003 * t_s]), range_m=1e6 + 1e4 * t_s,
        satellite_gain_db=-3.0 * t_s,
    )  # fmt: skip


def test_every_column_of_a_finer_table_is_that_of_its_time() -> None:
    fine = table(np.array([0.0, 1.0, 2.03])).resampled()
    assert len(fine.t_s) == 22, "at most 0.1 s each"
    assert (fine.t_s[0], fine.t_s[-1], fine.name) == (0.0, 2.03, "P")
    assert fine.duration_s == pytest.approx(2.03)
    np.testing.assert_allclose(fine.range_m, 1e6 + 1e4 * fine.t_s, rtol=1e-12)
    np.testing.assert_allclose(fine.satellite_gain_db, -3.0 * fine.t_s, atol=1e-12)
    # The Sun goes by straight lines between its directions: 5 mrad leave 3e-6.
    np.testing.assert_allclose(fine.sun_rad, table(fine.t_s).sun_rad, atol=5e-6)
    np.testing.assert_allclose(
        fine.sun_angle_rad(), angular_distance_rad(*fine.position_rad.T, *fine.sun_rad.T), atol=1e-12
    )
