"""Executable `tripulse_receiver`: a ground station, from a frame of samples to the line of sight.

Runs once in the namespace of every station.
Subscribes: tripulse_frame.
Publishes: tripulse_measurement (one for every frame; invalid ones carry their reason).
Parameters: station.name, array.*, signal.* (as the satellite sends), receiver.*, tracker.*.
"""

from dataclasses import dataclass
from pathlib import PurePosixPath

from rf_pointing_msgs.msg import TripulseFrame, TripulseMeasurement

from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.receiver import TripulseReceiver, TripulseReceiverParams
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.tracker import TrackerParams
from rf_pointing.core import Params, parameter
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


@dataclass(frozen=True, kw_only=True)
class StationParams(Params):
    """Whose receiver it is."""

    name: str = parameter("", "name of the station; empty: the last part of the node's namespace")


class TripulseReceiverNode(ManagedNode):
    """Acquires every frame anew, so that a lost one costs nothing later."""

    def __init__(self) -> None:
        super().__init__("tripulse_receiver")
        declare(
            self, station=StationParams(), receiver=TripulseReceiverParams(),
            array=TripulseArrayParams(), signal=TripulseSignalParams(), tracker=TrackerParams(),
        )  # fmt: skip
        self._receiver: TripulseReceiver | None = None
        self._station = ""
        self._frames = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        self._station = value("station").name or PurePosixPath(self.get_namespace()).name
        if not self._station:
            raise ValueError(
                "station.name='' must name the station, or the node must run in the station's namespace"
            )
        self._receiver = TripulseReceiver(
            array=value("array"),
            signal=value("signal"),
            params=value("receiver"),
            tracker=value("tracker"),
        )
        self._measurements = self.stream(TripulseMeasurement, "tripulse_measurement", STREAM)
        self.listen(
            TripulseFrame,
            "tripulse_frame",
            lambda m: self._frames.take(lambda: self._measure(m)),
            STREAM,
            required=True,
        )
        self.diagnostics.add("frames", self._frames.health)

    def activate(self) -> None:
        self._frames.open = True

    def deactivate(self) -> None:
        self._frames.open = False

    def _measure(self, message: TripulseFrame) -> str:
        frame = convert.frame_from_message(message, self._receiver.signal.sample_rate_hz)
        if frame.station != self._station:
            raise ValueError(f"station={frame.station!r} must be {self._station!r}")
        measured = self._receiver.measure(frame)
        self._measurements.publish(convert.line_to_message(measured))
        return measured.reason


def main() -> None:
    """Entry point of `ros2 run rf_pointing tripulse_receiver`."""
    run(TripulseReceiverNode)
