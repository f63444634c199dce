"""Small changes of a relative motion, in coordinates in which the measurements are nearly linear.

Fourteen numbers: range and two cross-track lengths (angle times range), velocity in the line-of-sight frame turned
along with the direction, rotation vector of A in the passive frame, angular rate, and the two excitation factors.
Cartesian changes would not do: at 100 km a cross-track error of 70 m lengthens the range by 25 mm, forty sigma.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.frames import frame_rotation, rotation_vector
from rf_pointing.array_sensors.arrays.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.attitude.rotations import cross_product, tangent_rows

__all__ = ["SIZE", "TrackedMotion", "cartesian_jacobian", "displaced", "local_difference", "sight_axes"]

Array = NDArray[np.float64]
SIZE = 14
POSITION, VELOCITY, ATTITUDE, RATE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
EXCITATION = slice(12, 14)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedMotion:
    """A relative motion and the excitation factors (..., 2) of the passive y and z dipoles."""

    motion: RelativeMotion
    excitation: Array


def sight_axes(position_m: Array) -> Array:
    """Return the matrix (..., 3, 3) whose columns are the direction and two axes across it, right-handed."""
    forward = position_m / np.linalg.norm(position_m, axis=-1, keepdims=True)
    rows = np.concatenate([forward[..., None, :], tangent_rows(forward)], axis=-2)
    return np.swapaxes(rows, -1, -2)


def displaced(tracked: TrackedMotion, change: Array) -> TrackedMotion:
    """Return the motion changed by local coordinates (..., 14); inverse of `local_difference`."""
    motion = tracked.motion
    axes = sight_axes(motion.position_m)
    distance = np.linalg.norm(motion.position_m, axis=-1)
    turn = np.stack([np.zeros_like(change[..., 0]), -change[..., 2], change[..., 1]], axis=-1) / distance[..., None]
    turning = _vector_rotation(_apply(axes, turn))
    velocity = motion.velocity_m_s + _apply(axes, change[..., VELOCITY])
    return TrackedMotion(
        motion=RelativeMotion(
            position_m=(distance + change[..., 0])[..., None] * _apply(turning, axes[..., 0]),
            velocity_m_s=_apply(turning, velocity),
            attitude=frame_rotation(change[..., ATTITUDE]) @ motion.attitude,
            rate_rad_s=motion.rate_rad_s + change[..., RATE],
        ),
        excitation=tracked.excitation + change[..., EXCITATION],
    )


def local_difference(tracked: TrackedMotion, reference: TrackedMotion) -> Array:
    """Return the local coordinates (..., 14) that lead from `reference` to `tracked`."""
    there, here = tracked.motion, reference.motion
    axes = sight_axes(here.position_m)
    distance = np.linalg.norm(here.position_m, axis=-1)
    unit = there.position_m / np.linalg.norm(there.position_m, axis=-1, keepdims=True)
    cross = cross_product(axes[..., 0], unit)
    sine, cosine = np.linalg.norm(cross, axis=-1), np.sum(axes[..., 0] * unit, axis=-1)
    scale = np.where(sine > 0.0, np.arctan2(sine, cosine) / np.where(sine > 0.0, sine, 1.0), 1.0)
    turn = cross * scale[..., None]
    back = np.swapaxes(axes, -1, -2)
    local_turn = _apply(back, turn)
    velocity = _apply(_vector_rotation(-turn), there.velocity_m_s) - here.velocity_m_s
    along = np.linalg.norm(there.position_m, axis=-1) - distance
    position = np.stack([along, distance * local_turn[..., 2], -distance * local_turn[..., 1]], axis=-1)
    attitude = rotation_vector(there.attitude @ np.swapaxes(here.attitude, -1, -2))
    parts = [position, _apply(back, velocity), attitude, there.rate_rad_s - here.rate_rad_s]
    return np.concatenate([*parts, tracked.excitation - reference.excitation], axis=-1)


def cartesian_jacobian(motion: RelativeMotion) -> Array:
    """Return d(position, velocity, rotation vector, rate)/d(local), (12, 12), of a single motion."""
    axes = sight_axes(motion.position_m)
    jacobian = np.eye(12)
    jacobian[POSITION, POSITION] = jacobian[VELOCITY, VELOCITY] = axes
    turns = np.stack([np.zeros(3), axes[:, 2], -axes[:, 1]]) / np.linalg.norm(motion.position_m)
    jacobian[VELOCITY, POSITION] = cross_product(turns, motion.velocity_m_s).T
    return jacobian


def _apply(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("...ij,...j->...i", matrix, vector))


def _vector_rotation(vector_rad: Array) -> Array:
    return np.swapaxes(frame_rotation(vector_rad), -1, -2)
