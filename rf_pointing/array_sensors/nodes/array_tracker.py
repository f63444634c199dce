"""Executable `array_tracker`: pointing error of a dish from the array of patches on it.

Subscribes: array_snapshots.
Publishes: pointing_error (one for every block; invalid ones carry their reason).
Parameters: array.* (from the station description).
"""

from rf_pointing_msgs.msg import ArraySnapshots, PointingError

from rf_pointing.array_sensors.doa.dish_array import DishArrayTracker
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.ros.convert import error_to_message
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.station_node import StationNode


class ArrayTracker(StationNode):
    """Measures; whether the antenna acts on it is the pointing controller's business."""

    def __init__(self) -> None:
        super().__init__("array_tracker")
        self._tracker: DishArrayTracker | None = None

    def configure(self) -> None:
        self._tracker = DishArrayTracker(self.parameters.value("array"))
        self._errors = self.stream(PointingError, "pointing_error", STREAM)
        self.listen(ArraySnapshots, "array_snapshots", self._on_snapshots, STREAM, required=True)
        self.diagnostics.add("blocks", self._health)

    def _on_snapshots(self, message: ArraySnapshots) -> None:
        if self.active:
            error = self._tracker.measure(convert.snapshots_from_message(message).block)
            self._errors.publish(error_to_message(error))

    def _health(self) -> Health:
        reason = self._tracker.last_reason
        return Health(
            WARN if reason else OK, reason or "errors are valid", dict(self._tracker.counts)
        )


def main() -> None:
    """Entry point of `ros2 run rf_pointing array_tracker`."""
    run(ArrayTracker)
