"""A driver for an antenna of one's own: scripts/run-python examples/antenna_driver.py --ros-args -r __ns:=/gs1

It does what the graph needs of a driver and no more (docs/own_antenna.md).  `Drive` takes the
place of the protocol of your servo; here it is an axis that follows its command exactly.
"""

import math

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.controllers import (
    CommandPreprocessor,
    CommandPreprocessorParams,
    TrajectoryBuffer,
    TrajectoryBufferParams,
)
from rf_pointing.core import JointReading
from rf_pointing.nodes import convert
from rf_pointing.nodes.qos import COMMAND_INPUT, STREAM
from rf_pointing.nodes.stamps import seconds_from_stamp

Array = NDArray[np.float64]
TICK_S = 0.02


class Drive:
    """Your servo: takes angles and rates of azimuth and elevation, tells its encoders."""

    def __init__(self, position_rad: Array) -> None:
        self._position_rad, self._velocity_rad_s = position_rad, np.zeros(2)

    def command(self, position_rad: Array, velocity_rad_s: Array) -> None:
        """Send one set point (2,)."""
        self._position_rad, self._velocity_rad_s = position_rad, velocity_rad_s

    def encoders(self) -> tuple[Array, Array]:
        """Return angles and rates (2,); azimuth continuous, never folded into one turn."""
        return self._position_rad, self._velocity_rad_s


class AntennaDriver(Node):
    """Follows `joint_trajectory` within its limits and publishes `joint_states`."""

    def __init__(self) -> None:
        super().__init__("antenna_driver")
        start = self.declare_parameter("start_deg", [0.0, 45.0]).value
        self._drive = Drive(np.radians(start))
        self._limits = CommandPreprocessor(CommandPreprocessorParams())
        self._limits.reset(self._drive.encoders()[0])
        self._table = TrajectoryBuffer(TrajectoryBufferParams())
        self._stepped_s = -math.inf
        self._joints = self.create_publisher(JointState, "joint_states", STREAM)
        self.create_subscription(JointTrajectory, "joint_trajectory", self._on_command, COMMAND_INPUT)
        self.create_timer(TICK_S, self._tick)

    def _now_s(self) -> float:
        return seconds_from_stamp(self.get_clock().now().to_msg())

    def _on_command(self, message: JointTrajectory) -> None:
        """Merge a command; one that is stale, in the future or not finite moves nothing."""
        try:
            reason = self._table.accept(convert.trajectory_from_message(message), self._now_s())
        except ValueError as error:
            reason = str(error)
        if reason:
            self.get_logger().warning(f"command refused: {reason}", throttle_duration_sec=1.0)
            return
        self._limits.follow()

    def _tick(self) -> None:
        """Give the drive its next set point, then say where the antenna is."""
        now_s = self._now_s()
        dt_s, self._stepped_s = min(max(now_s - self._stepped_s, 1e-3), 0.1), now_s
        goal, rate, acceleration = self._drive.encoders()[0], np.zeros(2), np.zeros(2)
        if not self._table.empty:
            sample = self._table.at(now_s)
            if sample.valid:
                goal, rate, acceleration = sample.position_rad, sample.velocity_rad_s, sample.acceleration_rad_s2
            elif sample.source == "dry":
                self._limits.stop()
        position, velocity, _ = self._limits.step(goal, rate, acceleration, dt_s)
        self._drive.command(position, velocity)
        angles, rates = self._drive.encoders()
        self._joints.publish(
            convert.joints_to_message(JointReading(t_s=now_s, position_rad=angles, velocity_rad_s=rates))
        )


def main() -> None:
    """Run until interrupted."""
    rclpy.init()
    node = AntennaDriver()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
