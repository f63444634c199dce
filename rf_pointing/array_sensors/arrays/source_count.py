"""How many sources a covariance holds: the minimum description length of Wax and Kailath (1985).

MDL(k) = L (M - k) ln(arithmetic / geometric mean of the M - k smallest eigenvalues) + k (2 M - k) ln(L) / 2.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.covariance import eigen

__all__ = ["count_sources"]

ROUNDING = 1e-12  # of the largest eigenvalue


def count_sources(covariance: NDArray[np.complex128], snapshots: int) -> NDArray[np.intp]:
    """Return the number of sources (n,) in covariances (n, M, M), 0 to M - 1.

    Raises
    ------
    ValueError
        If there are fewer snapshots than elements: the smallest eigenvalues are then zero and say nothing.
    """
    elements = covariance.shape[-1]
    if snapshots < elements:
        raise ValueError(f"snapshots={snapshots} must be >= elements={elements} to count sources")
    values = eigen(covariance, elements).values
    # Without noise the smallest are rounding of either sign: their logarithms would decide the count.
    values = np.maximum(values, ROUNDING * values[..., :1])
    scores = []
    for sources in range(elements):
        rest = values[..., sources:]
        ratio = np.log(np.mean(rest, axis=-1)) - np.mean(np.log(rest), axis=-1)
        penalty = 0.5 * sources * (2 * elements - sources) * np.log(snapshots)
        scores.append(snapshots * (elements - sources) * ratio + penalty)
    return np.asarray(np.argmin(np.stack(scores, axis=-1), axis=-1), dtype=np.intp)
