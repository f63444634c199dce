"""Rotations against numpy and as derivatives; `attitude.quaternion` is tested against scipy."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.rotations import (
    cosine_slopes,
    cross_matrix,
    cross_product,
    matrix_from_quaternion,
    tangent_rows,
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


def test_cosine_slopes_are_the_derivative_of_the_unit_vector() -> None:
    cosines, step = np.random.default_rng(4).uniform(-0.6, 0.6, (50, 2)), 1e-6

    def lifted(uv: np.ndarray) -> np.ndarray:
        return np.concatenate([uv, np.sqrt(1.0 - np.sum(uv**2, axis=-1, keepdims=True))], axis=-1)

    moves = step * np.eye(2)
    expected = [(lifted(cosines + move) - lifted(cosines - move)) / (2.0 * step) for move in moves]
    np.testing.assert_allclose(cosine_slopes(lifted(cosines)), np.stack(expected, axis=-1), atol=1e-9)
