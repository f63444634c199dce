"""A table of the sky's motion made finer, or cut, against the propagator itself, zenith included."""

import math

import numpy as np

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack, find_elements, first_pass_above, site, verification_elements
from rf_pointing.station.pointing.certificates import pass_profile


def test_the_refined_table_is_the_propagators_motion_even_at_the_zenith() -> None:
    """A pass through 89.90 deg: azimuth turns at 300 deg/s between two of the seconds that are known."""
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    window = first_pass_above(track, elements.epoch_t_s, math.radians(89.0), math.radians(5.0), 3.0 * 86400.0)
    fine = pass_profile(track, window).resampled(0.1)
    truth = track.sample(fine.t_s)
    apart = angular_distance_rad(*fine.position_rad.T, truth.azimuth_rad, truth.elevation_rad)
    assert np.max(apart) < 0.001 * MDEG
    gentle = truth.elevation_rad < math.radians(85.0)
    rates = np.column_stack([truth.azimuth_rate_rad_s, truth.elevation_rate_rad_s])
    bends = np.column_stack([truth.azimuth_acceleration_rad_s2, truth.elevation_acceleration_rad_s2])
    np.testing.assert_allclose(fine.velocity_rad_s[gentle], rates[gentle], atol=1e-8)
    np.testing.assert_allclose(fine.acceleration_rad_s2[gentle], bends[gentle], atol=1e-7)
    np.testing.assert_allclose(fine.position_rad[0], pass_profile(track, window).position_rad[0], atol=1e-12)


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
