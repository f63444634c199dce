"""Velocity, acceleration and jerk from five positions at even steps (central differences)."""

from typing import Any

from rf_pointing.ephemeris.state_vector import StateVector, Vector

__all__ = ["OFFSETS", "motion_from_positions"]

OFFSETS = (-2.0, -1.0, 0.0, 1.0, 2.0)
"""Where the five positions are, in steps from the time asked for."""

_STENCILS = (
    (0.0, 0.0, 1.0, 0.0, 0.0),
    (1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0),
    (-1.0 / 12.0, 4.0 / 3.0, -2.5, 4.0 / 3.0, -1.0 / 12.0),
    (-0.5, 1.0, 0.0, -1.0, 0.5),
)


def motion_from_positions(positions: list[Vector], step_s: float, unit_m: float) -> StateVector:
    """Return the motion in metres of five positions in `unit_m`; errors of order h^4, the jerk h^2."""
    orders = (_weighted(positions, weights, unit_m / step_s**k) for k, weights in enumerate(_STENCILS))
    position, velocity, acceleration, jerk = orders
    return StateVector(position, velocity, acceleration, jerk)


def _weighted(positions: list[Vector], weights: tuple[float, ...], scale: Any) -> Vector:
    (ax, ay, az), (bx, by, bz), (x, y, z), (cx, cy, cz), (dx, dy, dz) = positions
    a, b, o, c, d = (weight * scale for weight in weights)
    return (
        a * ax + b * bx + o * x + c * cx + d * dx,
        a * ay + b * by + o * y + c * cy + d * dy,
        a * az + b * bz + o * z + c * cz + d * dz,
    )
