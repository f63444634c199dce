"""Executable `interferometer_source`: simulated approach of two spacecraft, and their radio.

Publishes: interferometer_measurement (one for every sequence of carriers, when it has ended),
sim/relative_pose (geometry_msgs/PoseWithCovarianceStamped) and sim/relative_twist
(geometry_msgs/TwistWithCovarianceStamped), the truth in the middle of each sequence, with zero
covariance.
Parameters: source.* (period, seed), arrays.*, plan.*, schedule.*, radio.*, link.*, approach.*
(truth).
"""

from dataclasses import dataclass

from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rf_pointing_msgs.msg import InterferometerMeasurement

from rf_pointing.array_sensors.interferometer.docking import SimulatedDocking, true_pose
from rf_pointing.array_sensors.interferometer.motion import DockingApproach
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    CarrierPlan,
    InterferometerSystem,
    Schedule,
)
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.core import Params, parameter
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


@dataclass(frozen=True, kw_only=True)
class SequenceTiming(Params):
    """When sequences are sent."""

    period_s: float = parameter(2.0, "time between the ends of two sequences", low=0.01, high=600.0)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


class InterferometerSourceNode(ManagedNode):
    """The approach begins when the node is activated."""

    def __init__(self) -> None:
        super().__init__("interferometer_source")
        declare(
            self, source=SequenceTiming(), arrays=ArrayParams(), plan=CarrierPlan(),
            schedule=Schedule(), radio=RadioParams(), link=LinkParams(), approach=DockingApproach(),
        )  # fmt: skip
        self._simulated: SimulatedDocking | None = None
        self._sequences = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        duration_s, period_s = value("schedule").duration_s(value("plan")), value("source").period_s
        if period_s < duration_s:
            raise ValueError(f"source.period_s={period_s} must be >= the sequence's {duration_s} s")
        self._measurements = self.stream(
            InterferometerMeasurement, "interferometer_measurement", STREAM
        )
        self._true_pose = self.publisher(PoseWithCovarianceStamped, "sim/relative_pose", STREAM)
        self._true_twist = self.publisher(TwistWithCovarianceStamped, "sim/relative_twist", STREAM)
        self.diagnostics.add("sequences", self._sequences.health)

    def activate(self) -> None:
        value = self.parameters.value
        self._simulated = SimulatedDocking(
            InterferometerSystem(
                arrays=value("arrays"), plan=value("plan"), schedule=value("schedule")
            ),
            value("radio"),
            value("link"),
            value("approach"),
            start_s=self.now_s(),
            seed=value("source").seed,
        )
        self._sequences.open = True
        self.every(
            value("source").period_s, lambda t_s: self._sequences.take(lambda: self._send(t_s))
        )

    def deactivate(self) -> None:
        self._sequences.open = False

    def _send(self, t_s: float) -> str:
        moment = self._simulated.step(t_s)
        pose, twist = convert.pose_to_messages(moment.measurement.t_s, true_pose(moment.motion))
        self._true_pose.publish(pose)
        self._true_twist.publish(twist)
        self._measurements.publish(convert.sequence_to_message(moment.measurement))
        lost = int((~moment.measurement.locked).sum())
        return f"{lost} loops without lock" if lost else ""


def main() -> None:
    """Entry point of `ros2 run rf_pointing interferometer_source`."""
    run(InterferometerSourceNode)
