"""Parameters that belong to one pass only, eliminated from its equations by an orthogonal step.

The rows [P | A | b] of a pass and the prior rows [1/sigma | 0 | 0] of its own parameters p are brought to a triangle;
what lies below the rows of p is free of p and goes on to the common terms.  The rows of p give its estimate back.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.triangle import Solution, triangle_of

__all__ = ["PassHead", "eliminate"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PassHead:
    """The rows of a pass's own parameters: own (p, p) @ p + common (p, k) @ x = right (p,)."""

    own: Array
    common: Array
    right: Array

    def values(self, solution: Solution) -> Array:
        """Return the pass's parameters (p,) that go with the common solution."""
        return np.asarray(np.linalg.solve(self.own, self.right - self.common @ solution.values))

    def sigma(self, solution: Solution) -> Array:
        """Return their standard deviations (p,), the uncertainty of the terms included."""
        inverse = np.linalg.inv(self.own)
        spread = np.eye(len(self.own)) + self.common @ solution.covariance @ self.common.T
        return np.asarray(np.sqrt(np.diag(inverse @ spread @ inverse.T)))


def eliminate(rows: Array, prior_sigma: Array) -> tuple[PassHead, Array]:
    """Return the rows of a pass's own parameters and, free of them, rows (m, k + 1) for the common triangle.

    `rows` (n, p + k + 1) holds the pass's own partials, the common ones and the right side, divided by sigma.
    """
    count = len(prior_sigma)
    prior = np.zeros((count, rows.shape[1]))
    prior[:, :count] = np.diag(1.0 / prior_sigma)
    factor = triangle_of(np.concatenate([prior, rows]))
    return PassHead(factor[:count, :count], factor[:count, count:-1], factor[:count, -1]), factor[count:, count:]
