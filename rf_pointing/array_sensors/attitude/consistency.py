"""Is a filter's covariance true: normalised estimation error squared (NEES) and its chi-square band.

e^T P^-1 e has mean n for an n-dimensional Gaussian error of covariance P; its average over independent runs is
chi-square with runs * n degrees of freedom, divided by runs (Bar-Shalom, Li, Kirubarajan 2001, section 5.4).
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between, require_finite

__all__ = ["nees", "nees_band"]

Array = NDArray[np.float64]


def nees(error: Array, covariance: Array) -> Array:
    """Return e^T P^-1 e (...) of errors (..., n) and covariances (..., n, n); NaN is refused, not averaged."""
    require_finite("error", error)
    return np.asarray(np.sum(error * np.linalg.solve(covariance, error[..., None])[..., 0], axis=-1))


def nees_band(dimension: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval that holds the mean NEES of `runs` independent runs with probability `confidence`."""
    from scipy.special import chdtri

    require_between("dimension", dimension, 1, None)
    require_between("runs", runs, 1, None)
    require_between("confidence", confidence, 1e-6, 1.0 - 1e-6)
    tail = 0.5 * (1.0 - confidence)
    freedom = float(dimension * runs)
    return float(chdtri(freedom, 1.0 - tail)) / runs, float(chdtri(freedom, tail)) / runs
