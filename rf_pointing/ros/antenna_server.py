"""Topics and services of an antenna in operation.

They are those of `antenna_servo`, and last until cleanup.
"""

import math
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from rf_pointing_msgs.msg import AntennaStatus, Boresight, CommandSignature
from rf_pointing_msgs.srv import GoTo, InjectFault, Jog, PermitSun, StowInFault
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.core.moving_base import BaseSample
from rf_pointing.ephemeris.solar import SunPermit
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.convert import pair
from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.graph import BASE_IMU, BASE_ODOMETRY, COMMANDS, SIGNATURES, WIND
from rf_pointing.ros.identification_server import IdentificationServer
from rf_pointing.ros.leased_services import LeasedServices
from rf_pointing.ros.qos import COMMAND_INPUT, SAMPLES, STATUS, STREAM
from rf_pointing.ros.signed_commands import CommandPairs
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import STAMP_RESOLUTION_S, checked_message
from rf_pointing.station.antenna.control_unit import AntennaStatus as ControlUnitStatus
from rf_pointing.station.antenna.modes import OPERATED
from rf_pointing.station.antenna.operation import AntennaOperation, Tick
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna

HEAD_BYTES = 4096
"""Longest head of a command, and longest signature."""
EARLY_S, MOST_EARLY = 0.5, 10
"""How far ahead of the ticks, and how many, commands in simulated time wait for them."""
antenna_status_to_message, _ = pair(ControlUnitStatus, AntennaStatus)
POINT_BYTES = 112
"""Length of a point of a command: its time, and four sequences of two numbers with lengths."""


class AntennaServer:
    """Belongs to one node; `serve` connects it with the operation."""

    def __init__(self, node: StationNode, key: CommandKeyParams, identification: IdentificationServer) -> None:
        self._node, self._identification = node, identification
        self._joints = node.publisher(JointState, "joint_states", STREAM)
        self._boresight = node.stream(Boresight, "sim/boresight", SAMPLES)
        self._status = node.stream(AntennaStatus, "antenna_status", STATUS)
        self._key = CommandKey(key, node.resolve_topic_name(COMMANDS))
        self.leased = LeasedServices(node, self._key)
        self._simulated: bool = node.get_parameter("use_sim_time").value
        self._early = deque[tuple[JointTrajectory, str, float]](maxlen=MOST_EARLY)
        self._ticked_s = -math.inf

    def serve(self, operation: AntennaOperation, longest: Callable[[], int]) -> None:
        """Take commands of at most `longest()` points, and requests."""
        node, antenna = self._node, operation.antenna
        self._operation, self._axes = operation, antenna.safety.params.kinematics.axes
        pairs = self._pairs = CommandPairs(
            self._key, self._on_command, lambda reason: self._refuse(antenna.reject(reason)),
            unsigned=antenna.safety.params.unsigned_commands,
        )  # fmt: skip
        node.listen(
            JointTrajectory, COMMANDS, lambda raw: pairs.note_command(raw, node.now_s()), COMMAND_INPUT,
            raw=True, refused=antenna.reject, most_bytes=lambda: HEAD_BYTES + POINT_BYTES * longest(),
        )  # fmt: skip
        node.listen(
            CommandSignature, SIGNATURES, lambda m: pairs.note_signature(m, node.now_s()), COMMAND_INPUT,
            most_bytes=lambda: HEAD_BYTES,
        )  # fmt: skip
        node.serve_action(Trigger, "~/stop", self._stop, urgent=True)
        for name in OPERATED:
            self.leased.serve(Trigger, name, partial(_do, name, getattr(antenna, name)))
        self.leased.serve(GoTo, "go_to", lambda r: _do("go_to", partial(antenna.go_to, (r.azimuth, r.elevation)), r))
        jog = lambda r: _do("jog", partial(antenna.jog, (r.azimuth, r.elevation)), r)  # noqa: E731
        self.leased.serve(Jog, "jog", jog)
        self.leased.serve(StowInFault, "stow_in_fault", self._stow_in_fault)
        self.leased.serve(PermitSun, "permit_sun", self._permit_sun)
        node.diagnostics.add_report("drive", lambda: operation.drive_report(node.now_s()))
        if antenna.stage is not None:
            node.diagnostics.add_report("second_stage", operation.stage_report)
        node.diagnostics.add("commanders", self._commanders)
        # A simulated antenna has a wind of its own, and no anemometer.
        if not isinstance(antenna, SimulatedAntenna) and antenna.safety.params.wind.watched:
            node.listen(Vector3Stamped, WIND, self._on_wind, STREAM, required=True)
        # As little does it subscribe an IMU: its own is simulated with the motion that it measures.
        if not isinstance(antenna, SimulatedAntenna) and antenna.safety.base is not None:
            node.listen(Imu, BASE_IMU, self._on_imu, STREAM)
            node.listen(Odometry, BASE_ODOMETRY, self._on_odometry, STREAM)
        if antenna.safety.base is not None:
            node.diagnostics.add_report("base", lambda: operation.base_report(node.now_s()))
        if node.parameters.value("").enable_fault_injection:
            node.serve_action(InjectFault, "~/inject_fault", self._inject)

    def _on_command(self, payload: bytes, commander: str) -> None:
        try:
            message = checked_message(payload, JointTrajectory)
            stamp_s = seconds_from_stamp(message.header.stamp)
            if commander and self._key.signed and not stamp_s:
                raise ValueError("a signed command has stamp 0, must have its time: it could be sent again")
        except ValueError as error:
            self._refuse(self._operation.antenna.reject(str(error)))
            return
        # As every controller of ROS: stamp 0 begins now.
        issued_s = stamp_s or self._node.now_s()
        if self._simulated and self._ticked_s < issued_s - STAMP_RESOLUTION_S < self._ticked_s + EARLY_S:
            self._early.append((message, commander, issued_s))
        else:
            self._take(message, commander, issued_s)

    def begin_tick(self, t_s: float) -> None:
        """Take the commands that were issued before a tick and arrived before the ticks until then.

        So simulated time gives the same motion, whichever of command and clock arrives first.
        """
        self._pairs.expire(self._node.now_s())
        while self._early and self._early[0][2] < t_s - STAMP_RESOLUTION_S:
            self._take(*self._early.popleft())
        self._ticked_s = t_s

    def _take(self, message: JointTrajectory, commander: str, issued_s: float) -> None:
        try:
            if commander:
                self.leased.note(commander, issued_s)
            command = convert.trajectory_from_message(message, issued_s, self._axes)
            refused = self._operation.take(command, commander, issued_s, self._node.now_s())
        except ValueError as error:
            refused = self._operation.antenna.reject(str(error))
        self._refuse(refused)

    def _refuse(self, reason: str) -> None:
        if reason:
            self._node.log_once("command rejected", reason)

    def _on_wind(self, message: Vector3Stamped) -> None:
        age_s = self._node.now_s() - seconds_from_stamp(message.header.stamp)
        self._operation.note_wind(math.hypot(message.vector.x, message.vector.y), age_s)

    def _on_imu(self, message: Imu) -> None:
        self._on_base(message.header.stamp, message.orientation, message.angular_velocity)

    def _on_odometry(self, message: Odometry) -> None:
        attitude, rate = message.pose.pose.orientation, message.twist.twist.angular
        self._on_base(message.header.stamp, attitude, rate)

    def _on_base(self, stamp: Time, attitude: Quaternion, rate: Vector3) -> None:
        base = self._operation.antenna.safety.base
        assert base is not None
        quaternion = attitude.x, attitude.y, attitude.z, attitude.w
        t_s, rate_rad_s = seconds_from_stamp(stamp), np.array([rate.x, rate.y, rate.z])
        try:
            sample = BaseSample(t_s=t_s, quaternion=quaternion, rate_rad_s=rate_rad_s)
        except ValueError as error:
            base.refuse(str(error))
        else:
            base.take(sample, self._node.now_s())

    def _stop(self, _request: Trigger.Request) -> str:
        self._operation.antenna.stop("stop was requested")
        return "stopping; reset_fault allows motion again"

    def _stow_in_fault(self, request: StowInFault.Request) -> str:
        _do("", partial(self._operation.antenna.stow_in_fault, request.fault), request)
        return "stowing the elevation; the azimuth is braked, and the fault stays latched"

    def _permit_sun(self, request: PermitSun.Request) -> str:
        permit = None
        if request.by:
            until_t_s = seconds_from_stamp(request.until)
            permit = SunPermit(by=request.by, band=request.band, until_t_s=until_t_s)
        _do("", lambda: self._operation.antenna.permit_sun(permit, self._node.band), request)
        text = permit.text if permit else "the Sun is no longer permitted"
        self._node.get_logger().warning(text)
        return text

    def _inject(self, request: InjectFault.Request) -> str:
        antenna = self._operation.antenna
        assert isinstance(antenna, SimulatedAntenna)
        antenna.injected.inject(request.fault, request.value)
        return f"{request.fault} injected at {antenna.t_s:.3f}"

    def _commanders(self) -> Health:
        # An antenna without ticks ends the waiting here.
        self._pairs.expire(self._node.now_s())
        found = self._key.health(self._node.get_publishers_info_by_topic(COMMANDS))
        return Health(found.level, found.message, {**found.values, **self.leased.values()})

    def send(self, tick: Tick, t_s: float) -> None:
        """Publish what a tick has given."""
        if tick.reading is not None:
            self._joints.publish(convert.joints_to_message(tick.reading, self._axes))
        if tick.boresight is not None:
            self._boresight.publish(convert.boresight_to_message(tick.boresight))
        self._identification.tick(t_s)
        if tick.status is not None:
            message = antenna_status_to_message(tick.status)
            message.tick_lateness = self._operation.lateness_s
            self._status.publish(message)
        if tick.fault is not None:
            # An operator waits for it.
            self._node.diagnostics.publish()
        for reason in tick.refused:
            self._node.log_once("command rejected", reason)


def _do(name: str, act: Callable[[], str], _request: Any) -> str:
    """Do what returns "" or why not."""
    if refused := act():
        raise ValueError(refused)
    return f"{name} accepted"
