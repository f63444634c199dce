"""Executable `conscan_tracker`: pointing error from carrier power while the beam is scanned.

Subscribes: carrier_power, joint_states, tracking_status (scan centre).
Publishes: pointing_error (once a window; in between invalid ones that carry the C/N0).
Parameters: conscan.*, the same scan as the pointing controller's.
"""

from rclpy.serialization import deserialize_message
from rf_pointing_msgs.msg import CarrierPower, PointingError, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import OK, WARN, Health
from rf_pointing.nodes.managed import ManagedNode, run
from rf_pointing.nodes.qos import STREAM
from rf_pointing.station.beam_position import ConscanPositions
from rf_pointing.tracking import ConscanParams, ConscanTracker


class ConscanTrackerNode(ManagedNode):
    """Puts every carrier power where the beam was, and estimates when a window is full."""

    def __init__(self) -> None:
        super().__init__("conscan_tracker")
        self.parameters.declare("conscan", ConscanParams())
        self._positions: ConscanPositions | None = None
        self._active = False
        self._refused = ""

    def configure(self) -> None:
        self._positions = ConscanPositions(ConscanTracker(self.parameters.value("conscan")))
        self._errors = self.stream(PointingError, "pointing_error", STREAM)
        self.listen(CarrierPower, "carrier_power", self._on_power, STREAM)
        self.listen(JointState, "joint_states", self._on_joints, STREAM, raw=True)
        self.listen(TrackingStatus, "tracking_status", self._on_status, STREAM)
        self.diagnostics.add("samples", self._health)

    def activate(self) -> None:
        self._active = True

    def deactivate(self) -> None:
        self._active = False

    def _on_joints(self, raw: bytes) -> None:
        if not self._positions.scanning:
            return
        try:
            self._positions.take_joints(convert.joints_from_message(deserialize_message(raw, JointState)))
        except ValueError as refusal:
            self._refused = str(refusal)

    def _on_status(self, message: TrackingStatus) -> None:
        self._positions.take_status(*convert.scan_centre_from_message(message))

    def _on_power(self, message: CarrierPower) -> None:
        if self._active:
            for error in self._positions.take_power(convert.power_from_message(message)):
                self._errors.publish(convert.error_to_message(error))

    def _health(self) -> Health:
        state = self._positions.tracker.state
        reason = self._refused or state.last_rejection
        return Health(WARN if reason else OK, reason or "samples are used", {"rejected": state.rejected})


def main() -> None:
    """Entry point of `ros2 run rf_pointing conscan_tracker`."""
    run(ConscanTrackerNode)
