"""A managed node of one antenna: it begins with the numbers of the station description.

Every node publishes, latched on `station_in_use`, which description it runs on.  Nodes with
different limits or another horizon are how antennas get damaged, so the pointing controller refuses
a pass while a node of its namespace differs.
"""

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rf_pointing_msgs.msg import ExecutiveStatus, StationInUse

from rf_pointing.core import Params, parameter
from rf_pointing.nodes.diagnostics import ERROR, Health
from rf_pointing.nodes.graph import EXECUTIVE_STATUS, STATION_IN_USE
from rf_pointing.nodes.managed import ManagedNode
from rf_pointing.nodes.qos import IN_USE, STATUS
from rf_pointing.station.description import StationDescription, owner, read_station

EXECUTIVE_SILENT_S = 5.0
"""Wall time after which a silent executive is an error; it reports once a second."""
SHOWN_DIGITS = 12
"""Digits of a digest in a message to the operator."""


@dataclass(frozen=True, kw_only=True)
class StationParams(Params):
    """Which antenna a node belongs to."""

    station: str = parameter("dss13", "station description: a shipped name or a YAML file")
    band: str = parameter("", "band in use; empty: the description's default")


class StationNode(ManagedNode):
    """A node whose parameters the station description gives; `station` is None if it is refused."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.parameters.declare("", StationParams(), group="description")
        self.station: StationDescription | None = None
        choice: StationParams = self.parameters.value("description")
        try:
            station = read_station(choice.station)
            self.band = choice.band or station.default_band
            values = station.parameters(name, self.band)
        except ValueError as error:
            self.parameters.reasons += str(error).splitlines()
        else:
            self.station = station
            self.parameters.take_station(values, partial(owner, name))

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = super().on_configure(state)
        if result == TransitionCallbackReturn.SUCCESS and self.station is not None:
            message = StationInUse(
                node=self.get_fully_qualified_name(),
                station=self.station.name,
                band=self.band,
                digest=self.station.digest,
            )
            message.header.stamp = self.get_clock().now().to_msg()
            self.publisher(StationInUse, STATION_IN_USE, IN_USE).publish(message)
        return result


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
            return Health(ERROR, f"station_executive has been silent for {silent_s:.0f} s; it was {self._state}")
        return Health(message=self._state)


class StationCensus:
    """What the nodes of this namespace run on, as far as they run."""

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
