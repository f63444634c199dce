"""The second pointing controller of an antenna, on this computer or another one, in ROS.

Both have one name and namespace, and so receive the same messages, goals, calls and parameters.
The one that works claims the antenna with every period on command_signature: by its command, or by
a signature of no command between two passes.  The other is `quiet`: it publishes nothing but its
/diagnostics, under a name of its own, and answers nobody.  It follows the pass of the other from
the feedback of the action, and keeps the requests of its client.  It serves them when it takes
over: the client notices nothing.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rf_pointing_msgs.msg import AntennaStatus, CommandSignature, StationInUse, TrackingStatus

from rf_pointing.core import STANDBY, parameter
from rf_pointing.ros.command_key import CommandKey
from rf_pointing.ros.diagnostics import ERROR, WARN, Health
from rf_pointing.ros.graph import SIGNATURES, STATION_IN_USE
from rf_pointing.ros.lifecycle import LifecycleParams
from rf_pointing.ros.qos import IN_USE, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import checked_message
from rf_pointing.station.pointing.succession import FIRST, SECOND, Succession

MOST_KEPT = 8
"""Goals whose requests are kept: the one in hand, and those that it refused."""
FRESH_S = 1.0
"""Oldest claim that is believed, by the clocks of both computers."""


@dataclass(frozen=True, kw_only=True)
class StandbyParams(LifecycleParams):
    """Who brings the controller up, and whether it is one of two."""

    standby: str = parameter(
        "", "which of two of this name, of which one stands by; empty: the only one", choices=("", FIRST, SECOND)
    )

    @property
    def place(self) -> str:
        """Two run on one computer."""
        return STANDBY if self.standby == SECOND else ""


class Standby:
    """Decides for `node` whether it works; `works` is called when it begins.

    `in_pass()` is whether it follows a pass, and `idle()` ends that when the other has none.
    """

    def __init__(
        self, node: StationNode, role: str, key: CommandKey, in_pass: Callable[[], bool],
        works: Callable[[], object], idle: Callable[[], object],
    ) -> None:  # fmt: skip
        self._node, self._key, self._in_pass, self._works, self._idle = node, key, in_pass, works, idle
        self._succession = Succession(node.get_fully_qualified_name(), role, time.monotonic())
        self._stamp_s, self._differs = 0.0, ""
        # Simulated time is held until a station is up: nobody claims anything meanwhile.
        self._waits_s = node.now_s() if role == SECOND else -math.inf
        self._simulated: bool = node.get_parameter("use_sim_time").value
        # Undecoded: of two senders the numbers say nothing of losses.
        node.listen(CommandSignature, SIGNATURES, self._on_claim, STREAM, raw=True)
        node.listen(AntennaStatus, "antenna_status", self._on_antenna, STATUS)
        node.listen(TrackingStatus, "tracking_status", self._on_tracking, STREAM, raw=True)
        node.listen(StationInUse, STATION_IN_USE, self._on_station, IN_USE)
        node.diagnostics.add("standby", self._health)

    @property
    def name(self) -> str:
        """Name under which it commands the antenna."""
        return self._succession.name

    def step(self) -> None:
        """Begin, or give way, as it is due."""
        before = self._node.quiet
        if self._simulated and self._node.now_s() <= self._waits_s:
            self._succession.take_claim(time.monotonic())
        works = (
            self._node.active
            and not self._differs
            and self._succession.step(time.monotonic(), in_pass=self._in_pass(), needs_antenna=not self._simulated)
        )
        self._node.quiet = not works
        if works and before:
            self._node.get_logger().warning(f"{self.name} has the antenna")
            self._works()
        elif not works and not before:
            self._node.get_logger().warning(f"{self.name} stands by")

    def _on_claim(self, payload: bytes) -> None:
        message = checked_message(payload, CommandSignature)
        if message.commander != self._succession.other:
            return
        self._key.check(message)
        stamp_s, now_s = seconds_from_stamp(message.header.stamp), self._node.now_s()
        if stamp_s <= self._stamp_s or abs(now_s - stamp_s) > FRESH_S:
            raise ValueError(f"a claim of {message.commander} is {now_s - stamp_s:.1f} s old, or was sent before")
        self._stamp_s = stamp_s
        self._succession.take_claim(time.monotonic())

    def _on_antenna(self, message: AntennaStatus) -> None:
        self._succession.take_antenna(message.commander, message.commands_accepted, time.monotonic())

    def _on_tracking(self, payload: bytes) -> None:
        if self._node.quiet:
            self._node.others_goal = bool(checked_message(payload, TrackingStatus).target)
            if self._in_pass() and not self._node.others_goal:
                self._idle()

    def _on_station(self, message: StationInUse) -> None:
        if message.node == self._node.get_fully_qualified_name() and self._node.station is not None:
            same = message.digest == self._node.station.digest
            self._differs = "" if same else f"the controller that works runs on another description: {message.station}"

    def _health(self) -> Health:
        if self._differs:
            return Health(ERROR, f"does not stand by: {self._differs}")
        if not self._node.quiet:
            return Health(message="works")
        if self._node.active and self._node.missing_inputs():
            return Health(WARN, f"stands by, and could not take over: {self._node.missing_inputs()} is missing")
        return Health(message="stands by in a pass" if self._in_pass() else "stands by")


class HeldGoals:
    """Requests to an action server of a node that is quiet, by goal; `serve` carries them out.

    `follow(request, window)` begins what the other one does, as its feedback shows.
    """

    def __init__(self, node: StationNode, server: Any) -> None:
        self._node, self._server = node, server
        self._kept: dict[bytes, list[dict[str, Any]]] = {}
        self._goal = b""
        take = server.take_data
        server.take_data = lambda: self._held(take())

    def listen(self, kind: Any, name: str, follow: Callable[[Any, Any], object]) -> None:
        """Take the feedback of the action until cleanup."""
        self._follow = follow
        self._node.listen(kind.Impl.FeedbackMessage, f"{name}/_action/feedback", self._on_feedback, STREAM)

    def _held(self, taken: dict[str, Any]) -> dict[str, Any]:
        for part in ("goal", "result", "cancel") if self._node.quiet else ():
            if part in taken:
                request = taken[part][1]
                of = request.goal_info.goal_id if part == "cancel" else request.goal_id
                self._kept.setdefault(bytes(of.uuid), []).append({part: taken.pop(part)})
        while len(self._kept) > MOST_KEPT:
            del self._kept[next(each for each in self._kept if each != self._goal)]
        return taken

    def _on_feedback(self, message: Any) -> None:
        goal = bytes(message.goal_id.uuid)
        requests = [each["goal"][1].goal for each in self._kept.get(goal, ()) if "goal" in each]
        if self._node.quiet and requests:
            self._goal = goal
            self._follow(requests[0], message.feedback.target_pass)

    def serve(self) -> None:
        """Carry out the requests of the goal that was followed, as if they arrived now."""
        for each in self._kept.pop(self._goal, ()):
            self._node.executor.create_task(self._server.execute, each)
        self._kept.clear()
