"""Docking by the interferometer: simulated approach, tracker with a clock, pose in REP-103 axes.

REP-103: x forward, y left, z up.  Position and velocity are in the active body frame; the
orientation turns vectors of the passive body frame into it.  Rotations of the covariance are about
the active frame's fixed axes, as pose messages define it.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.attitude.attitude_report import require_arrived
from rf_pointing.array_sensors.interferometer.frames import rep103_from_spacecraft
from rf_pointing.array_sensors.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.interferometer.motion import DockingApproach, RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.interferometer.tracker import (
    InterferometerTracker,
    PoseEstimate,
    TrackerOutput,
    TrackerState,
)
from rf_pointing.core.types import Array

# From the report's axes (x boresight, y right, z down) to REP-103: y and z change their sign.
_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rep103Pose:
    """Position (3,), orientation (3, 3), their covariance (6, 6).

    Linear and angular velocity (3,), covariance (6, 6).  Angular velocity of the passive body
    relative to the active one, in the active frame like the linear one.
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
    # The filter's rotation error and rate are in the passive frame; pose messages want the active
    # one.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingMoment:
    """True motion in the middle of a sequence, and what was measured during it."""

    motion: RelativeMotion
    measurement: InterferometerMeasurement


class SimulatedDocking:
    """Approach and radio; the approach begins at `start_s`."""

    def __init__(
        self,
        system: InterferometerSystem,
        radio: RadioParams,
        link: LinkParams,
        approach: DockingApproach,
        *,
        start_s: float,
        seed: int,
    ) -> None:
        self._source = InterferometerSource(system, radio, link, seed)
        self._approach, self._start_s = approach, start_s
        self._half_s = 0.5 * system.schedule.duration_s(system.plan)

    def step(self, t_s: float) -> DockingMoment:
        """Return the sequence that ends at `t_s`; its measurement is stamped in its middle."""
        # Whole microseconds, as stamps have them: truth and measurement must share one time.
        middle_s = round(t_s - self._half_s, 6)
        motion = self._approach.motion_at(middle_s - self._start_s)
        return DockingMoment(motion=motion, measurement=self._source.measure(middle_s, motion))


class RelativePoseTracker:
    """The tracker with its state: `take` each measurement, `watch` the clock where none comes.

    What `watch` gives is a forecast and leaves the state where the last measurement put it, so that
    a measurement that was only delayed still counts, however late the silence was noticed.
    """

    def __init__(self, tracker: InterferometerTracker, silence_s: float) -> None:
        self.tracker = tracker
        self.state = TrackerState()
        self._silence_s = silence_s
        self._latest_s: float | None = None

    def take(self, measurement: InterferometerMeasurement, now_s: float) -> TrackerOutput:
        """Return the output after `measurement`.

        ValueError if it is late, repeated or ahead of the clock.
        """
        require_arrived(measurement.t_s, now_s)
        if self._latest_s is not None and measurement.t_s <= self._latest_s:
            raise ValueError(
                f"t_s={measurement.t_s} is late: the pose is already at {self._latest_s}"
            )
        self.state, output = self.tracker.step(self.state, measurement)
        self._latest_s = measurement.t_s
        return output

    def watch(self, t_s: float) -> TrackerOutput | None:
        """Return the output carried on to `t_s` if nothing came for too long, else None.

        Past the limit drop the pose.
        """
        if self._latest_s is None or t_s - self._latest_s <= self._silence_s:
            return None
        reason = f"no measurement for {t_s - self._latest_s:.6g} s, must be <= {self._silence_s} s"
        # A forecast: the state is kept only when the pose is dropped, or a delayed measurement
        # would be late for good.
        state, output = self.tracker.coast(self.state, t_s, reason)
        if output.estimate is None:
            self.state = state
        return output


def true_pose(motion: RelativeMotion) -> Rep103Pose:
    """Return a true motion in REP-103 axes, with zero covariance."""
    exact = PoseEstimate(
        t_s=0.0, motion=motion, covariance=np.zeros((12, 12)), excitation=np.ones(2)
    )
    return rep103_pose(exact)
