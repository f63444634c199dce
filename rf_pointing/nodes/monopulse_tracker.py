"""Executable `monopulse_tracker`: pointing error from sum and difference samples of one cluster.

Subscribes: monopulse; during a calibration scan joint_states and tracking_status.
Publishes: pointing_error (one for every cluster; invalid ones carry their reason).
Parameters: monopulse.*, calibration.*, calibration_file (empty: the ideal feed; read at
configuration if it exists, written after every calibration scan; of another band than the default,
its name ends in the band).
"""

from pathlib import Path

from rf_pointing_msgs.msg import Monopulse, PointingError, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.core import Sensor
from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import checked_message
from rf_pointing.tracking.cluster_tracker import ClusterTracker


class MonopulseTrackerNode(StationNode):
    """Measures; whether the antenna acts on it is the pointing controller's business."""

    def __init__(self) -> None:
        super().__init__("monopulse_tracker", live={Sensor.MONOPULSE.value: True})
        self.parameters.on_change(self._retune)
        self._tracker: ClusterTracker | None = None

    def configure(self) -> None:
        self._reads_joints = False
        self.use_band()
        self._errors = self.stream(PointingError, "pointing_error", STREAM)
        self.listen(Monopulse, "monopulse", self._on_cluster, STREAM, required=True)
        self.listen(TrackingStatus, "tracking_status", self._on_status, STREAM, required=True)
        self.diagnostics.add("clusters", self._health)
        self.diagnostics.add("calibration", self._calibration_health)

    def use_band(self) -> None:
        value, file = self.parameters.value, self.parameters.value("").calibration_file
        if file and self.band != self.station.default_band:
            # Each band has a feed of its own.
            file = str(Path(file).with_stem(f"{Path(file).stem}_{self.band}"))
        self._tracker = ClusterTracker(value("monopulse"), value("calibration"), file)

    def _on_cluster(self, message: Monopulse) -> None:
        if self.active:
            error = self._tracker.take_cluster(convert.monopulse_from_message(message))
            self._errors.publish(convert.error_to_message(error))

    def _on_joints(self, raw: bytes) -> None:
        if self._tracker.calibrating:
            self._tracker.take_joints(convert.joints_from_message(checked_message(raw, JointState)))

    def _on_status(self, message: TrackingStatus) -> None:
        self._tracker.take_status(*convert.scan_centre_from_message(message)[:4])
        if self._tracker.calibrating and not self._reads_joints:
            self._reads_joints = True
            self.listen(JointState, "joint_states", self._on_joints, STREAM, raw=True)

    def _retune(self) -> None:
        if self._tracker is not None:
            self._tracker.retune(self.parameters.value("monopulse"))

    def _health(self) -> Health:
        reason = self._tracker.last_reason
        return Health(WARN if reason else OK, reason or "errors are valid", dict(self._tracker.counts))

    def _calibration_health(self) -> Health:
        outcome = self._tracker.outcome
        return Health(WARN if outcome.refused else OK, outcome.message, {"scans": outcome.scans})


main = MonopulseTrackerNode.main
