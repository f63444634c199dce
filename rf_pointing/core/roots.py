"""Roots of functions: one of a plain function, or many at once of a function of arrays.

Both are here rather than taken from scipy.optimize, whose import takes half a second in the middle
of a node's start.
"""

from collections.abc import Callable

import numpy as np

from rf_pointing.core.types import Array

# Bisection of any interval of floats ends after 60; what takes more has met a NaN.
_MAX_ITERATIONS = 200


def bracketed_root(
    function: Callable[[float], float], low: float, high: float, tolerance: float = 1e-14
) -> float:
    """Return where `function` changes sign in [low, high], by regula falsi (Illinois).

    Raises ValueError if the function has the same sign at both ends.
    """
    at_low, at_high = function(low), function(high)
    if at_low * at_high > 0.0:
        raise ValueError(f"no sign change between {low} ({at_low}) and {high} ({at_high})")
    root, side = low, 0
    for _ in range(_MAX_ITERATIONS):
        previous, root = root, (low * at_high - high * at_low) / (at_high - at_low)
        value = function(root)
        if value == 0.0 or abs(root - previous) <= tolerance:
            break
        if value * at_high > 0.0:
            high, at_high = root, value
            # Halving the value of an end that stays is what keeps regula falsi from creeping.
            at_low *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            low, at_low = root, value
            at_high *= 0.5 if side == 1 else 1.0
            side = 1
    return root


def roots_between(
    function: Callable[[Array], Array], low: Array, high: Array, tolerance: float
) -> Array:
    """Return one root of `function` in each interval, to within `tolerance`; shapes (n,).

    Chandrupatla 1997, one array call of the function per iteration: inverse quadratic interpolation
    where the last three points make it safe, bisection elsewhere.  About eight calls for smooth
    functions.  Raises ValueError where the signs at the ends of an interval do not differ.
    """
    if low.size == 0:
        return low
    a, b = low.astype(np.float64), high.astype(np.float64)
    fa, fb = function(a), function(b)
    if np.any(fa * fb > 0.0):
        raise ValueError(f"no change of sign in the interval that starts at {a[fa * fb > 0.0][0]}")
    # The chord first: it saves a bisection or two of a smooth function.
    apart = fa - fb
    part = np.clip(np.divide(fa, apart, out=np.full_like(a, 0.5), where=apart != 0.0), 0.05, 0.95)
    for _ in range(_MAX_ITERATIONS):
        x = a + part * (b - a)
        fx = function(x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        width = np.abs(b - a)
        limit = 0.5 * tolerance / np.maximum(width, tolerance)
        if np.all((width <= tolerance) | (fa == 0.0)):
            break
        part = np.clip(_next_part(a, b, c, fa, fb, fc), limit, 1.0 - limit)
    return np.where(np.abs(fa) < np.abs(fb), a, b)


def _next_part(a: Array, b: Array, c: Array, fa: Array, fb: Array, fc: Array) -> Array:
    """Return the step from a to b: inverse quadratic where it stays inside, else one half."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        safe = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        quadratic = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (
            fc - fb
        )
    return np.where(safe & np.isfinite(quadratic), quadratic, 0.5)
