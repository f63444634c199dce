"""A live antenna_servo on a clock that follows it, the commands to it, and what it says."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from rf_pointing_msgs.msg import AntennaStatus
from rf_pointing_msgs.srv import InjectFault
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.graph import COMMANDS, SIGNATURES
from rf_pointing.ros.leased_services import Caller
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.signed_commands import CommandSender
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from test.faults.clocks import ManualClock, WallClock

START_S = 1_151_384_000.0
START_RAD = (math.radians(120.0), math.radians(60.0))
RATE_RAD_S = math.radians(0.3)
PATIENCE_S = 120.0
"""Simulated time in which a condition must come true."""


class Servo:
    """Sends a steady azimuth motion; `begun_s` and `base_rad` are when and where the motion of a test began."""

    def __init__(
        self, live: SimpleNamespace, yaml: str, station: dict[str, Any], *, simulated: bool = True,
        key: str = "", wall: bool = False,
    ) -> None:  # fmt: skip
        params = CommandKeyParams(command_key_file=key)
        self.caller = Caller(live.node, CommandKey(params))
        self.live, self.status, self.joints = live, AntennaStatus(), []
        self.simulated = simulated
        self.said: dict[str, str] = {}
        self.commanders = DiagnosticStatus()
        self.seen: list[AntennaStatus] = []
        self.heard_s = 0.0
        self.begun_s: float | None = None
        self.base_rad = START_RAD[0]
        self._clients: dict[str, Any] = {}
        # A real device moves in real time, whatever the clock of the nodes does.
        follows = (lambda: self.heard_s) if simulated else None
        self.clock: Any = WallClock(live) if wall else ManualClock(live, START_S, follows)
        self.wind = live.node.create_publisher(Vector3Stamped, "weather/wind", STREAM)
        if not simulated:
            self.clock.ticked = self._blow
        self.commands = CommandSender(live.node, params)
        live.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        live.node.create_subscription(JointState, "joint_states", self._on_joints, STREAM)
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.processes: NodeProcesses = live.start(
            ["antenna_servo"], yaml, autostart=True, simulated=not wall, station=station
        )
        both = lambda: all(map(live.node.count_subscribers, (COMMANDS, SIGNATURES)))  # noqa: E731
        self.until(lambda: self.status.mode == "holding" and both(), "the antenna")

    @property
    def now_s(self) -> float:
        return self.clock.t_s

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Let time go on until the condition is true."""
        assert self.clock.run(PATIENCE_S, condition), f"waited {PATIENCE_S:.0f} s for {what}, {self.status}"

    def mode(self, *modes: str) -> None:
        """Let time go on until the antenna is in one of these modes."""
        self.until(lambda: self.status.mode in modes, " or ".join(modes))

    def command(self, shift_s: float = 0.0, positions: list[float] | None = None,
                joints: tuple[str, str] = ("azimuth", "elevation")) -> JointTrajectory:  # fmt: skip
        """Return a second of motion on the steady line, or of standing at `positions`."""
        now_s = self.now_s + shift_s
        if self.begun_s is None:
            self.begun_s = now_s
        message = JointTrajectory(joint_names=list(joints))
        message.header.stamp = stamp_from_seconds(now_s)
        for step in range(1, 9):
            line = [self.base_rad + RATE_RAD_S * (now_s - self.begun_s + 0.1 * step), START_RAD[1]]
            point = JointTrajectoryPoint(positions=positions or line, accelerations=[0.0, 0.0])
            point.velocities = [0.0 if positions else RATE_RAD_S, 0.0]
            point.time_from_start.nanosec = 100_000_000 * step
            message.points.append(point)
        return message

    def send(self, message: JointTrajectory, who: str = "test") -> None:
        """Send a command, signed, under a name."""
        self.commands.name = who
        self.commands.send(message)

    def move(self, seconds: float) -> None:
        """Keep commands coming for a while."""
        for _ in range(round(10.0 * seconds)):
            self.send(self.command())
            self.clock.run(0.1)

    def rejected(self, message: JointTrajectory, words: str, who: str = "test") -> None:
        """Send what must be refused in these words."""
        before = self.status.commands_rejected
        self.send(message, who)
        self.until(lambda: self.status.commands_rejected > before, f"the rejection ({words})")
        assert words in self.status.last_rejection, self.status.last_rejection

    def ask(self, name: str, kind: Any = Trigger, request: Any = None) -> Any:
        """Call a service of the node, signed where it has a lease; time stands meanwhile."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.caller.client(kind, f"antenna_servo/{name}")
            self.live.spin_until(client.service_is_ready, name)
        future = client.call_async(self.caller.request(f"antenna_servo/{name}", request or kind.Request()))
        self.live.spin_until(future.done, f"the answer of {name}")
        return future.result()

    def inject(self, fault: str, value: float = 0.0) -> float:
        """Put a fault in; return when, by the servo's own ticks."""
        answer = self.ask("inject_fault", InjectFault, InjectFault.Request(fault=fault, value=value))
        assert answer.success
        return float(answer.message.split()[-1])

    def fault_at(self) -> float:
        """Return when the latched fault was seen, by the servo's own ticks."""
        self.until(lambda: self.said.get("message") == self.status.fault, "the fault on /diagnostics")
        assert "s before, test: to" in self.said["last_commands"]
        return float(self.said["fault_at_s"])

    def recover(self) -> None:
        """Mend, reset and stand again, for the next fault."""
        if self.simulated:
            self.inject("none")
        self.mode("fault", "holding")
        self.until(lambda: self._reset() in ("", "no fault is latched"), "the reset")
        self.until(lambda: self.status.mode == "holding" and not self.status.fault, "the reset")
        self.base_rad, self.begun_s = self.joints[-1], None

    def _blow(self) -> None:
        """Publish the reading of the station's anemometer five times a second."""
        if round(self.now_s / 0.02) % 10 == 0:
            message = Vector3Stamped()
            message.header.stamp, message.vector.x = stamp_from_seconds(self.now_s), 3.0
            self.wind.publish(message)

    def _reset(self) -> str:
        answer = self.ask("reset_fault")
        return "" if answer.success else str(answer.message)

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message
        self.seen.append(message)

    def _on_joints(self, message: JointState) -> None:
        self.heard_s = seconds_from_stamp(message.header.stamp)
        self.joints.append(message.position[0])

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self.live.namespace[1:]}/antenna_servo: commanders":
                self.commanders = status
            if status.name == f"{self.live.namespace[1:]}/antenna_servo: drive":
                self.said = {"message": status.message} | {pair.key: pair.value for pair in status.values}


def servo_yaml(wrap: Path) -> str:
    """Return the parameters of a servo in calm air that can be broken."""
    return f"""/**/antenna_servo:
  ros__parameters: {{enable_fault_injection: true, wrap_file: {wrap}, command_key_file: {wrap.with_name("command.key")},
    wind: {{mean_speed_m_s: 0.0}}}}
"""


def on_rotctld(port: int) -> dict[str, Any]:
    """Return the same station on the rotctld of a port, with its anemometer on weather/wind."""
    speed = {
        "rate_deg_s": 6.0, "acceleration_deg_s2": 6.0, "command_rate_deg_s": 6.0,
        "command_acceleration_deg_s2": 6.0,
    }  # fmt: skip
    return WITH_HILL | {
        "mount.azimuth": {"travel_deg": [-180.0, 223.0], **speed},
        "mount.elevation": {"travel_deg": [0.0, 90.0], **speed},
        "tuning.loops.preprocessor": {"travel_min_deg": [-180.0, 0.0], "travel_max_deg": [223.0, 90.0]},
        "drive.type": "hamlib",
        "drive.link": {"host": "127.0.0.1", "port": port},
        "tuning.safety.wind.silence_s": 2.0,
    }


WITH_HILL: dict[str, Any] = {
    "mount.horizon_deg": [
        [0.0, 0.0], [70.0, 0.0], [160.0, 0.0], [161.0, 70.0], [180.0, 0.0], [230.0, 0.0],
        [300.0, 0.0],
    ],
    "wind.gust_limit_m_s": 25.0, "wind.mean_limit_m_s": 100.0, "tuning.safety.wind.release_s": 0.2,
    "tuning.safety.wind.silence_s": 0.5,
}  # fmt: skip
"""A station with a hill 40 deg to the right of where the antenna starts; the tests together move it by some 20."""
