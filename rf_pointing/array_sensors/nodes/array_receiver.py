"""Executable `array_receiver`: simulated array of patches on the simulated dish.

Subscribes: sim/pointing_error (truth: where the target is off the beam, and its level).
Publishes: array_snapshots (10 Hz, complex samples of every patch).
Parameters: array.* (from the station description), receiver.* (seed).
"""

from rf_pointing_msgs.msg import ArraySnapshots, PointingError

from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock
from rf_pointing.array_sensors.doa.dish_array import SimulatedDishArray
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.ros.convert import error_from_message
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.station_node import StationNode


class ArrayReceiver(StationNode):
    """Turns the true direction of the target into samples of every patch."""

    def __init__(self) -> None:
        super().__init__("array_receiver")
        self._array: SimulatedDishArray | None = None

    def configure(self) -> None:
        self._array = SimulatedDishArray(
            self.parameters.value("array"), self.parameters.value("receiver").seed
        )
        self._snapshots = self.stream(ArraySnapshots, "array_snapshots", STREAM)
        self.listen(PointingError, "sim/pointing_error", self._on_truth, STREAM, required=True)

    def _on_truth(self, message: PointingError) -> None:
        if self.active:
            block = self._array.receive(error_from_message(message))
            self._snapshots.publish(
                convert.snapshots_to_message(ChannelBlock(transmitters=(), block=block))
            )


def main() -> None:
    """Entry point of `ros2 run rf_pointing array_receiver`."""
    run(ArrayReceiver)
