"""Angle to the Sun: the Sun itself, the full Moon, and a grid over a pass."""

import numpy as np
import pytest

from rf_pointing.ephemeris import (
    Elements,
    TopocentricTrack,
    find_passes,
    moon,
    site,
    smallest_sun_angle_rad,
    sun,
    sun_angle_rad,
)
from rf_pointing.ephemeris.time_scales import posix_from_calendar


def test_the_sun_is_at_no_angle_from_itself() -> None:
    track = TopocentricTrack(sun(), site("Madrid DSS-63"))
    np.testing.assert_allclose(sun_angle_rad(track, 1151384680.0 + np.arange(3) * 9999.0), 0.0, atol=1e-12)


def test_moon_and_sun_meet_in_an_eclipse_and_face_each_other_at_full_moon() -> None:
    """Total eclipse of 2006 March 29 over southern Turkey (36.8 N, 30.6 E) at 10:55 UTC; full moon on April 13."""
    track = TopocentricTrack(moon(), site("Madrid DSS-63").from_degrees(36.8, 30.6, 0.0))
    eclipse, full = (posix_from_calendar(text) for text in ("2006-03-29T10:56:00", "2006-04-13T16:40:00"))
    angles = np.degrees(sun_angle_rad(track, [eclipse, full]))
    assert angles[0] < 0.03
    assert angles[1] > 174.0


def test_the_smallest_angle_of_a_pass_is_that_of_a_fine_grid(track: TopocentricTrack, cbers: Elements) -> None:
    for found in find_passes(track, cbers.epoch_t_s, 86400.0, 0.1):
        fine = sun_angle_rad(track, np.linspace(found.aos_t_s, found.los_t_s, 401)).min()
        assert smallest_sun_angle_rad(track, found) == pytest.approx(fine, abs=np.radians(0.2))
