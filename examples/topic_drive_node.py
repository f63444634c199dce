"""A vendor's driver for `drive: {type: topic, model: position}`: two axes at 6 deg/s.

Start it in the antenna's namespace, and then check what the control unit relies on:

    python3 examples/topic_drive_node.py --ros-args -r __ns:=/gs1
    scripts/run check_drive --station my_dish.yaml --namespace /gs1 --move

Replace `advance` by your device.  A driver of `model: rate` gets velocities in place of positions,
50 a second; it stops by itself when none has come for 0.5 s.
"""

import math
import time
from contextlib import suppress

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

RATE_RAD_S, PERIOD_S = math.radians(6.0), 0.05


class Driver(Node):
    """Publishes where the axes are, and moves them towards the newest set point while enabled."""

    def __init__(self) -> None:
        super().__init__("topic_driver")
        self.axes = {"azimuth": 0.0, "elevation": 0.5}
        self.goal: dict[str, float] = {}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.state = self.create_publisher(JointState, "drive/state", 10)
        self.create_subscription(JointState, "drive/set_point", self.take, 10)
        self.create_subscription(Bool, "drive/enable", self.enable, latched)
        self.newest_s = time.monotonic()
        self.create_timer(PERIOD_S, self.advance)

    def take(self, set_point: JointState) -> None:
        goal = dict(zip(set_point.name, set_point.position, strict=False))
        if set(goal) == set(self.axes) and all(map(math.isfinite, goal.values())):
            self.goal = goal

    def enable(self, _enabled: Bool) -> None:
        # False: stop, and set the brakes.  What was commanded before does not come back.
        self.goal = {}

    def advance(self) -> None:
        # A clock that is set must not move the axes.
        now_s = time.monotonic()
        reach, self.newest_s = RATE_RAD_S * (now_s - self.newest_s), now_s
        for axis, goal in self.goal.items():
            self.axes[axis] += max(-reach, min(reach, goal - self.axes[axis]))
        message = JointState(name=list(self.axes), position=list(self.axes.values()))
        message.header.stamp = self.get_clock().now().to_msg()
        self.state.publish(message)


if __name__ == "__main__":
    rclpy.init()
    driver = Driver()
    while rclpy.ok():
        # What was damaged on its way and cannot be read must not end a driver.
        with suppress(ValueError, RuntimeError):
            rclpy.spin_once(driver)
