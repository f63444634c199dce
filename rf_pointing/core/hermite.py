"""Quintic Hermite interpolation: the curve through two states with velocity and acceleration.

Exact for polynomials of degree five; works on scalars and on arrays of axes alike.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core.types import Array


class Motion(NamedTuple):
    """Position, velocity and acceleration of one instant, each of any one shape."""

    position: Array
    velocity: Array
    acceleration: Array


def quintic_coefficients(
    start: tuple[Array, Array, Array], end: tuple[Array, Array, Array], h: Any
) -> tuple[Array, Array, Array]:
    """Return the factors of t^3, t^4 and t^5 between two motions that are `h` apart."""
    (p0, v0, a0), (p1, v1, a1) = start, end
    gap, slip, bend = p1 - p0 - v0 * h - 0.5 * a0 * h**2, v1 - v0 - a0 * h, a1 - a0
    c3 = (10.0 * gap - 4.0 * slip * h + 0.5 * bend * h**2) / h**3
    c4 = (-15.0 * gap + 7.0 * slip * h - bend * h**2) / h**4
    c5 = (6.0 * gap - 3.0 * slip * h + 0.5 * bend * h**2) / h**5
    return c3, c4, c5


class Quintic:
    """The curve from `start` to `end`, each (axes,) or scalars, after `duration_s` > 0."""

    def __init__(self, start: Motion, end: Motion, duration_s: float) -> None:
        if not duration_s > 0.0:
            raise ValueError(f"duration_s={duration_s} must be > 0")
        h = duration_s
        # Scalars are axes of one, so that one code serves both.
        p0, v0, a0 = np.atleast_2d(np.asarray(start, dtype=np.float64).T).T
        p1, v1, a1 = np.atleast_2d(np.asarray(end, dtype=np.float64).T).T
        c3, c4, c5 = quintic_coefficients((p0, v0, a0), (p1, v1, a1), h)
        # Rows: powers of time; columns: position, velocity and acceleration of every axis.
        self._axes = count = len(p0)
        self._coefficients = rows = np.zeros((6, 3 * count))
        rows[:6, :count] = p0, v0, 0.5 * a0, c3, c4, c5
        rows[:5, count : 2 * count] = v0, a0, 3.0 * c3, 4.0 * c4, 5.0 * c5
        rows[:4, 2 * count :] = a0, 6.0 * c3, 12.0 * c4, 20.0 * c5

    def at(self, t_s: ArrayLike) -> Motion:
        """Return the motion `t_s` after the start: (axes,) for a scalar, (n, axes) for (n,)."""
        count = self._axes
        # A control tick needs one time: a plain float saves the broadcasting.
        t = t_s if isinstance(t_s, float) else np.asarray(t_s, dtype=np.float64)[..., None]
        c = self._coefficients
        values = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
        return Motion(values[..., :count], values[..., count : 2 * count], values[..., 2 * count :])
