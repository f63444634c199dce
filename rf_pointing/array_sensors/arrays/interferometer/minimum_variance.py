"""Minimum-variance linear estimation of a linearised system.

dz = B dy with B = H G^T L^-1 and H = (G^T L^-1 G)^-1 (PI83 eqs. 4-2 to 4-8); G gradient, L measurement covariance.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["minimum_variance_step"]

Array = NDArray[np.float64]
_SMALLEST_EIGENVALUE = 1e-12  # of a matrix scaled to a unit diagonal; rounding leaves 1e-15 of an exact zero


def minimum_variance_step(
    gradient: ArrayLike, innovation: ArrayLike, covariance: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Return the increment dz (..., n) and its covariance H (..., n, n).

    Parameters: `gradient` G (..., m, n), `innovation` dy (..., m), `covariance` L (..., m, m) or None for the unit
    matrix (then H is per unit variance, as in the listing).  Raises ValueError if L is singular or the measurements do
    not determine all n parameters.
    """
    g = np.asarray(gradient, dtype=np.float64)
    weighted = g if covariance is None else _weighted(g, np.asarray(covariance, dtype=np.float64))
    information = np.swapaxes(g, -1, -2) @ weighted
    scale = np.sqrt(np.einsum("...kk->...k", information))
    if np.any(scale == 0.0) or not np.all(np.isfinite(scale)):
        raise ValueError("gradient has a zero or undefined column: a parameter is not determined")
    scaled = information / (scale[..., :, None] * scale[..., None, :])
    if np.any(np.linalg.eigvalsh(scaled)[..., 0] < _SMALLEST_EIGENVALUE):
        raise ValueError("gradient is rank deficient: the measurements do not determine all parameters")
    h = np.linalg.inv(scaled) / (scale[..., :, None] * scale[..., None, :])
    projected = np.einsum("...mn,...m->...n", weighted, np.asarray(innovation, dtype=np.float64))
    return np.einsum("...ij,...j->...i", h, projected), h


def _weighted(gradient: Array, covariance: Array) -> Array:
    if not _is_positive_definite(covariance):
        raise ValueError("covariance is singular or not positive definite: a measurement is certain or NaN")
    return np.asarray(np.linalg.solve(covariance, gradient))


def _is_positive_definite(covariance: Array) -> bool:
    # Not by Cholesky: whether it succeeds on a singular matrix is up to the last bits.
    variance = np.einsum("...kk->...k", covariance)
    if not (np.all(np.isfinite(covariance)) and np.all(variance > 0.0)):
        return False
    sigma = np.sqrt(variance)
    least = np.linalg.eigvalsh(covariance / (sigma[..., :, None] * sigma[..., None, :]))[..., 0]
    return bool(np.all(least > _SMALLEST_EIGENVALUE))
