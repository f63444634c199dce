"""Which observations count, and how much: 3-sigma editing and Huber weights.

Residuals are measured against their own robust spread (1.48 times the median deviation) where that exceeds the
stated sigma, so that an orbit error common to a whole pass does not throw the pass away.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["huber_weights", "normalised_size", "within_limit"]

Array = NDArray[np.float64]

_MEDIAN_TO_SIGMA = 1.4826


def normalised_size(residuals: tuple[Array, Array], sigmas: tuple[Array, Array], used: NDArray[np.bool_]) -> Array:
    """Return the larger of the azimuth and elevation residuals (n,) in units of their spread among `used` rows."""
    sizes = []
    for residual, sigma in zip(residuals, sigmas, strict=True):
        size = np.abs(residual) / sigma
        sizes.append(size / max(1.0, _MEDIAN_TO_SIGMA * float(np.median(size[used]))))
    return np.maximum(*sizes)


def within_limit(size: Array, limit: float, used: NDArray[np.bool_], *, may_return: bool) -> NDArray[np.bool_]:
    """Return the rows that count next; limit 0 keeps all, `may_return` lets rejected rows come back."""
    if limit == 0.0:
        return used
    keep = size <= limit
    return keep if may_return else keep & used


def huber_weights(size: Array, limit: float) -> Array:
    """Return weights (n,) that make residuals beyond `limit` count linearly; limit 0: all one."""
    return np.ones_like(size) if limit == 0.0 else np.minimum(1.0, limit / np.maximum(size, limit))
