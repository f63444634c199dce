"""Rotations: against scipy and numpy, at half a turn, near zero, and in stacks that broadcast."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.rotations import (
    cosine_slopes,
    cross_matrix,
    cross_product,
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_turn,
    quaternion_product,
    tangent_rows,
    turn_from_quaternion,
)

ROUNDING = 1e-15


@pytest.fixture
def quaternions() -> np.ndarray:
    drawn = np.random.default_rng(31).standard_normal((200, 4))
    return drawn / np.linalg.norm(drawn, axis=-1, keepdims=True)


def test_cross_product_and_matrix_are_numpys(quaternions: np.ndarray) -> None:
    a, b = quaternions[:100, :3], quaternions[100:, :3]
    np.testing.assert_allclose(cross_product(a, b), np.cross(a, b), atol=ROUNDING)
    np.testing.assert_allclose(cross_product(a, b[0]), np.cross(a, b[0]), atol=ROUNDING)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", cross_matrix(a), b), np.cross(a, b), atol=ROUNDING)


def test_tangent_rows_complete_any_direction_to_a_right_handed_frame(quaternions: np.ndarray) -> None:
    directions = np.concatenate([np.eye(3), -np.eye(3), matrix_from_quaternion(quaternions)[:, 0]])
    frames = np.concatenate([directions[:, None, :], tangent_rows(directions)], axis=1)
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-14)


def test_product_and_matrix_are_scipys(quaternions: np.ndarray) -> None:
    a, b = quaternions[:100], quaternions[100:]
    expected = (Rotation(a) * Rotation(b)).as_matrix()
    np.testing.assert_allclose(matrix_from_quaternion(quaternion_product(a, b)), expected, atol=4 * ROUNDING)


def test_turns_are_scipys_and_lose_the_sign_of_the_quaternion(quaternions: np.ndarray) -> None:
    turns = Rotation(quaternions).as_rotvec()
    np.testing.assert_allclose(turn_from_quaternion(quaternions), turns, atol=1e-13)
    np.testing.assert_array_equal(turn_from_quaternion(-quaternions), turn_from_quaternion(quaternions))
    np.testing.assert_allclose(Rotation(quaternion_from_turn(turns)).as_rotvec(), turns, atol=1e-13)


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, -1.0, 0], [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64]])
@pytest.mark.parametrize("angle_rad", [np.pi, np.pi - 1e-9, np.pi + 1e-9, 1e-9, 0.0])
def test_matrix_gives_its_quaternion_back_up_to_half_a_turn(axis: list[float], angle_rad: float) -> None:
    matrix = matrix_from_quaternion(quaternion_from_turn(angle_rad * np.asarray(axis)))
    again = matrix_from_quaternion(quaternion_from_matrix(matrix))
    np.testing.assert_allclose(again, matrix, atol=4 * ROUNDING)


@pytest.mark.parametrize("length_rad", [0.0, 1e-300, 1e-160, 1e-12, 1e-4, 3.0])
def test_small_turns_keep_their_relative_precision(length_rad: float) -> None:
    turn = length_rad * np.array([0.48, -0.6, 0.64])
    np.testing.assert_allclose(turn_from_quaternion(quaternion_from_turn(turn)), turn, rtol=1e-13)


def test_cosine_slopes_are_the_derivative_of_the_unit_vector() -> None:
    cosines, step = np.random.default_rng(4).uniform(-0.6, 0.6, (50, 2)), 1e-6

    def lifted(uv: np.ndarray) -> np.ndarray:
        return np.concatenate([uv, np.sqrt(1.0 - np.sum(uv**2, axis=-1, keepdims=True))], axis=-1)

    moves = step * np.eye(2)
    expected = [(lifted(cosines + move) - lifted(cosines - move)) / (2.0 * step) for move in moves]
    np.testing.assert_allclose(cosine_slopes(lifted(cosines)), np.stack(expected, axis=-1), atol=1e-9)


def test_one_rotation_and_stacks_of_stacks_are_treated_alike(quaternions: np.ndarray) -> None:
    stack = quaternions[:24].reshape(2, 3, 4, 4)
    vectors = stack[..., :3]
    directions = matrix_from_quaternion(stack)[..., 0]
    many = {
        "cross": cross_product(vectors, directions),
        "matrix": cross_matrix(vectors),
        "rows": tangent_rows(directions),
        "product": quaternion_product(stack, stack[::-1]),
        "turned": quaternion_from_turn(vectors),
        "turn": turn_from_quaternion(stack),
        "slopes": cosine_slopes(directions),
    }
    back = matrix_from_quaternion(quaternion_from_matrix(matrix_from_quaternion(stack)))
    np.testing.assert_allclose(back, matrix_from_quaternion(stack), atol=4 * ROUNDING)
    for index in np.ndindex(2, 3, 4):
        q, v, d = stack[index], vectors[index], directions[index]
        one = {
            "cross": cross_product(v, d),
            "matrix": cross_matrix(v),
            "rows": tangent_rows(d),
            "product": quaternion_product(q, stack[::-1][index]),
            "turned": quaternion_from_turn(v),
            "turn": turn_from_quaternion(q),
            "slopes": cosine_slopes(d),
        }
        for name, values in one.items():
            np.testing.assert_allclose(many[name][index], values, rtol=1e-12, atol=1e-14, err_msg=name)
        single = quaternion_from_matrix(matrix_from_quaternion(q))
        assert abs(single @ q) == pytest.approx(1.0)


def test_a_product_broadcasts_one_rotation_over_many(quaternions: np.ndarray) -> None:
    for left, right in ((quaternions, quaternions[0]), (quaternions[0], quaternions)):
        found = quaternion_product(left, right)
        assert found.shape == (200, 4)
        for k in (0, 7, 199):
            one = quaternion_product(left[k] if left.ndim == 2 else left, right[k] if right.ndim == 2 else right)
            np.testing.assert_allclose(found[k], one, atol=ROUNDING)
