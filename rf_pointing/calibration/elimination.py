"""Parameters that belong to one pass only, eliminated from its equations by an orthogonal step.

The rows [P | A | b] of a pass and the prior rows [1/sigma | 0 | 0] of its own parameters p are brought to a triangle;
what lies below the rows of p is free of p and goes on to the common terms.  The rows of p give its estimate back.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.triangle import Solution

__all__ = ["PassHead", "eliminate"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PassHead:
    """The rows of a pass's own parameters: own (p, p) @ p + common (p, k) @ x = right (p,)."""

    own: Array
    common: Array
    right: Array

    def estimate(self, solution: Solution) -> tuple[Array, Array]:
        """Return the pass's parameters and their standard deviations, the uncertainty of the terms included."""
        inverse = np.linalg.inv(self.own)
        values = inverse @ (self.right - self.common @ solution.values)
        spread = np.eye(len(values)) + self.common @ solution.covariance @ self.common.T
        return values, np.sqrt(np.diag(inverse @ spread @ inverse.T))


def eliminate(own: Array, common: Array, right: Array, prior_sigma: Array) -> tuple[PassHead, Array]:
    """Return the rows of a pass's own parameters and, free of them, rows (m, k + 1) for the common triangle.

    `own` (n, p), `common` (n, k) and `right` (n,) are already divided by sigma.
    """
    count, width = own.shape[1], common.shape[1]
    prior = np.concatenate([np.diag(1.0 / prior_sigma), np.zeros((count, width + 1))], axis=1)
    rows = np.concatenate([prior, np.column_stack([own, common, right])])
    factor = np.asarray(np.linalg.qr(rows, mode="r"))
    return PassHead(factor[:count, :count], factor[:count, count:-1], factor[:count, -1]), factor[count:, count:]
