"""Least squares on pieces of a time series: the workhorse of outlier search, thinning and smoothing."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

__all__ = ["fitted_piece", "pieces_of", "spread_of"]

Array = NDArray[np.float64]

_MEDIAN_TO_SIGMA = 1.4826


def pieces_of(t_s: Array, length_s: float) -> Iterator[NDArray[np.int64]]:
    """Yield the rows of each piece [k, k + 1) * `length_s` of increasing times that has any."""
    number = np.floor(t_s / length_s)
    cuts = np.flatnonzero(np.diff(number) != 0) + 1
    yield from np.split(np.arange(len(t_s)), cuts)


def fitted_piece(t: Array, values: Array, degree: int, at: Array) -> tuple[Array, Array, Array]:
    """Return the polynomial through (n, m) values at `at` (p,), its residuals, and its covariance factor (p, p).

    The covariance of the fitted values is the factor times the variance of one sample.
    """
    middle, half = 0.5 * (t[0] + t[-1]), max(0.5 * (t[-1] - t[0]), 1e-9)
    basis = np.vander((t - middle) / half, degree + 1)
    wanted = np.vander((at - middle) / half, degree + 1)
    orthogonal, factor = np.linalg.qr(basis)
    coefficients = np.linalg.solve(factor, orthogonal.T @ values)
    spread = np.linalg.solve(factor.T, wanted.T)
    return wanted @ coefficients, values - basis @ coefficients, spread.T @ spread


def spread_of(residuals: Array) -> float:
    """Return the standard deviation of residuals from their median size, insensitive to outliers."""
    return _MEDIAN_TO_SIGMA * float(np.median(np.abs(residuals)))
