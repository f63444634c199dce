"""The watch is silent on sound innovations and finds a mean and a scale that are not claimed."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.rotations import tangent_rows
from rf_pointing.array_sensors.doa.innovation_watch import InnovationWatch, WatchParams

PARAMS = WatchParams()
GATE = 30.0


def watched(seed: int, count: int, bias: np.ndarray, scale: float = 1.0) -> list[InnovationWatch]:
    """Return the watch after each innovation: N(E bias, scale^2 S) of random directions."""
    stream = np.random.default_rng(seed)
    watch, found = InnovationWatch(), []
    for _ in range(count):
        towards = stream.standard_normal(3)
        rows = tangent_rows(towards / np.linalg.norm(towards))
        root = np.tril(stream.uniform(0.5, 1.5, (2, 2)))
        z = rows @ bias + scale * root @ stream.standard_normal(2)
        watch = watch.with_direction(PARAMS, z, root @ root.T, rows, GATE)
        found.append(watch)
    return found


def test_sound_innovations_are_not_doubted_and_rarely_widen_the_covariance() -> None:
    runs = [watched(seed, 300, np.zeros(3)) for seed in range(20)]
    assert not any(watch.reasons(PARAMS) for run in runs for watch in run)
    widened = [np.any(run[-1].bias_covariance() > 0.0) for run in runs]
    assert np.mean(widened) <= 0.3


def test_mean_of_a_third_of_a_sigma_is_found_and_its_size_is_the_covariance() -> None:
    bias = np.array([0.3, -0.2, 0.1])
    run = watched(3, 600, bias)
    assert "common mean" in run[-1].reasons(PARAMS)[0]
    largest = np.linalg.eigh(run[-1].bias_covariance())
    assert np.sqrt(largest.eigenvalues[-1]) == pytest.approx(np.linalg.norm(bias), rel=0.3)
    assert abs(largest.eigenvectors[:, -1] @ bias) == pytest.approx(np.linalg.norm(bias), rel=0.1)


def test_errors_half_as_large_again_are_found_by_their_mean_square() -> None:
    run = watched(4, 200, np.zeros(3), scale=1.5)
    assert "mean squared innovation" in run[-1].reasons(PARAMS)[0]


def test_one_direction_seen_again_and_again_leaves_the_turn_about_it_out() -> None:
    towards, watch = np.array([0.0, 0.0, 1.0]), InnovationWatch()
    rows = tangent_rows(towards)
    for _ in range(50):
        watch = watch.with_direction(PARAMS, np.array([0.01, 0.0]), 1e-4 * np.eye(2), rows, GATE)
    added = watch.bias_covariance()
    assert np.sqrt(np.trace(added)) == pytest.approx(0.01, rel=0.2)
    assert added[2] == pytest.approx(0.0, abs=1e-12)


def test_the_weights_are_those_of_a_memory_that_fades() -> None:
    """Of n directions the k-th last counts keep^k: their sum, and that of the squares, in closed form."""
    count, keep = 40, 1.0 - 1.0 / np.array(PARAMS.directions)
    watch = watched(1, count, np.zeros(3))[-1]
    np.testing.assert_allclose(watch.weight, (1.0 - keep**count) / (1.0 - keep))
    np.testing.assert_allclose(watch.weight2, (1.0 - keep ** (2 * count)) / (1.0 - keep**2))


def test_a_handful_of_directions_proves_nothing() -> None:
    far_off = watched(5, 7, np.full(3, 30.0))
    # The sum of the weights of a memory of 20 directions reaches five with the sixth.
    assert [bool(watch.reasons(PARAMS)) for watch in far_off] == [False] * 5 + [True] * 2
    biased = watched(5, 7, np.full(3, 2.0))
    assert [bool(np.any(watch.bias_covariance())) for watch in biased] == [False] * 5 + [True] * 2
