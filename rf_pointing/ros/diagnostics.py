"""Health of a node on /diagnostics once a second, in the form of REP-107."""

import math
import re
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from rf_pointing.core.signals import STANDBY
from rf_pointing.ros.qos import STREAM
from rf_pointing.station.pointing.status import Report

OK, WARN, ERROR = LEVELS = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
QUIET_S, SHORTEST_S, MOST_EVENTS = 60.0, 1.0, 200
PATIENCE_S = 3.0
"""How long a node waits for something before it says so: a graph takes as long to start."""
_NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")


@dataclass
class Health:
    """Result of one check: a level, a sentence and the numbers behind it."""

    level: bytes = OK
    message: str = "ok"
    values: dict[str, object] = field(default_factory=dict)


class EventLog:
    """Decides what is news: /rosout says an event once, however often it repeats.

    Numbers in the words do not make another event.  One that has not come for `QUIET_S` is news
    again, and each subject is news once in `SHORTEST_S` at most.
    """

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], float] = {}
        self._logged: dict[str, float] = {}

    def is_news(self, subject: str, words: str, wall_s: float) -> bool:
        """Return whether to log `words` about `subject`."""
        event = subject, _NUMBER.sub("#", words)
        repeated = wall_s - self._seen.pop(event, -math.inf) < QUIET_S
        if not repeated and wall_s - self._logged.get(subject, -math.inf) < SHORTEST_S:
            # Not noted, so that it is news when it lasts.
            return False
        # At the end: the first of the table is the one that has been silent the longest.
        self._seen[event] = wall_s
        if len(self._seen) > MOST_EVENTS:
            del self._seen[next(iter(self._seen))]
        if not repeated:
            self._logged[subject] = wall_s
        return not repeated


class Wait:
    """Decides when to say what a node waits for: once it has lasted, and when it has come."""

    def __init__(self) -> None:
        self._awaited, self._since_s, self._told = "", 0.0, ""

    def news(self, awaited: str, wall_s: float) -> str:
        """Return what to log now about what is `awaited`, "" for nothing."""
        if awaited != self._awaited:
            self._awaited, self._since_s = awaited, wall_s
        if awaited == self._told or (awaited and wall_s - self._since_s < PATIENCE_S):
            return ""
        self._told = awaited
        return f"waits for {awaited}" if awaited else "waits no longer"


class Diagnostics:
    """Publishes every check once a second of wall time; `writing` surrounds the write."""

    writing: Callable[[], AbstractContextManager[None]] = nullcontext

    def __init__(self, node: Node) -> None:
        self._node = node
        self._checks: dict[str, Callable[[], Health]] = {}
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
        # Wall time, so that a stopped simulation clock shows.
        self._timer = node.create_timer(1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def add(self, name: str, check: Callable[[], Health]) -> None:
        """Register `check` as the subcomponent `name`."""
        self._checks[name] = check

    def add_report(self, name: str, check: Callable[[], Report]) -> None:
        """Register the check of a part that knows nothing of ROS."""
        self._checks[name] = lambda: Health(LEVELS[(found := check()).level], found.message, found.values)

    def publish(self) -> None:
        """Run the checks and publish them now."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        full_name = self._node.get_fully_qualified_name() + STANDBY * getattr(self._node, "quiet", False)
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
        with self.writing():
            self._publisher.publish(array)
