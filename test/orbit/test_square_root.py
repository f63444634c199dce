"""The square-root filter against dense normal equations: priors, Gauss-Markov biases, consider parameters."""

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.orbit.square_root import SquareRootFilter


def test_it_is_the_batch_of_the_same_rows_with_correlated_biases():
    """The bias of every epoch, a Gauss-Markov process, is part of a dense covariance of the measurements instead."""
    rng = random_stream(5, "rows")
    epochs, step_s, tau_s, sigma, noise = 9, 700.0, 2000.0, 3.0, 0.4
    partials = rng.standard_normal((epochs, 3))
    considered = rng.standard_normal((epochs, 2))
    measured = rng.standard_normal(epochs) * 5.0
    priors = np.array([2.0, np.inf, 7.0])
    ours = SquareRootFilter(["bias", "a", "b", "c"], [sigma, *priors], considered=2)
    decay = np.exp(-step_s / tau_s)
    for k in range(epochs):
        if k:
            ours.advance(np.array([0]), decay, sigma * np.sqrt(1.0 - decay**2))
        rows = np.concatenate([[1.0], partials[k]])[np.newaxis] / noise
        ours.update(rows, measured[k : k + 1] / noise, considered[k : k + 1] / noise)
    found = ours.estimate()

    lags = np.abs(np.subtract.outer(np.arange(epochs), np.arange(epochs))) * step_s
    weight = np.linalg.inv(sigma**2 * np.exp(-lags / tau_s) + noise**2 * np.eye(epochs))
    formal = np.linalg.inv(partials.T @ weight @ partials + np.diag(1.0 / priors**2))
    gain = formal @ partials.T @ weight
    assert np.allclose(found.values[1:], gain @ measured)
    assert np.allclose(found.formal[1:, 1:], formal)
    assert np.allclose(found.sensitivity[1:], -gain @ considered)
    spread = np.array([0.3, 2.0])
    effect = gain @ considered * spread
    assert np.allclose(found.covariance(spread)[1:, 1:], formal + effect @ effect.T)


def test_a_parameter_that_forgets_at_once_is_white():
    white = SquareRootFilter(["clock", "a"], [5.0, 10.0])
    white.update(np.array([[1.0, 1.0]]), [2.0])
    white.advance(np.array([0]), 0.0, 5.0)
    white.update(np.array([[1.0, 1.0]]), [4.0])
    assert white.estimate().formal[1, 1] == pytest.approx(1.0 / (2.0 / 26.0 + 0.01))


def test_it_names_what_is_not_determined():
    rows = SquareRootFilter(["a", "b"], [np.inf, np.inf])
    rows.update(np.array([[1.0, 2.0], [2.0, 4.0]]), [0.0, 0.0])
    with pytest.raises(ValueError, match="do not determine b"):
        rows.estimate()
    with pytest.raises(ValueError, match="must be 1 numbers > 0"):
        SquareRootFilter(["a"], [0.0])
