import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    euler_from_attitude,
    forward_angles,
    frame_rotation,
    rep103_from_spacecraft,
    reverse_angles,
    rotation_vector,
    small_rotation,
)

ROUNDING = 1e-14


def test_attitude_matrix_is_the_transposed_intrinsic_zyx_rotation_of_scipy(rng) -> None:
    angles = rng.uniform(-3.0, 3.0, (50, 3))
    expected = Rotation.from_euler("ZYX", angles).as_matrix().transpose(0, 2, 1)
    np.testing.assert_allclose(attitude_from_euler(*angles.T), expected, atol=ROUNDING)


def test_euler_angles_return_from_the_attitude_even_at_half_a_turn(rng) -> None:
    angles = rng.uniform([-np.pi, -1.5, -np.pi], [np.pi, 1.5, np.pi], (200, 3))
    angles[0] = [np.pi, 0.3, -np.pi + 1e-12]
    back = np.stack(euler_from_attitude(attitude_from_euler(*angles.T)), axis=-1)
    np.testing.assert_allclose(attitude_from_euler(*back.T), attitude_from_euler(*angles.T), atol=ROUNDING)
    np.testing.assert_allclose(back[1:], angles[1:], atol=1e-12)


def test_a_common_gain_error_of_the_matrix_cancels_in_the_corrected_euler_angles() -> None:
    attitude = attitude_from_euler(0.2, -0.4, 0.5)
    np.testing.assert_allclose(euler_from_attitude(1.1 * attitude), [0.2, -0.4, 0.5], atol=ROUNDING)


def test_published_elevation_lost_the_minus_sign() -> None:
    attitude = attitude_from_euler(0.2, -0.4, 0.5)
    np.testing.assert_allclose(euler_from_attitude(attitude, "published"), [0.2, 0.4, 0.5], atol=ROUNDING)


def test_euler_angles_at_the_pole_are_refused() -> None:
    with pytest.raises(ValueError, match=r"elevation is \+-90 deg"):
        euler_from_attitude(attitude_from_euler(0.2, np.pi / 2.0, 0.5))


def test_directions_return_from_their_angles(rng) -> None:
    azimuth, elevation = rng.uniform([-np.pi, -1.5], [np.pi, 1.5], (300, 2)).T
    direction = direction_from_angles(azimuth, elevation)
    for angles in (forward_angles, reverse_angles):
        np.testing.assert_allclose(angles(17.0 * direction), [azimuth, elevation], atol=1e-12)


def test_reverse_azimuth_is_half_a_turn_on_boresight_and_never_minus_half_a_turn() -> None:
    azimuth, _ = reverse_angles([[-1.0, 0.0, 0.0], [-1.0, 1e-3, 0.0], [-1.0, -1e-3, 0.0]])
    np.testing.assert_allclose(azimuth, [np.pi, np.pi - 1e-3, -np.pi + 1e-3], atol=1e-9)
    assert np.all(azimuth > -np.pi)


def test_small_rotation_is_the_first_order_of_the_full_one() -> None:
    small = small_rotation(1e-4, 2e-4, 3e-4)
    np.testing.assert_allclose(small, attitude_from_euler(1e-4, 2e-4, 3e-4), atol=2e-7)


def test_published_small_rotation_has_an_empty_diagonal_and_throws_the_direction_away() -> None:
    xi = direction_from_angles(0.2, -0.1)
    turned = small_rotation(-1e-3, 0.0, 0.0, "published") @ xi
    assert np.linalg.norm(turned) < 2e-3
    np.testing.assert_allclose(small_rotation(-1e-3, 0.0, 0.0) - np.eye(3), small_rotation(-1e-3, 0, 0, "published"))


def test_rotation_vector_and_frame_rotation_are_inverse_up_to_half_a_turn(rng) -> None:
    axes = rng.normal(size=(500, 3))
    vectors = axes / np.linalg.norm(axes, axis=1, keepdims=True) * rng.uniform(0.0, np.pi, (500, 1))
    vectors[:3] = [[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [0.0, np.pi - 1e-9, 0.0]]
    np.testing.assert_allclose(rotation_vector(frame_rotation(vectors)), vectors, atol=1e-12)
    expected = Rotation.from_rotvec(vectors).as_matrix().transpose(0, 2, 1)
    np.testing.assert_allclose(frame_rotation(vectors), expected, atol=ROUNDING)


def test_rep103_pose_points_the_same_way_in_flipped_axes(worked_example) -> None:
    xi, attitude = worked_example
    position, orientation = rep103_from_spacecraft(100.0 * xi, attitude)
    np.testing.assert_allclose(position, 100.0 * xi * [1, -1, -1])
    # A point one metre ahead of the passive body, by both conventions.
    np.testing.assert_allclose(orientation @ [1, 0, 0], (attitude.T @ [1, 0, 0]) * [1, -1, -1], atol=ROUNDING)
    np.testing.assert_allclose(orientation @ [0, 1, 0], (attitude.T @ [0, -1, 0]) * [1, -1, -1], atol=ROUNDING)
