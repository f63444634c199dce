"""Position and its derivatives as components: one code for floats and for arrays.

Many times at once may be rows (3, n) of one array, on which an operation costs a third.

Two kinds of derivative are needed.  An *inertial* motion holds d^k r/dt^k of a non-rotating frame,
written in Earth-fixed axes; light time shifts it.  A *rotating* motion holds the derivatives that
an observer on the ground sees:

    X'   = A1 - w x A0
    X''  = A2 - 2 w x A1 + w x (w x A0)
    X''' = A3 - 3 w x A2 + 3 w x (w x A1) - w x (w x (w x A0))
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

# Components x, y, z: floats, or arrays of one shape; or the rows of an array (3, n).
Vector = Any


@dataclass(frozen=True, slots=True)
class StateVector:
    """Position [m] with velocity, acceleration and jerk, in the axes its maker states."""

    position: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector

    def derivatives(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Return all four, position first."""
        return self.position, self.velocity, self.acceleration, self.jerk


def dot(a: Vector, b: Vector) -> Any:
    """Return the scalar product."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        x, y, z = a * b
        return x + y + z
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def root(a: Any) -> Any:
    """Return the square root; plain floats stay plain, which is three times faster."""
    return math.sqrt(a) if isinstance(a, float) else np.sqrt(a)


def norm(a: Vector) -> Any:
    """Return the length."""
    return root(dot(a, a))


def combined(*terms: tuple[Any, Vector]) -> Vector:
    """Return the sum of factor * vector; rows if one of them is."""
    if isinstance(terms[0][1], np.ndarray) or isinstance(terms[-1][1], np.ndarray):
        factor, first = terms[0]
        total = factor * _rows(first)
        for factor, vector in terms[1:]:
            total = total + factor * _rows(vector)
        return total
    factor, (x, y, z) = terms[0]
    x, y, z = factor * x, factor * y, factor * z
    for factor, (dx, dy, dz) in terms[1:]:
        x, y, z = x + factor * dx, y + factor * dy, z + factor * dz
    return x, y, z


def _rows(v: Vector) -> Any:
    return v if isinstance(v, np.ndarray) else np.reshape(v, (3, -1))


def rows_of(v: Vector, count: int) -> Any:
    """Return the components as an array (3, count)."""
    if isinstance(v, np.ndarray):
        return v
    return np.array([np.broadcast_to(one, count) for one in v])


def turned_about_z(motion: StateVector, angle_rad: Any, pole_x_rad: Any, pole_y_rad: Any) -> StateVector:
    """Return the components in axes turned by the Earth's angle, then tilted to the pole.

    The tilt is linear in the pole's coordinates: their squares are 1e-12, 7 micrometres on the
    ground.
    """
    functions: Any = math if isinstance(angle_rad, float) else np
    c, s = functions.cos(angle_rad), functions.sin(angle_rad)
    if isinstance(motion.position, np.ndarray):
        x, y, z = np.stack(motion.derivatives(), axis=1)
        turned = _earth_fixed((x, y, z), c, s, pole_x_rad, pole_y_rad)
        return StateVector(*np.stack(turned, axis=1))
    return StateVector(*(_earth_fixed(v, c, s, pole_x_rad, pole_y_rad) for v in motion.derivatives()))


def _earth_fixed(v: Vector, c: Any, s: Any, pole_x: Any, pole_y: Any) -> Vector:
    x, y, z = c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]
    return x + pole_x * z, y - pole_y * z, z - pole_x * x + pole_y * y


def rotated(motion: StateVector, axes: tuple[Vector, Vector, Vector]) -> StateVector:
    """Return the components along three fixed unit vectors."""
    if isinstance(motion.position, np.ndarray):
        x, y, z = np.array(axes).T[:, :, np.newaxis]
        return StateVector(*(x * v[0] + y * v[1] + z * v[2] for v in motion.derivatives()))
    first, second, third = axes
    return StateVector(*((dot(first, v), dot(second, v), dot(third, v)) for v in motion.derivatives()))


# -z x v, of rows.
_ACROSS = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def seen_from_rotating_axes(motion: StateVector, rate_rad_s: float) -> StateVector:
    """Return the derivatives seen in axes that turn about z, from inertial ones in them."""
    w, w2, w3 = rate_rad_s, rate_rad_s**2, rate_rad_s**3
    a0, a1, a2, a3 = motion.derivatives()
    if isinstance(a0, np.ndarray):
        b0, b1, b2 = _ACROSS @ a0, _ACROSS @ a1, _ACROSS @ a2
        c0, c1 = _ACROSS @ b0, _ACROSS @ b1
        jerk = a3 + 3.0 * w * b2 + 3.0 * w2 * c1 - w3 * b0
        return StateVector(a0, a1 + w * b0, a2 + 2.0 * w * b1 + w2 * c0, jerk)
    velocity = (a1[0] + w * a0[1], a1[1] - w * a0[0], a1[2])
    acceleration = (a2[0] + 2.0 * w * a1[1] - w2 * a0[0], a2[1] - 2.0 * w * a1[0] - w2 * a0[1], a2[2])
    jerk = (
        a3[0] + 3.0 * w * a2[1] - 3.0 * w2 * a1[0] - w3 * a0[1],
        a3[1] - 3.0 * w * a2[0] - 3.0 * w2 * a1[1] + w3 * a0[0],
        a3[2],
    )
    return StateVector(a0, velocity, acceleration, jerk)


# Where the five positions are, in steps from the wanted time.
OFFSETS = (-2.0, -1.0, 0.0, 1.0, 2.0)

# The jerk is of second order only: it serves the light time alone, where less will do.
_STENCILS = (
    (0.0, 0.0, 1.0, 0.0, 0.0), (1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0),
    (-1.0 / 12.0, 4.0 / 3.0, -2.5, 4.0 / 3.0, -1.0 / 12.0), (-0.5, 1.0, 0.0, -1.0, 0.5),
)  # fmt: skip


def motion_from_positions(positions: Any, step_s: float, unit_m: float) -> StateVector:
    """Return the motion [m] of five positions in `unit_m`, vectors or (5, n, 3); errors h^4."""
    if isinstance(positions, np.ndarray):
        positions = np.ascontiguousarray(positions.transpose(0, 2, 1))
    orders = (_weighted(positions, weights, unit_m / step_s**k) for k, weights in enumerate(_STENCILS))
    position, velocity, acceleration, jerk = orders
    return StateVector(position, velocity, acceleration, jerk)


def _weighted(positions: Any, weights: tuple[float, ...], scale: Any) -> Vector:
    # In this order everywhere: a product of matrices rounds as the processor likes.
    a, b, o, c, d = (weight * scale for weight in weights)
    if isinstance(positions, np.ndarray):
        first, second, third, fourth, fifth = positions
        return a * first + b * second + o * third + c * fourth + d * fifth
    (ax, ay, az), (bx, by, bz), (x, y, z), (cx, cy, cz), (dx, dy, dz) = positions
    return (
        a * ax + b * bx + o * x + c * cx + d * dx,
        a * ay + b * by + o * y + c * cy + d * dy,
        a * az + b * bz + o * z + c * cz + d * dz,
    )
