"""MUSIC for one source, batched: coarse search over the front half sphere, then Newton to the exact peak.

With one source the MUSIC spectrum (DOA eq. (11)) peaks where |v_1^H a| does, v_1 the principal eigenvector: this holds
for a single snapshot too, where the covariance has rank one.  The coarse lattice is spaced 0.5 / (k r) in the direction
cosines, a sixth of the main lobe's width, so the start lies in the lobe of the global maximum.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams, phase_radius_rad, steering
from rf_pointing.array_sensors.arrays.covariance import eigen
from rf_pointing.array_sensors.arrays.peak_refinement import Peaks, refine_peaks

__all__ = ["estimate_directions", "lattice", "principal_eigenvectors", "steered_lattice"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

CHUNK = 2048
"""Covariances handled together: the working set stays inside the processor's cache."""


def lattice(spacing: float) -> Array:
    """Return unit vectors (n, 3) of the front half sphere, on a square lattice of direction cosines."""
    line = np.arange(-np.floor(1.0 / spacing), np.floor(1.0 / spacing) + 1.0) * spacing
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    inside = u * u + v * v <= 1.0
    u, v = u[inside], v[inside]
    return np.stack([u, v, np.sqrt(np.maximum(0.0, 1.0 - u * u - v * v))], axis=-1)


@lru_cache(maxsize=8)
def steered_lattice(array: CircularArrayParams, spacing: float) -> tuple[Array, ComplexArray]:
    """Return `lattice` and its steering vectors (n, M), kept because every estimate needs the same."""
    points = lattice(spacing)
    manifold = steering(array, points)
    for kept in (points, manifold):
        kept.flags.writeable = False
    return points, manifold


def principal_eigenvectors(covariance: ComplexArray, elements: int) -> ComplexArray:
    """Return v_1 (n, M) of each checked covariance (n, M, M)."""
    return eigen(covariance, elements).vectors[..., 0]


def estimate_directions(
    array: CircularArrayParams, covariance: ComplexArray, response: ComplexArray | None = None
) -> Peaks:
    """Return the direction of the one source behind each covariance (n, M, M).

    Parameters
    ----------
    response : (M, M) calibrated coupling and gain matrix C of the real array; identity when None.

    Raises
    ------
    ValueError
        If a covariance is not finite, not Hermitian or without power (see `covariance.eigen`).
    """
    if covariance.ndim != 3:
        raise ValueError(f"covariance has shape {covariance.shape}, must be (n, elements, elements)")
    candidates, manifold = steered_lattice(array, 0.5 / phase_radius_rad(array))
    if response is not None:
        manifold = manifold @ response.T
        manifold = manifold / np.linalg.norm(manifold, axis=-1, keepdims=True)
    parts = [
        _estimate(array, covariance[start : start + CHUNK], candidates, manifold, response)
        for start in range(0, len(covariance), CHUNK)
    ]
    return Peaks(
        np.concatenate([part.direction for part in parts]),
        np.concatenate([part.fraction for part in parts]),
        np.concatenate([part.converged for part in parts]),
    )


def _estimate(
    array: CircularArrayParams,
    covariance: ComplexArray,
    candidates: Array,
    manifold: ComplexArray,
    response: ComplexArray | None,
) -> Peaks:
    principal = principal_eigenvectors(covariance, array.elements)
    spectrum = principal.conj() @ manifold.T
    start = candidates[np.argmax(spectrum.real**2 + spectrum.imag**2, axis=-1)]
    return refine_peaks(array, principal[:, :, None], start, response)
