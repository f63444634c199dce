"""Covariance that stays honest when the errors of one pass are correlated: the cluster sandwich.

    cov = C [ sum_g u_g u_g' ] C,    C = (A'WA)^-1,    u_g = (1 - M_g C)^-1 s_g,    M_g = A_g'W A_g,  s_g = A_g'W r_g

The sums run over passes.  The factor (1 - M_g C)^-1 undoes the pull of a pass on its own residuals (Bell and
McCaffrey's third correction, the delete-one-pass jackknife): without it few passes give far too small a sigma.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["FEWEST_PASSES", "sandwich_covariance"]

Array = NDArray[np.float64]

FEWEST_PASSES = 5
_ALONE = 1e-8


def sandwich_covariance(names: Sequence[str], covariance: Array, passes: Sequence[tuple[int, Array, Array]]) -> Array:
    """Return the covariance (k, k) from the white-noise one and per pass (number, rows (m, k), residuals (m,)).

    Rows and residuals are divided by sigma.  Raises ValueError for fewer than FEWEST_PASSES passes and where one
    pass alone determines a term.
    """
    if len(passes) < FEWEST_PASSES:
        raise ValueError(f"passes={len(passes)} must be >= {FEWEST_PASSES} for a sandwich covariance")
    meat = np.zeros_like(covariance)
    for number, rows, residuals in passes:
        remaining = np.eye(len(names)) - (rows.T @ rows) @ covariance
        values, vectors = np.linalg.eig(remaining.T)
        if np.min(np.abs(values)) < _ALONE:
            weak = np.abs(vectors[:, int(np.argmin(np.abs(values)))]) * np.sqrt(np.diag(covariance)) ** -1
            name = names[int(np.argmax(weak))]
            raise ValueError(f"pass {number} alone determines {name}: add passes that see it too")
        score = np.linalg.solve(remaining, rows.T @ residuals)
        meat += np.outer(score, score)
    return np.asarray(covariance @ meat @ covariance)
