"""The search along the track: nothing inside is missed, and the beam moves within its limits."""

import itertools

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.tracking import StripSearch

LENGTH, WIDTH, PITCH, RATE, ACCELERATION = 225 * MDEG, 50 * MDEG, 10 * MDEG, 60 * MDEG, 400 * MDEG


@pytest.fixture(scope="module")
def search() -> StripSearch:
    return StripSearch(LENGTH, WIDTH, PITCH, RATE, ACCELERATION)


@pytest.fixture(scope="module")
def path(search: StripSearch) -> np.ndarray:
    """One round, rows (n, 4) every 10 ms."""
    return np.array([search.offset(t) for t in np.arange(0.0, search.duration_s, 0.01)])


def test_every_direction_inside_comes_within_half_a_pitch(path: np.ndarray, random: np.random.Generator) -> None:
    for x, y in random.uniform(-1.0, 1.0, (200, 2)) * np.array([LENGTH, WIDTH]):
        assert np.min(np.hypot(path[:, 0] - x, path[:, 1] - y)) <= 0.5 * PITCH + 0.005 * RATE


def test_the_middle_strip_comes_first(search: StripSearch, path: np.ndarray) -> None:
    ends = int(np.argmax(path[:, 0] < -0.99 * LENGTH))
    assert ends * 0.01 < 3.2 * LENGTH / RATE
    assert not path[:ends, 1].any()


def test_rates_are_those_of_the_positions_and_stay_within_the_limits(path: np.ndarray) -> None:
    slopes = np.gradient(path[:, :2], 0.01, axis=0)
    assert float(np.max(np.abs(slopes - path[:, 2:]))) < 0.02 * ACCELERATION
    assert float(np.max(np.hypot(path[:, 2], path[:, 3]))) <= RATE * (1.0 + 1e-9)
    assert float(np.max(np.abs(np.diff(path[:, 2:], axis=0)))) / 0.01 <= 1.01 * np.sqrt(2.0) * ACCELERATION


def test_the_round_begins_again_where_it_ends(search: StripSearch) -> None:
    assert search.offset(search.duration_s - 1e-9)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    assert search.offset(search.duration_s + 2.0) == pytest.approx(search.offset(2.0), abs=1e-12)


def test_a_width_below_the_pitch_needs_one_strip() -> None:
    narrow = StripSearch(LENGTH, 0.5 * PITCH, PITCH, RATE, ACCELERATION)
    assert all(narrow.offset(t)[1] == 0.0 for t in np.linspace(0.0, narrow.duration_s, 50))


@pytest.mark.parametrize("length", [LENGTH, 4 * MDEG])
def test_every_leg_is_a_trapezoid_of_speed_from_rest_to_rest(length: float) -> None:
    """Short legs never reach the full speed: half of the way is run up, half run down."""
    search = StripSearch(length, 20 * MDEG, PITCH, RATE, ACCELERATION)
    # The middle, there and back, then two strips on each side; between them the way to the next one's beginning.
    corners = [(0.0, 0.0), (length, 0.0), (-length, 0.0)]
    corners += [(-length, PITCH), (length, PITCH), (length, -PITCH), (-length, -PITCH)]
    corners += [(-length, 2 * PITCH), (length, 2 * PITCH), (length, -2 * PITCH), (-length, -2 * PITCH), (0.0, 0.0)]
    total_s = 0.0
    for (x0, y0), (x1, y1) in itertools.pairwise(corners):
        way = np.hypot(x1 - x0, y1 - y0)
        fastest = min(RATE, np.sqrt(ACCELERATION * way))
        times = total_s + np.array([0.0, 0.5 * fastest / ACCELERATION, 0.5 * (way / fastest + fastest / ACCELERATION)])
        gone = np.array([0.0, 0.125 * fastest**2 / ACCELERATION, 0.5 * way]) / way
        speeds = np.array([0.0, 0.5 * fastest, fastest])
        for t_s, share, speed in zip(times, gone, speeds, strict=True):
            found = search.offset(float(t_s))
            assert found[:2] == pytest.approx((x0 + share * (x1 - x0), y0 + share * (y1 - y0)), abs=1e-9)
            assert np.hypot(*found[2:]) == pytest.approx(speed, abs=1e-6)
        total_s += way / fastest + fastest / ACCELERATION
    assert search.duration_s == pytest.approx(total_s, rel=1e-12)
    assert search.offset(-3.0) == pytest.approx((0.0, 0.0, 0.0, 0.0))
