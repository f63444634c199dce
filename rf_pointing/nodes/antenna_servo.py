"""Executable `antenna_servo`: an antenna's control unit and its drive, simulated or real.

Subscribes: joint_trajectory; on a real drive of a station with an anemometer weather/wind
(geometry_msgs/Vector3Stamped: velocity of the air in m/s, east, north, up).
Publishes: joint_states (50 Hz), antenna_status (10 Hz, on activation, and when a fault comes or
goes), sim/boresight (50 Hz, truth); while identifying manual_rate (50 Hz).
Action: identify (rf_pointing_msgs/Identify).
Services (std_srvs/Trigger): ~/stop (latches a fault), ~/pause, ~/resume, ~/park, ~/stow, ~/disable,
~/reset_fault; ~/go_to (rf_pointing_msgs/GoTo: to a position, and hold there); ~/stow_in_fault
(rf_pointing_msgs/StowInFault: the elevation alone, by an operator who names the fault);
~/inject_fault (rf_pointing_msgs/InjectFault, where fault injection is enabled).  While a signed
commander has the antenna, all but stop and inject_fault are taken by ~/signed alone
(rf_pointing_msgs/SignedCall, `leased_services.py`).
Parameters: antenna.*, drive.* (which drive, and how it is reached), loops.* (retunable while
running),
safety.*, wrap_file (keeps the azimuth's turn over a restart; empty: not kept), state_file (keeps
position, fault and rest), command_key_file (only commands signed with it are taken),
enable_fault_injection, and as truth of the simulated drive plant.* (changeable too), wind.*,
mount.*.  What guards the antenna (`GUARDS`) changes only while the drives are disabled, the key
only at the start.  Activation releases the brakes and holds; deactivation sets them.

A drive other than the simulated one must answer within 5 s of the configuration.  One that is lost
latches a fault, and joint_states are silent until it answers.  The topics of the drive `topic` are
in `topic_drive.py`.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Vector3Stamped
from rf_pointing_msgs.msg import AntennaStatus, Boresight
from rf_pointing_msgs.srv import GoTo, InjectFault, StowInFault
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.core import AXES
from rf_pointing.drives import make_drive
from rf_pointing.planning import WrapCount
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Health
from rf_pointing.ros.graph import WIND
from rf_pointing.ros.identification_server import IdentificationServer
from rf_pointing.ros.leased_services import LeasedServices
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.qos import COMMAND_INPUT, SAMPLES, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import ExecutiveWatch, StationNode
from rf_pointing.ros.topic_drive import TopicDrive
from rf_pointing.station.antenna.drive_antenna import DriveAntenna, wait_for_drive
from rf_pointing.station.antenna.memory import AntennaMemory
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna
from rf_pointing.station.parameters import ServoNodeParams

LIVE = ("plant", "loops")
"""Parameter sets that may change while the antenna moves."""
GUARDS = {
    "preprocessor": "travel, rates and accelerations",
    "table": "the trust in commands far ahead",
    "oscillation": "what counts as an oscillation",
    **{f"{axis}.rate_limit_rad_s": "the largest rates" for axis in (*AXES, *(f"lqg_{axis}" for axis in AXES))},
}
"""What of the loops guards the antenna, and what it bounds."""
STATUS_PERIOD_S = 0.1
HEAD_BYTES = 4096
POINT_BYTES = 112
"""Of a point of a command: four sequences of two numbers with their lengths, and its time."""
INACTIVE_PERIOD_S = 0.05
"""Time between two looks at a real drive while the node is not active."""
WRAP_EVERY = 10
"""Statuses after which the azimuth's turn is written if it has changed."""


class AntennaServo(StationNode):
    """Steps the simulated antenna once a tick of node time; ticks that fire late are made up."""

    def __init__(self) -> None:
        super().__init__("antenna_servo")
        self.parameters.declare("", ServoNodeParams())
        self.parameters.declare("", CommandKeyParams(), group="key")
        for prefix, defaults in AntennaParams().sets().items():
            self.parameters.declare(prefix, defaults, live=prefix in LIVE)
        self.parameters.check_with(self._check)
        self.parameters.on_change(self._retune)
        self._antenna: SimulatedAntenna | DriveAntenna | None = None
        self._identification = IdentificationServer(self)
        self._statuses = 0
        self._published_fault = ""
        self._wrap: WrapCount | None = None
        self._wrap_problem = ""
        self._tick_wall_s: float | None = None
        self._lateness_s = 0.0
        self._ticked_s = math.inf
        self._early: deque[JointTrajectory] = deque(maxlen=COMMAND_INPUT.depth)

    def configure(self) -> None:
        value = self.parameters.value
        self._memory = AntennaMemory(value("").state_file)
        params = AntennaParams(**{prefix: value(prefix) for prefix in AntennaParams().sets()})
        real = params.drive.type != "simulated"
        self._antenna = self._on_drive(params) if real else SimulatedAntenna(self._memory.start(params))
        self._status_every = max(1, round(STATUS_PERIOD_S / self._antenna.params.tick_s))
        self._joints = self.publisher(JointState, "joint_states", STREAM)
        self._boresight = self.stream(Boresight, "sim/boresight", SAMPLES)
        self._status = self.stream(AntennaStatus, "antenna_status", STATUS)
        self._identification.configure(self._antenna)
        self._key = CommandKey(self.parameters.value("key"), self.resolve_topic_name("joint_trajectory"))
        self._leased = LeasedServices(self, self._key)
        self.listen(
            JointTrajectory, "joint_trajectory", self._on_trajectory, COMMAND_INPUT,
            most_bytes=self._longest_command, refused=self._antenna.reject,
        )  # fmt: skip
        self.serve_action(Trigger, "~/stop", self._stop)
        self._recover_wrap()
        antenna = self._antenna
        actions = {"reset_fault": antenna.reset_fault, "pause": antenna.pause, "resume": antenna.resume,
                   "park": antenna.park, "stow": antenna.stow, "disable": antenna.disable}  # fmt: skip
        for name, action in actions.items():
            self._leased.serve(Trigger, name, partial(self._act, name, action))
        self._leased.serve(GoTo, "go_to", self._go_to)
        self._leased.serve(StowInFault, "stow_in_fault", self._stow_in_fault)
        if real and params.safety.wind.watched:
            self.listen(Vector3Stamped, WIND, self._on_wind, STREAM)
        if value("").enable_fault_injection and not real:
            self.serve_action(InjectFault, "~/inject_fault", self._inject)
        self.diagnostics.add("drive", self._health)
        self.diagnostics.add("commanders", self._commander_health)
        if real:
            self.diagnostics.add("device", self._device_health)
        self.diagnostics.add("oscillation", self._oscillation_health)
        self.diagnostics.add("memory", self._memory_health)
        ExecutiveWatch(self)

    def _on_drive(self, params: AntennaParams) -> DriveAntenna:
        """Connect the drive of the parameters; it is looked at until cleanup."""
        if self.parameters.value("").enable_fault_injection:
            raise ValueError(f"enable_fault_injection needs drive.type=simulated, it is {params.drive.type}")
        topic = params.drive.type == "topic"
        drive = TopicDrive(self, params.drive) if topic else make_drive(params.drive, params.antenna.start_rad)
        begun_s, steady_s = self.now_s(), time.monotonic()
        try:
            # Simulated time does not go on while this waits.
            wait_for_drive(drive, lambda: begun_s + time.monotonic() - steady_s)
            antenna = DriveAntenna(params, drive, begun_s + time.monotonic() - steady_s)
        except ValueError:
            drive.close()
            raise
        self._at_cleanup.callback(antenna.close)
        timer = self.create_timer(INACTIVE_PERIOD_S, self._look)
        self._at_cleanup.callback(self.destroy_timer, timer)
        return antenna

    def _look(self) -> None:
        """Keep a real drive connected while there are no ticks."""
        if not self.active:
            self._antenna.hardware.look(self.now_s())

    def activate(self) -> None:
        if isinstance(self._antenna, DriveAntenna):
            self._antenna.hardware.look(self.now_s())
            if not self._antenna.hardware.current:
                raise ValueError(self._antenna.hardware.fault)
        self._antenna.enable()
        self._memory.restore(self._antenna)
        self._tick_wall_s = None
        self._ticked_s = self.now_s()
        self._early.clear()
        self._joints.publish(convert.joints_to_message(self._antenna.reading(self._ticked_s)))
        self._publish_status(self._ticked_s)
        self._schedule = self.every(self._antenna.params.tick_s, self._tick)

    def deactivate(self) -> None:
        self._ticked_s = math.inf
        try:
            self._antenna.deactivate()
        except Exception as error:
            # The stop itself has failed: only the brakes are left.
            self._antenna.trip(f"the stop has failed: {error}")
            raise
        self._identification.end()
        self._keep_wrap()

    def fail(self, reason: str) -> None:
        # The fault goes into the file first: whatever raised may raise again in the stop.
        if self.active:
            self._antenna.stop(f"antenna_servo failed: {reason}")
            self._memory.keep(self._antenna, self._antenna.t_s)

    def _recover_wrap(self) -> None:
        """Check the kept turn against the encoder, which counts all turns; a real one has one."""
        name = self.parameters.value("").wrap_file
        self._wrap, self._wrap_problem = WrapCount(Path(name)) if name else None, ""
        one_turn = isinstance(self._antenna, DriveAntenna) and self._antenna.hardware.drive.capabilities.one_turn
        if self._wrap is None:
            if one_turn:
                self._antenna.stop(
                    "the drive reads the azimuth modulo 360 deg and no wrap_file keeps its turn: "
                    "look at the cables, then reset"
                )
            return
        azimuth = float(self._antenna.reading(0.0).position_rad[0])
        recovered, doubt = self._wrap.recover(azimuth)
        if one_turn:
            self._antenna.place(recovered)
        elif not doubt and abs(recovered - azimuth) > 1e-6:
            doubt = "the wrap file names another turn than the encoder: look at the cables, then reset"
        if doubt:
            self._antenna.stop(doubt)
        self._keep_wrap()
        if self._wrap_problem:
            raise ValueError(self._wrap_problem)

    def _keep_wrap(self) -> None:
        """Write the azimuth's turn; a full disk must not leave the antenna alone in its motion."""
        if self._wrap is None or self._antenna.status(self.now_s()).fault:
            return
        try:
            self._wrap.keep(float(self._antenna.reading(0.0).position_rad[0]))
            self._wrap_problem = ""
        except OSError as error:
            self._wrap_problem = f"wrap_file={self.parameters.value('').wrap_file} cannot be written: {error.strerror}"

    def _tick(self, t_s: float) -> None:
        # After a jump of the clock every time in the command table means another direction.
        if self._schedule.jumped_s:
            self._antenna.stop(f"the clock jumped by {self._schedule.jumped_s:+.2f} s")
        elif self._schedule.stalled_s:
            self._antenna.stop("")
            self.get_logger().error(
                f"this process stalled for {self._schedule.stalled_s:.1f} s: stopped until the next command"
            )
        self._measure_lateness(self._antenna.params.tick_s)
        self._ticked_s = t_s
        reading, boresight = self._antenna.step(t_s)
        if reading is not None:
            self._joints.publish(convert.joints_to_message(reading))
        if boresight is not None:
            self._boresight.publish(convert.boresight_to_message(boresight))
        self._identification.tick(t_s)
        fault = self._antenna.safety.latch.text
        news, self._published_fault = fault != self._published_fault, fault
        # A fault is kept in the file before anyone is informed of it, and published at once.
        if news or round(t_s / self._antenna.params.tick_s) % self._status_every == 0:
            self._memory.keep(self._antenna, t_s)
            self._publish_status(t_s)
            self._statuses += 1
            if self._statuses % WRAP_EVERY == 0:
                self._keep_wrap()
        if news:
            self.diagnostics.publish()
        while self._early and seconds_from_stamp(self._early[0].header.stamp) <= t_s:
            self._take(self._early.popleft())

    def _publish_status(self, t_s: float) -> None:
        message = convert.antenna_status_to_message(self._antenna.status(t_s))
        message.tick_lateness = self._lateness_s
        self._status.publish(message)

    def _measure_lateness(self, tick_s: float) -> None:
        """Compare the wall time between two ticks with the period; another speed than 1 shows."""
        wall_s = time.perf_counter()
        if self._tick_wall_s is not None:
            self._lateness_s = wall_s - self._tick_wall_s - tick_s
        self._tick_wall_s = wall_s

    def _longest_command(self) -> int:
        """Return the bytes of the longest command; decoding 100 000 points takes 0.8 s."""
        return HEAD_BYTES + POINT_BYTES * int(self.parameters.value("loops").table.max_points)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        """Take a command; one issued at an instant between tick and clock waits for its tick."""
        # Which of clock and command arrives first is chance; taken at once the same run would give
        # another pass.
        if self._ticked_s < seconds_from_stamp(message.header.stamp) <= self.now_s():
            self._early.append(message)
        else:
            self._take(message)

    def _take(self, message: JointTrajectory) -> None:
        try:
            commander = self._key.check(message)
            self._leased.note(commander, seconds_from_stamp(message.header.stamp))
            command = convert.trajectory_from_message(message)
            refused = self._antenna.accept(command, self.now_s(), commander)
        except ValueError as error:
            refused = self._antenna.reject(str(error))
        if refused:
            self.log_once("command rejected", refused)

    def _stop(self, _request: Trigger.Request) -> str:
        self._antenna.stop("stop was requested")
        return "stopping; reset_fault allows motion again"

    @staticmethod
    def _act(name: str, action: Callable[[], str], _request: Trigger.Request) -> str:
        """Do what returns "" or why not."""
        if refused := action():
            raise ValueError(refused)
        return f"{name} accepted"

    def _go_to(self, request: GoTo.Request) -> str:
        return self._act("go_to", partial(self._antenna.go_to, (request.azimuth, request.elevation)), request)

    def _stow_in_fault(self, request: StowInFault.Request) -> str:
        if refused := self._antenna.stow_in_fault(request.fault):
            raise ValueError(refused)
        return "stowing the elevation; the azimuth is braked, and the fault stays latched"

    def _on_wind(self, message: Vector3Stamped) -> None:
        """Take the speed of the wind, unless it is so old that it counts as silence."""
        age_s = self.now_s() - seconds_from_stamp(message.header.stamp)
        if age_s <= self._antenna.safety.wind.params.silence_s:
            self._antenna.hardware.note_wind(math.hypot(message.vector.x, message.vector.y))

    def _inject(self, request: InjectFault.Request) -> str:
        self._antenna.injected.inject(request.fault, request.value)
        return f"{request.fault} injected at {self._antenna.t_s:.3f}"

    def _check(self, sets: Mapping[str, Any]) -> None:
        key = self.parameters.value("key")
        if key.command_key_file and sets["key"] != key:
            # Whoever can reach the node could otherwise put a key of his own in its place.
            raise ValueError("command_key_file is given when antenna_servo starts, and cannot change")
        if self._antenna is None:
            return
        present = self.parameters.value("loops")
        for name, words in GUARDS.items():
            guard = attrgetter(name)
            if guard(sets["loops"]) == guard(present):
                continue
            # Anybody may deactivate the node, which disables the drives.
            if not self.active and (holder := self._leased.holder):
                raise ValueError(f"loops.{name} guards the antenna: {words} cannot change while {holder} commands it")
            if self.active and self._antenna.axes.hardware.powered:
                raise ValueError(
                    f"loops.{name} guards the antenna: {words} cannot change while the drives are enabled "
                    f"(the antenna is {self._antenna.mode}); disable it first"
                )
        self._antenna.check(sets["plant"], sets["loops"])

    def _retune(self) -> None:
        if self._antenna is not None:
            self._antenna.retune(self.parameters.value("plant"), self.parameters.value("loops"))

    def _health(self) -> Health:
        status = self._antenna.status(self.now_s())
        level = ERROR if status.fault else WARN if any(status.at_limit) or status.warning else OK
        fault = self._antenna.safety.latch.fault
        rejected = {"commands_rejected": status.commands_rejected, "last_rejection": status.last_rejection}
        before = {"fault_at_s": f"{fault.t_s:.3f}", "last_commands": " | ".join(fault.lines())} if fault else {}
        values = {"commands_accepted": status.commands_accepted, "commander": status.commander, **rejected, **before}
        return Health(level, status.fault or status.warning or status.mode, values)

    def _commander_health(self) -> Health:
        found = self._key.health(self.get_publishers_info_by_topic("joint_trajectory"))
        return Health(found.level, found.message, {**found.values, **self._leased.values()})

    def _device_health(self) -> Health:
        hardware = self._antenna.hardware
        rotator, reading = hardware.rotator, hardware.rotator.reading
        counts = rotator.counts()
        values = {f"lost {name}": count for name, count in hardware.drive.losses.items()} | {
            "set_points": counts.commands,
            **{f"{axis}_starts": count for axis, count in zip(AXES, counts.starts, strict=True)},
            **{f"{axis}_reversals": count for axis, count in zip(AXES, counts.reversals, strict=True)},
            "latency_s": f"{rotator.latency_s:.2f}",
            "age_s": f"{reading.age_s(self.now_s()):.2f}",
            "status": reading.status,
        }
        if reading.temperature_k is not None:
            values["temperature_k"] = f"{reading.temperature_k:.1f}"
        return Health(ERROR if hardware.fault else OK, hardware.fault or self.parameters.value("drive").type, values)

    def _memory_health(self) -> Health:
        problems = "; ".join(filter(None, (self._memory.problem, self._wrap_problem)))
        return Health(WARN if problems else OK, problems or "kept", {})

    def _oscillation_health(self) -> Health:
        watch = dict(zip(AXES, self._antenna.axes.loops.watch, strict=True))
        found = "; ".join(f"{axis}: {seen.reason}" for axis, seen in watch.items() if seen.oscillating)
        swings = {f"{axis}_swings_in_a_row": len(seen.state.row) for axis, seen in watch.items()}
        return Health(ERROR if found else OK, found or "none", swings)


def main() -> None:
    """Entry point of `ros2 run rf_pointing antenna_servo`."""
    run(AntennaServo)
