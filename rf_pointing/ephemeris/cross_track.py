"""Cross-track offset: the target moved on the sky at right angles to its motion, positive to the right of it.

With the sky normal m = rho x rho' / |rho x rho'| the moved target is rho cos(q) - |rho| sin(q) m; its derivatives
carry m' and m'' along, so that the rates stay the derivatives of the angles.
"""

import math
from typing import Any

import numpy as np

from rf_pointing.ephemeris.state_vector import StateVector, Vector, combined, cross, dot, norm

__all__ = ["moved_across"]


def moved_across(motion: StateVector, offset_rad: float) -> StateVector:
    """Return the motion (rotating axes) of the target moved by `offset_rad`; its range stays the same.

    Raises ValueError for a target that stands still on the sky: it has no across.
    """
    r, v, a, j = motion.derivatives()
    normal = combined((-1.0, cross(r, v)))
    normal1 = combined((-1.0, cross(r, a)))
    normal2 = combined((-1.0, cross(v, a)), (-1.0, cross(r, j)))
    if np.any(norm(normal) == 0.0):
        raise ValueError(f"cross_track_offset_rad={offset_rad} needs a target that moves on the sky")
    m, m1, m2 = _unit(normal, normal1, normal2)
    rho, rho1, rho2 = _length(r, v, a)
    c, s = math.cos(offset_rad), math.sin(offset_rad)
    position = combined((c, r), (s * rho, m))
    velocity = combined((c, v), (s * rho1, m), (s * rho, m1))
    acceleration = combined((c, a), (s * rho2, m), (2.0 * s * rho1, m1), (s * rho, m2))
    return StateVector(position, velocity, acceleration, j)


def _length(r: Vector, v: Vector, a: Vector) -> tuple[Any, Any, Any]:
    """Return |r| and its two derivatives."""
    length = norm(r)
    rate = dot(r, v) / length
    return length, rate, (dot(v, v) + dot(r, a) - rate * rate) / length


def _unit(r: Vector, v: Vector, a: Vector) -> tuple[Vector, Vector, Vector]:
    """Return r/|r| and its two derivatives."""
    length, rate, curvature = _length(r, v, a)
    inverse = 1.0 / length
    inverse1 = -rate / length**2
    inverse2 = -curvature / length**2 + 2.0 * rate**2 / length**3
    unit = combined((inverse, r))
    unit1 = combined((inverse, v), (inverse1, r))
    return unit, unit1, combined((inverse, a), (2.0 * inverse1, v), (inverse2, r))
