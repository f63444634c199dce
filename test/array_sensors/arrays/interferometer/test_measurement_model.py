import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import two_way_gradients
from rf_pointing.array_sensors.arrays.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams
from rf_pointing.array_sensors.arrays.interferometer.local_coordinates import TrackedMotion, sight_axes
from rf_pointing.array_sensors.arrays.interferometer.measurement_model import (
    expected_path_rates_m_s,
    expected_reading,
    local_gradient,
    numerical_jacobian,
)
from rf_pointing.array_sensors.arrays.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.arrays.interferometer.reading import ErrorFloor, read_ranges
from rf_pointing.array_sensors.arrays.interferometer.rf_simulation import RadioParams
from rf_pointing.array_sensors.arrays.interferometer.schedule import Schedule
from rf_pointing.array_sensors.arrays.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.arrays.interferometer.system import InterferometerSystem

LOUD = RadioParams(forward_power_w=1e6, return_power_w=1e6)


@pytest.fixture
def tracked() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([800.0, -60.0, 90.0]),
        velocity_m_s=np.array([-0.4, 0.2, 0.1]),
        attitude=attitude_from_euler(0.3, -0.2, 0.9),
        rate_rad_s=np.array([0.002, -0.001, 0.003]),
    )
    return TrackedMotion(motion=motion, excitation=np.array([0.9, 1.1]))


@pytest.mark.parametrize("order", ["simultaneous", "ascending", "nested"])
def test_reading_of_a_noiseless_source_is_the_expected_one_however_the_phases_were_aided(tracked, order) -> None:
    system = InterferometerSystem(schedule=Schedule(order=order))
    source = InterferometerSource(system, LOUD, LinkParams(), 1, excitation=(0.9, 1.1))
    measured = source.measure(0.0, tracked.motion)
    rates = expected_path_rates_m_s(tracked, system)
    for aiding in (None, rates, rates + 0.003):
        reading = read_ranges(measured, system, ErrorFloor(), aiding)
        off = reading.vector - expected_reading(tracked, reading, system)
        assert np.max(np.abs(off[:9])) < 3e-4
        assert np.max(np.abs(off[9:18])) < 1e-5
        assert np.max(np.abs(off[18:])) < 1e-5


def test_gradient_of_the_ranges_is_the_analytic_one_in_local_coordinates(tracked) -> None:
    system = InterferometerSystem()
    source = InterferometerSource(system, LOUD, LinkParams(), 1)
    reading = read_ranges(source.measure(0.0, tracked.motion), system, ErrorFloor())
    _, gradient = local_gradient(tracked, np.zeros(14), reading, system)
    motion = tracked.motion
    by_position, by_attitude = two_way_gradients(motion.position_m, motion.attitude, system.arrays)
    expected = by_position.reshape(9, 3) @ sight_axes(motion.position_m)
    np.testing.assert_allclose(gradient[:9, :3], expected, atol=1e-6)
    np.testing.assert_allclose(gradient[:9, 6:9], by_attitude.reshape(9, 3), atol=1e-5)
    np.testing.assert_allclose(gradient[9:18, 3], np.full(9, 2.0), atol=1e-4)


def test_numerical_jacobian_of_a_matrix_is_the_matrix(rng) -> None:
    matrix = rng.normal(size=(4, 3))
    found = numerical_jacobian(lambda stack: stack @ matrix.T, np.array([0.1, 1.0, 10.0]))
    np.testing.assert_allclose(found, matrix, atol=1e-12)
