"""Many roots at once: bisection safeguarding secant steps, one array call of the function per iteration."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["roots_between"]

Array = NDArray[np.float64]

_MAX_ITERATIONS = 80


def roots_between(function: Callable[[Array], Array], low: Array, high: Array, tolerance: float) -> Array:
    """Return one root of `function` in each interval [low, high], to within `tolerance`; shapes (n,).

    Illinois method (Dowell and Jarratt 1971), every third step a bisection.  Raises ValueError where the signs at the
    ends of an interval do not differ.
    """
    if low.size == 0:
        return low
    a, b = low.astype(np.float64), high.astype(np.float64)
    fa, fb = function(a), function(b)
    if np.any(fa * fb > 0.0):
        raise ValueError(f"no change of sign in the interval that starts at {a[fa * fb > 0.0][0]}")
    for iteration in range(_MAX_ITERATIONS):
        if np.all(np.abs(b - a) <= tolerance) or np.all((fa == 0.0) | (fb == 0.0)):
            break
        change = np.where(fb == fa, 1.0, fb - fa)
        secant = b - fb * (b - a) / change
        x = 0.5 * (a + b) if iteration % 3 == 2 else np.clip(secant, np.minimum(a, b), np.maximum(a, b))
        fx = function(x)
        crossed = fx * fb <= 0.0
        # Keep the sign change between a and b; halving a stale end value stops it from pinning the secant.
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, 0.5 * fa)
        b, fb = x, fx
    return np.where(np.abs(fa) < np.abs(fb), a, b)
