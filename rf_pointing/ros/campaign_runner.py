"""A campaign on the live graph: pass after pass, selected at the ephemeris and tracked.

A pass counts as observed when it gave observations, even if the controller does not call it
tracked: most of a short piece of a pass goes into the search.  A fault of the antenna ends the
campaign: it would refuse every other pass, too.
"""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.action import ActionClient
from rclpy.node import Node
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import Pass
from rf_pointing_msgs.srv import SelectTarget

from rf_pointing.ros.repeated_call import RepeatedCall
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.campaign.log import CalibrationLog

# Wall time after which a service or an action server that does not answer is given up.
ANSWER_S = 20.0
# Passes are selected from this long before: they may rise long before the wanted piece.
LOOK_BACK_S = 7200.0


class CampaignRunner:
    """Runs the passes of one campaign; `failures` says why passes gave no observation.

    `fault` is what ended the campaign before its last pass.
    """

    def __init__(self, node: Node) -> None:
        self._log: CalibrationLog | None = None
        self._before = 0
        self._select = node.create_client(SelectTarget, "ephemeris_publisher/select_target")
        self._track = ActionClient(node, TrackPass, "track_pass")
        self._passes: Sequence[Pass] = ()
        self._sensor = ""
        self._future: Any = None
        self._then: Callable[[Any], None] | None = None
        self._until_s = 0.0
        self._handle: Any = None
        self.number, self.observed = 0, 0
        self.failures: list[str] = []
        self.fault = ""

    @property
    def busy(self) -> bool:
        """Whether a campaign is under way."""
        return self._then is not None

    @property
    def target(self) -> str:
        """Target of the pass in work."""
        return self._passes[self.number - 1].target if 0 < self.number <= len(self._passes) else ""

    @property
    def count(self) -> int:
        """Number of passes of the campaign."""
        return len(self._passes)

    def start(self, passes: Sequence[Pass], sensor: str, log: CalibrationLog) -> None:
        """Begin; `log` takes the observations.

        Raises ValueError for nothing to track or without the nodes that track.
        """
        if not passes:
            raise ValueError("passes is empty, must name at least one pass")
        if not self._select.service_is_ready() or not self._track.server_is_ready():
            raise ValueError("ephemeris_publisher and pointing_controller must be running in this namespace")
        self._passes, self._sensor, self._log = list(passes), sensor, log
        self.number, self.observed, self.failures, self.fault = 0, 0, [], ""
        self._next()

    def cancel(self) -> None:
        """End after the pass in work has been stopped under control."""
        self._passes = self._passes[: self.number]
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def poll(self) -> None:
        """Continue where an answer has arrived."""
        # Polled between two events: a callback that waited for an answer would block its arrival.
        if self._then is None:
            return
        if self._future.done():
            self._then(self._future.result())
        elif time.monotonic() > self._until_s:
            self._fail(f"no answer within {ANSWER_S:.0f} s")

    def _next(self) -> None:
        self._handle = None
        if self.number >= len(self._passes):
            self._then = None
            return
        wanted = self._passes[self.number]
        self.number += 1
        self._before = len(self._log)
        self._log.begin_pass()
        rises_s = seconds_from_stamp(wanted.aos)
        request = SelectTarget.Request(target=wanted.target, start=stamp_from_seconds(rises_s - LOOK_BACK_S))
        self._wait_for(RepeatedCall(self._select, request), self._selected)

    def _wait_for(self, future: Any, then: Callable[[Any], None], longest_s: float = ANSWER_S) -> None:
        self._future, self._then, self._until_s = future, then, time.monotonic() + longest_s

    def _fail(self, why: str) -> None:
        self.failures.append(f"{self.target}: {why}")
        self._next()

    def _selected(self, answer: SelectTarget.Response) -> None:
        if not answer.success:
            self._fail(answer.message)
            return
        goal = TrackPass.Goal(target_pass=self._passes[self.number - 1], sensor=self._sensor)
        self._wait_for(self._track.send_goal_async(goal), self._offered)

    def _offered(self, handle: Any) -> None:
        if not handle.accepted:
            self._fail("the controller refused the pass")
            return
        self._handle = handle
        # A pass lasts as long as it lasts: only services and goals have a time to answer in.
        self._wait_for(handle.get_result_async(), self._tracked, math.inf)

    def _tracked(self, answer: Any) -> None:
        self.fault = answer.result.fault
        if self.fault:
            self._passes = self._passes[: self.number]
        if len(self._log) > self._before:
            self.observed += 1
            self._next()
        else:
            tracked = f"{answer.result.seconds_tracked:.0f} s on target, {answer.result.message}"
            self._fail(f"no observation, {tracked}; {self._log.reasons()}")
