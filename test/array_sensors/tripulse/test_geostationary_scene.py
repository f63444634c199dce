import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import GroundStation
from rf_pointing.array_sensors.attitude.quaternion import quaternion_to_roll_pitch_yaw
from rf_pointing.array_sensors.tripulse.geostationary_scene import (
    EARTH_RATE_RAD_S,
    ORBIT_RADIUS_M,
    GeostationaryParams,
    WobbleParams,
    geostationary_point,
    scene_moment,
)

ORBIT = GeostationaryParams()
DAY_S = 2.0 * np.pi / EARTH_RATE_RAD_S
STATIONS = [
    GroundStation(name="usingen", latitude_rad=np.radians(50.3), longitude_rad=np.radians(8.5)),
    GroundStation(name="hartebeesthoek", latitude_rad=np.radians(-25.9), longitude_rad=np.radians(27.7)),
]


def test_satellite_draws_a_figure_of_eight_about_its_longitude() -> None:
    places = np.array([geostationary_point(ORBIT, t).position_m for t in np.linspace(0.0, DAY_S, 200)])
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), ORBIT_RADIUS_M)
    latitude = np.arcsin(places[:, 2] / ORBIT_RADIUS_M)
    assert np.max(latitude) == pytest.approx(ORBIT.inclination_rad, rel=1e-3)
    longitude = np.arctan2(places[:, 1], places[:, 0]) - ORBIT.longitude_rad
    # Half width of the figure: tan^2(i/2).
    assert np.max(np.abs(longitude)) == pytest.approx(np.tan(ORBIT.inclination_rad / 2.0) ** 2, rel=0.01)


def test_frame_is_right_handed_with_z_to_the_earth_and_y_against_the_momentum() -> None:
    point = geostationary_point(ORBIT, 12345.0)
    np.testing.assert_allclose(point.frame @ point.frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(point.frame) == pytest.approx(1.0)
    np.testing.assert_allclose(point.frame[2], -point.position_m / ORBIT_RADIUS_M)
    assert point.frame[1, 2] < -0.99
    # Eastward flight.
    assert point.frame[0] @ np.cross([0.0, 0.0, 1.0], point.position_m) > 0.0


def test_range_rate_is_the_slope_of_the_range() -> None:
    for t_s in (1000.0, 30000.0):
        moments = [scene_moment(ORBIT, WobbleParams(), STATIONS, t_s + dt) for dt in (-50.0, 0.0, 50.0)]
        slope = (moments[2].view.range_m - moments[0].view.range_m) / 100.0
        np.testing.assert_allclose(moments[1].range_rate_m_s, slope, atol=0.01)
    assert np.max(np.abs(scene_moment(ORBIT, WobbleParams(), STATIONS, 0.0).range_rate_m_s)) > 10.0


def test_attitude_error_has_its_constant_and_its_amplitude() -> None:
    wobble = WobbleParams(roll_rad=0.01, pitch_rad=-0.02, yaw_rad=0.3, amplitude_rad=0.001, period_s=100.0)
    times = np.linspace(0.0, 100.0, 400, endpoint=False)
    angles = np.array(
        [quaternion_to_roll_pitch_yaw(scene_moment(ORBIT, wobble, STATIONS, t).quaternion) for t in times]
    )
    np.testing.assert_allclose(np.mean(angles, axis=0), [0.01, -0.02, 0.3], atol=1e-9)
    np.testing.assert_allclose(np.ptp(angles, axis=0) / 2.0, 0.001, rtol=1e-3)


def test_rotation_takes_reference_directions_to_the_array() -> None:
    moment = scene_moment(
        ORBIT, WobbleParams(roll_rad=0.1, amplitude_rad=0.0, pitch_rad=0.0, yaw_rad=0.0), STATIONS, 0.0
    )
    np.testing.assert_allclose(moment.rotation @ [0.0, 0.0, 1.0], [0.0, np.sin(0.1), np.cos(0.1)], atol=1e-12)


def test_frame_rate_is_that_of_the_frame_in_inertial_axes() -> None:
    """The Earth's turn is taken off again: what is left is the motion along the orbit, about -y."""
    start_s, step_s = 4321.0, 0.5

    def inertial(t_s: float) -> np.ndarray:
        angle = EARTH_RATE_RAD_S * (t_s - start_s)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return geostationary_point(ORBIT, t_s).frame @ turn.T

    cross = -(inertial(start_s + step_s) - inertial(start_s - step_s)) / (2.0 * step_s) @ inertial(start_s).T
    found = np.array([cross[2, 1], cross[0, 2], cross[1, 0]])
    rate = geostationary_point(ORBIT, start_s).frame_rate_rad_s
    np.testing.assert_allclose(found, rate, atol=1e-11)
    np.testing.assert_allclose(rate, [0.0, -EARTH_RATE_RAD_S, 0.0], atol=1e-15)
