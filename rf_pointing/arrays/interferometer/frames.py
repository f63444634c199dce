"""Frames of the two spacecraft: rotations of frames, one-way attitude, directions.

Axes: x boresight, y right, z down.  Azimuth turns x towards y, elevation turns x towards -z, roll turns y towards z.
The matrices rotate frames, not vectors: v_passive = A v_active with A = Tx(roll) Ty(elevation) Tz(azimuth), PI83
eq. (2-1).  Zero attitude: both spacecraft face the same way.  All functions work on stacks (leading dimensions).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.arrays.interferometer.variant import CORRECTED, is_published

__all__ = [
    "attitude_from_euler",
    "azimuth_rotation",
    "cross_product",
    "direction_from_angles",
    "elevation_rotation",
    "euler_from_attitude",
    "forward_angles",
    "frame_rotation",
    "rep103_from_spacecraft",
    "reverse_angles",
    "roll_rotation",
    "rotation_vector",
    "small_rotation",
    "spacecraft_from_rep103",
    "target_axes",
]

Array = NDArray[np.float64]
_GIMBAL_COSINE = 1e-9
_AXES = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}
_REP103 = np.array([1.0, -1.0, -1.0])
_LEVI_CIVITA = np.zeros((3, 3, 3))
_LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_LEVI_CIVITA[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = -1.0


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
    """Return the first-order product of the three rotations, (..., 3, 3) (PI83 eq. 4-11, listing IACOMP).

    As "published" the diagonal of (4-11) is zero; with it the updated direction would be orthogonal to the old one.
    """
    angles = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (roll_rad, elevation_rad, azimuth_rad)))
    skew = -_cross_matrix(np.stack(angles, axis=-1))
    return skew if is_published(variant) else skew + np.eye(3)


def frame_rotation(vector_rad: ArrayLike) -> Array:
    """Return the frame turned by the rotation vector (..., 3): T = exp(-[v x]); inverse of `rotation_vector`."""
    vector = np.asarray(vector_rad, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = _cross_matrix(vector)
    return np.asarray(
        np.eye(3) - np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (cross @ cross)
    )


def rotation_vector(rotation: ArrayLike) -> Array:
    """Return the rotation vector (..., 3), length in [0, pi], of a frame rotation; inverse of `frame_rotation`.

    Through the quaternion's largest component, so that it stays accurate at half a turn (where the sign is free).
    """
    matrix = np.asarray(rotation, dtype=np.float64)
    products = _quaternion_products(matrix)
    largest = np.argmax(np.einsum("...kk->...k", products), axis=-1)[..., None, None]
    quaternion = np.take_along_axis(products, largest, axis=-2)[..., 0, :]
    quaternion = quaternion * np.where(quaternion[..., 3:] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(quaternion[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quaternion[..., 3:])
    return quaternion[..., :3] * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 0.0)


def _quaternion_products(matrix: Array) -> Array:
    # 4 q q^T of the scalar-last quaternion whose vector rotation is the transpose of `matrix`.
    m = np.swapaxes(matrix, -1, -2)
    trace = np.einsum("...kk->...", m)[..., None, None]
    products = np.empty((*m.shape[:-2], 4, 4))
    products[..., :3, :3] = m + np.swapaxes(m, -1, -2) + (1.0 - trace) * np.eye(3)
    odd = np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1)
    products[..., :3, 3] = products[..., 3, :3] = odd
    products[..., 3, 3] = 1.0 + trace[..., 0, 0]
    return products


def _cross_matrix(vector: Array) -> Array:
    return np.asarray(np.einsum("ijk,...j->...ik", _LEVI_CIVITA, vector))


def cross_product(left: ArrayLike, right: ArrayLike) -> Array:
    """Return left x right of stacks (..., 3); several times faster than numpy's on small ones."""
    return np.asarray(np.einsum("ijk,...j,...k->...i", _LEVI_CIVITA, np.asarray(left), np.asarray(right)))


def attitude_from_euler(azimuth_rad: ArrayLike, elevation_rad: ArrayLike, roll_rad: ArrayLike) -> Array:
    """Return A (..., 3, 3) of the passive spacecraft relative to the active one (PI83 eq. 2-1, listing ACOMP)."""
    return roll_rotation(roll_rad) @ elevation_rotation(elevation_rad) @ azimuth_rotation(azimuth_rad)


def euler_from_attitude(attitude: ArrayLike, variant: str = CORRECTED) -> tuple[Array, Array, Array]:
    """Return azimuth and roll in [-pi, pi] and elevation in [-pi/2, pi/2] of A (..., 3, 3).

    "corrected" is the listing's EULER, where a common gain error of A cancels; "published" is eq. (2-5) as printed,
    which lost the minus sign of A13.  Raises ValueError at elevation +-90 deg, where azimuth and roll coincide.
    """
    matrix = np.asarray(attitude, dtype=np.float64)
    if np.any(np.hypot(matrix[..., 0, 0], matrix[..., 0, 1]) < _GIMBAL_COSINE):
        raise ValueError("attitude elevation is +-90 deg: azimuth and roll are not defined there")
    azimuth = np.arctan2(matrix[..., 0, 1], matrix[..., 0, 0])
    roll = np.arctan2(matrix[..., 1, 2], matrix[..., 2, 2])
    if is_published(variant):
        return azimuth, np.arctan(matrix[..., 0, 2] * np.cos(azimuth) / matrix[..., 0, 0]), roll
    cosine = 0.5 * (
        matrix[..., 0, 0] * np.cos(azimuth)
        + matrix[..., 0, 1] * np.sin(azimuth)
        + matrix[..., 1, 2] * np.sin(roll)
        + matrix[..., 2, 2] * np.cos(roll)
    )
    return azimuth, np.arctan2(-matrix[..., 0, 2], cosine), roll


def target_axes(attitude: ArrayLike, variant: str = CORRECTED) -> Array:
    """Return the passive spacecraft's axes in the active frame, (..., 3, 3), one axis per last-dimension column.

    The text after (2-1) says that the columns of A are these axes ("published"); with v_passive = A v_active they
    are its rows.
    """
    matrix = np.asarray(attitude, dtype=np.float64)
    return matrix if is_published(variant) else np.swapaxes(matrix, -1, -2)


def direction_from_angles(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
    """Return the unit vector (..., 3) = [cos b cos a, cos b sin a, -sin b] (PI83 eq. 3-26, listing PRC)."""
    azimuth, elevation = np.broadcast_arrays(
        np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    )
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), -np.sin(elevation)], axis=-1)


def forward_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Return azimuth in [-pi, pi] and elevation of vectors (..., 3) of any length (listing RPC)."""
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    return np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))


def reverse_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Return azimuth in (-pi, pi] and elevation of vectors near -x, smooth in the vector there (listing RPC2)."""
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    azimuth = np.pi - np.arctan2(y, -x)
    return np.where(azimuth > np.pi, azimuth - 2.0 * np.pi, azimuth), np.arctan2(-z, np.hypot(x, y))


def rep103_from_spacecraft(position_m: ArrayLike, attitude: ArrayLike) -> tuple[Array, Array]:
    """Return position and orientation by REP-103 (x forward, y left, z up) from position and A.

    The position (..., 3) is in the active body frame; the orientation (..., 3, 3) turns vectors of the passive body
    frame into the active one, as a pose message means it.  The inverse is `spacecraft_from_rep103`.
    """
    turned = np.swapaxes(np.asarray(attitude, dtype=np.float64), -1, -2)
    return np.asarray(position_m, dtype=np.float64) * _REP103, _REP103[:, None] * turned * _REP103


def spacecraft_from_rep103(position_m: ArrayLike, orientation: ArrayLike) -> tuple[Array, Array]:
    """Return position and A in the report's axes from a REP-103 pose; inverse of `rep103_from_spacecraft`."""
    return rep103_from_spacecraft(position_m, orientation)
