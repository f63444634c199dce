"""Frames of the two spacecraft: rotations of frames, one-way attitude, directions.

Axes: x boresight, y right, z down.  Azimuth turns x towards y, elevation turns x towards -z, roll
turns y towards z. The matrices rotate frames, not vectors: v_passive = A v_active with A = Tx(roll)
Ty(elevation) Tz(azimuth), PI83 eq. (2-1).  Zero attitude: both spacecraft face the same way.  All
functions work on stacks (leading dimensions).
"""

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.rotations import (
    cross_matrix,
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_turn,
    turn_from_quaternion,
)
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core.types import Array

# At elevation +-90 deg azimuth and roll are about one axis: refusing is better than an arbitrary
# split.
_GIMBAL_COSINE = 1e-9
_AXES = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}
_REP103 = np.array([1.0, -1.0, -1.0])


def azimuth_rotation(angle_rad: ArrayLike) -> Array:
    """Return Tz, (..., 3, 3): the frame turned about z, x towards y (PI83 Table 2-1)."""
    return _axis_rotation("z", angle_rad)


def elevation_rotation(angle_rad: ArrayLike) -> Array:
    """Return Ty, (..., 3, 3): the frame turned about y, x towards -z (PI83 Table 2-1)."""
    return _axis_rotation("y", angle_rad)


def roll_rotation(angle_rad: ArrayLike) -> Array:
    """Return Tx, (..., 3, 3): the frame turned about x, y towards z (PI83 Table 2-1)."""
    return _axis_rotation("x", angle_rad)


def _axis_rotation(axis: str, angle_rad: ArrayLike) -> Array:
    angle = np.asarray(angle_rad, dtype=np.float64)
    first, second = _AXES[axis]
    matrix = np.zeros((*angle.shape, 3, 3)) + np.eye(3)
    matrix[..., first, first] = matrix[..., second, second] = np.cos(angle)
    matrix[..., first, second] = np.sin(angle)
    matrix[..., second, first] = -np.sin(angle)
    return matrix


def small_rotation(
    azimuth_rad: ArrayLike, elevation_rad: ArrayLike, roll_rad: ArrayLike, variant: str = CORRECTED
) -> Array:
    """Return the first-order product of the three rotations, (..., 3, 3) (PI83 eq. 4-11, listing
    IACOMP).

    As "published" the diagonal of (4-11) is zero; with it the updated direction would be orthogonal
    to the old one.
    """
    angles = np.broadcast_arrays(
        *(np.asarray(a, dtype=np.float64) for a in (roll_rad, elevation_rad, azimuth_rad))
    )
    # Frames turn, not vectors: hence the minus sign.
    skew = -cross_matrix(np.stack(angles, axis=-1))
    return skew if is_published(variant) else skew + np.eye(3)


def frame_rotation(vector_rad: ArrayLike) -> Array:
    """Return the frame turned by the rotation vector (..., 3): T = exp(-[v x]).

    Inverse of `rotation_vector`.
    """
    vector = np.asarray(vector_rad, dtype=np.float64)
    return matrix_from_quaternion(quaternion_from_turn(-vector))


def rotation_vector(rotation: ArrayLike) -> Array:
    """Return the rotation vector (..., 3), length in [0, pi], of a frame rotation.

    Inverse of `frame_rotation`.  Accurate at half a turn too, where its sign is free.
    """
    matrix = np.asarray(rotation, dtype=np.float64)
    return turn_from_quaternion(quaternion_from_matrix(np.swapaxes(matrix, -1, -2)))


def attitude_from_euler(
    azimuth_rad: ArrayLike, elevation_rad: ArrayLike, roll_rad: ArrayLike
) -> Array:
    """Return A (..., 3, 3) of the passive spacecraft relative to the active one (PI83 eq. 2-1,
    listing ACOMP).
    """
    return (
        roll_rotation(roll_rad) @ elevation_rotation(elevation_rad) @ azimuth_rotation(azimuth_rad)
    )


def euler_from_attitude(
    attitude: ArrayLike, variant: str = CORRECTED
) -> tuple[Array, Array, Array]:
    """Return azimuth and roll in [-pi, pi] and elevation in [-pi/2, pi/2] of A (..., 3, 3).

    "corrected" is the listing's EULER, where a common gain error of A cancels; "published" is eq.
    (2-5) as printed, which lost the minus sign of A13.  Raises ValueError at elevation +-90 deg,
    where azimuth and roll coincide.
    """
    matrix = np.asarray(attitude, dtype=np.float64)
    if np.any(np.hypot(matrix[..., 0, 0], matrix[..., 0, 1]) < _GIMBAL_COSINE):
        raise ValueError("attitude elevation is +-90 deg: azimuth and roll are not defined there")
    azimuth = np.arctan2(matrix[..., 0, 1], matrix[..., 0, 0])
    roll = np.arctan2(matrix[..., 1, 2], matrix[..., 2, 2])
    if is_published(variant):
        return azimuth, np.arctan(matrix[..., 0, 2] * np.cos(azimuth) / matrix[..., 0, 0]), roll
    # Mean of two expressions for cos(elevation): a common gain error of A cancels in the ratio.
    cosine = 0.5 * (
        matrix[..., 0, 0] * np.cos(azimuth)
        + matrix[..., 0, 1] * np.sin(azimuth)
        + matrix[..., 1, 2] * np.sin(roll)
        + matrix[..., 2, 2] * np.cos(roll)
    )
    return azimuth, np.arctan2(-matrix[..., 0, 2], cosine), roll


def direction_from_angles(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
    """Return the unit vector (..., 3) = [cos b cos a, cos b sin a, -sin b] (PI83 eq. 3-26, listing
    PRC).
    """
    azimuth, elevation = np.broadcast_arrays(
        np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    )
    horizontal = np.cos(elevation)
    return np.stack(
        [horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), -np.sin(elevation)], axis=-1
    )


def forward_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Return azimuth in [-pi, pi] and elevation of vectors (..., 3) of any length (listing RPC)."""
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    return np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))


def reverse_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Return azimuth in (-pi, pi] and elevation of vectors near -x, smooth in the vector there
    (listing RPC2).
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    azimuth = np.pi - np.arctan2(y, -x)
    return np.where(azimuth > np.pi, azimuth - 2.0 * np.pi, azimuth), np.arctan2(-z, np.hypot(x, y))


def rep103_from_spacecraft(position_m: ArrayLike, attitude: ArrayLike) -> tuple[Array, Array]:
    """Return position and orientation by REP-103 (x forward, y left, z up) from position and A.

    The position (..., 3) is in the active body frame; the orientation (..., 3, 3) turns vectors of
    the passive body frame into the active one, as a pose message means it.
    """
    turned = np.swapaxes(np.asarray(attitude, dtype=np.float64), -1, -2)
    return np.asarray(position_m, dtype=np.float64) * _REP103, _REP103[:, None] * turned * _REP103
