"""MUSIC for one source, batched: coarse search, then Newton's method to the exact peak.

Signal fraction g(s) = |V^H C a(s)|^2 / |C a(s)|^2, V the signal eigenvectors: DOA eq. (11) is
1 / (|C a|^2 (1 - g)), so its peaks are the maxima of g.  With one source V is the principal
eigenvector; this holds for a single snapshot too, where the covariance has rank one.

log g has closed derivatives in the direction cosines (u, v); on the sphere the gradient is E^T d
and the Hessian E^T H E - (s . d) I with E an orthonormal tangent basis.  Neither theta = 0 nor the
array plane (where the spectrum mirrors itself) is a special place, and no step needs a search grid.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.rotations import tangent_rows
from rf_pointing.array_sensors.doa.array import (
    CircularArrayParams,
    phase_radius_rad,
    steering,
    steering_taylor,
)
from rf_pointing.array_sensors.doa.covariance import eigen
from rf_pointing.core.types import Array, ComplexArray

# Far below the bound of any practical SNR; quadratic convergence makes the last digits cheap.
STEP_TOLERANCE_RAD = 1e-8
MAX_ITERATIONS = 25
# Covariances handled together: the working set stays inside the processor's cache.
CHUNK = 2048
"""Covariances handled together: the working set stays inside the processor's cache."""


@dataclass(frozen=True, slots=True)
class Peaks:
    """Refined directions (n, 3), signal fraction there (n,), and whether Newton's method converged
    (n,).
    """

    direction: Array
    fraction: Array
    converged: NDArray[np.bool_]


def refine_peaks(
    array: CircularArrayParams,
    signal: ComplexArray,
    start: Array,
    response: ComplexArray | None = None,
) -> Peaks:
    """Return the maxima of g reached from `start` (n, 3).

    A start that does not converge is flagged.

    Parameters
    ----------
    signal : (n, M, K) signal eigenvectors of each covariance.
    response : (n, M) coupling and gain matrix C of the n elements in use; identity when None.
    """
    taylor = steering_taylor(array)
    numerator = signal.conj().swapaxes(-1, -2)
    if response is not None:
        # C enters as V^H C, once, so that the steering derivatives stay those of the ideal array.
        numerator = numerator @ response
    direction = np.array(start, dtype=np.float64)
    value = np.zeros(len(direction))
    active = np.arange(len(direction))
    for _ in range(MAX_ITERATIONS):
        here = direction[active]
        fraction, gradient, hessian = _log_fraction(
            array, taylor, numerator[active], here, response
        )
        value[active] = fraction
        direction[active], length = _newton_step(
            here, gradient, hessian, 0.5 / phase_radius_rad(array)
        )
        # Only the starts that still move are computed again: most converge in a few steps.
        active = active[length > STEP_TOLERANCE_RAD]
        if not len(active):
            break
    converged = np.ones(len(direction), dtype=np.bool_)
    converged[active] = False
    return Peaks(direction, value, converged)


def _log_fraction(
    array: CircularArrayParams,
    taylor: ComplexArray,
    numerator: ComplexArray,
    direction: Array,
    response: ComplexArray | None,
) -> tuple[Array, Array, Array]:
    phase = (2.0j * np.pi / array.wavelength_m) * direction[:, :2]
    places = taylor[:, 1:3].imag.T * (array.wavelength_m / (2.0 * np.pi))
    manifold = np.exp(phase @ places)
    power, slope, curve = _log_derivatives(numerator * manifold[:, None, :] @ taylor)
    if response is None:
        return power / array.elements, slope, curve
    below = _log_derivatives(response * manifold[:, None, :] @ taylor)
    return power / below[0], slope - below[1], curve - below[2]


def _log_derivatives(y: ComplexArray) -> tuple[Array, Array, Array]:
    """Return p = sum |y_0|^2 and the gradient (n, 2) and Hessian (n, 2, 2) of log p from Taylor
    columns y (n, K, 6).
    """
    # A direction orthogonal to the signal has no logarithm of power; the floor keeps its gradient
    # finite.
    power = np.maximum(np.sum(np.abs(y[..., 0]) ** 2, axis=-1), 1e-300)
    base = y[..., :1].conj()
    slope = 2.0 * np.sum(base * y[..., 1:3], axis=1).real / power[:, None]
    second = np.sum(base * y[..., 3:6], axis=1)
    uu, uv, vv = (
        second + np.stack([_inner(y, 1, 1), _inner(y, 1, 2), _inner(y, 2, 2)], axis=-1)
    ).real.T
    curve = (
        2.0 * np.stack([np.stack([uu, uv], -1), np.stack([uv, vv], -1)], -2) / power[:, None, None]
    )
    return power, slope, curve - slope[:, :, None] * slope[:, None, :]


def _inner(y: ComplexArray, i: int, j: int) -> ComplexArray:
    return np.asarray(np.sum(y[..., i].conj() * y[..., j], axis=1))


def _newton_step(
    direction: Array, gradient: Array, hessian: Array, limit: float
) -> tuple[Array, Array]:
    """Return the new direction (reflected to the front) and the length of the step taken."""
    basis = tangent_rows(direction)
    slope = np.einsum("nij,nj->ni", basis[:, :, :2], gradient)
    radial = np.sum(direction[:, :2] * gradient, axis=-1)
    curve = basis[:, :, :2] @ hessian @ basis[:, :, :2].swapaxes(-1, -2)
    step = _climb(
        curve[:, 0, 0] - radial, curve[:, 0, 1], curve[:, 1, 1] - radial, slope, 1e-6 / limit**2
    )
    length = np.hypot(step[:, 0], step[:, 1])
    # At most 0.5 / (k r): a longer step may leave the main lobe for a sidelobe.
    step *= np.minimum(1.0, limit / np.maximum(length, 1e-300))[:, None]
    moved = direction + np.einsum("ni,nij->nj", step, basis)
    # A planar array sees the same phases from behind; the front image is the physical one.
    moved[:, 2] = np.abs(moved[:, 2])
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True), np.minimum(length, limit)


def _climb(a: Array, b: Array, c: Array, slope: Array, floor: float) -> Array:
    """Return the Newton step of the Hessian [[a, b], [b, c]], turned uphill where the surface is a
    saddle or valley.
    """
    # Eigenvalues in closed form: taking their size makes every step uphill, also on saddles.
    turn = 0.5 * np.arctan2(2.0 * b, a - c)
    cosine, sine = np.cos(turn), np.sin(turn)
    middle, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    first = (cosine * slope[:, 0] + sine * slope[:, 1]) / np.maximum(np.abs(middle + half), floor)
    second = (cosine * slope[:, 1] - sine * slope[:, 0]) / np.maximum(np.abs(middle - half), floor)
    return np.stack([cosine * first - sine * second, sine * first + cosine * second], axis=-1)


def lattice(spacing: float) -> Array:
    """Return unit vectors (n, 3) of the front half sphere, on a square lattice of direction
    cosines.
    """
    line = np.arange(-np.floor(1.0 / spacing), np.floor(1.0 / spacing) + 1.0) * spacing
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    inside = u * u + v * v <= 1.0
    u, v = u[inside], v[inside]
    return np.stack([u, v, np.sqrt(np.maximum(0.0, 1.0 - u * u - v * v))], axis=-1)


@lru_cache(maxsize=8)
def steered_lattice(array: CircularArrayParams, spacing: float) -> tuple[Array, ComplexArray]:
    """Return `lattice` and its steering vectors (n, M), kept for the next estimates."""
    points = lattice(spacing)
    manifold = steering(array, points)
    # The cache hands the same arrays to every caller; a write would change later estimates.
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
    response : (n, M) calibrated coupling and gain matrix C of the n elements in use; identity when
        None.

    Raises
    ------
    ValueError
        If a covariance is not finite, not Hermitian or without power (see `covariance.eigen`).
    """
    if covariance.ndim != 3:
        raise ValueError(
            f"covariance has shape {covariance.shape}, must be (n, elements, elements)"
        )
    # Spacing 0.5 / (k r) in the direction cosines is a sixth of the main lobe's width: the start
    # lies in the lobe of the global maximum.
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
    principal = principal_eigenvectors(
        covariance, array.elements if response is None else len(response)
    )
    spectrum = principal.conj() @ manifold.T
    # |v_1^H a|^2 orders the lattice as the MUSIC spectrum does when there is one source.
    start = candidates[np.argmax(spectrum.real**2 + spectrum.imag**2, axis=-1)]
    return refine_peaks(array, principal[:, :, None], start, response)
