"""Uncertainty of elements on the sky: closed form at closest approach, Monte Carlo of moved orbits, growth with age."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream, sky_offset_rad, utc_text
from rf_pointing.ephemeris import Elements, ElementUncertainty, OemTarget, Site, TopocentricTrack, moon, sky_uncertainty
from test.ephemeris.oem_text import START_T_S, STEP_S, read_oem, teme_states, text_of

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
            np.arcsin(moved[:, 2] / np.linalg.norm(moved, axis=1)), azimuth, elevation,
        )
    )  # fmt: skip
    scale = np.sqrt(np.outer(np.diag(sky.covariance_rad2), np.diag(sky.covariance_rad2)))
    np.testing.assert_allclose(np.cov(offsets) / scale, sky.covariance_rad2 / scale, atol=0.03)


def test_split_and_matrix_hold_the_same_variance(track: TopocentricTrack) -> None:
    sky = sky_uncertainty(track, TCA_T_S + 77.0, ElementUncertainty())
    assert sky.along_track_rad**2 + sky.cross_track_rad**2 == pytest.approx(np.trace(sky.covariance_rad2))
    assert np.all(np.linalg.eigvalsh(sky.covariance_rad2) > 0.0)
    assert sky.age_s == pytest.approx(TCA_T_S + 77.0 - 1151347924.08, abs=0.01)


def test_nothing_is_known_of_the_error_of_a_body(goldstone: Site) -> None:
    assert sky_uncertainty(TopocentricTrack(moon(), goldstone), TCA_T_S, ElementUncertainty()) is None


def ephemeris(cbers: Elements, goldstone: Site, frame: str, *matrices: np.ndarray) -> TopocentricTrack:
    """A track on an ephemeris of TEME states, with covariances [km^2] at its first and last but one state."""
    rows = [START_T_S + STEP_S * k for k in (1, 13)]
    blocks = ["COVARIANCE_START"]
    for t_s, matrix in zip(rows, matrices, strict=False):
        full = np.zeros((6, 6))
        full[:3, :3] = matrix
        blocks += [f"EPOCH = {utc_text(t_s)}", f"COV_REF_FRAME = {frame}"]
        blocks += [" ".join(f"{value:.12e}" for value in full[k, : k + 1]) for k in range(6)]
    text = text_of(teme_states(cbers))
    text = text[: text.index("COVARIANCE_START")] + "\n".join([*blocks, "COVARIANCE_STOP", ""])
    return TopocentricTrack(OemTarget(read_oem(text)), goldstone)


def test_an_ephemeris_brings_its_covariance_which_is_a_mean_between_two_of_its_epochs(
    cbers: Elements, goldstone: Site
) -> None:
    early, late = np.diag([0.01, 0.25, 0.04]), np.diag([0.04, 1.0, 0.09])
    track = ephemeris(cbers, goldstone, "RTN", early, late)
    for share, along_m in ((0.0, 500.0), (0.5, math.sqrt(0.5 * (0.25 + 1.0)) * 1e3), (1.0, 1000.0), (1.05, 1000.0)):
        sky = sky_uncertainty(track, START_T_S + STEP_S + share * 12.0 * STEP_S, ElementUncertainty())
        # The velocity is within 0.2 deg of the transverse axis.
        assert sky.along_track_s * 7450.0 == pytest.approx(along_m, rel=0.01)
        assert sky.age_s == 0.0
        assert sky.along_track_rad**2 + sky.cross_track_rad**2 == pytest.approx(np.trace(sky.covariance_rad2))


@pytest.mark.parametrize("frame", ["TNW", "TEME", "EME2000", "ITRF-2020"])
def test_a_covariance_is_the_same_error_in_every_frame(frame: str, cbers: Elements, goldstone: Site) -> None:
    """A sphere is one in all of them; a needle along an axis of the frame is where that axis points."""
    t_s = START_T_S + STEP_S
    round_ = sky_uncertainty(ephemeris(cbers, goldstone, frame, np.eye(3)), t_s, ElementUncertainty())
    assert np.allclose(np.linalg.eigvalsh(round_.covariance_rad2), round_.cross_track_rad**2, rtol=1e-6)
    track = ephemeris(cbers, goldstone, frame, np.diag([1.0, 0.0, 0.0]))
    needle = sky_uncertainty(track, t_s, ElementUncertainty())
    axis = track.site.axes @ track.target.axes_of(frame, t_s)[0]
    seen = np.array(track.relative_motion_at(t_s)[0].position)
    across = axis - seen * (axis @ seen) / (seen @ seen)
    assert math.sqrt(np.trace(needle.covariance_rad2)) == pytest.approx(
        1e3 * np.linalg.norm(across) / np.linalg.norm(seen)
    )


def test_what_cannot_be_a_covariance_is_refused_and_an_unknown_frame_said(cbers: Elements, goldstone: Site) -> None:
    with pytest.raises(ValueError, match=r"line \d+: a covariance has the eigenvalue -1 km2, must be >= 0"):
        ephemeris(cbers, goldstone, "RTN", np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    odd = ephemeris(cbers, goldstone, "LVLH", np.eye(3))
    assert "covariance in LVLH is not used" in odd.warnings(START_T_S)
    assert sky_uncertainty(odd, START_T_S + STEP_S, ElementUncertainty()) is None


def test_after_a_manoeuvre_the_error_grows_by_three_times_its_speed() -> None:
    law = ElementUncertainty(along_m=0.0, along_growth_m_s=0.0, along_drag_m_s2=0.0, manoeuvre_m_s=0.1)
    assert law.sigmas_m(86400.0)[0] == pytest.approx(3.0 * 0.1 * 86400.0)
