import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.frames import attitude_from_euler, rotation_vector
from rf_pointing.array_sensors.arrays.interferometer.local_coordinates import (
    SIZE,
    TrackedMotion,
    cartesian_jacobian,
    displaced,
    local_difference,
    sight_axes,
)
from rf_pointing.array_sensors.arrays.interferometer.measurement_model import numerical_jacobian
from rf_pointing.array_sensors.arrays.interferometer.motion import RelativeMotion


@pytest.fixture
def tracked() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([80.0, -30.0, 25.0]),
        velocity_m_s=np.array([-1.0, 0.4, 0.7]),
        attitude=attitude_from_euler(0.3, -0.5, 2.9),
        rate_rad_s=np.array([0.01, -0.03, 0.02]),
    )
    return TrackedMotion(motion=motion, excitation=np.array([0.9, 1.1]))


def test_changes_return_from_the_displaced_motion_even_when_large(tracked, rng) -> None:
    changes = rng.uniform(-1.0, 1.0, (300, SIZE)) * np.r_[20, 60, 60, [2] * 3, [1.5] * 3, [1] * 3, 1, 1]
    np.testing.assert_allclose(local_difference(displaced(tracked, changes), tracked), changes, atol=1e-11)
    np.testing.assert_array_equal(local_difference(tracked, tracked), 0.0)


def test_a_cross_track_change_keeps_the_range_and_a_range_change_the_direction(tracked) -> None:
    change = np.zeros((2, SIZE))
    change[0, 1:3] = [8.0, -5.0]
    change[1, 0] = 7.0
    moved = displaced(tracked, change).motion.position_m
    distance = np.linalg.norm(tracked.motion.position_m)
    assert np.linalg.norm(moved[0]) == pytest.approx(distance, abs=1e-12)
    assert np.linalg.norm(moved[1]) == pytest.approx(distance + 7.0, abs=1e-12)
    np.testing.assert_allclose(np.cross(moved[1], tracked.motion.position_m), 0.0, atol=1e-10)


def test_sight_axes_are_right_handed_with_the_direction_first(rng) -> None:
    positions = rng.normal(size=(50, 3))
    axes = sight_axes(positions)
    np.testing.assert_allclose(axes[..., 0], positions / np.linalg.norm(positions, axis=1, keepdims=True))
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)


def test_cartesian_jacobian_is_the_derivative_of_the_displacement(tracked) -> None:
    def cartesian(change):
        moved = displaced(tracked, change).motion
        turn = rotation_vector(moved.attitude @ tracked.motion.attitude.T)
        return np.concatenate([moved.position_m, moved.velocity_m_s, turn, moved.rate_rad_s], axis=-1)

    expected = numerical_jacobian(cartesian, np.full(SIZE, 1e-4))
    np.testing.assert_allclose(cartesian_jacobian(tracked.motion), expected[:, :12], atol=1e-7)
