"""Matching of directions to stations."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.match_directions import match_directions


@pytest.fixture
def expected() -> np.ndarray:
    v = np.random.default_rng(2).standard_normal((4, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_shuffled_directions_find_their_stations(expected: np.ndarray) -> None:
    order = [2, 0, 3, 1]
    noisy = expected[order] + 0.01
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    assert sorted(match_directions(noisy, expected, 0.2)) == [(i, j) for i, j in enumerate(order)]


def test_direction_without_a_station_in_reach_stays_unmatched(expected: np.ndarray) -> None:
    stray = np.concatenate([expected[:2], -expected[2:3]])
    assert sorted(match_directions(stray, expected[:2], 0.1)) == [(0, 0), (1, 1)]


def test_total_angle_decides_where_the_nearest_would_collide() -> None:
    def at(angle: float) -> list[float]:
        return [np.cos(angle), np.sin(angle), 0.0]

    measured, expected = np.array([at(0.0), at(0.10)]), np.array([at(0.06), at(0.20)])
    assert match_directions(measured, expected, 0.5) == [(0, 0), (1, 1)]


def test_vectors_of_the_wrong_shape_are_refused(expected: np.ndarray) -> None:
    with pytest.raises(ValueError, match="measured has shape"):
        match_directions(expected[0], expected, 0.1)
