"""Unit quaternions, scalar last (x, y, z, w) as in ROS: q = [axis * sin(angle/2), cos(angle/2)].

A quaternion stands for the active rotation v' = C(q) v; products follow Hamilton, C(a*b) = C(a)
C(b).  As the orientation of a body, C(q) takes components in the body frame to components in the
reference frame (ROS).  q and -q are the same rotation: functions that return a quaternion of a
rotation return the one with w >= 0 (at half a turn, where w = 0, the one whose first non-zero
component is positive).  All functions accept leading batch axes and refuse what is not a rotation;
the arithmetic is in `core.rotations`.
"""

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude import rotations
from rf_pointing.core import require_finite
from rf_pointing.core.types import Array

UNIT_TOLERANCE = 1e-6
"""Largest accepted difference of a quaternion's norm from one."""
ROTATION_TOLERANCE = 1e-6
"""Largest accepted departure of C C^T from the unit matrix."""


def unit_quaternion(quaternion: ArrayLike, name: str = "quaternion") -> Array:
    """Return `quaternion` (..., 4) with its rounding error removed.

    Refuse one that is not of unit length.
    """
    q = _vectors(name, quaternion, 4)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if np.any(np.abs(norm - 1.0) > UNIT_TOLERANCE):
        worst = float(norm.flat[int(np.argmax(np.abs(norm - 1.0)))])
        raise ValueError(f"{name} has norm {worst!r}, must be 1 within {UNIT_TOLERANCE}")
    return np.asarray(q / norm)


# q and -q are one rotation; without one choice of sign a recorded attitude would jump between them.
def canonical(quaternion: ArrayLike) -> Array:
    """Return q or -q, whichever has w > 0 (at w = 0: a positive first non-zero component)."""
    q = unit_quaternion(quaternion)
    x, y, z, sign = np.moveaxis(np.sign(q), -1, 0)
    for component in (x, y, z):
        sign = np.where(sign == 0.0, component, sign)
    return np.asarray(q * sign[..., None] + 0.0)


def conjugate(quaternion: ArrayLike) -> Array:
    """Return the inverse rotation of unit `quaternion` (..., 4)."""
    return np.asarray(unit_quaternion(quaternion) * np.array([-1.0, -1.0, -1.0, 1.0]))


def multiply(left: ArrayLike, right: ArrayLike) -> Array:
    """Return the Hamilton product left * right of unit quaternions (..., 4).

    Rotate by `right`, then by `left`.
    """
    return rotations.quaternion_product(
        unit_quaternion(left, "left"), unit_quaternion(right, "right")
    )


def quaternion_to_matrix(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix C(q), shape (..., 3, 3).

    The inverse is `quaternion_from_matrix`.
    """
    return rotations.matrix_from_quaternion(unit_quaternion(quaternion))


def quaternion_from_matrix(matrix: ArrayLike) -> Array:
    """Return the canonical quaternion of rotation matrices (..., 3, 3), regular at half a turn
    (Shepperd's choice).

    Raises ValueError where the matrix is not orthonormal or is a reflection.
    """
    return canonical(rotations.quaternion_from_matrix(require_rotation("matrix", matrix)))


def quaternion_from_rotation_vector(rotation_rad: ArrayLike) -> Array:
    """Return the canonical quaternion of the rotation by |v| about v, `rotation_rad` (..., 3).

    Exact at zero.
    """
    return canonical(rotations.quaternion_from_turn(_vectors("rotation_rad", rotation_rad, 3)))


def quaternion_to_rotation_vector(quaternion: ArrayLike) -> Array:
    """Return the rotation vector (..., 3), at most pi long.

    At exactly half a turn its sign is the canonical one.
    """
    return rotations.turn_from_quaternion(canonical(quaternion))


def rotation_angle_between_rad(first: ArrayLike, second: ArrayLike) -> Array:
    """Return the angle in [0, pi] of the rotation that takes one orientation to the other."""
    difference = multiply(conjugate(first), second)
    return np.asarray(
        2.0 * np.arctan2(np.linalg.norm(difference[..., :3], axis=-1), np.abs(difference[..., 3]))
    )


def quaternion_from_roll_pitch_yaw(roll_pitch_yaw_rad: ArrayLike) -> Array:
    """Return the canonical quaternion of Rz(yaw) Ry(pitch) Rx(roll) (fixed axes, as in ROS), angles
    (..., 3).
    """
    half = _vectors("roll_pitch_yaw_rad", roll_pitch_yaw_rad, 3) / 2.0
    factors = []
    for axis in range(3):
        q = np.zeros((*half.shape[:-1], 4))
        q[..., axis], q[..., 3] = np.sin(half[..., axis]), np.cos(half[..., axis])
        factors.append(q)
    return canonical(multiply(factors[2], multiply(factors[1], factors[0])))


def quaternion_to_roll_pitch_yaw(quaternion: ArrayLike) -> Array:
    """Return roll, pitch, yaw (..., 3) of Rz(yaw) Ry(pitch) Rx(roll).

    Raises ValueError at pitch = +-90 deg, where roll and yaw are one angle.
    """
    c = quaternion_to_matrix(quaternion)
    level = np.hypot(c[..., 0, 0], c[..., 1, 0])
    if np.any(level < UNIT_TOLERANCE):
        raise ValueError("pitch is +-90 deg: roll and yaw are not defined apart")
    roll = np.arctan2(c[..., 2, 1], c[..., 2, 2])
    pitch = np.arctan2(-c[..., 2, 0], level)
    yaw = np.arctan2(c[..., 1, 0], c[..., 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)


def _vectors(name: str, value: ArrayLike, length: int) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape[-1:] != (length,):
        raise ValueError(f"{name} has shape {array.shape}, must be (..., {length})")
    require_finite(name, array)
    return array


def require_rotation(name: str, matrix: ArrayLike) -> Array:
    """Return `matrix` (..., 3, 3) as floats; ValueError unless it is a proper rotation."""
    c = np.asarray(matrix, dtype=np.float64)
    if c.shape[-2:] != (3, 3):
        raise ValueError(f"{name} has shape {c.shape}, must be (..., 3, 3)")
    require_finite(name, c)
    defect = float(np.max(np.abs(c @ np.swapaxes(c, -1, -2) - np.eye(3)), initial=0.0))
    if defect > ROTATION_TOLERANCE:
        raise ValueError(
            f"{name} misses orthonormality by {defect:.3g}, must be <= {ROTATION_TOLERANCE}"
        )
    if np.any(np.linalg.det(c) < 0.0):
        raise ValueError(f"{name} has determinant -1: a reflection, not a rotation")
    return c
