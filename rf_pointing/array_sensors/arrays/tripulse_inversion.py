"""From measured ratios to the direction: exact inversion of (9), polar angles (10).

Uniform aperture: eps_x = 4/(N_x kd_x) atan(R_x), valid for |eps_x| < lambda/(N_x d_x).  Any other known aperture
(taper, dead elements, quantised phases): Newton's method on atan R(eps), which is nearly straight.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams, centred_indices
from rf_pointing.array_sensors.arrays.tripulse_beams import beam_signals
from rf_pointing.core import require_finite

__all__ = ["direction_projections", "invert_ratios", "invert_with_weights", "polar_angles_rad", "ratio_and_slope"]

Array = NDArray[np.float64]

NEWTON_STEPS = 30
PROJECTION_TOLERANCE = 1e-13
SMALLEST_SLOPE = 1e-6


def invert_ratios(params: TripulseArrayParams, ratios: ArrayLike) -> Array:
    """Return the projection errors (..., 2) of a uniform aperture with these ratios (..., 2): (9) inverted."""
    r = np.asarray(ratios, dtype=np.float64)
    require_finite("ratios", r)
    return np.asarray(4.0 * np.arctan(r) / (params.kd * np.array([params.n_x, params.n_y])))


def invert_with_weights(
    params: TripulseArrayParams, weights: ArrayLike, steering: ArrayLike, ratios: ArrayLike
) -> Array:
    """Return the projection errors (..., 2) for an aperture whose weights (N_x, N_y) are known, steered to (2,).

    Raises
    ------
    ValueError : where Newton's method leaves the unambiguous region or does not converge.
    """
    target = np.arctan(np.asarray(ratios, dtype=np.float64))
    require_finite("ratios", target)
    limit = 1.5 * params.unambiguous_projection
    error = invert_ratios(params, ratios)
    for _ in range(NEWTON_STEPS):
        ratio, ratio_slope = ratio_and_slope(params, weights, np.asarray(steering, dtype=np.float64) + error)
        value, slope = np.arctan(ratio), ratio_slope / (1.0 + ratio[..., None] ** 2)
        if np.any(np.abs(np.linalg.det(slope)) < SMALLEST_SLOPE * np.prod(params.kd)):
            raise ValueError("the delta beams of this aperture do not respond to the direction: half of it is dead")
        step = np.linalg.solve(slope, (target - value)[..., None])[..., 0]
        error = error + step
        if np.any(np.abs(error) > limit):
            raise ValueError(f"ratios={ratios!r} lie outside the unambiguous region of this aperture")
        if np.max(np.abs(step), initial=0.0) < PROJECTION_TOLERANCE:
            return np.asarray(error)
    raise ValueError(f"ratios={ratios!r} have no solution after {NEWTON_STEPS} Newton steps")


def direction_projections(steering: ArrayLike, projection_error: ArrayLike) -> Array:
    """Return T = T_0 + eps, shape (..., 2), refused where it is longer than one (no such direction exists)."""
    t = np.asarray(steering, dtype=np.float64) + np.asarray(projection_error, dtype=np.float64)
    length = np.hypot(t[..., 0], t[..., 1])
    if np.any(~(length <= 1.0)):
        raise ValueError(f"projections have length {np.max(length)}, must be <= 1: not a direction")
    return np.asarray(t)


def polar_angles_rad(projections: ArrayLike) -> tuple[Array, Array]:
    """Return theta in [0, pi/2] and phi in (-pi, pi] of T (..., 2): (10), with the quadrant of phi kept.

    phi is 0 at theta = 0, where it has no meaning.
    """
    t = direction_projections(projections, 0.0)
    return np.arcsin(np.hypot(t[..., 0], t[..., 1])), np.arctan2(t[..., 1], t[..., 0])


def ratio_and_slope(params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike) -> tuple[Array, Array]:
    """Return the ratios (..., 2) of an aperture at `direction` (..., 2) and their derivative (..., 2, 2) by it."""
    w = np.asarray(weights, dtype=np.complex128)
    signals = beam_signals(params, w, direction)
    if np.any(signals[..., 0] == 0.0):
        raise ValueError("the sum beam of this aperture has a null in the direction sought")
    index_x, index_y = centred_indices(params.n_x)[:, None], centred_indices(params.n_y)[None, :]
    moments = [-1j * params.kd[0] * index_x * w, -1j * params.kd[1] * index_y * w]
    slopes = np.stack([beam_signals(params, moment, direction) for moment in moments], axis=-1)
    ratio = signals[..., 1:] / signals[..., :1]
    ratio_slope = (slopes[..., 1:, :] - ratio[..., None] * slopes[..., :1, :]) / signals[..., :1, None]
    return np.asarray(ratio.imag), np.asarray(ratio_slope.imag)
