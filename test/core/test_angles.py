"""Angles against closed forms on the sphere, at random points and at the poles."""

import math

import numpy as np
import pytest

from rf_pointing.core import (
    MDEG,
    angular_distance_rad,
    azel_from_unit_vector,
    nearest_turn_rad,
    sky_offset_rad,
    unit_vector_from_azel,
    wrap_rad,
)

ROUNDING_RAD = 1e-14


def directions(random: np.random.Generator, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    return random.uniform(-3.0 * np.pi, 3.0 * np.pi, count), np.arcsin(random.uniform(-1.0, 1.0, count))


def test_wrapped_angles_lie_in_the_half_open_turn_and_differ_by_whole_turns(random: np.random.Generator) -> None:
    angle = random.uniform(-100.0, 100.0, 1000)
    wrapped = wrap_rad(angle)
    assert np.all((wrapped >= -np.pi) & (wrapped < np.pi))
    turns = (angle - wrapped) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-13)


def test_half_a_turn_wraps_to_minus_half_a_turn() -> None:
    assert wrap_rad(np.pi) == -np.pi
    assert wrap_rad(-np.pi) == -np.pi


def test_nearest_turn_is_within_half_a_turn_and_the_same_direction(random: np.random.Generator) -> None:
    for angle, reference in random.uniform(-30.0, 30.0, (300, 2)):
        near = nearest_turn_rad(angle, reference)
        assert abs(near - reference) <= np.pi + ROUNDING_RAD
        assert abs(float(wrap_rad(near - angle))) < 1e-13


@pytest.mark.parametrize(("angle", "reference"), [(math.nan, 0.0), (0.0, math.inf)])
def test_nearest_turn_refuses_what_is_not_finite(angle: float, reference: float) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        nearest_turn_rad(angle, reference)


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "enu"),
    [(0, 0, (0, 1, 0)), (90, 0, (1, 0, 0)), (180, 0, (0, -1, 0)), (270, 0, (-1, 0, 0)), (33, 90, (0, 0, 1))],
)  # fmt: skip
def test_azimuth_runs_from_north_through_east_and_elevation_up(
    azimuth_deg: float, elevation_deg: float, enu: tuple[int, int, int]
) -> None:
    vector = unit_vector_from_azel(math.radians(azimuth_deg), math.radians(elevation_deg))
    np.testing.assert_allclose(vector, enu, atol=1e-15)


def test_unit_vectors_and_angles_are_inverse(random: np.random.Generator) -> None:
    azimuth, elevation = directions(random)
    back_azimuth, back_elevation = azel_from_unit_vector(unit_vector_from_azel(azimuth, elevation))
    assert np.all((back_azimuth >= 0.0) & (back_azimuth < 2.0 * np.pi))
    np.testing.assert_allclose(np.cos(elevation) * wrap_rad(back_azimuth - azimuth), 0.0, atol=ROUNDING_RAD)
    np.testing.assert_allclose(back_elevation, elevation, atol=1e-12)


def test_offset_has_the_length_of_the_great_circle_arc(random: np.random.Generator) -> None:
    azimuth, elevation = directions(random)
    from_azimuth, from_elevation = directions(random)
    right, up = sky_offset_rad(azimuth, elevation, from_azimuth, from_elevation)
    distance = angular_distance_rad(azimuth, elevation, from_azimuth, from_elevation)
    np.testing.assert_allclose(np.hypot(right, up), distance, atol=1e-12)


def test_small_offsets_are_cross_elevation_and_elevation(random: np.random.Generator) -> None:
    """The flat form d_az cos(el) holds to second order: 10 mdeg at 70 deg of elevation leave 2.5e-7 rad^2 tan(el)."""
    azimuth, elevation = random.uniform(-6.0, 6.0, 200), random.uniform(-1.2, 1.2, 200)
    d_azimuth, d_elevation = random.uniform(-10.0 * MDEG, 10.0 * MDEG, (2, 200))
    right, up = sky_offset_rad(azimuth + d_azimuth, elevation + d_elevation, azimuth, elevation)
    second_order = 2.0 * (10.0 * MDEG) ** 2 * math.tan(1.2)
    np.testing.assert_allclose(right, d_azimuth * np.cos(elevation), atol=second_order)
    np.testing.assert_allclose(up, d_elevation, atol=second_order)


def test_the_same_direction_has_no_offset_even_at_the_zenith() -> None:
    right, up = sky_offset_rad([0.3, 2.0], [0.7, np.pi / 2.0], [0.3, 2.0], [0.7, np.pi / 2.0])
    np.testing.assert_allclose([right, up], 0.0, atol=4e-16)


def test_at_the_zenith_the_offset_follows_the_beam_azimuth() -> None:
    """Seen from a beam at the zenith that came up at azimuth a, a target at azimuth b lies at angle b - a + 180 deg."""
    tilt = 5.0 * MDEG
    for beam, target in ((0.4, 0.4), (0.4, 2.1), (-1.0, 3.0)):
        right, up = sky_offset_rad(target, np.pi / 2.0 - tilt, beam, np.pi / 2.0)
        assert right == pytest.approx(tilt * math.sin(target - beam), abs=1e-15)
        assert up == pytest.approx(-tilt * math.cos(target - beam), abs=1e-15)


def test_a_plunged_beam_sees_the_same_offset_upside_down(random: np.random.Generator) -> None:
    azimuth, elevation = directions(random)
    beam_azimuth, beam_elevation = directions(random)
    right, up = sky_offset_rad(azimuth, elevation, beam_azimuth, beam_elevation)
    plunged = sky_offset_rad(azimuth, elevation, beam_azimuth + np.pi, np.pi - beam_elevation)
    np.testing.assert_allclose(plunged, [-right, -up], atol=1e-12)


@pytest.mark.parametrize("separation_rad", [1e-12, 1e-9, 1e-3, 1.0, np.pi - 1e-9])
def test_distance_is_accurate_for_small_and_large_separations(separation_rad: float) -> None:
    distance = angular_distance_rad(0.0, 0.0, separation_rad, 0.0)
    assert distance == pytest.approx(separation_rad, rel=1e-12)
