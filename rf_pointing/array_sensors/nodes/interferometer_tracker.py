"""Executable `interferometer_tracker`: pose and motion of the passive spacecraft.

Subscribes: interferometer_measurement.
Publishes: relative_pose (geometry_msgs/PoseWithCovarianceStamped) and relative_twist
(geometry_msgs/TwistWithCovarianceStamped) while there is a pose, relative_pose_status always.
Parameters: tracking.silence_s, arrays.*, plan.*, schedule.* (as the source sends), tracker.*,
filter.*, floor.*; radio.* and link.* (what the links are expected to give).
"""

from dataclasses import dataclass

from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rf_pointing_msgs.msg import InterferometerMeasurement, RelativePoseStatus

from rf_pointing.array_sensors.interferometer.docking import RelativePoseTracker, rep103_pose
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.rate_filter import FilterParams
from rf_pointing.array_sensors.interferometer.reading import ErrorFloor
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    CarrierPlan,
    InterferometerSystem,
    Schedule,
)
from rf_pointing.array_sensors.interferometer.tracker import (
    InterferometerTracker,
    TrackerOutput,
    TrackerParams,
)
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.core import Params, parameter
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


@dataclass(frozen=True, kw_only=True)
class TrackingParams(Params):
    """When silence is noticed."""

    silence_s: float = parameter(
        5.0, "time without a measurement after which the pose coasts", low=0.1, high=600.0
    )


class InterferometerTrackerNode(ManagedNode):
    """Works on the stamps of what arrives; a timer only notices silence."""

    def __init__(self) -> None:
        super().__init__("interferometer_tracker")
        declare(
            self, tracking=TrackingParams(), arrays=ArrayParams(), plan=CarrierPlan(),
            schedule=Schedule(), tracker=TrackerParams(), filter=FilterParams(), floor=ErrorFloor(),
            radio=RadioParams(), link=LinkParams(),
        )  # fmt: skip
        self._tracker: RelativePoseTracker | None = None
        self._sequences = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        tracker = InterferometerTracker(
            system=InterferometerSystem(
                arrays=value("arrays"), plan=value("plan"), schedule=value("schedule")
            ),
            params=value("tracker"),
            filter_params=value("filter"),
            floor=value("floor"),
            radio=value("radio"),
            link=value("link"),
        )
        self._tracker = RelativePoseTracker(tracker, value("tracking").silence_s)
        self._poses = self.publisher(PoseWithCovarianceStamped, "relative_pose", STREAM)
        self._twists = self.publisher(TwistWithCovarianceStamped, "relative_twist", STREAM)
        self._status = self.stream(RelativePoseStatus, "relative_pose_status", STREAM)
        self.listen(
            InterferometerMeasurement,
            "interferometer_measurement",
            lambda message: self._sequences.take(lambda: self._track(message)),
            STREAM,
            required=True,
        )
        self.diagnostics.add("sequences", self._sequences.health)

    def activate(self) -> None:
        self._sequences.open = True
        self.every(0.5 * self.parameters.value("tracking").silence_s, self._watch)

    def deactivate(self) -> None:
        self._sequences.open = False

    def _track(self, message: InterferometerMeasurement) -> str:
        output = self._tracker.take(convert.sequence_from_message(message), self.now_s())
        self._publish(output)
        return output.reason

    def _watch(self, t_s: float) -> None:
        output = self._tracker.watch(t_s)
        if output is not None:
            self._publish(output)
            self._sequences.take(lambda: output.reason)

    def _publish(self, output: TrackerOutput) -> None:
        self._status.publish(convert.status_to_message(output))
        if output.estimate is not None:
            pose, twist = convert.pose_to_messages(output.t_s, rep103_pose(output.estimate))
            self._poses.publish(pose)
            self._twists.publish(twist)


def main() -> None:
    """Entry point of `ros2 run rf_pointing interferometer_tracker`."""
    run(InterferometerTrackerNode)
