"""A vendor's driver for `drive: {type: topic, model: position}`: two axes at 6 deg/s.

Start it in the antenna's namespace, and then check what the control unit relies on:

    python3 examples/topic_drive_node.py --ros-args -r __ns:=/gs1
    scripts/run check_drive --station my_dish.yaml --namespace /gs1 --move

Have it started again when it ends, `respawn=True` in a launch file.  Replace `advance` by your
device.  A driver of `model: rate` gets velocities in place of positions, 50 a second; it stops by
itself when none has come for 0.5 s.
"""

import math
import time

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from rf_pointing.ros.driver_node import spin_watched


class Driver(Node):
    """Publishes where the axes are, and moves them towards the newest set point while enabled."""

    def __init__(self) -> None:
        super().__init__("topic_driver")
        self.axes, self.newest_s = {"azimuth": 0.0, "elevation": 0.5}, time.monotonic()
        self.goal: dict[str, float] = {}
        self.state = self.create_publisher(JointState, "drive/state", 10)
        self.create_subscription(JointState, "drive/set_point", self.take, 10)
        # False: stop, and set the brakes.  What was commanded before never comes back.
        self.create_subscription(Bool, "drive/enable", lambda _: self.goal.clear(), 10)
        self.create_timer(0.05, self.advance)

    def take(self, set_point: JointState) -> None:
        goal = dict(zip(set_point.name, set_point.position, strict=False))
        if goal.keys() == self.axes.keys() and all(map(math.isfinite, goal.values())):
            self.goal = goal

    def advance(self) -> None:
        # A clock that is set must not move the axes.
        reach, self.newest_s = math.radians(6.0) * (time.monotonic() - self.newest_s), time.monotonic()
        for axis, goal in self.goal.items():
            self.axes[axis] += max(-reach, min(reach, goal - self.axes[axis]))
        message = JointState(name=list(self.axes), position=list(self.axes.values()))
        message.header.stamp = self.get_clock().now().to_msg()
        self.state.publish(message)


if __name__ == "__main__":
    rclpy.init()
    spin_watched(Driver())
