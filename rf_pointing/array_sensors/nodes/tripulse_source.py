"""Executable `tripulse_source`: simulated satellite with its array, and the link to every station.

Publishes: <station>/tripulse_frame (one each period), sim/attitude
(geometry_msgs/QuaternionStamped, truth).
Parameters: source.* (period, seed), array.*, signal.*, link.*, orbit.*, stations.*, scene.*,
wobble.* (the true attitude errors).
"""

from dataclasses import dataclass

from geometry_msgs.msg import QuaternionStamped
from rf_pointing_msgs.msg import TripulseFrame

from rf_pointing.array_sensors.attitude.pass_scene import pass_scene, scene_params
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.geostationary_scene import GeostationaryParams, WobbleParams
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.array_sensors.tripulse.system import SimulatedTripulse
from rf_pointing.core import Params, parameter
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


@dataclass(frozen=True, kw_only=True)
class SendingParams(Params):
    """When the satellite sends."""

    period_s: float = parameter(1.0, "time between two frames", low=0.01, high=3600.0)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


class TripulseSourceNode(ManagedNode):
    """Sends one frame to every station each period.

    Without a line of sight to all of them it says so and waits.
    """

    def __init__(self) -> None:
        super().__init__("tripulse_source")
        declare(
            self, source=SendingParams(), array=TripulseArrayParams(),
            signal=TripulseSignalParams(), link=TripulseSourceParams(), **scene_params(GeostationaryParams()),
            wobble=WobbleParams(),
        )  # fmt: skip
        self._simulated: SimulatedTripulse | None = None
        self._sending = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        orbit, stations = pass_scene(value("scene"), value("orbit"), value("stations"))
        self._simulated = SimulatedTripulse(
            value("array"),
            value("signal"),
            value("link"),
            orbit,
            value("wobble"),
            stations,
            value("source").seed,
        )
        self._frames = {
            s.name: self.stream(TripulseFrame, f"{s.name}/tripulse_frame", STREAM) for s in stations
        }
        self._truth = self.publisher(QuaternionStamped, "sim/attitude", STREAM)
        self.diagnostics.add("frames", self._sending.health)

    def activate(self) -> None:
        self._sending.open = True
        self.every(
            self.parameters.value("source").period_s,
            lambda t_s: self._sending.take(lambda: self._send(t_s)),
        )

    def deactivate(self) -> None:
        self._sending.open = False

    def _send(self, t_s: float) -> str:
        sent = self._simulated.step(t_s)
        self._truth.publish(
            convert.orientation_to_message(t_s, sent.moment.quaternion, convert.ORBIT_FRAME)
        )
        for frame in sent.frames:
            message = convert.frame_to_message(
                frame, self.parameters.value("signal").sample_rate_hz
            )
            self._frames[frame.station].publish(message)
        return ""


def main() -> None:
    """Entry point of `ros2 run rf_pointing tripulse_source`."""
    run(TripulseSourceNode)
