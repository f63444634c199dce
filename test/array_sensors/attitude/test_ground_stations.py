"""Ground stations: the sign of (13), nadir angle, visibility and the eight stations of the scene."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import (
    GroundNetworkParams,
    GroundStation,
    SurveyedStation,
    largest_nadir_angle_rad,
    place_slopes,
    stations_along_track,
    view_stations,
)
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.ephemeris import Site

ORBIT = SunSynchronousOrbitParams()
LOWEST_RAD = np.radians(10.0)


def test_pass_of_one_station_lasts_about_ten_minutes() -> None:
    view = view_stations(ORBIT, stations_along_track(ORBIT, 0.0), np.arange(-400.0, 5400.0))
    seen = view.visible(LOWEST_RAD)
    assert seen.sum(axis=0) == pytest.approx(np.full(8, 635.0), abs=15.0)
    # One of the eight stations is in view for 5000 s.
    assert seen[400:5400].any(axis=-1).all()


@pytest.mark.parametrize("latitude_rad", [-0.9, 0.0, 1.2, np.pi / 2])
def test_place_slopes_are_the_change_of_the_direction_by_a_metre(latitude_rad: float) -> None:
    site = GroundStation(name="site", latitude_rad=latitude_rad, longitude_rad=-1.1)
    (slopes,) = place_slopes(ORBIT, [site], 500.0)
    up, step_m = site.zenith, 100.0
    north = np.array([-np.sin(latitude_rad) * np.cos(-1.1), -np.sin(latitude_rad) * np.sin(-1.1), np.cos(latitude_rad)])
    east = np.cross(north, up)
    point = orbit_point(ORBIT, 500.0)

    def seen(place: np.ndarray) -> np.ndarray:
        away = point.frame @ (place - point.position_m)
        return away / np.linalg.norm(away)

    found = [
        (seen(site.position_m + step_m * e) - seen(site.position_m - step_m * e)) / 2 / step_m for e in (north, east)
    ]
    # At a pole north and east are any two level directions.
    assert slopes @ slopes.T == pytest.approx(np.transpose(found) @ found, rel=1e-4, abs=1e-18)
    if abs(latitude_rad) < 1.5:
        np.testing.assert_allclose(slopes.T, found, rtol=1e-4, atol=1e-12)


def test_no_stations_are_refused() -> None:
    with pytest.raises(ValueError, match="stations is empty"):
        view_stations(ORBIT, [], 0.0)


@pytest.mark.parametrize("number", [1, 5])
def test_stations_are_passed_one_after_the_other_by_turns_right_and_left(number: int) -> None:
    """At the middle of its time each is abeam: 0.05 rad of the Earth's surface to the right (y) or left."""
    found = stations_along_track(ORBIT, 200.0, count=number, spacing_s=400.0, aside_rad=0.05)
    assert [each.name for each in found] == [f"station_{k + 1}" for k in range(number)]
    for k, each in enumerate(found):
        point = orbit_point(ORBIT, 200.0 + 400.0 * (k + 0.5))
        x, y, z = point.frame @ each.position_m / EARTH_RADIUS_M
        assert (x, y) == pytest.approx((0.0, (-1.0) ** k * np.sin(0.05)), abs=1e-12)
        assert z == pytest.approx(-np.cos(0.05))
    assert len(stations_along_track(ORBIT, 0.0)) == 8
    late = stations_along_track(ORBIT, 0.0)[3]
    abeam = orbit_point(ORBIT, 3.5 * 625.0).frame @ late.position_m / EARTH_RADIUS_M
    assert tuple(abeam[:2]) == pytest.approx((0.0, -np.sin(0.02)), abs=1e-12)


def test_stations_are_seen_from_the_given_elevation_on() -> None:
    view = view_stations(ORBIT, stations_along_track(ORBIT, 0.0), 900.0)
    for elevation in view.elevation_rad:
        assert np.sum(view.visible(float(elevation))) == np.sum(view.elevation_rad >= elevation)
        assert np.sum(view.visible(float(elevation) + 1e-9)) == np.sum(view.elevation_rad > elevation)
    for index, station in enumerate(stations_along_track(ORBIT, 0.0)):
        point = orbit_point(ORBIT, 900.0)
        away = station.position_m - point.position_m
        assert view.range_m[index] == pytest.approx(np.linalg.norm(away))
        assert view.elevation_rad[index] == pytest.approx(
            np.arccos(station.zenith @ away / np.linalg.norm(away)) - np.pi / 2.0
        )
        np.testing.assert_allclose(view.reference[index], point.frame @ away / np.linalg.norm(away), atol=1e-12)


def test_a_surveyed_station_stands_on_the_ellipsoid_with_its_own_vertical() -> None:
    site = Site(latitude_rad=np.radians(47.0), longitude_rad=np.radians(8.0), altitude_m=500.0)
    station = SurveyedStation(name="site", site=site)
    x, y, z = station.position_m
    # WGS 84: the prime vertical's radius from the semi-axis and the flattening.
    e2 = (2.0 - 1.0 / 298.257223563) / 298.257223563
    prime = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(np.radians(47.0)) ** 2)
    assert np.hypot(x, y) == pytest.approx((prime + 500.0) * np.cos(np.radians(47.0)), abs=1e-3)
    assert z == pytest.approx((prime * (1.0 - e2) + 500.0) * np.sin(np.radians(47.0)), abs=1e-3)
    latitude, longitude = np.radians([47.0, 8.0])
    expected = [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    np.testing.assert_allclose(station.zenith, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"names": ("Usingen", "b")}, "names has 'Usingen', must be lower-case letters, digits and underscores"),
        ({"names": ("a", "1b")}, "names has '1b'"),
        ({"names": ("a", "a")}, r"names=\('a', 'a'\) must be different, and at least one"),
        ({"names": ()}, r"names=\(\) must be different, and at least one"),
        ({"latitude_rad": (0.1,)}, "latitude_rad has 1 values, must be one for each of 2 names"),
        ({"longitude_rad": (0.1, 0.2, 0.3)}, "longitude_rad has 3 values, must be one for each of 2 names"),
        ({"latitude_rad": (0.1, 1.6)}, r"latitude_rad\[1\]=1.6"),
        ({"longitude_rad": (0.1, np.nan)}, r"longitude_rad\[1\]"),
    ],
)
def test_a_network_of_stations_without_places_or_names_is_refused(changes: dict[str, tuple], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        GroundNetworkParams(**changes)
    first, second = GroundNetworkParams().stations()
    assert (first.name, second.name) == ("usingen", "hartebeesthoek")
    assert (second.latitude_rad, first.longitude_rad) == pytest.approx((np.radians(-25.89), np.radians(8.48)))


def test_a_longitude_is_at_most_a_turn_and_a_latitude_at_most_a_quarter_either_way() -> None:
    for sign in (1.0, -1.0):
        edge = GroundStation(name="x", latitude_rad=sign * np.pi / 2.0, longitude_rad=sign * 2.0 * np.pi)
        np.testing.assert_allclose(edge.zenith, [0.0, 0.0, sign], atol=1e-12)
        for latitude, longitude, words in ((0.0, 6.3, "longitude_rad="), (1.58, 0.0, "latitude_rad=")):
            with pytest.raises(ValueError, match=words):
                GroundStation(name="x", latitude_rad=sign * latitude, longitude_rad=sign * longitude)


def test_a_station_stands_on_the_sphere_at_its_latitude_and_longitude() -> None:
    station = GroundStation(name="x", latitude_rad=0.6, longitude_rad=-2.2)
    up = np.array([np.cos(0.6) * np.cos(-2.2), np.cos(0.6) * np.sin(-2.2), np.sin(0.6)])
    np.testing.assert_allclose(station.zenith, up, atol=1e-12)
    np.testing.assert_allclose(station.position_m, EARTH_RADIUS_M * up, rtol=1e-12)


def test_the_nadir_angle_is_that_of_the_sphere_at_any_height() -> None:
    for altitude_m, elevation in ((500e3, 0.0), (1200e3, 0.4)):
        orbit = SunSynchronousOrbitParams(altitude_m=altitude_m)
        sine = EARTH_RADIUS_M * np.cos(elevation) / (EARTH_RADIUS_M + altitude_m)
        assert largest_nadir_angle_rad(orbit, elevation) == pytest.approx(np.arcsin(sine))
    assert np.degrees(largest_nadir_angle_rad(ORBIT, LOWEST_RAD)) == pytest.approx(61.05, abs=0.005)
