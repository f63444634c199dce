"""Pose estimate in REP-103 axes (x forward, y left, z up), ready for standard geometry messages.

Position and velocity in the active body frame; the orientation turns vectors of the passive body frame into it; the
covariance's rotations are about the active frame's fixed axes, as pose messages define it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.frames import rep103_from_spacecraft
from rf_pointing.array_sensors.arrays.interferometer.tracker import PoseEstimate

__all__ = ["Rep103Pose", "rep103_pose"]

Array = NDArray[np.float64]
_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rep103Pose:
    """Position (3,), orientation (3, 3), their covariance (6, 6); linear and angular velocity (3,), covariance (6, 6).

    Angular velocity of the passive body relative to the active one, in the active frame like the linear one.
    """

    position_m: Array
    orientation: Array
    pose_covariance: Array
    velocity_m_s: Array
    angular_velocity_rad_s: Array
    twist_covariance: Array


def rep103_pose(estimate: PoseEstimate) -> Rep103Pose:
    """Return the estimate in REP-103 axes."""
    motion = estimate.motion
    position, orientation = rep103_from_spacecraft(motion.position_m, motion.attitude)
    to_active = _FLIP @ motion.attitude.T
    pose = _block(_FLIP, to_active)
    rows, twist_rows = np.r_[0:3, 6:9], np.r_[3:6, 9:12]
    return Rep103Pose(
        position_m=position,
        orientation=orientation,
        pose_covariance=pose @ estimate.covariance[np.ix_(rows, rows)] @ pose.T,
        velocity_m_s=_FLIP @ motion.velocity_m_s,
        angular_velocity_rad_s=to_active @ motion.rate_rad_s,
        twist_covariance=pose @ estimate.covariance[np.ix_(twist_rows, twist_rows)] @ pose.T,
    )


def _block(first: Array, second: Array) -> Array:
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = first, second
    return matrix
