"""Spectral lines of two biphase-modulated carriers through a square-law or an exponential device.

Input s0 + a1 m1 cos(w1 t + phi1) + a2 m2 cos(w2 t + phi2), m = +-1.  Square law c v^2 (PI83 eqs. 5-4 to 5-6); diode or
bipolar c exp(q v/kT), whose lines are products of modified Bessel functions (eqs. 5-10 to 5-16).  The difference line
carries the product code m1 m2.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["exponential_line", "modified_bessel", "product_code", "square_law_lines"]

Array = NDArray[np.float64]
_BESSEL_TERMS = 60


def square_law_lines(bias: float, amplitude1: float, amplitude2: float) -> dict[str, float]:
    """Return the amplitude of each line of v^2 (PI83 eq. 5-6): dc, difference, f1, f2, 2f1, 2f2, sum."""
    return {
        "dc": bias**2 + 0.5 * amplitude1**2 + 0.5 * amplitude2**2,
        "difference": amplitude1 * amplitude2,
        "f1": 2.0 * bias * amplitude1,
        "f2": 2.0 * bias * amplitude2,
        "2f1": 0.5 * amplitude1**2,
        "2f2": 0.5 * amplitude2**2,
        "sum": amplitude1 * amplitude2,
    }


def exponential_line(
    order1: int, order2: int, drive1: float, drive2: float, code1: int = 1, code2: int = 1, bias: float = 0.0
) -> float:
    """Return the amplitude of cos(order1 w1 t +- order2 w2 t) of exp(x), x = q v/kT (PI83 eq. 5-16).

    `drive` y = q a/kT, `code` the biphase value +-1 (seen only by odd orders, eq. 5-15), `bias` q s0/kT.  With both
    orders above zero the sum and the difference line have this amplitude each.
    """
    line = math.exp(bias)
    for order, drive, code in ((order1, drive1, code1), (order2, drive2, code2)):
        if code not in (-1, 1):
            raise ValueError(f"code={code} must be -1 or 1")
        line *= code**order * modified_bessel(order, drive) * (2.0 if order else 1.0)
    return 0.5 * line if order1 and order2 else line


def modified_bessel(order: int, argument: float) -> float:
    """Return I_n(x) by its power series (PI83 eq. 5-14), for orders n >= 0 and |x| <= 30."""
    if order < 0 or abs(argument) > 30.0:
        raise ValueError(f"order={order} must be >= 0 and argument={argument} within +-30")
    half = 0.5 * argument
    terms = (half ** (order + 2 * k) / (math.factorial(k) * math.factorial(order + k)) for k in range(_BESSEL_TERMS))
    return math.fsum(terms)


def product_code(code1: ArrayLike, code2: ArrayLike) -> Array:
    """Return the code m1 m2 on the reradiated signal (PI83 eq. 5-7); equal codes give a bare carrier."""
    first, second = np.asarray(code1, dtype=np.float64), np.asarray(code2, dtype=np.float64)
    if first.shape != second.shape or not np.all(np.isin(np.stack([first, second]), (-1.0, 1.0))):
        raise ValueError("code1 and code2 must be equally long and of values -1 and 1")
    return first * second
