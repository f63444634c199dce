"""Attitude from directions: the rotation R that minimises sum_l w_l |t_l - R t'_l|^2.

t'_l are unit vectors in the reference frame, t_l the same directions measured in the body (array)
frame, t = R t'.  Source: TRIPULSE, eqs. (24)-(33) (Arun's SVD solution), with the weights kept
inside H, which the paper's H leaves out.  Covariances belong to the rotation vector d of
R_hat = (I + [d x]) R, in the body frame.  All functions accept leading batch axes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.rotations import cross_matrix
from rf_pointing.core import require_finite
from rf_pointing.core.types import Array

# Larger than the rounding of a float32 sensor, smaller than any beam error that matters.
DIRECTION_TOLERANCE = 1e-6
SMALLEST_SEPARATION_RAD = 1e-6
"""Below this spread of the directions the rotation about them is lost in double precision."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WahbaFit:
    """Result of `fit_rotation`: t = rotation t'; batch axes lead every shape.

    rotation (3, 3); residuals (L, 3) = t - R t'; cost = sum w |residual|^2; singular_values (3,) of
    H; reflected: whether the plain SVD solution was a reflection and its third axis was turned
    over.
    """

    rotation: Array
    residuals: Array
    cost: Array
    singular_values: Array
    reflected: NDArray[np.bool_]


def fit_rotation(
    reference: ArrayLike,
    measured: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    smallest_separation_rad: float = SMALLEST_SEPARATION_RAD,
) -> WahbaFit:
    """Return the weighted least-squares rotation with `measured` = R `reference` (TRIPULSE (25),
    SVD method).

    Parameters
    ----------
    reference, measured : unit vectors, shape (..., L, 3), L >= 2
    weights : positive, shape (L,) or (..., L); equal when None
    smallest_separation_rad : refuse directions that lie closer together (see `separation_rad`)

    Raises
    ------
    ValueError : fewer than two directions, a vector that is not unit, a weight that is not
        positive, directions along one line (the turn about it is unobservable), or a mirrored set
        whose best rotation is not unique.
    """
    t_reference, t_measured = (
        unit_directions("reference", reference),
        unit_directions("measured", measured),
    )
    t_reference, t_measured = np.broadcast_arrays(t_reference, t_measured)
    w = _weights(weights, t_measured)
    for name, directions in (("reference", t_reference), ("measured", t_measured)):
        _require_separated(name, directions, w, smallest_separation_rad)
    # H = sum w t' t^T and R = V U^T: the transposed H would give R^T.
    h = np.einsum("...l,...li,...lj->...ij", w, t_reference, t_measured)
    u, singular_values, vt = np.linalg.svd(h)
    # The plain SVD solution may be a reflection; turning its last axis over gives the best proper
    # rotation.
    turn = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    # Equal singular values with opposite sign leave a whole circle of equally good rotations.
    gap = singular_values[..., 1] + turn * singular_values[..., 2]
    # Rounding makes 1e-16 of a gap of zero; directions 1e-6 rad apart, the least allowed, leave
    # 2.5e-13.
    if np.any(gap <= 1e-14 * singular_values[..., 0]):
        raise ValueError(
            "measured directions mirror the reference directions: the best rotation is not unique"
        )
    v = (
        np.swapaxes(vt, -1, -2)
        * np.stack([np.ones_like(turn), np.ones_like(turn), turn], axis=-1)[..., None, :]
    )
    rotation = v @ np.swapaxes(u, -1, -2)
    residuals = t_measured - np.einsum("...ij,...lj->...li", rotation, t_reference)
    cost = np.sum(w * np.sum(residuals**2, axis=-1), axis=-1)
    return WahbaFit(
        rotation=rotation,
        residuals=residuals,
        cost=cost,
        singular_values=singular_values,
        reflected=turn < 0.0,
    )


def separation_rad(directions: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Return how far apart the directions (..., L, 3) lie as axes.

    For two of equal weight, the angle between them.  2 asin sqrt(lambda), lambda the smallest
    eigenvalue of sum w (I - t t^T) / sum w, eq. (30); opposite directions are one axis, and count
    as separated by nothing.
    """
    t = unit_directions("directions", directions)
    w = _weights(weights, t)
    scaled = t * np.sqrt(w / np.sum(w, axis=-1, keepdims=True))[..., None]
    # Singular values of t itself: forming sum t t^T first would lose directions closer than 1e-8
    # rad to rounding.
    spread = np.linalg.svd(scaled, compute_uv=False)[..., 1:]
    # At most 2/3: the largest of three that sum up to one is left out.
    return np.asarray(2.0 * np.arcsin(np.sqrt(np.sum(spread**2, axis=-1))))


def attitude_covariance(
    directions: ArrayLike, direction_covariances: ArrayLike, weights: ArrayLike | None = None
) -> Array:
    """Return the covariance (..., 3, 3) of the rotation error, in the body frame, rad^2: eq. (31).

    Parameters
    ----------
    directions : true or measured unit vectors in the body frame, shape (..., L, 3)
    direction_covariances : covariance of each direction's error, shape (..., L, 3, 3), independent
        between directions
    weights : those given to `fit_rotation`
    """
    t = unit_directions("directions", directions)
    covariances = np.asarray(direction_covariances, dtype=np.float64)
    if covariances.shape[-3:] != (t.shape[-2], 3, 3):
        raise ValueError(
            f"direction_covariances has shape {covariances.shape}, must be (..., {t.shape[-2]}, 3, 3)"
        )
    require_finite("direction_covariances", covariances)
    w = _weights(weights, t)
    _require_separated("directions", t, w, SMALLEST_SEPARATION_RAD)
    # Normal matrix of the rotation error: a direction says nothing about the turn about itself,
    # hence I - t t^T.
    normal = np.einsum("...l,...lij->...ij", w, np.eye(3) - t[..., :, None] * t[..., None, :])
    cross = cross_matrix(t)
    middle = np.einsum("...l,...lij,...ljk,...lmk->...im", w**2, cross, covariances, cross)
    # Symmetric, as its inverse.
    inverse = np.linalg.inv(normal)
    return np.asarray(inverse @ middle @ inverse)


def unit_directions(name: str, value: ArrayLike) -> Array:
    """Return unit vectors (..., 3) with their rounding removed.

    Refuse any that is not of unit length.
    """
    t = np.asarray(value, dtype=np.float64)
    if t.shape[-1:] != (3,):
        raise ValueError(f"{name} has shape {t.shape}, must be (..., 3)")
    require_finite(name, t)
    norm = np.linalg.norm(t, axis=-1, keepdims=True)
    worst = float(np.max(np.abs(norm - 1.0), initial=0.0))
    if worst > DIRECTION_TOLERANCE:
        raise ValueError(
            f"{name} differs from unit length by {worst!r}, must be <= {DIRECTION_TOLERANCE}"
        )
    return np.asarray(t / norm)


def _weights(weights: ArrayLike | None, directions: Array) -> Array:
    count = directions.shape[-2] if directions.ndim >= 2 else 1
    if count < 2:
        raise ValueError(
            f"{count} direction given, must be at least 2: the turn about one is unobservable"
        )
    w = np.ones(count) if weights is None else np.asarray(weights, dtype=np.float64)
    if w.shape[-1:] != (count,):
        raise ValueError(f"weights has shape {w.shape}, must be (..., {count})")
    require_finite("weights", w)
    if np.any(w <= 0.0):
        raise ValueError(f"weights={w} must be > 0")
    return np.broadcast_to(w, directions.shape[:-1])


def _require_separated(name: str, directions: Array, weights: Array, smallest_rad: float) -> None:
    found = float(np.min(separation_rad(directions, weights)))
    if found < smallest_rad:
        raise ValueError(
            f"{name} directions are collinear: separation {found} rad must be >= {smallest_rad} rad, "
            "the turn about them is unobservable"
        )
