"""Sum and difference beams of Tripulse and their ratios; the last axis of every beam array is Sigma, Delta_x, Delta_y.

Sigma = Q1+Q2+Q3+Q4, Delta_x = Q1-Q2-Q3+Q4, Delta_y = Q1+Q2-Q3-Q4 with
Q_i = sum w exp(-j c(m) kd_x T_x - j c(n) kd_y T_y) over quadrant i (TRIPULSE (1), (6), (7)); in closed form for a
uniform aperture (8); ratios (9).
The paper's phases belong to fields that vary as exp(-j w t).  A receiver that counts exp(+j w t), as engineers do, sees
the complex conjugates, and the ratio changes sign: `monopulse_ratios` must be told which.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams, centred_indices
from rf_pointing.core import require_choice, require_finite

__all__ = [
    "TIME_CONVENTIONS",
    "beam_signals",
    "beam_signs",
    "closed_form_signals",
    "monopulse_ratios",
    "quadrant_signals",
]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TIME_CONVENTIONS = ("exp(-jwt)", "exp(+jwt)")


def beam_signs(params: TripulseArrayParams) -> Array:
    """Return the sign of every element in the three beams, shape (3, N_x, N_y)."""
    x_sign = np.where(centred_indices(params.n_x) < 0.0, 1.0, -1.0)
    y_sign = np.where(centred_indices(params.n_y) < 0.0, 1.0, -1.0)
    ones_x, ones_y = np.ones(params.n_x), np.ones(params.n_y)
    return np.stack([np.outer(ones_x, ones_y), np.outer(x_sign, ones_y), np.outer(ones_x, y_sign)])


def quadrant_signals(params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike) -> ComplexArray:
    """Return the signals of quadrants 1-4, eq. (6), shape (..., 4), towards the projections `direction` (..., 2)."""
    field = _element_fields(params, weights, direction)
    low_x, high_x = slice(None, params.n_x // 2), slice(params.n_x // 2, None)
    low_y, high_y = slice(None, params.n_y // 2), slice(params.n_y // 2, None)
    quadrants = ((low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y))
    return np.stack([np.sum(field[..., qx, qy], axis=(-2, -1)) for qx, qy in quadrants], axis=-1)


def beam_signals(params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike) -> ComplexArray:
    """Return Sigma, Delta_x, Delta_y, eq. (7), shape (..., 3), for any element weights (..., N_x, N_y)."""
    combine = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    return np.asarray(quadrant_signals(params, weights, direction) @ combine.T)


def closed_form_signals(params: TripulseArrayParams, projection_error: ArrayLike) -> ComplexArray:
    """Return Sigma, Delta_x, Delta_y of the uniform, exact array, eq. (8) with K = 1, shape (..., 3).

    `projection_error` (..., 2) is T - T_0; the limits at X = 0 and Y = 0 are taken.
    """
    phase = np.asarray(projection_error, dtype=np.float64) * params.kd
    require_finite("projection_error", phase)
    even_x, odd_x = _even_and_odd(phase[..., 0], params.n_x)
    even_y, odd_y = _even_and_odd(phase[..., 1], params.n_y)
    return np.stack([even_x * even_y + 0j, 2j * odd_x * even_y, 2j * even_x * odd_y], axis=-1)


def monopulse_ratios(signals: ArrayLike, time_convention: str = "exp(-jwt)") -> Array:
    """Return R_x = Im(Delta_x / Sigma) and R_y, eq. (9), shape (..., 2), from beam signals (..., 3).

    Raises
    ------
    ValueError : where the sum signal is zero or a signal is not finite.
    """
    require_choice("time_convention", time_convention, TIME_CONVENTIONS)
    s = np.asarray(signals, dtype=np.complex128)
    require_finite("signals", s)
    if np.any(s[..., 0] == 0.0):
        raise ValueError("sum signal is 0: the ratios are not defined")
    ratio = np.imag(s[..., 1:] / s[..., :1])
    return np.asarray(ratio if time_convention == "exp(-jwt)" else -ratio)


def _element_fields(params: TripulseArrayParams, weights: ArrayLike, direction: ArrayLike) -> ComplexArray:
    t = np.asarray(direction, dtype=np.float64)
    require_finite("direction", t)
    along_x = np.exp(-1j * params.kd[0] * t[..., 0, None] * centred_indices(params.n_x))
    along_y = np.exp(-1j * params.kd[1] * t[..., 1, None] * centred_indices(params.n_y))
    return np.asarray(np.asarray(weights) * along_x[..., :, None] * along_y[..., None, :])


def _even_and_odd(phase: Array, count: int) -> tuple[Array, Array]:
    """Return sin(N X/2)/sin(X/2) and sin^2(N X/4)/sin(X/2), with their limits where sin(X/2) vanishes."""
    half = phase / 2.0
    # X and X - 2 pi give the same field but for the sign of exp(-j c 2 pi) with half-integer c.
    turns = np.round(half / np.pi)
    sign = np.where(turns % 2.0 == 0.0, 1.0, -1.0)
    rest = half - turns * np.pi
    safe = np.where(rest == 0.0, 1.0, np.sin(rest))
    even = np.where(rest == 0.0, float(count), np.sin(count * rest) / safe)
    odd = np.where(rest == 0.0, 0.0, np.sin(count * rest / 2.0) ** 2 / safe)
    return sign * even, sign * odd
