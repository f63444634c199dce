"""Executable `doa_source`: simulated satellite whose array receives ground stations.

Publishes: array_snapshots (one block each period while a station is received), known_torque (each
period), sim/attitude (geometry_msgs/QuaternionStamped, truth), sim/attitude_rate
(geometry_msgs/Vector3Stamped, truth).
Parameters: source.* (period, seed), array.*, receiver.*, orbit.*, stations.*, scene.*,
satellite.*, and the truth that the filter does not know: response.* (of the array), scenario.*
(link, access, true start), hold.* (attitude control), disturbance.*.
"""

from dataclasses import dataclass

from geometry_msgs.msg import QuaternionStamped, Vector3Stamped
from rf_pointing_msgs.msg import ArraySnapshots, KnownTorque

from rf_pointing.array_sensors.attitude.multiplicative_filter import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.pass_scene import pass_scene, scene_params
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import CircularArrayParams, ResponseParams
from rf_pointing.array_sensors.doa.array_source import ArraySourceParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.core import Params, parameter
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


@dataclass(frozen=True, kw_only=True)
class BlockParams(Params):
    """When blocks are taken."""

    period_s: float = parameter(0.25, "time between two blocks of snapshots", low=0.01, high=10.0)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


class DoaSource(ManagedNode):
    """Steps the satellite each period and publishes what it knows and what its array receives."""

    def __init__(self) -> None:
        super().__init__("doa_source")
        declare(
            self, source=BlockParams(), array=CircularArrayParams(), receiver=ArraySourceParams(),
            response=ResponseParams(), **scene_params(SunSynchronousOrbitParams()),
            satellite=SatelliteParams(), scenario=DoaScenarioParams(), hold=NadirHoldParams(),
            disturbance=ProcessNoiseParams(),
        )  # fmt: skip
        self._simulated: SimulatedDoa | None = None
        self._blocks = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        self._simulated = SimulatedDoa(
            value("array"),
            value("receiver"),
            *pass_scene(value("scene"), value("orbit"), value("stations")),
            value("satellite"),
            value("hold"),
            value("disturbance"),
            value("scenario"),
            value("source").seed,
            response=value("response").response(value("array").elements),
        )
        self._snapshots = self.stream(ArraySnapshots, "array_snapshots", STREAM)
        self._torques = self.stream(KnownTorque, "known_torque", STREAM)
        self._true_attitude = self.publisher(QuaternionStamped, "sim/attitude", STREAM)
        self._true_rate = self.publisher(Vector3Stamped, "sim/attitude_rate", STREAM)
        self.diagnostics.add("blocks", self._blocks.health)

    def activate(self) -> None:
        self._blocks.open = True
        self.every(
            self.parameters.value("source").period_s,
            lambda t_s: self._blocks.take(lambda: self._step(t_s)),
        )

    def deactivate(self) -> None:
        self._blocks.open = False

    def _step(self, t_s: float) -> str:
        moment = self._simulated.step(t_s)
        truth = moment.truth
        self._true_attitude.publish(
            convert.orientation_to_message(t_s, truth.quaternion, convert.ORBIT_FRAME)
        )
        self._true_rate.publish(
            convert.vector_to_message(t_s, truth.rate_rad_s, convert.BODY_FRAME)
        )
        self._torques.publish(convert.torque_to_message(moment.torque))
        if moment.heard is None:
            return "no station is above its horizon and in front of the array"
        self._snapshots.publish(convert.snapshots_to_message(moment.heard))
        return ""


def main() -> None:
    """Entry point of `ros2 run rf_pointing doa_source`."""
    run(DoaSource)
