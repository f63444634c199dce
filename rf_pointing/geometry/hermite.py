"""Quintic Hermite interpolation: the curve through two states of position, velocity and acceleration.

Exact for polynomials of degree five; works on scalars and on arrays of axes alike.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Motion", "quintic"]

Array = NDArray[np.float64]


class Motion(NamedTuple):
    """Position, velocity and acceleration of one instant, each of any one shape."""

    position: Array
    velocity: Array
    acceleration: Array


def quintic(start: Motion, end: Motion, duration_s: float, t_s: ArrayLike) -> Motion:
    """Return the motion `t_s` after `start` on the quintic that reaches `end` after `duration_s` > 0.

    `t_s` is a scalar, or an array (n,) where the states are arrays (axes,): the result is then (n, axes).
    """
    if not duration_s > 0.0:
        raise ValueError(f"duration_s={duration_s} must be > 0")
    t, h = np.asarray(t_s, dtype=np.float64)[..., None], duration_s
    p0, v0, a0 = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in start)
    p1, v1, a1 = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in end)
    gap = p1 - p0 - v0 * h - 0.5 * a0 * h**2
    slip = v1 - v0 - a0 * h
    bend = a1 - a0
    c3 = (10.0 * gap - 4.0 * slip * h + 0.5 * bend * h**2) / h**3
    c4 = (-15.0 * gap + 7.0 * slip * h - bend * h**2) / h**4
    c5 = (6.0 * gap - 3.0 * slip * h + 0.5 * bend * h**2) / h**5
    return Motion(
        p0 + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5)))),
        v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
        a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
    )
