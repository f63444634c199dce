"""Health of a node on /diagnostics once a second, in the form of REP-107."""

from collections.abc import Callable
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from rf_pointing.nodes.qos import STREAM

OK, WARN, ERROR = LEVELS = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@dataclass
class Health:
    """Result of one check: a level, a sentence and the numbers behind it."""

    level: bytes = OK
    message: str = "ok"
    values: dict[str, object] = field(default_factory=dict)


class Diagnostics:
    """Publishes every registered check once a second of wall time."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._checks: dict[str, Callable[[], Health]] = {}
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
        # Wall time, so that a stopped simulation clock shows.
        self._timer = node.create_timer(1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def add(self, name: str, check: Callable[[], Health]) -> None:
        """Register `check` as the subcomponent `name`."""
        self._checks[name] = check

    def publish(self) -> None:
        """Run the checks and publish them now."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        full_name = self._node.get_fully_qualified_name()
        for name, check in self._checks.items():
            try:
                health = check()
            except ValueError as error:
                # An error of the subject, not of the node.
                health = Health(ERROR, str(error))
            status = DiagnosticStatus(level=health.level, name=f"{full_name.lstrip('/')}: {name}")
            # The full name: two antennas share the topic /diagnostics.
            status.message, status.hardware_id = health.message, full_name
            status.values = [KeyValue(key=key, value=str(value)) for key, value in health.values.items()]
            array.status.append(status)
        self._publisher.publish(array)
