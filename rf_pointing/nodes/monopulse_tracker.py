"""Executable `monopulse_tracker`: pointing error from the sum and difference samples of one cluster.

Subscribes: monopulse.  Publishes: pointing_error (one for every cluster; invalid ones carry their reason).
Parameters: monopulse.*.
"""

from rf_pointing_msgs.msg import Monopulse, PointingError

from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import OK, WARN, Health
from rf_pointing.nodes.managed import ManagedNode, run
from rf_pointing.nodes.qos import STREAM
from rf_pointing.tracking import MonopulseParams, MonopulseTracker


class MonopulseTrackerNode(ManagedNode):
    """Measures; whether the antenna acts on it is the pointing controller's business."""

    def __init__(self) -> None:
        super().__init__("monopulse_tracker")
        self.parameters.declare("monopulse", MonopulseParams())
        self.parameters.on_change(self._retune)
        self._tracker: MonopulseTracker | None = None
        self._active = False
        self._counts = {"valid": 0, "invalid": 0, "rejected": 0, "last_reason": ""}

    def configure(self) -> None:
        self._retune()
        self._errors = self.stream(PointingError, "pointing_error", STREAM)
        self.listen(Monopulse, "monopulse", self._on_cluster, STREAM)
        self.diagnostics.add("clusters", self._health)

    def activate(self) -> None:
        self._active = True

    def deactivate(self) -> None:
        self._active = False

    def _on_cluster(self, message: Monopulse) -> None:
        if not self._active:
            return
        try:
            error = self._tracker.measure(convert.monopulse_from_message(message))
        except ValueError as refusal:
            self._counts["rejected"] += 1
            self._counts["last_reason"] = str(refusal)
            return
        self._counts["valid" if error.valid else "invalid"] += 1
        self._counts["last_reason"] = error.reason
        self._errors.publish(convert.error_to_message(error))

    def _retune(self) -> None:
        self._tracker = MonopulseTracker(self.parameters.value("monopulse"))

    def _health(self) -> Health:
        reason = self._counts["last_reason"]
        return Health(WARN if reason else OK, reason or "errors are valid", dict(self._counts))


def main() -> None:
    """Entry point of `ros2 run rf_pointing monopulse_tracker`."""
    run(MonopulseTrackerNode)
