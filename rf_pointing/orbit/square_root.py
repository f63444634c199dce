"""Square-root information filter with estimated, stochastic and consider parameters.

What is known of the parameters x and of the consider parameters c are the rows of

    R x + R_c c = z + noise of unit variance,   R upper triangular

New rows are joined and made triangular again by an orthogonal transformation, which never forms a
covariance.  Consider parameters are not estimated.  Their effect is carried along:

    x^ = R^-1 z,   P = R^-1 R^-T,   S = -R^-1 R_c,   P_total = P + S C S'

A stochastic parameter is a first-order Gauss-Markov process between two batches of rows:
p' = m p + w, m = exp(-dt / tau), var w = sigma^2 (1 - m^2); tau = 0 makes it white.  Bierman,
Factorization Methods for Discrete Sequential Estimation, V and VIII.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core.types import Array, IntArray

# Share of a diagonal in its column; below it a combination has not been measured.
RANK_TOLERANCE = 1e-13


@dataclass(frozen=True, eq=False)
class Estimate:
    """Values (p,) with formal covariance (p, p), and sensitivity (p, c) to what is considered."""

    values: Array
    formal: Array
    sensitivity: Array

    def covariance(self, sigma: ArrayLike) -> Array:
        """Return the total covariance (p, p) for sigmas (c,) of the consider parameters."""
        effect = self.sensitivity * np.asarray(sigma, dtype=np.float64)
        return np.asarray(self.formal + effect @ effect.T)


class SquareRootFilter:
    """Rows that determine `names`, beginning with priors of `sigmas` (p,); inf: without a prior."""

    def __init__(self, names: Sequence[str], sigmas: ArrayLike, considered: int = 0) -> None:
        self.names = tuple(names)
        spread = np.asarray(sigmas, dtype=np.float64)
        if spread.shape != (len(names),) or not np.all(spread > 0.0):
            raise ValueError(f"sigmas={sigmas!r} must be {len(names)} numbers > 0")
        self._rows = np.zeros((len(names), len(names) + considered + 1))
        np.fill_diagonal(self._rows, 1.0 / spread)

    def update(self, partials: Array, measured: ArrayLike, considered: Array | None = None) -> None:
        """Take measurements (n,) of unit variance; partials (n, p), and (n, c) of the others."""
        count = len(partials)
        others = np.zeros((count, 0)) if considered is None else considered
        column = np.broadcast_to(np.asarray(measured, dtype=np.float64), (count,))[:, np.newaxis]
        rows = np.concatenate([partials, others, column], axis=1)
        self._rows = triangular(np.concatenate([self._rows, rows]), len(self.names))

    def advance(self, which: IntArray, decay: ArrayLike, sigma: ArrayLike) -> None:
        """Let parameters (their places, (k,)) forget by `decay` and regain `sigma` (k,), > 0."""
        k = len(which)
        m, noise = (
            np.broadcast_to(np.asarray(one, dtype=np.float64), (k,)) for one in (decay, sigma)
        )
        # p' - m p = w, a measurement of the old and the new value at once.
        renewed = np.zeros((k, self._rows.shape[1]))
        renewed[np.arange(k), which] = 1.0 / noise
        before = self._rows.copy()
        before[:, which] = 0.0
        # The old values lead, so that the triangle below them is free of them.
        known = np.concatenate([self._rows[:, which], before], axis=1)
        change = np.concatenate([np.diag(-m / noise), renewed], axis=1)
        whole = triangular(np.concatenate([known, change]), k + len(self.names))
        self._rows = whole[k:, k:]

    def estimate(self) -> Estimate:
        """Return what is known; ValueError names the parameters that are not determined."""
        p = len(self.names)
        root = self._rows[:, :p]
        scale = np.linalg.norm(root, axis=0)
        share = np.abs(np.diag(root)) / np.where(scale > 0.0, scale, 1.0)
        if np.any(share < RANK_TOLERANCE):
            lost = [
                name for name, one in zip(self.names, share, strict=True) if one < RANK_TOLERANCE
            ]
            raise ValueError(f"the measurements do not determine {', '.join(lost)}")
        # The root is inverted, not the normal equations: half the digits are lost.
        inverse = np.linalg.inv(root)
        return Estimate(
            inverse @ self._rows[:, -1], inverse @ inverse.T, -inverse @ self._rows[:, p:-1]
        )


def triangular(rows: Array, count: int) -> Array:
    """Return the first `count` rows (..., count, q) of the triangle of rows (..., n, q)."""
    return np.asarray(np.linalg.qr(rows, mode="r"))[..., :count, :]
