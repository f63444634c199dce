"""Spatial covariance of an array, its eigenvectors (DOA eqs. (9), (10)) and the number of sources.

R = 1/L sum_l x_l x_l^H.  A covariance that is empty, not finite, not Hermitian or without power is
rejected here, once, so that the estimators need not check again.

Number of sources k: the minimum description length of Wax and Kailath (1985),

    MDL(k) = L (M - k) ln(arithmetic / geometric mean of the M - k smallest eigenvalues)
             + k (2 M - k) ln(L) / 2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array, ComplexArray

ROUNDING = 1e-12  # of the largest eigenvalue


@dataclass(frozen=True, slots=True)
class Eigen:
    """Eigenvalues descending (..., M) and the matching eigenvectors as columns (..., M, M)."""

    values: Array
    vectors: ComplexArray


def sample_covariance(snapshots: ComplexArray, sources: int = 1) -> ComplexArray:
    """Return R (..., M, M) of `snapshots` (..., M, L).

    Raises
    ------
    ValueError
        If there are fewer snapshots than sources (the signal subspace cannot be filled) or a
        sample is not finite.
    """
    if snapshots.ndim < 2:
        raise ValueError(
            f"snapshots has shape {snapshots.shape}, must be (..., elements, snapshots)"
        )
    count = snapshots.shape[-1]
    if count < max(sources, 1):
        raise ValueError(f"snapshots={count} must be >= sources={sources}")
    if not np.all(np.isfinite(snapshots)):
        raise ValueError("snapshots contain values that are not finite")
    return np.asarray(snapshots @ snapshots.conj().swapaxes(-1, -2) / count, dtype=np.complex128)


def eigen(covariance: ComplexArray, elements: int, sources: int = 1) -> Eigen:
    """Return the checked eigen decomposition of `covariance` (..., M, M), largest eigenvalue first.

    Raises
    ------
    ValueError
        Wrong shape, values that are not finite, not Hermitian, or rank below `sources`.
    """
    if covariance.ndim < 2 or covariance.shape[-2:] != (elements, elements):
        raise ValueError(
            f"covariance has shape {covariance.shape}, must be (..., {elements}, {elements})"
        )
    if not 1 <= sources < elements:
        raise ValueError(f"sources={sources} must be >= 1 and < elements={elements}")
    if not np.all(np.isfinite(covariance)):
        raise ValueError("covariance contains values that are not finite")
    scale = np.abs(covariance).max(axis=(-1, -2), keepdims=True)
    # Relative to the largest element: a covariance is symmetric to rounding, and eigh reads one
    # triangle only.
    if np.any(np.abs(covariance - covariance.conj().swapaxes(-1, -2)) > 1e-9 * scale):
        raise ValueError("covariance is not Hermitian")
    values, vectors = np.linalg.eigh(covariance)
    values, vectors = values[..., ::-1], vectors[..., ::-1]
    # Below this the signal subspace is filled by rounding, and MUSIC points anywhere.
    if np.any(values[..., sources - 1] <= 1e-12 * np.maximum(values[..., 0], 1e-300)):
        raise ValueError(
            f"covariance has rank below sources={sources}: no power, or too few independent snapshots"
        )
    return Eigen(values, vectors)


def count_sources(covariance: NDArray[np.complex128], snapshots: int) -> NDArray[np.intp]:
    """Return the number of sources (n,) in covariances (n, M, M), 0 to M - 1.

    Raises
    ------
    ValueError
        If there are fewer snapshots than elements: the smallest eigenvalues are then zero
        and say nothing.
    """
    elements = covariance.shape[-1]
    if snapshots < elements:
        raise ValueError(f"snapshots={snapshots} must be >= elements={elements} to count sources")
    values = eigen(covariance, elements).values
    # Without noise the smallest are rounding of either sign: their logarithms would decide the
    # count.
    values = np.maximum(values, ROUNDING * values[..., :1])
    scores = []
    for sources in range(elements):
        rest = values[..., sources:]
        # Arithmetic over geometric mean: one for equal eigenvalues, which is what noise alone would
        # give.
        ratio = np.log(np.mean(rest, axis=-1)) - np.mean(np.log(rest), axis=-1)
        penalty = 0.5 * sources * (2 * elements - sources) * np.log(snapshots)
        scores.append(snapshots * (elements - sources) * ratio + penalty)
    return np.asarray(np.argmin(np.stack(scores, axis=-1), axis=-1), dtype=np.intp)
