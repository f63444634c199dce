"""Attitude from two stations by the bisector construction (TRIPULSE 5.2), and directions from their projections.

A = [A1 A2 A3], A1 the bisector of the two directions, A2 their normal, A3 = A1 x A2; likewise A' of the reference
directions; R = A A'^T.  Equal weights; the same rotation as `fit_rotation`, in closed form.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.wahba import SMALLEST_SEPARATION_RAD, separation_rad, unit_directions
from rf_pointing.core import cosine_slopes, require_finite

__all__ = ["bisector_rotation", "direction_covariances", "directions_from_projections"]

Array = NDArray[np.float64]

SMALLEST_HEIGHT = 1e-3
SMALLEST_EIGENVALUE = 1e-12  # of the largest: rounding leaves 1e-16 of an exact zero, of either sign
"""Of T_z: nearer to the plane of the array its error grows beyond every bound."""


def bisector_rotation(
    reference: ArrayLike, measured: ArrayLike, *, smallest_separation_rad: float = SMALLEST_SEPARATION_RAD
) -> Array:
    """Return R (..., 3, 3) with `measured` = R `reference` in the least-squares sense, unit vectors (..., 2, 3).

    Raises
    ------
    ValueError : if a set is not of two unit vectors, or the two stations lie along one line.
    """
    frames = []
    for name, directions in (("reference", reference), ("measured", measured)):
        t = unit_directions(name, directions)
        if t.shape[-2:] != (2, 3):
            raise ValueError(f"{name} has shape {t.shape}, must be (..., 2, 3)")
        found = float(np.min(separation_rad(t)))
        if found < smallest_separation_rad:
            raise ValueError(
                f"{name} directions are collinear: separation {found} rad must be >= {smallest_separation_rad} rad"
            )
        frames.append(_bisector_frame(t[..., 0, :], t[..., 1, :]))
    return np.asarray(frames[1] @ np.swapaxes(frames[0], -1, -2))


def directions_from_projections(projections: ArrayLike) -> Array:
    """Return unit vectors (..., 3) with T_z = sqrt(1 - T_x^2 - T_y^2) from projections (..., 2)."""
    t = np.asarray(projections, dtype=np.float64)
    if t.shape[-1:] != (2,):
        raise ValueError(f"projections has shape {t.shape}, must be (..., 2)")
    require_finite("projections", t)
    height2 = 1.0 - np.sum(t**2, axis=-1)
    if np.any(height2 < SMALLEST_HEIGHT**2):
        raise ValueError(f"projections={t} leave T_z below {SMALLEST_HEIGHT}: in or behind the plane of the array")
    return np.concatenate([t, np.sqrt(height2)[..., None]], axis=-1)


def direction_covariances(projections: ArrayLike, covariances: ArrayLike) -> Array:
    """Return the covariances (..., 3, 3) of the directions, to first order in those of the projections (..., 2, 2)."""
    t = directions_from_projections(projections)
    c = np.asarray(covariances, dtype=np.float64)
    if c.shape[-2:] != (2, 2):
        raise ValueError(f"covariances has shape {c.shape}, must be (..., 2, 2)")
    require_finite("covariances", c)
    values = np.linalg.eigvalsh(c)
    if np.any(values[..., 0] <= SMALLEST_EIGENVALUE * values[..., 1]):
        raise ValueError(f"covariances={c} must be positive definite: singular covariance")
    slopes = cosine_slopes(t)
    return np.asarray(slopes @ c @ np.swapaxes(slopes, -1, -2))


def _bisector_frame(first: Array, second: Array) -> Array:
    bisector, normal = first + second, np.cross(first, second)
    a1 = bisector / np.linalg.norm(bisector, axis=-1, keepdims=True)
    a2 = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([a1, a2, np.cross(a1, a2)], axis=-1)
