"""Ground stations: the sign of (13), nadir angle, visibility and the eight stations of the scene."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import (
    GroundStation,
    largest_nadir_angle_rad,
    place_slopes,
    stations_along_track,
    view_stations,
)
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point

ORBIT = SunSynchronousOrbitParams()
LOWEST_RAD = np.radians(10.0)


def under(t_s: float) -> GroundStation:
    x, y, z = orbit_point(ORBIT, t_s).position_m
    return GroundStation(name="under", latitude_rad=np.arctan2(z, np.hypot(x, y)), longitude_rad=np.arctan2(y, x))


def test_station_below_the_satellite_lies_along_nadir() -> None:
    view = view_stations(ORBIT, [under(500.0)], 500.0)
    assert view.reference[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert view.elevation_rad[0] == pytest.approx(np.pi / 2, abs=1e-6)
    assert view.range_m[0] == pytest.approx(800e3, abs=1.0)


def test_station_ahead_lies_forward_before_the_pass_and_aft_after_it() -> None:
    view = view_stations(ORBIT, [under(500.0)], np.array([400.0, 600.0]))
    assert view.reference[0, 0, 0] > 0.5
    assert view.reference[1, 0, 0] < -0.5


def test_station_at_10_degrees_elevation_is_61_05_degrees_off_nadir() -> None:
    assert np.degrees(largest_nadir_angle_rad(ORBIT, LOWEST_RAD)) == pytest.approx(61.05, abs=0.005)
    t_s = np.linspace(100.0, 900.0, 4001)
    view = view_stations(ORBIT, [under(500.0)], t_s)
    seen = view.reference[view.visible(LOWEST_RAD)[:, 0], 0]
    nadir = np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), seen[:, 2])
    assert np.degrees(nadir.max()) == pytest.approx(61.05, abs=0.05)


def test_one_of_the_eight_stations_is_in_view_for_5000_seconds() -> None:
    view = view_stations(ORBIT, stations_along_track(ORBIT, 0.0), np.arange(0.0, 5000.0, 0.25))
    assert view.visible(LOWEST_RAD).any(axis=-1).all()
    assert np.all(np.degrees(view.elevation_rad.max(axis=0)) < 82.0)


def test_pass_of_one_station_lasts_about_ten_minutes() -> None:
    view = view_stations(ORBIT, stations_along_track(ORBIT, 0.0), np.arange(-400.0, 5400.0))
    assert view.visible(LOWEST_RAD).sum(axis=0) == pytest.approx(np.full(8, 635.0), abs=15.0)


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


@pytest.mark.parametrize(("latitude", "longitude"), [(1.6, 0.0), (0.0, 7.0), (np.nan, 0.0)])
def test_station_off_the_earth_is_refused(latitude: float, longitude: float) -> None:
    with pytest.raises(ValueError, match="itude_rad="):
        GroundStation(name="x", latitude_rad=latitude, longitude_rad=longitude)
