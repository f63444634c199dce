"""Sum and difference beams of Tripulse, their ratios, and the direction from the ratios.

Sigma = Q1+Q2+Q3+Q4, Delta_x = Q1-Q2-Q3+Q4, Delta_y = Q1+Q2-Q3-Q4 with
Q_i = sum w exp(-j c(m) kd_x T_x - j c(n) kd_y T_y) over quadrant i (TRIPULSE (1), (6), (7)); in
closed form for a uniform aperture (8); ratios (9).  The last axis of every beam array is Sigma,
Delta_x, Delta_y.

Inverse: a uniform aperture has eps_x = 4/(N_x kd_x) atan(R_x), valid for |eps_x| < lambda/(N_x
d_x).  Any other known aperture (taper, dead elements, quantised phases) takes Newton's method on
atan R(eps), which is nearly straight.  Polar angles: (10).

The paper's phases belong to fields that vary as exp(-j w t).  A receiver that counts exp(+j w t),
as engineers do, measures the complex conjugates, and the ratio changes sign: `monopulse_ratios`
takes the convention as an argument.
"""

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.tripulse.array import (
    TripulseArrayParams,
    centred_indices,
    element_weights,
)
from rf_pointing.core import require_choice, require_finite
from rf_pointing.core.types import Array, ComplexArray

TIME_CONVENTIONS = ("exp(-jwt)", "exp(+jwt)")
# A few steps are typical; thirty means that the ratios belong to no direction of this aperture.
NEWTON_STEPS = 30
PROJECTION_TOLERANCE = 1e-13
# Least slope as a share of a healthy aperture's: the delta beams of one half dead do not move with
# direction.
SMALLEST_SLOPE = 1e-6


def beam_signs(params: TripulseArrayParams) -> Array:
    """Return the sign of every element in the three beams, shape (3, N_x, N_y)."""
    x_sign = np.where(centred_indices(params.n_x) < 0.0, 1.0, -1.0)
    y_sign = np.where(centred_indices(params.n_y) < 0.0, 1.0, -1.0)
    ones_x, ones_y = np.ones(params.n_x), np.ones(params.n_y)
    return np.stack([np.outer(ones_x, ones_y), np.outer(x_sign, ones_y), np.outer(ones_x, y_sign)])


def quadrant_signals(
    params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike
) -> ComplexArray:
    """Return the signals of quadrants 1-4, eq. (6), shape (..., 4), towards the projections
    `direction` (..., 2).
    """
    field = _element_fields(params, weights, direction)
    low_x, high_x = slice(None, params.n_x // 2), slice(params.n_x // 2, None)
    low_y, high_y = slice(None, params.n_y // 2), slice(params.n_y // 2, None)
    quadrants = ((low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y))
    return np.stack([np.sum(field[..., qx, qy], axis=(-2, -1)) for qx, qy in quadrants], axis=-1)


def beam_signals(
    params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike
) -> ComplexArray:
    """Return Sigma, Delta_x, Delta_y, eq. (7), shape (..., 3), for any element weights (..., N_x,
    N_y).
    """
    # Rows are the signs of the quadrants in Sigma, Delta_x, Delta_y.
    combine = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    return np.asarray(quadrant_signals(params, weights, direction) @ combine.T)


def closed_form_signals(params: TripulseArrayParams, projection_error: ArrayLike) -> ComplexArray:
    """Return Sigma, Delta_x, Delta_y of the uniform, exact array, eq. (8) with K = 1, shape (...,
    3).

    `projection_error` (..., 2) is T - T_0; the limits at X = 0 and Y = 0 are taken.
    """
    phase = np.asarray(projection_error, dtype=np.float64) * params.kd
    require_finite("projection_error", phase)
    even_x, odd_x = _even_and_odd(phase[..., 0], params.n_x)
    even_y, odd_y = _even_and_odd(phase[..., 1], params.n_y)
    return np.stack([even_x * even_y + 0j, 2j * odd_x * even_y, 2j * even_x * odd_y], axis=-1)


def monopulse_ratios(signals: ArrayLike, time_convention: str = "exp(-jwt)") -> Array:
    """Return R_x = Im(Delta_x / Sigma) and R_y, eq. (9), shape (..., 2), from beam signals (...,
    3).

    Raises
    ------
    ValueError : where the sum signal is zero or a signal is not finite.
    """
    require_choice("time_convention", time_convention, TIME_CONVENTIONS)
    s = np.asarray(signals, dtype=np.complex128)
    require_finite("signals", s)
    if np.any(s[..., 0] == 0.0):
        raise ValueError("sum signal is 0: the ratios are not defined")
    # Delta and Sigma are 90 deg apart: the real part is noise and phase error.
    ratio = np.imag(s[..., 1:] / s[..., :1])
    return np.asarray(ratio if time_convention == "exp(-jwt)" else -ratio)


def _element_fields(
    params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike
) -> ComplexArray:
    t = np.asarray(direction, dtype=np.float64)
    require_finite("direction", t)
    along_x = np.exp(-1j * params.kd[0] * t[..., 0, None] * centred_indices(params.n_x))
    along_y = np.exp(-1j * params.kd[1] * t[..., 1, None] * centred_indices(params.n_y))
    return np.asarray(np.asarray(weights) * along_x[..., :, None] * along_y[..., None, :])


def _even_and_odd(phase: Array, count: int) -> tuple[Array, Array]:
    """Return sin(N X/2)/sin(X/2) and sin^2(N X/4)/sin(X/2), with their limits where sin(X/2)
    vanishes.
    """
    half = phase / 2.0
    # X and X - 2 pi give the same field but for the sign of exp(-j c 2 pi) with half-integer c.
    turns = np.round(half / np.pi)
    sign = np.where(turns % 2.0 == 0.0, 1.0, -1.0)
    rest = half - turns * np.pi
    safe = np.where(rest == 0.0, 1.0, np.sin(rest))
    even = np.where(rest == 0.0, float(count), np.sin(count * rest) / safe)
    odd = np.sin(count * rest / 2.0) ** 2 / safe
    return sign * even, sign * odd


def invert_ratios(params: TripulseArrayParams, ratios: ArrayLike) -> Array:
    """Return the projection errors (..., 2) of a uniform aperture with these ratios (..., 2).

    (9) inverted.
    """
    r = np.asarray(ratios, dtype=np.float64)
    require_finite("ratios", r)
    return np.asarray(4.0 * np.arctan(r) / (params.kd * np.array([params.n_x, params.n_y])))


def invert_with_weights(
    params: TripulseArrayParams, weights: ArrayLike, steering: ArrayLike, ratios: ArrayLike
) -> Array:
    """Return the projection errors (..., 2) for an aperture whose weights (N_x, N_y) are known,
    steered to (2,).

    Raises
    ------
    ValueError : where Newton's method leaves the unambiguous region or does not converge.
    """
    target = np.arctan(np.asarray(ratios, dtype=np.float64))
    require_finite("ratios", target)
    # Beyond lambda/(N d) the ratio repeats: a step that leaves the region would converge a lobe
    # away.
    limit = 1.5 * params.unambiguous_projection
    # The uniform aperture is the start: taper and dead elements change the slope, not the sign.
    error = invert_ratios(params, ratios)
    for _ in range(NEWTON_STEPS):
        ratio, ratio_slope = ratio_and_slope(
            params, weights, np.asarray(steering, dtype=np.float64) + error
        )
        # atan of the ratio is nearly linear in the direction, the ratio itself has a pole.
        value, slope = np.arctan(ratio), ratio_slope / (1.0 + ratio[..., None] ** 2)
        if np.any(np.abs(np.linalg.det(slope)) < SMALLEST_SLOPE * np.prod(params.kd)):
            raise ValueError(
                "the delta beams of this aperture do not respond to the direction: half of it is dead"
            )
        step = np.linalg.solve(slope, (target - value)[..., None])[..., 0]
        error = error + step
        if np.any(np.abs(error) > limit):
            raise ValueError(
                f"ratios={ratios!r} lie outside the unambiguous region of this aperture"
            )
        if np.max(np.abs(step), initial=0.0) < PROJECTION_TOLERANCE:
            return np.asarray(error)
    raise ValueError(f"ratios={ratios!r} have no solution after {NEWTON_STEPS} Newton steps")


def direction_projections(steering: ArrayLike, projection_error: ArrayLike) -> Array:
    """Return T = T_0 + eps, shape (..., 2), refused where it is longer than one (no such direction
    exists).
    """
    t = np.asarray(steering, dtype=np.float64) + np.asarray(projection_error, dtype=np.float64)
    length = np.hypot(t[..., 0], t[..., 1])
    # Negated so that NaN is rejected too.
    if np.any(~(length <= 1.0)):
        raise ValueError(f"projections have length {np.max(length)}, must be <= 1: not a direction")
    return np.asarray(t)


def polar_angles_rad(projections: ArrayLike) -> tuple[Array, Array]:
    """Return theta in [0, pi/2] and phi in (-pi, pi] of T (..., 2): (10), with the quadrant of phi
    kept.

    phi is 0 at theta = 0, where it has no meaning.
    """
    t = direction_projections(projections, 0.0)
    return np.arcsin(np.hypot(t[..., 0], t[..., 1])), np.arctan2(t[..., 1], t[..., 0])


def ratio_and_slope(
    params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike
) -> tuple[Array, Array]:
    """Return the ratios (..., 2) of an aperture at `direction` (..., 2) and their derivative (...,
    2, 2) by it.
    """
    w = np.asarray(weights, dtype=np.complex128)
    signals = beam_signals(params, w, direction)
    if np.any(signals[..., 0] == 0.0):
        raise ValueError("the sum beam of this aperture has a null in the direction sought")
    index_x, index_y = centred_indices(params.n_x)[:, None], centred_indices(params.n_y)[None, :]
    moments = [-1j * params.kd[0] * index_x * w, -1j * params.kd[1] * index_y * w]
    slopes = np.stack([beam_signals(params, moment, direction) for moment in moments], axis=-1)
    ratio = signals[..., 1:] / signals[..., :1]
    ratio_slope = (slopes[..., 1:, :] - ratio[..., None] * slopes[..., :1, :]) / signals[
        ..., :1, None
    ]
    return np.asarray(ratio.imag), np.asarray(ratio_slope.imag)


def shared_projection_sigma(params: TripulseArrayParams, quadrant_rad: float) -> Array:
    """Return the error (2,) of each projection if the phases of the quadrants are off by
    `quadrant_rad` rms: 2 p/(N k d) of a uniform aperture.

    A taper takes from the slope of the ratios, and makes it larger: 1.21 times at an edge of 0.4.
    """
    weights = element_weights(params, [0.0, 0.0])
    quadrants = quadrant_signals(params, weights, [0.0, 0.0]).real
    share = quadrants / np.sum(quadrants)
    signs = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    moved = (signs - (signs @ share)[:, np.newaxis]) * share
    _, slope = ratio_and_slope(params, weights, [0.0, 0.0])
    return np.asarray(quadrant_rad * np.linalg.norm(np.linalg.solve(slope, moved), axis=1))
