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
    require_rotation,
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


def test_matrix_of_a_product_is_the_product_of_the_matrices(quaternions: np.ndarray) -> None:
    a, b = quaternions[:100], quaternions[100:]
    np.testing.assert_allclose(
        quaternion_to_matrix(multiply(a, b)), quaternion_to_matrix(a) @ quaternion_to_matrix(b), atol=ROUNDING
    )


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


@pytest.mark.parametrize(
    ("matrix", "complaint"),
    [
        (np.diag([1.0, 1.0, -1.0]), "attitude has determinant -1: a reflection, not a rotation"),
        ([np.eye(3), 1.01 * np.eye(3)], r"attitude misses orthonormality by 0\.0201, must be <= 1e-06"),
        (np.full((3, 3), np.nan), r"attitude=[^=]* must be finite"),
        (np.eye(4), r"attitude has shape \(4, 4\), must be \(\.\.\., 3, 3\)"),
    ],
)
def test_what_is_no_rotation_is_named_with_its_defect(matrix: object, complaint: str) -> None:
    with pytest.raises(ValueError, match=f"^{complaint}$"):
        require_rotation("attitude", matrix)


def test_rotations_pass_unchanged() -> None:
    turns = np.array([np.eye(3), np.diag([1.0, -1.0, -1.0])])
    assert np.array_equal(require_rotation("attitude", turns), turns)


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


def test_quaternions_of_rotations_have_no_negative_scalar(quaternions: np.ndarray) -> None:
    turns = Rotation(quaternions).as_rotvec()
    angles = Rotation(quaternions).as_euler("xyz")
    for found in (
        quaternion_from_rotation_vector(turns),
        quaternion_from_matrix(quaternion_to_matrix(quaternions)),
        quaternion_from_roll_pitch_yaw(angles),
    ):
        np.testing.assert_allclose(found, canonical(quaternions), atol=1e-12)
        assert np.all(found[:, 3] >= 0.0)


def test_one_orientation_and_stacks_of_stacks_are_treated_alike(quaternions: np.ndarray) -> None:
    stack = quaternions[:24].reshape(2, 3, 4, 4)
    angles, turns = quaternion_to_roll_pitch_yaw(stack), quaternion_to_rotation_vector(stack)
    matrices, products = quaternion_to_matrix(stack), multiply(stack, conjugate(stack[::-1]))
    between = rotation_angle_between_rad(stack, stack[::-1])
    for index in np.ndindex(2, 3, 4):
        one, other = stack[index], stack[::-1][index]
        np.testing.assert_allclose(quaternion_to_roll_pitch_yaw(one), angles[index], atol=1e-12)
        np.testing.assert_allclose(quaternion_to_rotation_vector(one), turns[index], atol=1e-12)
        np.testing.assert_allclose(quaternion_to_matrix(one), matrices[index], atol=1e-12)
        np.testing.assert_allclose(multiply(one, conjugate(other)), products[index], atol=1e-12)
        assert float(rotation_angle_between_rad(one, other)) == pytest.approx(float(between[index]), abs=1e-12)
        for again in (
            quaternion_from_matrix(matrices)[index],
            quaternion_from_rotation_vector(turns)[index],
            quaternion_from_roll_pitch_yaw(angles)[index],
            canonical(stack)[index],
        ):
            np.testing.assert_allclose(again, canonical(one), atol=1e-12)


def test_the_quaternion_farthest_from_unit_length_is_named_and_rounding_is_removed() -> None:
    with pytest.raises(ValueError, match=r"turn has norm 1\.2, must be 1 within 1e-06"):
        unit_quaternion([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.2, 0.0], [0.0, 0.9, 0.0, 0.0]], "turn")
    for scale in (1.0 + 9e-7, 1.0 - 9e-7):
        np.testing.assert_allclose(unit_quaternion(scale * np.array([0.0, 0.6, 0.0, -0.8])), [0.0, 0.6, 0.0, -0.8])
    for scale in (1.0 + 1.2e-6, 1.0 - 1.2e-6):
        with pytest.raises(ValueError, match="quaternion has norm"):
            unit_quaternion(scale * np.array([0.0, 0.6, 0.0, -0.8]))


def test_roll_and_yaw_are_told_apart_up_to_a_microradian_from_the_pole() -> None:
    for off_rad, refused in ((2e-6, False), (0.5e-6, True)):
        for side in (1.0, -1.0):
            pole = quaternion_from_roll_pitch_yaw([0.3, side * (np.pi / 2.0 - off_rad), -0.7])
            if refused:
                with pytest.raises(ValueError, match="pitch is"):
                    quaternion_to_roll_pitch_yaw(pole)
            else:
                # Rounding of 1e-16 over the distance from the pole.
                found = quaternion_to_roll_pitch_yaw(pole)
                np.testing.assert_allclose(found, [0.3, side * (np.pi / 2.0 - off_rad), -0.7], atol=1e-8)


def test_a_rotation_may_miss_orthonormality_by_a_millionth() -> None:
    for off, refused in ((0.4e-6, False), (0.6e-6, True)):
        given = np.array([np.eye(3), (1.0 + off) * np.eye(3)])
        if refused:
            with pytest.raises(ValueError, match="misses orthonormality"):
                require_rotation("attitude", given)
        else:
            np.testing.assert_array_equal(require_rotation("attitude", given), given)
