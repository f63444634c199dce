"""Watches of a node over the others: the executive, their clocks, their descriptions."""

import time
from collections import deque
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rf_pointing_msgs.msg import ExecutiveStatus, StationInUse

from rf_pointing.ros.diagnostics import ERROR, WARN, Health
from rf_pointing.ros.graph import EXECUTIVE_STATUS, STATION_IN_USE
from rf_pointing.ros.qos import STATUS, WATCHED
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode

EXECUTIVE_SILENT_S = 5.0
"""Wall time after which a silent executive is an error; it reports once a second."""
CLOCK_WARN_S = 0.02
"""Offset of a clock that is a warning: a low orbit moves by up to 20 mdeg meanwhile."""
CLOCK_ERROR_S = 0.1
"""Offset that is an error: commands begin 0.1 s ahead, so they would be in the antenna's past."""
CLOCK_SAMPLES, CLOCK_LEAST, CLOCK_AGE_S = 10, 5, 30.0
"""Messages of a node that count, those needed, and how old they may be."""
SHOWN_DIGITS = 12
"""Digits of a digest in a message to the operator."""


class ExecutiveWatch:
    """Notices an executive that has died in the middle of a night; its own alarms cannot say so."""

    def __init__(self, node: StationNode) -> None:
        self._seen_s: float | None = None
        self._state = ""
        node.listen(ExecutiveStatus, EXECUTIVE_STATUS, self._note, STATUS)
        node.diagnostics.add("executive", self._health)

    def _note(self, message: ExecutiveStatus) -> None:
        self._seen_s, self._state = time.monotonic(), message.state

    def _health(self) -> Health:
        if self._seen_s is None:
            return Health(message="none")
        silent_s = time.monotonic() - self._seen_s
        # One that is idle may end: nothing waits for it.
        if silent_s > EXECUTIVE_SILENT_S and self._state != "idle":
            words = f"station_executive has been silent for {silent_s:.0f} s; it was {self._state}"
            return Health(ERROR, words)
        return Health(message=self._state)


class ClockWatch:
    """Notices nodes on a computer whose clock differs from this one's, by their /diagnostics.

    They are stamped when they are sent, so their age at arrival is the delay less what the sender's
    clock is ahead.  The least of the last messages counts: delays vary, an offset stays.
    """

    def __init__(self, node: StationNode) -> None:
        self._node = node
        self._ages_s: dict[str, deque[tuple[float, float]]] = {}
        # Simulated time comes from one clock.
        if not node.get_parameter("use_sim_time").value:
            node.listen(DiagnosticArray, "/diagnostics", self._note, WATCHED)
            node.diagnostics.add("clocks", self.health)

    def _note(self, message: DiagnosticArray) -> None:
        name = message.status[0].hardware_id if message.status else ""
        if not name.startswith(self._node.get_namespace().rstrip("/") + "/"):
            return
        ages = self._ages_s.setdefault(name.rpartition("/")[2], deque(maxlen=CLOCK_SAMPLES))
        ages.append((self._node.now_s() - seconds_from_stamp(message.header.stamp), time.monotonic()))

    def health(self) -> Health:
        """Return the offset of every node's clock in ms, as far as it exceeds the delay."""
        since_s, offsets_s = time.monotonic() - CLOCK_AGE_S, {}
        for name, ages in self._ages_s.items():
            recent = [age_s for age_s, seen_s in ages if seen_s >= since_s]
            # A message of a moment when the sender was busy says nothing.
            if len(recent) >= CLOCK_LEAST:
                offsets_s[name] = -min(recent)
        # Its own messages, of the same clock, are as late as this node takes any.
        delay_s = max(0.0, -offsets_s.pop(self._node.get_name(), 0.0))
        offsets_s = {name: max(each_s, min(each_s + delay_s, 0.0)) for name, each_s in offsets_s.items()}
        values = {f"offset_ms {name}": round(1e3 * offset_s, 1) for name, offset_s in sorted(offsets_s.items())}
        worst_s = max(map(abs, offsets_s.values()), default=0.0)
        if worst_s < CLOCK_WARN_S:
            return Health(values=values)
        words = [
            f"the clock of {name} is {1e3 * abs(offset_s):.0f} ms "
            + ("ahead of this computer's" if offset_s > 0.0 else "behind this computer's, or its messages are late")
            for name, offset_s in sorted(offsets_s.items())
            if abs(offset_s) >= CLOCK_WARN_S
        ]
        return Health(ERROR if worst_s >= CLOCK_ERROR_S else WARN, "; ".join(words), values)


class StationCensus:
    """Stations that the nodes of this namespace run on, as far as they run."""

    def __init__(self) -> None:
        self._seen: dict[str, StationInUse] = {}

    def note(self, message: StationInUse) -> None:
        """Take what a node published."""
        self._seen[message.node] = message

    def difference(self, node: Any) -> str:
        """Return which running nodes differ from `node`, "" if none does."""
        own = self._seen.get(node.get_fully_qualified_name())
        if own is None:
            return ""
        # A latched message outlives its node, which may come back with another description.
        running = {
            f"{each.node_namespace.rstrip('/')}/{each.node_name}"
            for each in node.get_publishers_info_by_topic(STATION_IN_USE)
        }
        others = [
            f"{name.rsplit('/', 1)[-1]} on {_shown(seen)}"
            for name, seen in sorted(self._seen.items())
            if name in running and (seen.digest, seen.band) != (own.digest, own.band)
        ]
        return f"{', '.join(others)}; this node on {_shown(own)}" if others else ""


def _shown(seen: StationInUse) -> str:
    return f"{seen.station}, {seen.band} band, digest {seen.digest[:SHOWN_DIGITS]}"
