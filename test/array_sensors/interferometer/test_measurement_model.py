import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, rotation_vector
from rf_pointing.array_sensors.interferometer.measurement_model import (
    SIZE,
    TrackedMotion,
    cartesian_covariance,
    cartesian_jacobian,
    displaced,
    expected_path_accelerations_m_s2,
    expected_path_rates_m_s,
    expected_reading,
    local_difference,
    local_gradient,
    numerical_jacobian,
    sight_axes,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.reading import ErrorFloor, PathMotion, read_ranges
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem, Schedule, two_way_gradients

LOUD = RadioParams(forward_power_w=1e6, return_power_w=1e6, phase_noise_rad=0.0)


@pytest.fixture
def tracked() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([80.0, -30.0, 25.0]), velocity_m_s=np.array([-1.0, 0.4, 0.7]),
        attitude=attitude_from_euler(0.3, -0.5, 2.9), rate_rad_s=np.array([0.01, -0.03, 0.02]),
    )  # fmt: skip
    return TrackedMotion(motion=motion, excitation=np.array([0.9, 1.1]))


def test_changes_return_from_the_displaced_motion_even_when_large(tracked, rng) -> None:
    changes = rng.uniform(-1.0, 1.0, (300, SIZE)) * np.r_[20, 60, 60, [2] * 3, [1.5] * 3, [1] * 3, 1, 1]
    np.testing.assert_allclose(local_difference(displaced(tracked, changes), tracked), changes, atol=1e-11)
    np.testing.assert_array_equal(local_difference(tracked, tracked), 0.0)


def test_a_cross_track_change_keeps_the_range_and_a_range_change_the_direction(tracked) -> None:
    change = np.zeros((2, SIZE))
    change[0, 1:3] = [8.0, -5.0]
    change[1, 0] = 7.0
    there = displaced(tracked, change).motion.position_m
    distance = np.linalg.norm(tracked.motion.position_m)
    assert np.linalg.norm(there[0]) == pytest.approx(distance, abs=1e-12)
    assert np.linalg.norm(there[1]) == pytest.approx(distance + 7.0, abs=1e-12)
    np.testing.assert_allclose(np.cross(there[1], tracked.motion.position_m), 0.0, atol=1e-10)


def test_sight_axes_are_right_handed_with_the_direction_first(rng) -> None:
    positions = rng.normal(size=(50, 3))
    axes = sight_axes(positions)
    np.testing.assert_allclose(axes[..., 0], positions / np.linalg.norm(positions, axis=1, keepdims=True))
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)


def test_cartesian_jacobian_is_the_derivative_of_the_displacement(tracked) -> None:
    def cartesian(change):
        there = displaced(tracked, change).motion
        turn = rotation_vector(there.attitude @ tracked.motion.attitude.T)
        return np.concatenate([there.position_m, there.velocity_m_s, turn, there.rate_rad_s], axis=-1)

    expected = numerical_jacobian(cartesian, np.full(SIZE, 1e-4))
    np.testing.assert_allclose(cartesian_jacobian(tracked.motion), expected[:, :12], atol=1e-7)


def test_cartesian_covariance_is_that_of_drawn_motions_along_the_sight_too(rng) -> None:
    """80 km away, 40 m across, the range known to a millimetre: the way along the sight is 10 mm short."""
    far = TrackedMotion(
        motion=RelativeMotion(
            position_m=np.array([7.9e4, 9e3, -6e3]), velocity_m_s=np.array([-1.0, 0.4, 0.7]),
            attitude=attitude_from_euler(0.3, -0.5, 2.9), rate_rad_s=np.zeros(3),
        ),
        excitation=np.ones(2),
    )  # fmt: skip
    sigma = np.r_[1e-3, 40.0, 25.0, 4e-4, 0.3, 0.2, np.full(3, 1e-3), np.full(3, 1e-4), 0.0, 0.0]
    mixed = np.eye(SIZE)
    mixed[1, 4] = mixed[4, 1] = 0.7
    covariance = mixed * np.outer(sigma, sigma)
    drawn = displaced(far, rng.multivariate_normal(np.zeros(SIZE), covariance, 20_000)).motion
    off = np.concatenate(
        [drawn.position_m - far.motion.position_m, drawn.velocity_m_s - far.motion.velocity_m_s], axis=1
    )
    claimed = cartesian_covariance(far.motion, covariance)[:6, :6]
    whitened = np.linalg.solve(np.linalg.cholesky(claimed), off.T)
    # Fourth moments of Gaussian numbers scatter widely: ten per cent of 20 000 draws.
    np.testing.assert_allclose(whitened @ whitened.T / 20_000, np.eye(6), atol=0.1)
    first_order = cartesian_jacobian(far.motion) @ covariance[:12, :12] @ cartesian_jacobian(far.motion).T
    along = far.motion.position_m / np.linalg.norm(far.motion.position_m)
    assert np.mean((off[:, :3] @ along) ** 2) > 50.0 * along @ first_order[:3, :3] @ along


@pytest.fixture
def slow_motion() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([800.0, -60.0, 90.0]), velocity_m_s=np.array([-0.4, 0.2, 0.1]),
        attitude=attitude_from_euler(0.3, -0.2, 0.9), rate_rad_s=np.array([0.002, -0.001, 0.003]),
    )  # fmt: skip
    return TrackedMotion(motion=motion, excitation=np.array([0.9, 1.1]))


@pytest.mark.parametrize("order", ["simultaneous", "ascending", "nested"])
def test_reading_of_a_noiseless_source_is_the_expected_one_however_the_phases_were_aided(slow_motion, order) -> None:
    system = InterferometerSystem(schedule=Schedule(order=order))
    source = InterferometerSource(system, LOUD, LinkParams(), 1, excitation=(0.9, 1.1))
    measured = source.measure(0.0, slow_motion.motion)
    rates = expected_path_rates_m_s(slow_motion, system)
    bent = expected_path_accelerations_m_s2(slow_motion, system)
    for aiding in (
        None,
        PathMotion(rates_m_s=rates, accelerations_m_s2=bent),
        PathMotion(rates_m_s=rates + 0.003, accelerations_m_s2=bent),
    ):
        reading = read_ranges(measured, system, ErrorFloor(), aiding)
        off = reading.vector - expected_reading(slow_motion, reading, system)
        assert np.max(np.abs(off[:9])) < 1e-5
        assert np.max(np.abs(off[9:18])) < 1e-5
        assert np.max(np.abs(off[18:])) < 1e-5


def test_gradient_of_the_ranges_is_the_analytic_one_in_local_coordinates(slow_motion) -> None:
    system = InterferometerSystem()
    source = InterferometerSource(system, LOUD, LinkParams(), 1)
    reading = read_ranges(source.measure(0.0, slow_motion.motion), system, ErrorFloor())
    _, gradient = local_gradient(slow_motion, np.zeros(14), reading, system)
    motion = slow_motion.motion
    by_position, by_attitude = two_way_gradients(motion.position_m, motion.attitude, system.arrays)
    expected = by_position.reshape(9, 3) @ sight_axes(motion.position_m)
    np.testing.assert_allclose(gradient[:9, :3], expected, atol=1e-6)
    np.testing.assert_allclose(gradient[:9, 6:9], by_attitude.reshape(9, 3), atol=1e-5)
    np.testing.assert_allclose(gradient[9:18, 3], np.full(9, 2.0), atol=1e-4)
