"""Executable `doa_attitude`: attitude and rate of a satellite from directions of ground stations.

Subscribes: array_snapshots, known_torque.
Publishes: attitude (one for every block; invalid ones carry their reason), attitude_rate
(geometry_msgs/TwistWithCovarianceStamped, with every valid attitude).
Parameters: array.*, response.* (as calibrated), estimator.*, orbit.*, stations.*, scene.*,
satellite.*, filter.*, start.*, noise.*, gate.*, watch.*, chain.*.
"""

from geometry_msgs.msg import TwistWithCovarianceStamped
from rf_pointing_msgs.msg import ArraySnapshots, Attitude, KnownTorque

from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.pass_scene import pass_scene, scene_params
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import CircularArrayParams, ResponseParams
from rf_pointing.array_sensors.doa.attitude_chain import (
    DoaAttitude,
    DoaAttitudeReport,
    DoaChainParams,
)
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM

SILENCE_S = 2.0
"""Without a block for this long, the attitude is carried on by the known torques and published all
the same."""


class DoaAttitudeNode(ManagedNode):
    """Works on the stamps of what arrives; a timer only notices silence."""

    def __init__(self) -> None:
        super().__init__("doa_attitude")
        declare(
            self, array=CircularArrayParams(), estimator=DoaEstimatorParams(),
            response=ResponseParams(), **scene_params(SunSynchronousOrbitParams()), satellite=SatelliteParams(),
            filter=DoaAttitudeParams(), start=StartParams(), noise=ProcessNoiseParams(),
            gate=GateParams(), watch=WatchParams(), chain=DoaChainParams(),
        )  # fmt: skip
        self._chain: DoaAttitude | None = None
        self._blocks, self._torques = InputOutcomes(), InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        self._chain = DoaAttitude(
            value("array"),
            value("estimator"),
            *pass_scene(value("scene"), value("orbit"), value("stations")),
            value("satellite"),
            (value("filter"), value("start"), value("noise"), value("gate"), value("watch")),
            value("chain"),
            response=value("response").response(value("array").elements),
        )
        self._attitudes = self.stream(Attitude, "attitude", STREAM)
        self._rates = self.publisher(TwistWithCovarianceStamped, "attitude_rate", STREAM)
        self.listen(
            KnownTorque,
            "known_torque",
            lambda m: self._torques.take(lambda: self._on_torque(m)),
            STREAM,
        )
        self.listen(
            ArraySnapshots,
            "array_snapshots",
            lambda m: self._blocks.take(lambda: self._on_block(m)),
            STREAM,
            required=True,
        )
        self.diagnostics.add("blocks", self._blocks.health)
        self.diagnostics.add("torques", self._torques.health)

    def activate(self) -> None:
        self._blocks.open = self._torques.open = True
        # Half of it: the silence is noticed at most 1.5 times its length after the last block.
        self.every(0.5 * SILENCE_S, lambda t_s: self._watch(t_s))

    def deactivate(self) -> None:
        self._blocks.open = self._torques.open = False

    def _on_torque(self, message: KnownTorque) -> str:
        self._chain.take_torque(convert.torque_from_message(message), self.now_s())
        return ""

    def _on_block(self, message: ArraySnapshots) -> str:
        report = self._chain.take_block(convert.snapshots_from_message(message), self.now_s())
        self._publish(report)
        return "; ".join([*report.refused, report.attitude.reason]).strip("; ")

    def _watch(self, t_s: float) -> None:
        last_s = self._chain.time_s
        if last_s is not None and t_s - last_s > SILENCE_S:
            self._blocks.take(lambda: self._coast(t_s - SILENCE_S))

    def _coast(self, t_s: float) -> str:
        # Not up to now: a block that is late by less than the silence must still find the filter
        # before it.
        self._publish(self._chain.coast(t_s))
        return f"no block for more than {SILENCE_S} s"

    def _publish(self, report: DoaAttitudeReport) -> None:
        self._attitudes.publish(convert.attitude_to_message(report.attitude, convert.BODY_FRAME))
        if report.attitude.valid:
            self._rates.publish(convert.rate_to_message(report.rate))


def main() -> None:
    """Entry point of `ros2 run rf_pointing doa_attitude`."""
    run(DoaAttitudeNode)
