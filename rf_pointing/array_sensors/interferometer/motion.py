"""Relative motion of the two spacecraft: pose with its rates, and a simulated docking approach.

Position and velocity are in the active frame; the angular rate turns the passive frame relative to
the active one and is given in the passive frame: A(t + dt) = frame_rotation(rate dt) A(t).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    frame_rotation,
    rotation_vector,
)
from rf_pointing.array_sensors.interferometer.relative_pose import RelativePose
from rf_pointing.core import Params, as_finite_array, parameter, require_finite
from rf_pointing.core.types import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeMotion:
    """Position (..., 3), velocity (..., 3), A (..., 3, 3) and angular rate (..., 3).

    One motion or a stack.
    """

    position_m: Array
    velocity_m_s: Array
    attitude: Array
    rate_rad_s: Array


def require_motion(motion: RelativeMotion) -> RelativeMotion:
    """Return a single, finite motion with a proper rotation, else raise ValueError naming the
    field.
    """
    pose = RelativePose(position_m=motion.position_m, attitude=motion.attitude)
    return RelativeMotion(
        position_m=pose.position_m,
        velocity_m_s=as_finite_array("velocity_m_s", motion.velocity_m_s, (3,)),
        attitude=pose.attitude,
        rate_rad_s=as_finite_array("rate_rad_s", motion.rate_rad_s, (3,)),
    )


def moved(motion: RelativeMotion, dt_s: ArrayLike) -> RelativeMotion:
    """Return the motion `dt_s` (...) later at constant velocity and constant angular rate."""
    dt = np.asarray(dt_s, dtype=np.float64)[..., None]
    return RelativeMotion(
        position_m=motion.position_m + motion.velocity_m_s * dt,
        velocity_m_s=np.broadcast_to(
            motion.velocity_m_s, np.broadcast_shapes(motion.velocity_m_s.shape, dt.shape)
        ),
        attitude=frame_rotation(motion.rate_rad_s * dt) @ motion.attitude,
        rate_rad_s=np.broadcast_to(
            motion.rate_rad_s, np.broadcast_shapes(motion.rate_rad_s.shape, dt.shape)
        ),
    )


def crude_attitude_rate(earlier: ArrayLike, later: ArrayLike, dt_s: float) -> Array:
    """Return the angular rate (3,) from A(k) A(k-1)^T (PI83 p. 38).

    Raises ValueError when the attitude changed by more than 90 deg: the turn may have gone the
    other way round.
    """
    _require_positive(dt_s)
    turn = rotation_vector(
        np.asarray(later, dtype=np.float64) @ np.asarray(earlier, dtype=np.float64).T
    )
    angle = float(np.linalg.norm(turn))
    # Beyond it sampling no longer shows which way round the body turned.
    if angle > math.pi / 2.0:
        raise ValueError(
            f"attitude changed by {math.degrees(angle):.4g} deg between samples, must be <= 90 deg"
        )
    return turn / dt_s


def _require_positive(dt_s: float) -> None:
    require_finite("dt_s", dt_s)
    if dt_s <= 0.0:
        raise ValueError(f"dt_s={dt_s} must be > 0")


@dataclass(frozen=True, kw_only=True)
class DockingApproach(Params):
    """A straight approach slowing down to the docking range, both bodies swaying slowly.

    The demonstration of the simulated source.
    """

    start_range_m: float = parameter(2000.0, "range at time zero", low=1.0, high=1e5)
    dock_range_m: float = parameter(5.0, "range approached in the end", low=0.1, high=1e4)
    time_constant_s: float = parameter(
        1200.0, "time in which the remaining way shrinks by e", low=1.0, high=1e6
    )
    azimuth_rad: float = parameter(
        math.radians(8.0), "mean direction of the passive spacecraft", low=-1.2, high=1.2
    )
    elevation_rad: float = parameter(
        math.radians(-5.0), "mean direction, above", low=-1.2, high=1.2
    )
    attitude_azimuth_rad: float = parameter(
        math.radians(10.0), "mean attitude; zero: same heading", low=-1.2, high=1.2
    )
    sway_m: float = parameter(0.5, "amplitude of the sideways swaying", low=0.0, high=100.0)
    sway_rad: float = parameter(
        math.radians(3.0), "amplitude of the swaying attitude", low=0.0, high=0.5
    )
    sway_period_s: float = parameter(240.0, "period of the swaying", low=1.0, high=1e5)
    roll_rate_rad_s: float = parameter(
        math.radians(0.2), "steady roll of the passive spacecraft", low=-0.1, high=0.1
    )

    def check_together(self) -> None:
        """Refuse an approach that moves away."""
        if self.dock_range_m >= self.start_range_m:
            raise ValueError(
                f"dock_range_m={self.dock_range_m} must be < start_range_m={self.start_range_m}"
            )

    def pose_at(self, t_s: float) -> tuple[Array, Array]:
        """Return position (3,) and A (3, 3) at `t_s` after the start."""
        phase = 2.0 * math.pi * t_s / self.sway_period_s
        shrunk = math.exp(-t_s / self.time_constant_s)
        distance = self.dock_range_m + (self.start_range_m - self.dock_range_m) * shrunk
        sideways = self.sway_m * np.array([0.0, math.sin(phase), math.cos(phase)])
        # Frequencies in no simple ratio, so that the swaying of the axes never repeats together.
        attitude = attitude_from_euler(
            self.attitude_azimuth_rad + self.sway_rad * math.cos(0.7 * phase),
            self.sway_rad * math.sin(1.3 * phase),
            self.roll_rate_rad_s * t_s,
        )
        return distance * direction_from_angles(
            self.azimuth_rad, self.elevation_rad
        ) + sideways, attitude

    def motion_at(self, t_s: float) -> RelativeMotion:
        """Return pose and rates at `t_s`, rates as central differences over 20 ms."""
        # Central differences: the approach is smooth, and the error is below 1e-6 of the rates.
        step = 0.01
        (before, attitude_before), (after, attitude_after) = (
            self.pose_at(t_s - step),
            self.pose_at(t_s + step),
        )
        position, attitude = self.pose_at(t_s)
        return RelativeMotion(
            position_m=position,
            velocity_m_s=(after - before) / (2.0 * step),
            attitude=attitude,
            rate_rad_s=crude_attitude_rate(attitude_before, attitude_after, 2.0 * step),
        )
