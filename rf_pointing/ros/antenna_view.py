"""Receives one antenna for the operator's page, and sends its commands: a `Board` on topics of a
namespace, that of the node or another one.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState

from rf_pointing.ros import convert, station_view
from rf_pointing.ros.convert_planning import profile_from_message
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import ESSENTIAL, EXECUTIVE_STATUS, SCHEDULE, STATION_IN_USE
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.repeated_call import ParametersOf
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.clients import network
from rf_pointing.station.clients.board import READ, Board
from rf_pointing.station.clients.network import ERROR, SILENT_S, WARNING, Finding

PARAMETERS_S = 5.0  # Wall time between two requests for the limits in force.
GRAPH_S = 5.0
"""Wall time between two looks at who publishes."""
# A node that was killed leaves the graph after 20 s, and may have been started again meanwhile.
DOUBLE_LOOKS = 6
CLOCK_LOOKS = 10
STREAMS = {
    "antenna": (ours.AntennaStatus, ESSENTIAL, STATUS),
    "tracking": (ours.TrackingStatus, "tracking_status", STREAM),
    "target": (ours.Target, "target", STREAM),
}  # fmt: skip
SECTIONS = {
    "passes": (ours.PassList, "passes", station_view.passes_values, LATCHED),
    "schedule": (ours.Schedule, SCHEDULE, station_view.schedule_values, LATCHED),
    "certificate": (ours.PassCertificate, "pass_certificate", station_view.certificate_values, LATCHED),
    "executive": (ours.ExecutiveStatus, EXECUTIVE_STATUS, station_view.executive_values, STATUS),
    "station": (ours.StationInUse, STATION_IN_USE, lambda m: {"name": m.station, "band": m.band}, IN_USE),
}
"""Sections of the page by name: the message, its topic, and its values."""


@dataclass
class Publishers:
    """Who publishes the status of an antenna, as the last look at the graph has shown."""

    simulated: bool = False
    doubled: int = 0
    """How many looks in a row have found more than one."""
    other_version: bool = False

    @property
    def findings(self) -> list[Finding]:
        """Levels and words for an operator."""
        found: list[Finding] = []
        if self.doubled >= DOUBLE_LOOKS:
            found.append((ERROR, "two antennas have this namespace: give one another"))
        if self.other_version:
            found.append((WARNING, "its messages are those of another version of rf_pointing"))
        return found


def antennas_in_graph(node: ManagedNode) -> list[str]:
    """Return the namespaces in which an antenna publishes its status."""
    topics: list[tuple[str, list[str]]] = []
    # A damaged name: the next look may read it.
    with suppress(UnicodeDecodeError):
        topics = node.get_topic_names_and_types()
    parts = (topic.rpartition("/") for topic, kinds in topics if network.TOPIC_TYPE in kinds)
    return [namespace for namespace, _, name in parts if name == ESSENTIAL and namespace]


class AntennaView:
    """The board of one antenna, fed until the cleanup of `node`; "" is the node's own namespace."""

    def __init__(self, node: ManagedNode, namespace: str, rate_hz: float, key: Any) -> None:
        self.namespace = namespace or node.get_namespace()
        self.path = namespace.lstrip("/")
        """Below /at on the page; "" for that of a single antenna."""
        self._node, self._start = node, f"{namespace}/" if namespace else ""
        self.board = board = Board(rate_hz, self.namespace, self._send)
        ways = board.responded, board.ended
        self._sender = DirectiveSender(node, board.rows, {}, *ways, key, space=self._start)
        self._readers = {
            each: ParametersOf(node, self._start + each, names, PARAMETERS_S)
            for each, names in READ.items()
        }  # fmt: skip
        self._newest: dict[str, Any] = {}
        self._ahead_s = deque[float](maxlen=CLOCK_LOOKS)
        self._publishers, self._look_s = Publishers(), 0.0
        # An antenna of a network may be silent: it is one of its lines that says so.
        listen = partial(node.listen_latest, required=not namespace)
        self._streams = {
            name: listen(kind, self._start + topic, lambda m: m, qos)
            for name, (kind, topic, qos) in STREAMS.items()
        }  # fmt: skip
        joints = self._start + "joint_states", convert.joints_from_message
        self._streams["joints"] = listen(JointState, *joints, STREAM)
        for name, (kind, topic, values, qos) in SECTIONS.items():
            node.listen(kind, self._start + topic, partial(self._keep, name, values), qos)
        profiles = lambda m: board.take_profiles([profile_from_message(each) for each in m.profiles])  # noqa: E731
        node.listen(ours.PassProfileList, self._start + "pass_profiles", profiles, LATCHED)

    def close(self) -> None:
        """Destroy the clients; the subscriptions end with the cleanup of the node."""
        for part in (self._sender, *self._readers.values()):
            part.close()

    def poll(self) -> None:
        """Take what has come back of commands."""
        self._sender.poll()

    def take(self) -> dict[str, Any]:
        """Take the newest messages, and return what moves."""
        for name, stream in self._streams.items():
            if (message := stream.take()) is not None:
                self._newest[name] = message
                self.board.seen(name)
                if name == "antenna":
                    self._ahead_s.append(seconds_from_stamp(message.header.stamp) - time.time())
        return station_view.live_values(self._newest)

    def sections(self, live: Mapping[str, Any]) -> dict[str, Any]:
        """Return what to show now, with the parameters that have arrived."""
        for node, reader in self._readers.items():
            if refused := self.board.take_parameters(node, reader.take()):
                self._node.inputs.note_refusal("get_parameters", refused)
        return self.board.sections(live)

    def line(self, live: Mapping[str, Any]) -> dict[str, Any]:
        """Return the line of the antenna in its network."""
        if (now_s := time.monotonic()) >= self._look_s:
            self._look_s = now_s + GRAPH_S
            # A damaged name, or a node that has just gone: the next look shows more.
            with suppress(UnicodeDecodeError, RuntimeError):
                self._look()
        seen = self._publishers
        found = [*seen.findings, *network.clock_finding(self._ahead_s, simulated=seen.simulated)]
        if self.board.age_s.get("antenna", 0.0) > SILENT_S:
            self._ahead_s.clear()
        return network.antenna_line(self.namespace, self.board, live, found)

    def _look(self) -> None:
        topic = self._start + ESSENTIAL
        senders = self._node.get_publishers_info_by_topic(topic)
        own = {each.topic_type_hash for each in self._node.get_subscriptions_info_by_topic(topic)
               if each.node_name == self._node.get_name()}  # fmt: skip
        doubled = self._publishers.doubled + 1 if len(senders) > 1 else 0
        self._publishers = Publishers(
            bool(self._node.count_publishers(f"{self._start}clock")), doubled,
            any(own and each.topic_type_hash not in own for each in senders),
        )  # fmt: skip

    def _keep(self, name: str, values: Callable[[Any], Any], message: Any) -> None:
        # A message without values leaves the one before it, on the board and here.
        self.board.keep(name, values(message))
        self._newest[name] = message

    def _send(self, number: int, name: str, arguments: Mapping[str, Any]) -> None:
        if name == "track":
            arguments = {**arguments, "target_pass": self._newest["passes"].passes[arguments["target_pass"]]}
        self._sender.send(number, name, arguments)
