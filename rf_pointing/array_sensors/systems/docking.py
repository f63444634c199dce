"""Two spacecraft that find each other by the polarized interferometer: the simulated approach, and the pose with a clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams
from rf_pointing.array_sensors.arrays.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.arrays.interferometer.motion import DockingApproach, RelativeMotion
from rf_pointing.array_sensors.arrays.interferometer.rep103 import Rep103Pose, rep103_pose
from rf_pointing.array_sensors.arrays.interferometer.rf_simulation import RadioParams
from rf_pointing.array_sensors.arrays.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.arrays.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.arrays.interferometer.tracker import (
    InterferometerTracker,
    PoseEstimate,
    TrackerOutput,
    TrackerState,
)
from rf_pointing.array_sensors.systems.arrival import require_arrived

__all__ = ["DockingMoment", "RelativePoseTracker", "SimulatedDocking", "true_pose"]

Array = NDArray[np.float64]


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

    What `watch` gives is a forecast and leaves the state where the last measurement put it, so that a measurement that
    was only delayed still counts, however late the silence was noticed.
    """

    def __init__(self, tracker: InterferometerTracker, silence_s: float) -> None:
        self.tracker = tracker
        self.state = TrackerState()
        self._silence_s = silence_s
        self._latest_s: float | None = None

    def take(self, measurement: InterferometerMeasurement, now_s: float) -> TrackerOutput:
        """Return the output after `measurement`; ValueError if it is late, repeated or ahead of the clock."""
        require_arrived(measurement.t_s, now_s)
        if self._latest_s is not None and measurement.t_s <= self._latest_s:
            raise ValueError(f"t_s={measurement.t_s} is late: the pose is already at {self._latest_s}")
        self.state, output = self.tracker.step(self.state, measurement)
        self._latest_s = measurement.t_s
        return output

    def watch(self, t_s: float) -> TrackerOutput | None:
        """Return the output carried on to `t_s` if nothing came for too long, else None; past the limit drop the pose."""
        if self._latest_s is None or t_s - self._latest_s <= self._silence_s:
            return None
        reason = f"no measurement for {t_s - self._latest_s:.6g} s, must be <= {self._silence_s} s"
        state, output = self.tracker.coast(self.state, t_s, reason)
        if output.estimate is None:
            self.state = state
        return output


def true_pose(motion: RelativeMotion) -> Rep103Pose:
    """Return a true motion in REP-103 axes, with zero covariance."""
    exact = PoseEstimate(t_s=0.0, motion=motion, covariance=np.zeros((12, 12)), excitation=np.ones(2))
    return rep103_pose(exact)
