"""Serves FollowJointTrajectory for the antenna, as planners such as MoveIt send it.

    python3 examples/follow_joint_trajectory.py --ros-args -r __ns:=/gs1 \
        -p command_key_file:=$HOME/.local/state/rf_pointing/gs1/command.key

It needs control_msgs, which the package itself does not.  The control unit checks every command as
one of pointing_controller: travel, rates, horizon, Sun, wind, authority.  What it refuses ends the
goal with its words.  A trajectory ends at rest and has a point each second or more.  With a
simulated station add `-p use_sim_time:=true -r /clock:=/gs1/clock`.
"""

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time import Time
from rf_pointing_msgs.msg import AntennaStatus
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.ros.signed_commands import CommandSender
from rf_pointing.station.parameters import CommandKeyParams

AHEAD, REACH, PERIOD_S = Duration(seconds=0.1), Duration(seconds=10.0), 0.2
"""Points from 0.1 s to 10 s ahead are sent; the control unit takes up to 15 s."""
TOLERANCE_RAD, PATIENCE = 0.002, Duration(seconds=2.0)
"""Where the goal gives none: 0.1 deg, and how long the axes may take after the end."""
RESULT = FollowJointTrajectory.Result


class Bridge(Node):
    """Sends what is left of the trajectory again and again: a commander that is silent is lost."""

    def __init__(self) -> None:
        super().__init__("follow_joint_trajectory")
        self.axes: dict[str, float] = {}
        self.status, self.goal = AntennaStatus(), None
        key_file = self.declare_parameter("command_key_file", "").value
        self.commands = CommandSender(self, CommandKeyParams(command_key_file=key_file))
        self.create_subscription(JointState, "joint_states", self.read, 10)
        self.create_subscription(AntennaStatus, "antenna_status", self.note, 10)
        self.server = ActionServer(
            self, FollowJointTrajectory, "follow_joint_trajectory", self.follow,
            goal_callback=lambda _: self.answer(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip
        self.create_timer(PERIOD_S, self.step)

    def read(self, message: JointState) -> None:
        self.axes = dict(zip(message.name, message.position, strict=True))

    def note(self, message: AntennaStatus) -> None:
        self.status = message

    def answer(self) -> GoalResponse:
        # One at a time, and none before the axes and the time are known.
        ready = self.goal is None and self.axes and self.get_clock().now().nanoseconds
        return GoalResponse.ACCEPT if ready else GoalResponse.REJECT

    async def follow(self, goal: object) -> RESULT:
        self.goal, self.ended, self.wanted = goal, Future(), goal.request.trajectory
        start = Time.from_msg(self.wanted.header.stamp, self.get_clock().clock_type)
        if not start.nanoseconds:
            start = self.get_clock().now() + AHEAD + AHEAD
        self.when = [start + Duration.from_msg(each.time_from_start) for each in self.wanted.points]
        self.begin: Time | None = None
        self.rejected = self.status.commands_rejected
        return await self.ended

    def step(self) -> None:
        if self.goal is None:
            return None
        wanted, now = self.wanted, self.get_clock().now()
        if sorted(wanted.joint_names) != ["azimuth", "elevation"] or not wanted.points:
            return self.end(RESULT.INVALID_JOINTS, "needs points of azimuth and elevation")
        if self.goal.is_cancel_requested:
            # Silence: the control unit stops under control.
            return self.end(RESULT.SUCCESSFUL, "canceled")
        if self.status.fault or self.status.commands_rejected > self.rejected:
            return self.end(RESULT.INVALID_GOAL, self.status.fault or self.status.last_rejection)
        command = JointTrajectory(joint_names=wanted.joint_names)
        begin = next((at for at in self.when if at > now + AHEAD), None)
        # Whole microseconds, as the control unit keeps times.
        base = Time(nanoseconds=now.nanoseconds // 1000 * 1000, clock_type=now.clock_type)
        command.header.stamp = base.to_msg()
        for point, at in zip(wanted.points, self.when, strict=True):
            if base + AHEAD < at < base + REACH:
                point.time_from_start = (at - base).to_msg()
                command.points.append(point)
        # The same points again would be refused as a duplicate.
        if command.points and begin != self.begin:
            self.begin = begin
            self.commands.send(command)
        target = dict(zip(wanted.joint_names, wanted.points[-1].positions, strict=True))
        allowed = {each.name: each.position for each in self.goal.request.goal_tolerance}
        off = {name: abs(self.axes.get(name, 1e9) - angle) for name, angle in target.items()}
        within = all(each <= (allowed.get(name) or TOLERANCE_RAD) for name, each in off.items())
        patience = Duration.from_msg(self.goal.request.goal_time_tolerance)
        if now >= self.when[-1] and within:
            return self.end(RESULT.SUCCESSFUL, "")
        if now > self.when[-1] + (patience if patience.nanoseconds else PATIENCE):
            return self.end(RESULT.GOAL_TOLERANCE_VIOLATED, f"the axes are off by {off} rad")
        feedback = FollowJointTrajectory.Feedback(joint_names=list(target))
        feedback.header.stamp = now.to_msg()
        feedback.actual.positions = [self.axes.get(name, 0.0) for name in target]
        self.goal.publish_feedback(feedback)
        return None

    def end(self, code: int, words: str) -> None:
        goal, self.goal = self.goal, None
        if goal.is_cancel_requested:
            goal.canceled()
        elif code == RESULT.SUCCESSFUL:
            goal.succeed()
        else:
            goal.abort()
        self.ended.set_result(RESULT(error_code=code, error_string=words))


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Bridge())
