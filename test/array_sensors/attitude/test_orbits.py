"""Sun-synchronous orbit: period, inclination, local time, and the rate of the frame against its own motion."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.orbits import (
    YEAR_S,
    SunSynchronousOrbitParams,
    circular_frame,
    inclination_rad,
    orbit_point,
    period_s,
)
from rf_pointing.core.constants import EARTH_RADIUS_M

ORBIT = SunSynchronousOrbitParams(ascending_node_time_s=1.7e9)


@pytest.mark.parametrize("turn", [0, 3, 14])
def test_descending_node_passes_at_08_00_local_mean_solar_time(turn: int) -> None:
    t_s = 1.7e9 + (turn + 0.5) * period_s(ORBIT)
    position = orbit_point(ORBIT, t_s).position_m
    assert position[2] == pytest.approx(0.0, abs=1.0)
    assert orbit_point(ORBIT, t_s + 1.0).position_m[2] < 0.0
    hours = t_s / 3600.0 + np.degrees(np.arctan2(position[1], position[0])) / 15.0
    assert (hours - 8.0 + 12.0) % 24.0 - 12.0 == pytest.approx(0.0, abs=1e-3)


def test_frame_is_forward_and_nadir_at_the_height_asked_for() -> None:
    t_s = 1.7e9 + np.linspace(0.0, 6000.0, 50)
    point = orbit_point(ORBIT, t_s)
    assert np.linalg.norm(point.position_m, axis=1) == pytest.approx(EARTH_RADIUS_M + 800e3)
    assert point.frame @ point.frame.swapaxes(-1, -2) == pytest.approx(
        np.broadcast_to(np.eye(3), (50, 3, 3)), abs=1e-12
    )
    assert np.linalg.det(point.frame) == pytest.approx(1.0)
    assert point.frame[:, 2] == pytest.approx(-point.position_m / (EARTH_RADIUS_M + 800e3))


def test_frame_rate_is_the_derivative_of_the_frame_in_inertial_axes() -> None:
    turn_rad_s = 2 * np.pi / 86400 + 2 * np.pi / YEAR_S
    start, h = 1.7e9 + 777.0, 0.5

    def inertial(t_s: float) -> np.ndarray:
        angle = turn_rad_s * (t_s - start)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return orbit_point(ORBIT, t_s).frame @ turn.T

    slope = (inertial(start + h) - inertial(start - h)) / (2 * h)
    cross = -slope @ inertial(start).T
    found = np.array([cross[2, 1], cross[0, 2], cross[1, 0]])
    assert found == pytest.approx(orbit_point(ORBIT, start).frame_rate_rad_s, abs=2e-9)


@pytest.mark.parametrize("tilt", [0.3, 1.7])
def test_the_frame_of_a_circular_orbit_is_that_of_three_plain_turns(tilt: float) -> None:
    """Along the orbit, about the line of nodes, about the axis of the Earth."""
    along, node = 0.8, -2.1

    def about_z(angle: float) -> np.ndarray:
        return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    about_x = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    outward, forward, normal = (about_z(node) @ about_x @ about_z(along)).T
    found = circular_frame(along, node, tilt)
    np.testing.assert_allclose(found, [forward, -normal, -outward], atol=1e-12)


def test_the_inclination_follows_from_the_precession_of_one_turn_a_year() -> None:
    """dOmega/dt = -3/2 J2 n (R / a)^2 cos i, solved the other way round."""
    assert period_s(ORBIT) == pytest.approx(6052.4, abs=0.1)
    for altitude_m in (300e3, 900e3):
        orbit = SunSynchronousOrbitParams(altitude_m=altitude_m)
        axis_m, n = EARTH_RADIUS_M + altitude_m, 2.0 * np.pi / period_s(orbit)
        turn = -1.5 * 1.08262668e-3 * n * (EARTH_RADIUS_M / axis_m) ** 2 * np.cos(inclination_rad(orbit))
        assert turn == pytest.approx(2.0 * np.pi / (365.24219 * 86400.0), rel=1e-9)
        assert n == pytest.approx(np.sqrt(3.986004418e14 / axis_m**3), rel=1e-6)
