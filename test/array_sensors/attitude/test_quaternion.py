import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.quaternion import (
    canonical,
    conjugate,
    multiply,
    quaternion_from_matrix,
    quaternion_from_roll_pitch_yaw,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    quaternion_to_roll_pitch_yaw,
    quaternion_to_rotation_vector,
    rotation_angle_between_rad,
    unit_quaternion,
)
from rf_pointing.core import random_stream

ROUNDING = 1e-14


@pytest.fixture
def quaternions() -> np.ndarray:
    q = random_stream(1, "quaternion test").normal(size=(200, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def test_matrix_agrees_with_scipy(quaternions: np.ndarray) -> None:
    np.testing.assert_allclose(quaternion_to_matrix(quaternions), Rotation(quaternions).as_matrix(), atol=ROUNDING)


def test_product_is_hamilton_and_agrees_with_scipy(quaternions: np.ndarray) -> None:
    a, b = quaternions[:100], quaternions[100:]
    np.testing.assert_allclose(
        canonical(multiply(a, b)), canonical((Rotation(a) * Rotation(b)).as_quat()), atol=ROUNDING
    )
    np.testing.assert_allclose(multiply([1.0, 0, 0, 0], [0.0, 1.0, 0, 0]), [0.0, 0.0, 1.0, 0.0])


def test_conjugate_undoes_the_rotation(quaternions: np.ndarray) -> None:
    identity = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (200, 4))
    np.testing.assert_allclose(multiply(quaternions, conjugate(quaternions)), identity, atol=ROUNDING)


def test_matrix_round_trip_is_exact_everywhere(quaternions: np.ndarray) -> None:
    np.testing.assert_allclose(
        quaternion_from_matrix(quaternion_to_matrix(quaternions)), canonical(quaternions), atol=ROUNDING
    )


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0], [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64]])
@pytest.mark.parametrize("turn_rad", [np.pi, -np.pi, np.pi - 1e-9, np.pi + 1e-9])
def test_half_turns_survive_the_matrix_and_the_rotation_vector(axis: list[float], turn_rad: float) -> None:
    q = quaternion_from_rotation_vector(turn_rad * np.asarray(axis))
    back = quaternion_from_matrix(quaternion_to_matrix(q))
    assert rotation_angle_between_rad(q, back) < 1e-12
    again = quaternion_from_rotation_vector(quaternion_to_rotation_vector(q))
    assert rotation_angle_between_rad(q, again) < 1e-12


def test_both_signs_of_a_quaternion_are_one_rotation(quaternions: np.ndarray) -> None:
    np.testing.assert_array_equal(canonical(quaternions), canonical(-quaternions))
    np.testing.assert_array_equal(canonical([-0.6, 0.8, 0.0, 0.0]), [0.6, -0.8, 0.0, 0.0])
    np.testing.assert_array_equal(
        quaternion_to_rotation_vector(quaternions), quaternion_to_rotation_vector(-quaternions)
    )


def test_rotation_vector_agrees_with_scipy(quaternions: np.ndarray) -> None:
    np.testing.assert_allclose(
        quaternion_to_rotation_vector(quaternions), Rotation(quaternions).as_rotvec(), atol=1e-13
    )


@pytest.mark.parametrize("length_rad", [0.0, 1e-300, 1e-12, 1e-4, 1.0])
def test_rotation_vector_round_trip_keeps_relative_precision(length_rad: float) -> None:
    v = length_rad * np.array([0.48, -0.6, 0.64])
    np.testing.assert_allclose(quaternion_to_rotation_vector(quaternion_from_rotation_vector(v)), v, rtol=1e-13)


def test_roll_pitch_yaw_are_fixed_axis_angles_as_in_scipy(quaternions: np.ndarray) -> None:
    angles = quaternion_to_roll_pitch_yaw(quaternions)
    np.testing.assert_allclose(angles, Rotation(quaternions).as_euler("xyz"), atol=1e-12)
    np.testing.assert_allclose(quaternion_from_roll_pitch_yaw(angles), canonical(quaternions), atol=1e-12)


def test_roll_and_yaw_are_refused_at_pitch_90_deg() -> None:
    with pytest.raises(ValueError, match="pitch is"):
        quaternion_to_roll_pitch_yaw(quaternion_from_roll_pitch_yaw([0.3, np.pi / 2.0, 0.0]))


@pytest.mark.parametrize(
    ("quaternion", "message"),
    [
        ([0.0, 0.0, 0.0, 1.1], "norm 1.1"),
        ([0.0, 0.0, 0.0, 0.0], "norm 0.0"),
        ([0.0, np.nan, 0.0, 1.0], "finite"),
        ([0.0, 0.0, 1.0], "shape"),
    ],
)
def test_a_quaternion_that_is_not_unit_is_refused(quaternion: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        unit_quaternion(quaternion)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([1.0, 1.0, -1.0]), "reflection"),
        (np.eye(3) * 1.01, "orthonormality"),
        (np.full((3, 3), np.nan), "finite"),
        (np.eye(4), "shape"),
    ],
)
def test_a_matrix_that_is_no_rotation_is_refused(matrix: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        quaternion_from_matrix(matrix)


def test_the_angle_between_two_orientations_is_that_of_scipy(quaternions: np.ndarray) -> None:
    a, b = quaternions[:100], quaternions[100:]
    expected = (Rotation(a).inv() * Rotation(b)).magnitude()
    np.testing.assert_allclose(rotation_angle_between_rad(a, b), expected, atol=1e-12)
    np.testing.assert_allclose(rotation_angle_between_rad(a, -b), expected, atol=1e-12)
    assert np.max(expected) > 2.5


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0]),
        ([0.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]),
        ([0.0, -0.6, 0.8, 0.0], [0.0, 0.6, -0.8, 0.0]),
        ([-1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 0.6, -0.8], [0.0, 0.0, -0.6, 0.8]),
        ([0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0]),
        ([-0.6, 0.0, 0.0, 0.8], [-0.6, 0.0, 0.0, 0.8]),
    ],
)
def test_the_first_component_that_is_not_zero_is_positive_the_scalar_before_all(
    given: list[float], expected: list[float]
) -> None:
    for sign in (1.0, -1.0):
        found = canonical(sign * np.array(given))
        np.testing.assert_array_equal(found, expected)
        # Zeros are plain zeros: a recorded attitude shows none with a sign.
        assert not np.any(np.signbit(found[found == 0.0]))
