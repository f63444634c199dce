"""Executable `antenna_servo`: an antenna's control unit and its drive, simulated or real.

Subscribes: joint_trajectory; on a real drive of a station with an anemometer weather/wind
(geometry_msgs/Vector3Stamped: velocity of the air in m/s, east, north, up); on a real drive of a
base that moves base/imu (sensor_msgs/Imu) or base/odometry (nav_msgs/Odometry).
Publishes: joint_states (50 Hz), antenna_status (10 Hz, on activation, and when a fault comes or
goes), sim/boresight (50 Hz, truth); while identifying manual_rate (50 Hz).
Action: identify (rf_pointing_msgs/Identify).
Services (std_srvs/Trigger): ~/stop (latches a fault), ~/pause, ~/resume, ~/park, ~/stow, ~/disable,
~/reset_fault; ~/go_to (rf_pointing_msgs/GoTo: to a position, and hold there); ~/jog
(rf_pointing_msgs/Jog: at rates, for 0.5 s more); ~/stow_in_fault
(rf_pointing_msgs/StowInFault: the elevation alone, by an operator who names the fault);
~/permit_sun (rf_pointing_msgs/PermitSun: the beam may look into the Sun, once and until a time);
~/inject_fault (rf_pointing_msgs/InjectFault, where fault injection is enabled).  While a signed
commander has the antenna, all but stop and inject_fault are taken by ~/signed alone
(rf_pointing_msgs/SignedCall, `leased_services.py`).
Parameters: antenna.*, drive.* (which drive, and how it is reached), loops.* (retunable while
running), safety.*, second_stage.* (`topic_stage.py`), wrap_file (keeps the azimuth's turn over a
restart; empty: not kept), state_file (keeps position, fault and rest), command_key_file (only
commands signed with it are taken), enable_fault_injection, and as truth of the simulated drive
plant.* (changeable too), wind.*, mount.*, base_motion.*.  What guards the antenna changes only
while the drives are disabled, the key only at the start.  Activation releases the brakes,
deactivation sets them.

A drive other than the simulated one must answer within 5 s of the configuration; a node that
brings itself up waits for it, however long it takes.  One that is lost latches a fault, and
joint_states are silent until it answers.  The topics of the drive `topic` are
in `topic_drive.py`.
"""

import time
from collections.abc import Mapping
from typing import Any

from rf_pointing.drives.registry import SIMULATED
from rf_pointing.ros.antenna_server import AntennaServer
from rf_pointing.ros.identification_server import IdentificationServer
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.station_watches import ExecutiveWatch
from rf_pointing.ros.topic_drive import DriveConnection
from rf_pointing.ros.topic_stage import join_stage
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.memory import AntennaMemory
from rf_pointing.station.antenna.operation import LIVE, AntennaOperation
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

INACTIVE_PERIOD_S = 0.05
"""Time between two looks at a real drive while the node is not active."""


class AntennaServo(StationNode):
    """Ticks an antenna in operation; a simulated one makes up for ticks that are late."""

    def __init__(self) -> None:
        super().__init__("antenna_servo", live=dict.fromkeys(LIVE, True))
        self.parameters.check_with(self._check)
        self.parameters.on_change(self._retune)
        self._operation: AntennaOperation | None = None
        self._connection = DriveConnection(self)
        self._identification = IdentificationServer(self)

    def configure(self) -> None:
        value = self.parameters.value
        params = AntennaParams(**{prefix: value(prefix) for prefix in AntennaParams().sets()})
        memory, real = AntennaMemory(value("").state_file), params.drive.type != "simulated"
        antenna = self._on_drive(params) if real else SimulatedAntenna(memory.start(params))
        self._identification.configure(antenna)
        self._server = AntennaServer(self, value("key"), self._identification)
        operation = self._operation = AntennaOperation(antenna, memory, value("").wrap_file)
        self._server.serve(operation, lambda: int(value("loops").table.max_points))
        if real:
            self.diagnostics.add_report("device", lambda: operation.device_report(self.now_s()))
        self.diagnostics.add_report("oscillation", operation.oscillation_report)
        self.diagnostics.add_report("memory", operation.memory_report)
        ExecutiveWatch(self)

    def use_band(self) -> None:
        antenna = self._operation.antenna
        if isinstance(antenna, SimulatedAntenna):
            antenna.hardware.bend(self.parameters.value("mount"))
        permit = antenna.safety.sun.permit
        if permit is not None and permit.band != self.band:
            antenna.permit_sun(None)

    def _on_drive(self, params: AntennaParams) -> DriveAntenna:
        """Connect the drive of the parameters; it is looked at until cleanup."""
        if self.parameters.value("").enable_fault_injection:
            raise ValueError(f"enable_fault_injection needs drive.type=simulated, it is {params.drive.type}")
        antenna = self._connection.antenna(params)
        join_stage(self, antenna, params)
        self._at_cleanup.callback(antenna.close)
        # Keeps the drive connected while there are no ticks.
        look = self.timer(INACTIVE_PERIOD_S, lambda: self.active or antenna.hardware.look(self.now_s()))
        self._at_cleanup.callback(self.destroy_timer, look)
        return antenna

    def end(self) -> None:
        super().end()
        self._connection.release()

    def silent_because(self) -> str:
        antenna = self._operation.antenna if self._operation is not None else None
        lost = isinstance(antenna, DriveAntenna) and not antenna.hardware.current
        return f"joint_states are silent: {antenna.hardware.fault}" if lost else ""

    def activate(self) -> None:
        now_s = self.now_s()
        # A device cannot live through the past: it gets one tick for all that were missed.
        simulated = self.parameters.value("drive").type in SIMULATED
        self._schedule = self.every(self._operation.tick_s, self._tick, catches_up=simulated)
        # Last: brakes that are released without ticks would hold nothing.
        self._server.send(self._operation.start(now_s), now_s)

    def _tick(self, t_s: float) -> None:
        due = self._schedule
        jumped_s, stalled_s, stepped_s = due.jumped_s, due.stalled_s, due.stepped_s
        if stalled_s:
            self.get_logger().error(f"this process stalled for {stalled_s:.1f} s: stopped until the next command")
        self._server.begin_tick(t_s)
        tick = self._operation.tick(t_s, self.now_s(), time.perf_counter(), jumped_s, stalled_s, stepped_s)
        self._server.send(tick, t_s)

    def deactivate(self) -> None:
        self._operation.stop()
        self._identification.end()

    def fail(self, reason: str) -> None:
        if self.active:
            self._operation.fail(f"antenna_servo failed: {reason}")

    def _check(self, sets: Mapping[str, Any]) -> None:
        key = self.parameters.value("key")
        if key.command_key_file and sets["key"] != key:
            # Whoever can reach the node could otherwise put a key of his own in its place.
            raise ValueError("command_key_file is given when antenna_servo starts, and cannot change")
        if self._operation is not None:
            holder = self._server.leased.holder
            self._operation.check(self.parameters.value("loops"), sets, active=self.active, holder=holder)

    def _retune(self) -> None:
        if self._operation is not None:
            self._operation.antenna.retune(self.parameters.value("plant"), self.parameters.value("loops"))


main = AntennaServo.main
