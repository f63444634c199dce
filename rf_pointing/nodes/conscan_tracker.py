"""Executable `conscan_tracker`: pointing error from carrier power while the beam is moved.

Subscribes: carrier_power, joint_states, tracking_status (scan centre, mode).
Publishes: pointing_error (one for every power once a window is filled; until then invalid ones
with the C/N0).
Parameters: conscan.*, steptrack.*, the same patterns as the pointing controller's.
"""

from rf_pointing_msgs.msg import CarrierPower, PointingError, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import checked_message
from rf_pointing.tracking.power_tracker import NODE, PowerTracker, PowerTrackerParams


class ConscanTrackerNode(StationNode):
    """Puts every carrier power where the beam was, and estimates when there are enough."""

    def __init__(self) -> None:
        super().__init__(NODE)
        self._tracker: PowerTracker | None = None
        self._counts = {"valid": 0, "invalid": 0}

    def configure(self) -> None:
        self.use_band()
        self._errors = self.stream(PointingError, "pointing_error", STREAM)
        self.listen(CarrierPower, "carrier_power", self._on_power, STREAM, required=True)
        self.listen(JointState, "joint_states", self._on_joints, STREAM, raw=True, required=True)
        self.listen(TrackingStatus, "tracking_status", self._on_status, STREAM, required=True)
        self.diagnostics.add("samples", self._health)

    def use_band(self) -> None:
        sets = PowerTrackerParams().sets()
        self._tracker = PowerTracker(PowerTrackerParams(**{prefix: self.parameters.value(prefix) for prefix in sets}))

    def _on_joints(self, raw: bytes) -> None:
        if self._tracker.scanning:
            self._tracker.take_joints(convert.joints_from_message(checked_message(raw, JointState)))

    def _on_status(self, message: TrackingStatus) -> None:
        self._tracker.take_status(*convert.scan_centre_from_message(message))

    def _on_power(self, message: CarrierPower) -> None:
        if self.active:
            for error in self._tracker.take_power(convert.power_from_message(message)):
                if error.estimated:
                    self._counts["valid" if error.valid else "invalid"] += 1
                self._errors.publish(convert.error_to_message(error))

    def _health(self) -> Health:
        rejected, reason = self._tracker.rejections
        values = {**self._counts, "rejected": rejected, "delay_s": round(self._tracker.delay_s, 4)}
        sound = "samples are used" if any(self._counts.values()) else "no sample yet"
        return Health(WARN if reason else OK, reason or sound, values)


main = ConscanTrackerNode.main
