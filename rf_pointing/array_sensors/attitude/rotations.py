"""Rotations in space as arithmetic on stacks (..., 3) and (..., 4).

v' = C v turns a vector actively.  Quaternions are scalar last (x, y, z, w), Hamilton products: C(a
b) = C(a) C(b). Filters step these tens of thousands of times, so nothing here checks its input;
`attitude.quaternion` and `arrays.interferometer.frames` are the doors with checks.
"""

import numpy as np

from rf_pointing.core.types import Array


def cross_product(first: Array, second: Array) -> Array:
    """Return first x second (..., 3), at a third of the time of numpy's."""
    product = np.empty(np.broadcast_shapes(first.shape, second.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(
            first[..., j] * second[..., k], first[..., k] * second[..., j], out=product[..., i]
        )
    return product


def cross_matrix(vector: Array) -> Array:
    """Return [v x] (..., 3, 3) with [v x] u = v x u."""
    matrix = np.zeros((*vector.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., k, j] = vector[..., i]
        matrix[..., j, k] = -vector[..., i]
    return matrix


def tangent_rows(direction: Array) -> Array:
    """Return two orthonormal rows (..., 2, 3) across unit vectors (..., 3), right-handed with them.

    Smooth on either side of z = 0 (Duff et al., Building an orthonormal basis, revisited, 2017).
    """
    x, y, z = (direction[..., i] for i in range(3))
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    rows = np.empty((*direction.shape[:-1], 2, 3))
    rows[..., 0, 0], rows[..., 0, 1], rows[..., 0, 2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    rows[..., 1, 0], rows[..., 1, 1], rows[..., 1, 2] = b, sign + y * y * a, -y
    return rows


def quaternion_product(left: Array, right: Array) -> Array:
    """Return left * right (..., 4): turn by `right`, then by `left`."""
    ax, ay, az, aw = (left[..., i] for i in range(4))
    bx, by, bz, bw = (right[..., i] for i in range(4))
    product = np.empty(np.broadcast_shapes(left.shape, right.shape))
    product[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 1] = aw * by + ay * bw + az * bx - ax * bz
    product[..., 2] = aw * bz + az * bw + ax * by - ay * bx
    product[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def matrix_from_quaternion(quaternion: Array) -> Array:
    """Return C (..., 3, 3) of unit quaternions (..., 4); inverse: `quaternion_from_matrix`."""
    x, y, z, w = (quaternion[..., i] for i in range(4))
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    matrix = np.empty((*quaternion.shape[:-1], 3, 3))
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2] = 1.0 - yy - zz, xy - wz, xz + wy
    matrix[..., 1, 0], matrix[..., 1, 1], matrix[..., 1, 2] = xy + wz, 1.0 - xx - zz, yz - wx
    matrix[..., 2, 0], matrix[..., 2, 1], matrix[..., 2, 2] = xz - wy, yz + wx, 1.0 - xx - yy
    return matrix


def quaternion_from_matrix(matrix: Array) -> Array:
    """Return a unit quaternion (..., 4), of either sign, of C (..., 3, 3) (Shepperd's choice)."""
    trace = np.einsum("...kk->...", matrix)
    # Four times the outer product q q^T; its largest diagonal entry names the row that divides
    # without loss, at half a turn too.
    outer = np.empty((*matrix.shape[:-2], 4, 4))
    outer[..., :3, :3] = (
        matrix + np.swapaxes(matrix, -1, -2) + (1.0 - trace)[..., None, None] * np.eye(3)
    )
    for index, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        outer[..., 3, index] = outer[..., index, 3] = matrix[..., i, j] - matrix[..., j, i]
    outer[..., 3, 3] = 1.0 + trace
    row = np.argmax(np.einsum("...kk->...k", outer), axis=-1)
    quaternion = np.take_along_axis(outer, row[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))


def quaternion_from_turn(turn_rad: Array) -> Array:
    """Return the quaternion (..., 4) of the turn by |v| about v (..., 3); exact at zero."""
    x, y, z = (turn_rad[..., i] for i in range(3))
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    quaternion = np.empty((*turn_rad.shape[:-1], 4))
    quaternion[..., :3] = turn_rad * (0.5 * np.sinc(half / np.pi))[..., None]
    quaternion[..., 3] = np.cos(half)
    return quaternion


def turn_from_quaternion(quaternion: Array) -> Array:
    """Return the rotation vector (..., 3), at most pi long, of unit quaternions of either sign."""
    x, y, z, w = (quaternion[..., i] for i in range(4))
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    ratio = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
    return np.asarray(quaternion[..., :3] * np.where(w < 0.0, -ratio, ratio)[..., None])


def cosine_slopes(direction: Array) -> Array:
    """Return ds/d(s_x, s_y) (..., 3, 2) of unit vectors (..., 3) with s_z > 0."""
    slopes = np.zeros((*direction.shape[:-1], 3, 2))
    slopes[..., 0, 0] = slopes[..., 1, 1] = 1.0
    # From s_z = sqrt(1 - s_x^2 - s_y^2): at the horizon of the array the slope is infinite.
    slopes[..., 2, :] = -direction[..., :2] / direction[..., 2:]
    return slopes
