"""Markers have the places, sizes and colours that a viewer draws, at any radius and for any beam."""

import math
from typing import Any

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from rf_pointing.core import Target, unit_vector_from_azel
from rf_pointing.planning import HorizonMask, PassProfile
from rf_pointing.ros import convert_description as draw

RADIUS_M = 20.0
FRAME = "gs4/base_link"
SHADES = {
    "green": (0.2, 0.8, 0.4, 1.0), "blue": (0.2, 0.5, 1.0, 1.0), "yellow": (1.0, 0.8, 0.1, 1.0),
    "brown": (0.7, 0.4, 0.2, 1.0),
}  # fmt: skip


def places(marker: Marker) -> np.ndarray:
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def assert_drawn(marker: Marker, kind: str, shape: int, shade: str, width_m: float) -> None:
    """Compare what every marker has: its kind and shape, frame, colour and width."""
    assert (marker.ns, marker.type, marker.action, marker.header.frame_id) == (kind, shape, Marker.ADD, FRAME)
    colour = marker.color
    assert (colour.r, colour.g, colour.b, colour.a) == pytest.approx(SHADES[shade], rel=1e-6)
    assert marker.scale.x == pytest.approx(width_m, rel=1e-12)
    turn = marker.pose.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)


def angles_from(direction: np.ndarray, rim: np.ndarray) -> np.ndarray:
    """Return the angles between a direction and the points of a circle around it."""
    along = rim @ direction / np.linalg.norm(rim, axis=1)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(rim, direction), axis=1) / RADIUS_M, along))


@pytest.mark.parametrize(("beamwidth_deg", "half_deg"), [(6.0, 3.0), (1.01, 0.505), (0.99, 0.5), (0.065, 0.5)])
def test_the_beam_is_an_arrow_along_x_in_the_circle_of_its_half_power(beamwidth_deg: float, half_deg: float) -> None:
    arrow, circle = draw.beam_markers(FRAME, RADIUS_M, math.radians(beamwidth_deg))
    assert_drawn(arrow, "beam", Marker.ARROW, "green", 0.2)
    assert (arrow.scale.y, arrow.scale.z) == pytest.approx((0.4, 0.4), rel=1e-12)
    assert places(arrow).tolist() == [[0.0, 0.0, 0.0], [RADIUS_M, 0.0, 0.0]]
    assert_drawn(circle, "half_power_beam", Marker.LINE_STRIP, "green", 0.1)
    rim = places(circle)
    assert len(rim) == 49
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), RADIUS_M, rtol=1e-12)
    np.testing.assert_allclose(angles_from(np.array([1.0, 0.0, 0.0]), rim), math.radians(half_deg), rtol=1e-9)
    np.testing.assert_allclose(rim[0], rim[-1], atol=1e-12)
    radius_m = RADIUS_M * math.sin(math.radians(half_deg))
    assert rim[12] == pytest.approx([RADIUS_M * math.cos(math.radians(half_deg)), 0.0, radius_m], abs=1e-12)
    assert arrow.frame_locked
    assert circle.frame_locked


def target(azimuth_rad: float, elevation_rad: float) -> Target:
    return Target(
        t_s=1e9, name="bird", azimuth_rad=azimuth_rad, elevation_rad=elevation_rad, azimuth_rate_rad_s=0.0,
        elevation_rate_rad_s=0.0, azimuth_acceleration_rad_s2=0.0, elevation_acceleration_rad_s2=0.0, range_m=1e6,
        range_rate_m_s=0.0, refraction_rad=0.0,
    )  # fmt: skip


def test_the_target_is_a_sphere_with_its_name_above_until_it_is_not_renewed() -> None:
    sphere, name = draw.target_markers(target(2.5, 0.6), FRAME, RADIUS_M)
    assert_drawn(sphere, "target", Marker.SPHERE, "blue", 0.6)
    assert (sphere.scale.y, sphere.scale.z) == (sphere.scale.x, sphere.scale.x)
    assert_drawn(name, "target_name", Marker.TEXT_VIEW_FACING, "blue", 0.0)
    assert (name.text, name.scale.z) == ("bird", pytest.approx(1.0, rel=1e-12))
    east, north, up = RADIUS_M * unit_vector_from_azel(2.5, 0.6)
    place, above = sphere.pose.position, name.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((east, north, up), rel=1e-12)
    assert (above.x, above.y, above.z) == pytest.approx((east, north, up + 1.0), rel=1e-12)
    for marker in (sphere, name):
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (1, 500_000_000)


@pytest.mark.parametrize(
    ("direction_rad", "zone_deg", "drawn_deg"),
    [((2.5, 0.6), 5.0, 5.0), ((0.0, 0.0), 5.0, 5.0), ((1.0, 1.5), 0.28, 0.28), ((4.0, -0.2), 0.1, 0.27)],
)
def test_the_zone_of_the_sun_is_a_circle_around_it_no_smaller_than_the_sun(
    direction_rad: tuple[float, float], zone_deg: float, drawn_deg: float
) -> None:
    marker = draw.sun_marker(direction_rad, math.radians(zone_deg), FRAME, RADIUS_M)
    assert_drawn(marker, "sun_zone", Marker.LINE_STRIP, "yellow", 0.1)
    assert (marker.lifetime.sec, marker.lifetime.nanosec) == (1, 500_000_000)
    rim, sun = places(marker), unit_vector_from_azel(*direction_rad)
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), RADIUS_M, rtol=1e-12)
    np.testing.assert_allclose(angles_from(sun, rim), math.radians(drawn_deg), rtol=1e-9)
    # All the way around: its points have their mean on the line to the Sun.
    np.testing.assert_allclose(rim[:-1].mean(axis=0), RADIUS_M * math.cos(math.radians(drawn_deg)) * sun, atol=1e-9)


def test_the_mask_has_a_point_each_degree_and_at_those_of_the_survey() -> None:
    survey = np.radians([10.5, 95.0, 200.25])
    mask = HorizonMask(azimuth_rad=tuple(survey), elevation_rad=(0.1, 0.3, 0.02))
    marker = draw.mask_marker(mask, FRAME, RADIUS_M)
    assert_drawn(marker, "mask", Marker.LINE_STRIP, "brown", 0.16)
    azimuth = np.sort(np.radians([*range(361), 10.5, 200.25]))
    expected = RADIUS_M * unit_vector_from_azel(azimuth, mask.lowest_all(azimuth))
    np.testing.assert_allclose(places(marker), expected, atol=1e-9)


def profile(**changes: Any) -> PassProfile:
    position = np.array([[0.1, 0.2], [1.1, 0.9], [2.3, 0.3]])
    values = {
        "t_s": np.array([1e9, 1e9 + 10.0, 1e9 + 20.0]), "position_rad": position, "velocity_rad_s": 0.1 * position,
        "acceleration_rad_s2": 0.01 * position, "sun_rad": position, "range_m": np.full(3, 1e6),
        "satellite_gain_db": np.zeros(3),
    }  # fmt: skip
    return PassProfile(name="bird", **{**values, **changes})


def test_a_pass_is_a_line_over_the_sky_and_without_one_the_line_goes() -> None:
    marker = draw.pass_marker(profile(), FRAME, RADIUS_M)
    assert_drawn(marker, "pass", Marker.LINE_STRIP, "blue", 0.1)
    expected = RADIUS_M * unit_vector_from_azel([0.1, 1.1, 2.3], [0.2, 0.9, 0.3])
    np.testing.assert_allclose(places(marker), expected, rtol=1e-12)
    gone = draw.pass_marker(None, FRAME, RADIUS_M)
    assert (gone.ns, gone.type, gone.action, len(gone.points)) == ("pass", Marker.LINE_STRIP, Marker.DELETE, 0)
    assert gone.scale.x == 0.0
