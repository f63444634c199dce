"""The actions `track_pass` and `scan`, and what the goals send (the port of `PassGoals`).

Publishes: joint_trajectory, command_signature, tracking_status, pass_certificate.  Calls
ephemeris_publisher/select_target for a pass by satellite and time, target_designate/select_target
for a target that reports lead to.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import Scan, TrackPass
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import JointState

from rf_pointing.core import JointReading
from rf_pointing.core import JointTrajectory as Trajectory
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import Certificate
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.convert_planning import goal_from_message, goal_of_scan
from rf_pointing.ros.graph import DESIGNATE, STATION_IN_USE
from rf_pointing.ros.qos import IN_USE, LATCHED, STREAM
from rf_pointing.ros.repeated_call import RepeatedCall
from rf_pointing.ros.signed_commands import CommandSender
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.standby import HeldGoals, Standby
from rf_pointing.ros.station_node import StationInUse, StationNode
from rf_pointing.ros.station_watches import StationCensus
from rf_pointing.station.clients.goals import PassGoal, PassGoals
from rf_pointing.station.parameters import CommandKeyParams
from rf_pointing.station.pointing.status import TrackingStatus

SERVED: Any = (TrackPass, "track_pass", goal_from_message), (Scan, "scan", goal_of_scan)
"""Type and name of each action, and what reads its goals."""


class PassCall(RepeatedCall):
    """A call of ephemeris_publisher/select_target."""

    def passes(self) -> list[Pass]:
        """Return the passes of the answer; ValueError says why it has none."""
        answer: SelectTarget.Response = self.result()
        if not answer.success:
            raise ValueError(answer.message)
        return [convert_planning.pass_from_message(each) for each in answer.passes]


class TrackPassServer:
    """Belongs to one node; `configure` connects it with the goals until cleanup."""

    def __init__(self, node: StationNode) -> None:
        self._node = node
        self._goals: Any = None
        self._handle: Any = None
        self._standby: Standby | None = None
        self._followed: Any = None
        """The request of the pass of the other controller, while this one follows it."""
        self._role: str = node.parameters.value("lifecycle").standby
        # One of two is silent until it knows that the other one does not work.
        node.quiet = bool(self._role)
        self._finders = {
            designated: node.create_client(SelectTarget, f"{owner}/select_target")
            for designated, owner in ((False, "ephemeris_publisher"), (True, DESIGNATE))
        }
        self._kind: Any = TrackPass
        servers = [
            node.serve_goals(
                kind, name, accepts=self._accepts, begin=partial(self._begin, kind, read),
                cancel=lambda: self._goals.cancel(), result=self._result,
                lost="pointing_controller was killed in the pass; send the goal again",
            )
            for kind, name, read in SERVED
        ]  # fmt: skip
        self._held = [HeldGoals(node, server) for server in servers] if self._role else []

    def configure(self, goals: PassGoals, key: CommandKeyParams) -> None:
        """Serve these goals, and sign their commands."""
        node, self._goals = self._node, goals
        self._axes = goals.controller.plan.mount.axes
        self._commands = CommandSender(node, key, node.publisher)
        self._status = node.stream(ours.TrackingStatus, "tracking_status", STREAM)
        self._certificates = node.stream(ours.PassCertificate, "pass_certificate", LATCHED)
        joints = partial(convert.joints_from_message, axes=self._axes)
        self._joints = node.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        self._census, self._message = StationCensus(), ours.TrackingStatus()
        node.listen(StationInUse, STATION_IN_USE, self._census.note, IN_USE)
        self._standby = self._one_of_two() if self._role else None

    def turn(self) -> None:
        """Look whether to take over from the other controller, if there is one."""
        if self._standby is not None:
            self._standby.step()

    def _one_of_two(self) -> Standby:
        node = self._node
        for (kind, name, read), held in zip(SERVED, self._held, strict=True):
            held.listen(kind, name, partial(self._follow, kind, read))
        stop = partial(self._goals.stop, "the other controller has ended the pass")
        busy = lambda: self._goals.busy  # noqa: E731
        standby = Standby(node, self._role, self._commands.key, busy, self._take_over, stop)
        self._commands.name = standby.name
        return standby

    def _follow(self, kind: Any, read: Callable[[Any], PassGoal], request: Any, window: ours.Pass) -> None:
        """Begin the pass of the other controller, in silence."""
        if self._node.active and not self._goals.busy:
            self._handle, self._kind, self._followed = None, kind, request
            goal = replace(read(request), window=convert_planning.pass_from_message(window))
            self._goals.begin(goal, self._node.now_s(), time.perf_counter())

    def _take_over(self) -> None:
        """Publish what lasts, and serve the client of the pass in hand."""
        self._node.announce()
        self._status.publish(self._message)
        if (certificate := self._goals.controller.plan.certificate) is not None:
            self.show(certificate)
        for each in self._held:
            each.serve()

    def _accepts(self, request: TrackPass.Goal) -> bool:
        serves = self._node.active and not self._node.quiet
        if serves and (not self._goals.busy or request is self._followed):
            return True
        why = "another pass is tracked" if serves else "not active"
        self._node.log_once("goal refused", why, error=True)
        return False

    def _begin(self, kind: Any, read: Callable[[Any], PassGoal], handle: Any) -> None:
        self._handle, self._kind = handle, kind
        if self._goals.busy:
            # The pass goes on that was followed.
            return
        try:
            goal = read(handle.request)
        except ValueError as error:
            self._goals.reject(str(error))
        else:
            self._goals.begin(goal, self._node.now_s(), time.perf_counter())

    def _window(self) -> ours.Pass:
        window = self._goals.window
        return ours.Pass() if window is None else convert_planning.pass_to_message(window)

    def _result(self) -> Any:
        given = self._goals.outcome()
        kept = self._kind.Result.get_fields_and_field_types()
        mine = {name: given[name] for name in given if name in kept}
        return self._kind.Result(**mine, target_pass=self._window())

    # The port of the goals

    def joints(self, until_s: float) -> JointReading | None:
        reading: JointReading | None = self._joints.take(until_s)
        return reading

    def difference(self) -> str:
        return self._census.difference(self._node)

    def use_band(self, goal: PassGoal) -> bool:
        node = self._node
        assert node.station is not None
        if goal.band in ("", node.band):
            return False
        # A sensor that the band does not have is refused before anything changes.
        node.station.chosen_sensor(goal.sensor, goal.band)
        # Its own message arrives later than the next look at the census.
        self._census.note(node.change_band(goal.band))
        node.get_logger().info(f"{goal.band} band: waits for every node to take it")
        return True

    def band(self) -> str:
        return self._node.band

    def find(self, goal: PassGoal, from_s: float) -> PassCall:
        return PassCall(self._finders[goal.designated], SelectTarget.Request(
            target=goal.satellite, start=stamp_from_seconds(from_s),
            minimum_peak_elevation=goal.minimum_peak_elevation_rad,
        ))  # fmt: skip

    def publish(self, t_s: float, trajectory: Trajectory | None, status: TrackingStatus) -> None:
        self._message = convert.tracking_status_to_message(status)
        if self._node.quiet:
            return
        if trajectory is not None:
            self._commands.send(convert.trajectory_to_message(trajectory, t_s, self._axes))
        elif self._standby is not None:
            self._commands.claim(t_s)
        self._message.commands_sent = self._commands.sent
        self._status.publish(self._message)

    def show(self, certificate: Certificate) -> None:
        if not self._node.quiet:
            self._certificates.publish(convert_planning.certificate_to_message(certificate))

    def feed_back(self, progress: float) -> None:
        if self._handle is None or self._node.quiet:
            return
        feedback = self._kind.Feedback(status=self._message, progress=progress, target_pass=self._window())
        self._handle.publish_feedback(feedback)

    def warn(self, alarm: str) -> None:
        self._node.diagnostics.publish()
        if alarm:
            self._node.get_logger().warning(alarm)

    def error(self, words: str) -> None:
        self._node.get_logger().error(words)

    def end_goal(self) -> None:
        self._followed = None
        # The one that works answers the client.
        if self._handle is not None and not self._node.quiet:
            self._handle.execute()
