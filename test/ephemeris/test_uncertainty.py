"""Uncertainty of elements on the sky: closed form at closest approach, Monte Carlo of moved orbits, growth with age."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream, sky_offset_rad
from rf_pointing.ephemeris import ElementUncertainty, Site, TopocentricTrack, moon, sky_uncertainty

TCA_T_S = 1151384680.3


def test_defaults_are_a_kilometre_and_grow_by_kilometres_a_day() -> None:
    model = ElementUncertainty()
    assert model.sigmas_m(0.0) == (700.0, 300.0, 300.0)
    along, cross, radial = model.sigmas_m(-3.0 * 86400.0)
    assert along == pytest.approx(700.0 + 3000.0 + 1800.0)
    assert (cross, radial) == (pytest.approx(600.0), pytest.approx(600.0))


def test_along_track_error_alone_is_a_time_error_along_the_motion(track: TopocentricTrack) -> None:
    """Moving the satellite by the stated seconds moves the direction by the stated angle."""
    only_along = ElementUncertainty(along_m=1000.0, cross_m=0.0, radial_m=0.0).replace(
        along_growth_m_s=0.0, along_drag_m_s2=0.0, cross_growth_m_s=0.0, radial_growth_m_s=0.0
    )
    for t_s in (TCA_T_S - 250.0, TCA_T_S, TCA_T_S + 200.0):
        sky = sky_uncertainty(track, t_s, only_along)
        assert sky.along_track_s == pytest.approx(1000.0 / 7450.0, rel=0.01)
        here = track.target_at(t_s)
        moved = track.with_offsets(along_track_offset_s=sky.along_track_s, cross_track_offset_rad=0.0).target_at(t_s)
        offset = np.hypot(*sky_offset_rad(moved.azimuth_rad, moved.elevation_rad, here.azimuth_rad, here.elevation_rad))
        assert math.sqrt(np.trace(sky.covariance_rad2)) == pytest.approx(offset, rel=0.01)
        assert sky.cross_track_rad < 0.15 * sky.along_track_rad


def test_covariance_is_that_of_randomly_moved_satellites(track: TopocentricTrack) -> None:
    """Monte Carlo in the plane of the sky with 20 000 draws: 2 % of each element's scale."""
    model, t_s = ElementUncertainty(), TCA_T_S - 200.0
    sky = sky_uncertainty(track, t_s, model)
    rng = random_stream(5, "orbit errors")
    motion, _, _ = track.relative_motion_at(t_s)
    orbit = (
        np.array([track.site.axes]) @ np.stack([np.array(v) for v in track.target.motion_at(t_s).derivatives()[:2]]).T
    )
    position, velocity = orbit[0].T
    along = velocity / np.linalg.norm(velocity)
    normal = np.cross(position, velocity)
    normal /= np.linalg.norm(normal)
    axes = np.array([along, normal, np.cross(along, normal)])
    errors = rng.standard_normal((20000, 3)) * model.sigmas_m(sky.age_s) @ axes
    seen = np.array(motion.position)
    azimuth, elevation = math.atan2(seen[0], seen[1]), math.asin(seen[2] / np.linalg.norm(seen))
    moved = seen + errors
    offsets = np.array(
        sky_offset_rad(
            np.arctan2(moved[:, 0], moved[:, 1]),
            np.arcsin(moved[:, 2] / np.linalg.norm(moved, axis=1)),
            azimuth,
            elevation,
        )
    )
    scale = np.sqrt(np.outer(np.diag(sky.covariance_rad2), np.diag(sky.covariance_rad2)))
    np.testing.assert_allclose(np.cov(offsets) / scale, sky.covariance_rad2 / scale, atol=0.03)


def test_split_and_matrix_hold_the_same_variance(track: TopocentricTrack) -> None:
    sky = sky_uncertainty(track, TCA_T_S + 77.0, ElementUncertainty())
    assert sky.along_track_rad**2 + sky.cross_track_rad**2 == pytest.approx(np.trace(sky.covariance_rad2))
    assert np.all(np.linalg.eigvalsh(sky.covariance_rad2) > 0.0)
    assert sky.age_s == pytest.approx(TCA_T_S + 77.0 - 1151347924.08, abs=0.01)


def test_nothing_is_known_of_the_error_of_a_body(goldstone: Site) -> None:
    assert sky_uncertainty(TopocentricTrack(moon(), goldstone), TCA_T_S, ElementUncertainty()) is None
