"""A drive behind topics, for a vendor's own driver node: set points out, state in.

Publishes: drive/set_point (sensor_msgs/JointState: position, or velocity for a drive of rates) and
drive/enable (std_msgs/Bool, latched; false: stop and set the brakes).  Subscribes: drive/state
(sensor_msgs/JointState: position, velocity where it is measured), stamped when it was measured.
"""

from contextlib import ExitStack
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from rf_pointing.core import AXES, BASE, JointReading, Pair, require_choice
from rf_pointing.drives import Capabilities, Drive, DriveParams, DriveReading, make_drive
from rf_pointing.drives.drive import POSITION, RATE
from rf_pointing.ros.qos import LATCHED, SET_POINT
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.streams import checked_message, frame_in, require_length
from rf_pointing.station.antenna.drive_antenna import CONNECT_S, DriveAntenna, connected_antenna
from rf_pointing.station.antenna.simulated_antenna import AntennaParams

PATIENCE_S = 0.5
"""Longest wait for a device in one attempt of a node that tries again; it reports meanwhile."""
STATE_BYTES = 64 * 1024
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Quality of service of a state of which only the newest counts."""


class TopicDrive(Drive):
    """The topics of one antenna's drive; `drive.model` says whether it takes positions or rates."""

    def __init__(self, beside: Node, params: DriveParams) -> None:
        model = params.model or POSITION
        require_choice("drive.model", model, (POSITION, RATE))
        rotator = params.rotator
        first, second = (step or 1e-4 for step in rotator.resolution_rad)
        self.capabilities = Capabilities(
            set_points=model, resolution_rad=(first, second), rate_rad_s=rotator.rate_rad_s,
            period_s=params.link.poll_period_s, latency_s=rotator.latency_s,
            one_turn=rotator.reads_one_turn,
        )  # fmt: skip
        self.losses: dict[str, int] = {"state that cannot be used": 0}
        self._lost_s, self._t_s, self._stepped_s = params.link.lost_s, 0.0, 0.0
        self._reading: DriveReading | None = None
        self._refusal, self._taken, self._seen, self._behind_s = "", 0, 0, 0.0
        # A node of its own: its executor is turned by `step`, also before the antenna's node runs.
        self.node = Node(
            f"{beside.get_name()}_drive", namespace=beside.get_namespace(), context=beside.context,
            use_global_arguments=False, start_parameter_services=False,
        )  # fmt: skip
        self._set_points = self.node.create_publisher(JointState, "drive/set_point", SET_POINT)
        self._enabled = self.node.create_publisher(Bool, "drive/enable", LATCHED)
        self.node.create_subscription(JointState, "drive/state", self.take_state, NEWEST, raw=True)
        self._executor = SingleThreadedExecutor(context=beside.context)
        self._executor.add_node(self.node)
        self.problem = "no message on drive/state yet"

    def clock_stepped(self, by_s: float) -> None:
        # The newest state is as old as before; the next one shows whether its clock came along.
        self._t_s, self._stepped_s = self._t_s + by_s, self._stepped_s + by_s

    def step(self, t_s: float) -> DriveReading | None:
        # A step that came late is not silence of the device.
        late_s, self._t_s = max(0.0, t_s - (self._t_s or t_s)), t_s
        before = self._taken
        for _ in range(2):
            # One that only ends the wait of the spin before takes nothing.
            if self._taken == before:
                self._executor.spin_once(timeout_sec=0.0)
        if self._reading is not None:
            age_s, most_s = self._reading.age_s(t_s - late_s) - self._stepped_s, self._lost_s
            self._behind_s = age_s if self._taken > self._seen else self._behind_s
            self._seen = self._taken
            found = f"no message on drive/state for {age_s:.2f} s"
            if self._behind_s > most_s:
                found = f"the stamps on drive/state are {self._behind_s:.1f} s behind this computer's clock"
            self.problem = f"{found}, at most {most_s:.2f} s" if age_s > most_s else ""
        if self.problem and self._refusal:
            self.problem = f"no message on drive/state that can be used: {self._refusal}"
        return self._reading

    def go_to(self, position_rad: Pair) -> None:
        self._publish(position=list(position_rad))

    def turn(self, rate_rad_s: Pair) -> None:
        self._publish(velocity=list(rate_rad_s))

    def stop(self) -> None:
        self._enabled.publish(Bool(data=False))

    def enable(self) -> None:
        self._enabled.publish(Bool(data=True))

    def close(self) -> None:
        self.stop()
        self._executor.shutdown()
        self.node.destroy_node()

    def _publish(self, **values: list[float]) -> None:
        message = JointState(name=list(AXES), **values)
        message.header.stamp = stamp_from_seconds(self._t_s)
        message.header.frame_id = frame_in(self.node.get_namespace(), BASE)
        self._set_points.publish(message)

    def take_state(self, payload: bytes) -> None:
        """Take a message of drive/state; one that cannot be used is counted."""
        # Turned by the periodic work of the antenna's node, which nothing that arrives may end.
        self._taken += 1
        try:
            require_length(payload, STATE_BYTES)
            self._reading, self._refusal = self._reading_of(checked_message(payload, JointState)), ""
            self._stepped_s = 0.0
        except ValueError as error:
            self.losses["state that cannot be used"] += 1
            self._refusal = str(error)

    def _reading_of(self, message: JointState) -> DriveReading:
        # Other joints of the vendor's machine, a polarizer for example, are its own.
        names, measured = list(message.name), len(message.velocity) > 0
        if any(names.count(axis) != 1 for axis in AXES):
            raise ValueError(f"joints are {', '.join(names) or 'none'}, must have {', '.join(AXES)} once")
        for field, values in (("position", message.position), ("velocity", message.velocity if measured else names)):
            if len(values) != len(names):
                raise ValueError(f"{field} has {len(values)} values, must have one for each of {len(names)} joints")
        order = [names.index(axis) for axis in AXES]
        rates = [message.velocity[index] for index in order] if measured else [0.0, 0.0]
        joints = JointReading(
            t_s=seconds_from_stamp(message.header.stamp),
            position_rad=[message.position[index] for index in order],
            velocity_rad_s=rates,
        )
        # A state of the future would never be too old.
        ahead_s = joints.t_s - self._t_s
        if ahead_s > self._lost_s:
            raise ValueError(f"its stamp is {ahead_s:.1f} s ahead of this computer's clock")
        azimuth, elevation = joints.position_rad.tolist()
        return DriveReading(
            t_s=joints.t_s, position_rad=(azimuth, elevation), rate_rad_s=(rates[0], rates[1]) if measured else None
        )


def drive_beside(name: str, namespace: str, params: DriveParams, ends: ExitStack) -> TopicDrive:
    """Return the drive of a namespace for a program that is not a node; `ends` releases ROS."""
    rclpy.init()
    ends.callback(rclpy.try_shutdown)
    node = Node(name, namespace=namespace, use_global_arguments=False, start_parameter_services=False)
    ends.callback(node.destroy_node)
    return TopicDrive(node, params)


class DriveConnection:
    """The drive of antenna_servo, from its making until an antenna is in front of it.

    A drive that has not answered yet is kept from attempt to attempt: it may need longer than one.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._made: tuple[DriveParams, Drive] | None = None

    def antenna(self, params: AntennaParams) -> DriveAntenna:
        """Return the antenna on the drive of the parameters; ValueError says why not yet."""
        node = self._node
        if self._made is None or self._made[0] != params.drive:
            self.release()
            topic = params.drive.type == "topic"
            drive = TopicDrive(node, params.drive) if topic else make_drive(params.drive, params.antenna.start_rad)
            drive.now_s = node.now_s
            self._made = params.drive, drive
        patience_s = PATIENCE_S if node.brings_itself_up else CONNECT_S
        try:
            antenna = connected_antenna(params, self._made[1], node.now_s(), patience_s)
        except ValueError:
            if not node.brings_itself_up:
                self.release()
            raise
        self._made = None
        return antenna

    def release(self) -> None:
        """Close a drive that has not answered."""
        made, self._made = self._made, None
        if made is not None:
            made[1].close()
