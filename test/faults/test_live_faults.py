"""Faults on live nodes: processes really killed and stopped, sensors really wrong; many faults in each start-up."""

import json
import math
import os
import re
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2", exc_type=ImportError)
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rf_pointing_msgs.msg import (
    AntennaStatus,
)
from rf_pointing_msgs.srv import InjectFault
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes.qos import COMMAND, STREAM
from test.faults.clocks import ManualClock
from test.graph.conftest import ask

pytestmark = pytest.mark.graph

START_RAD = (math.radians(120.0), math.radians(60.0))
SERVO = """/**/antenna_servo:
  ros__parameters:
    enable_fault_injection: true
    wrap_file: {wrap}
    wind: {{mean_speed_m_s: 0.0}}
    safety:
      wind: {{gust_limit_m_s: 25.0, mean_limit_m_s: 100.0, release_s: 0.2, silence_s: 0.5}}
      mask: {{azimuth_deg: [0.0, 140.0, 141.0, 160.0], elevation_deg: [0.0, 0.0, 70.0, 0.0]}}
"""
RATE_RAD_S = math.radians(0.3)


class Servo:
    """A live antenna_servo, the commands to it, and what it says."""

    def __init__(self, live: SimpleNamespace, wrap: Path) -> None:
        self.live, self.status, self.joints = live, AntennaStatus(), []
        self.diagnostics: dict[str, Any] = {}
        self.commands = live.node.create_publisher(JointTrajectory, "joint_trajectory", COMMAND)
        live.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        live.node.create_subscription(JointState, "joint_states", self._on_joints, STREAM)
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.seen: list[tuple[float, str, str]] = []
        self.heard_s = 0.0
        self.begun_s: float | None = None
        self.base = START_RAD[0]
        self.yaml = SERVO.format(wrap=wrap)
        self.started = live.start(["antenna_servo"], self.yaml)
        self.until(lambda: self.status.mode == "holding" and self.commands.get_subscription_count() == 1, "the antenna")

    def until(self, condition: Any, what: str) -> None:
        self.live.spin_until(condition, what)

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message
        self.seen.append((time.monotonic(), message.mode, message.warning))

    def _on_joints(self, message: JointState) -> None:
        self.heard_s = time.monotonic()
        self.joints.append(message.position[0])

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics |= {status.name: status for status in message.status}

    def now_s(self) -> float:
        return self.live.node.get_clock().now().nanoseconds * 1e-9

    def command(self, shift_s: float = 0.0, who: str = "test", positions: list[float] | None = None,
                joints: tuple[str, str] = ("azimuth", "elevation")) -> JointTrajectory:  # fmt: skip
        """A second of steady azimuth motion from where the motion of this test began."""
        now_s = self.now_s() + shift_s
        if self.begun_s is None:
            self.begun_s = now_s
        message = JointTrajectory(joint_names=list(joints))
        message.header.stamp.sec, message.header.stamp.nanosec = int(now_s), int((now_s % 1.0) * 1e9)
        message.header.frame_id = who
        for step in range(1, 9):
            position = positions or [self.base + RATE_RAD_S * (now_s - self.begun_s + 0.1 * step), START_RAD[1]]
            point = JointTrajectoryPoint(positions=position, velocities=[RATE_RAD_S, 0.0], accelerations=[0.0, 0.0])
            point.time_from_start.nanosec = 100_000_000 * step
            message.points.append(point)
        return message

    def move(self, seconds: float) -> None:
        """Keep commands coming for a while."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.commands.publish(self.command())
            due_s = time.monotonic() + 0.1
            while time.monotonic() < due_s:
                self.live.executor.spin_once(timeout_sec=0.01)

    def rejected(self, message: JointTrajectory, words: str) -> None:
        before = self.status.commands_rejected
        self.commands.publish(message)
        self.until(lambda: self.status.commands_rejected > before, f"the rejection ({words})")
        assert words in self.status.last_rejection

    def ask(self, name: str) -> Trigger.Response:
        return ask(self.live, Trigger, f"antenna_servo/{name}", Trigger.Request())

    def inject(self, fault: str, value: float = 0.0) -> float:
        """Put a fault in; return when, by the servo's own ticks."""
        request = InjectFault.Request(fault=fault, value=value)
        answer = ask(self.live, InjectFault, "antenna_servo/inject_fault", request)
        assert answer.success
        return float(answer.message.split()[-1])

    def retune(self, **values: list[float]) -> None:
        """Set limits of the commands while the antenna runs."""
        kind = ParameterType.PARAMETER_DOUBLE_ARRAY
        parameters = [
            Parameter(
                name=f"loops.preprocessor.{name}", value=ParameterValue(type=kind, double_array_value=value)
            ) for name, value in values.items()
        ]  # fmt: skip
        request = SetParametersAtomically.Request(parameters=parameters)
        answer = ask(self.live, SetParametersAtomically, "antenna_servo/set_parameters_atomically", request).result
        assert answer.successful, answer.reason

    def fault_at(self) -> float:
        """Return when the latched fault was seen, by the servo's own ticks."""
        self.diagnostics.clear()

        def said(key: str) -> str:
            found = [s for name, s in self.diagnostics.items() if name.endswith("drive")]
            return next((v.value for s in found for v in s.values if v.key == key), "")

        self.until(lambda: said("fault_at"), "the time of the fault on /diagnostics")
        assert "s before, test: to" in said("last_commands")
        return float(said("fault_at"))

    def recover(self) -> None:
        """Mend, reset and stand again, for the next fault."""
        self.inject("none")
        self.until(lambda: self.status.mode in ("fault", "holding"), "rest")
        for _ in range(50):
            answer = self.ask("reset_fault")
            if answer.success or answer.message == "no fault is latched":
                break
        self.until(lambda: self.status.mode == "holding" and not self.status.fault, "the reset")
        self.base, self.begun_s = self.joints[-1], None


def test_one_servo_survives_its_faults(live: SimpleNamespace, tmp_path: Path) -> None:
    servo = Servo(live, tmp_path / "wrap.json")
    check_bad_commands(servo)
    check_two_commanders(servo)
    check_silence(servo)
    check_five_ways_to_end_a_motion(servo)
    check_sensors(servo)
    check_limits(servo)
    check_wind(servo)
    check_frozen_process(servo)


def check_bad_commands(servo: Servo) -> None:
    servo.rejected(servo.command(positions=[math.nan, 1.0]), "must be finite")
    servo.rejected(servo.command(joints=("azimuth", "polarisation")), "unknown joint polarisation")
    servo.rejected(servo.command(shift_s=-5.0), "stale")
    servo.rejected(servo.command(shift_s=100.0), "future")
    assert servo.status.commands_accepted == 0
    servo.begun_s = None
    servo.move(0.5)
    old = servo.command()
    servo.move(0.3)
    servo.rejected(old, "out of order")
    same = servo.command()
    servo.commands.publish(same)
    servo.rejected(same, "duplicate")


def check_two_commanders(servo: Servo) -> None:
    servo.move(0.3)
    servo.rejected(servo.command(who="panel"), "conflict: test commands, panel is refused")
    assert servo.status.commander == "test"


def check_silence(servo: Servo) -> None:
    """Warned after 100 ms, carried on for a second past the last point, then stopped under control."""
    servo.move(0.5)
    quiet_s, servo.seen = time.monotonic(), []
    servo.until(lambda: servo.status.mode == "fault", "the end of the commands")
    warned = next(warning for _, _, warning in servo.seen if warning.startswith("no command for"))
    assert 0.2 <= float(warned.split()[3]) <= 0.32, "100 ms after the next one was due, seen at the next status"
    stopping = next(t for t, mode, _ in servo.seen if mode in ("stopping", "fault"))
    assert 1.3 < stopping - quiet_s < 3.0, "0.8 s of commands and 1 s beyond"
    ran_dry = re.search(r"commands ran dry ([0-9.]+) s ago while moving", servo.status.fault)
    assert ran_dry
    assert float(ran_dry[1]) <= 1.1, "extrapolated for at most a second"
    servo.rejected(servo.command(), "fault latched")
    servo.recover()


def check_five_ways_to_end_a_motion(servo: Servo) -> None:
    servo.move(0.4)
    assert servo.ask("pause").success
    servo.until(lambda: servo.status.mode == "paused", "the pause")
    servo.move(0.3)
    assert servo.status.mode == "paused"
    assert servo.ask("resume").success
    servo.move(0.2)
    assert servo.status.mode == "tracking"
    assert servo.ask("stop").success
    servo.until(lambda: servo.status.mode == "fault", "the stop")
    servo.recover()
    assert servo.ask("disable").success
    servo.until(lambda: servo.status.mode == "disabled", "the brakes")
    servo.rejected(servo.command(), "the antenna is disabled; resume it first")
    assert servo.ask("resume").success
    servo.until(lambda: servo.status.mode == "holding", "the release")
    for name, mode in (("park", "parking"), ("stow", "stowing")):
        assert servo.ask(name).success
        servo.until(lambda mode=mode: servo.status.mode == mode, name)
        assert servo.status.transmit_inhibit == f"the antenna is {mode}"
        servo.ask("stop")
        servo.until(lambda: servo.status.mode == "fault", "the stop")
        servo.recover()


def check_sensors(servo: Servo) -> None:
    cases = {
        "encoder_frozen": (0.0, "encoder"),
        "encoder_jump": (math.radians(5.0), "jumped"),
        "encoder_lie": (math.radians(1.0), "more than the drive"),
        "encoder_nan": (0.0, "no number"),
        "runaway": (math.radians(1.9), "drive runs at"),
    }
    for fault, (value, words) in cases.items():
        servo.move(0.8)
        assert servo.status.mode == "tracking", servo.status.fault
        injected_s = servo.inject(fault, value)
        servo.move(0.4)
        servo.until(lambda: servo.status.mode == "fault", f"the fault {fault}")
        assert words in servo.status.fault, fault
        took_s = servo.fault_at() - injected_s
        print(f"{fault} seen {1e3 * took_s:.0f} ms after the first tick that it changed")
        # A drive that runs away is held to its own acceleration: 0.5 s pass before it is 0.5 deg/s over the command.
        assert took_s < (0.05 + 0.5 if fault == "runaway" else 0.2) + 1e-3
        if fault == "encoder_nan":
            assert "the cause is still there" in servo.ask("reset_fault").message
        servo.recover()
    servo.move(0.8)
    servo.inject("encoder_spike", math.radians(20.0))
    servo.move(0.5)
    assert servo.status.mode == "tracking", "two wrong samples are bridged"
    assert max(abs(b - a) for a, b in zip(servo.joints[-40:], servo.joints[-39:], strict=False)) < math.radians(0.1)
    servo.ask("stop")
    servo.recover()


def check_limits(servo: Servo) -> None:
    """Soft limit and horizon refuse with the number, the hard limit cuts the drives, and the way back in stays open."""
    servo.rejected(servo.command(positions=[math.radians(230.0), 1.0]), "past the limit")
    servo.rejected(servo.command(positions=[math.radians(150.0), 0.5]), "below the horizon mask")
    here = math.degrees(servo.joints[-1])
    servo.retune(travel_max_deg=[here + 0.5, 91.5])
    servo.inject("runaway", math.radians(0.2))
    servo.until(lambda: servo.status.mode == "fault", "the hard limit")
    assert "past the hard limit" in servo.status.fault
    outside = servo.joints[-1]
    assert math.radians(0.7) < outside - math.radians(here) < math.radians(1.2)
    servo.recover()
    assert servo.joints[-1] == pytest.approx(outside, abs=math.radians(0.05)), "a reset moves nothing"
    servo.rejected(servo.command(positions=[outside + 0.05, START_RAD[1]]), "past the limit")
    inward = servo.command(positions=[math.radians(here), START_RAD[1]])
    for point in inward.points:
        point.velocities = [0.0, 0.0]
    servo.commands.publish(inward)
    servo.until(lambda: abs(servo.joints[-1] - math.radians(here)) < math.radians(0.05), "the way back in")
    servo.retune(travel_max_deg=[223.0, 91.5])
    servo.until(lambda: servo.status.mode == "holding", "the end of the commands")
    servo.recover()


def check_wind(servo: Servo) -> None:
    servo.move(0.3)
    servo.inject("gust", 120.0)
    while servo.status.mode == "tracking":
        servo.move(0.2)
    assert servo.status.mode == "stowing", servo.status.fault
    servo.rejected(servo.command(), "the antenna is stowing; resume it first")
    servo.ask("stop")
    servo.until(lambda: servo.status.mode == "fault", "the stop")
    servo.inject("none")
    calm_s = time.monotonic() + 4.0
    servo.until(lambda: time.monotonic() > calm_s, "the gust to pass")
    servo.recover()
    servo.inject("anemometer_silent")
    servo.until(lambda: servo.status.mode == "stowing", "the silent anemometer")
    servo.ask("stop")
    servo.until(lambda: servo.status.mode == "fault", "the stop")
    servo.inject("none")
    calm_s = time.monotonic() + 1.0
    servo.until(lambda: time.monotonic() > calm_s, "the anemometer to be believed again")
    servo.recover()


def check_frozen_process(servo: Servo) -> None:
    """SIGSTOP for longer than commands live: what waited meanwhile is discarded, and the antenna stands."""
    servo.move(0.4)
    before = servo.joints[-1]
    process = servo.started.processes.process_id("antenna_servo")
    os.kill(process, signal.SIGSTOP)
    try:
        stopped_s = time.monotonic()
        servo.move(2.0)
        assert time.monotonic() - servo.heard_s > 1.0
        assert time.monotonic() - stopped_s > 1.0
    finally:
        os.kill(process, signal.SIGCONT)
    servo.until(lambda: servo.status.mode in ("fault", "stopping"), "the jump of its clock")
    assert "jumped by" in servo.status.fault or "ran dry" in servo.status.fault
    servo.until(lambda: servo.status.mode == "fault", "rest")
    assert servo.joints[-1] - before < RATE_RAD_S * 1.0, "2 s of commands were waiting, none of them was followed"
    servo.recover()


@pytest.mark.parametrize("jump_s", [5.0, -3.0])
def test_a_jump_of_the_clock_stops_the_antenna_and_never_makes_it_jump(live: SimpleNamespace, jump_s: float) -> None:
    clock = ManualClock(live, 1_151_384_000.0)
    statuses, joints = [AntennaStatus()], []
    live.node.create_subscription(AntennaStatus, "antenna_status", statuses.append, STREAM)
    live.node.create_subscription(JointState, "joint_states", lambda m: joints.append(list(m.position)), STREAM)
    started = live.start(["antenna_servo"], SERVO.format(wrap='""'), state="configure", simulated=True)
    for _ in range(100):
        clock.run(0.1)
        if not started.client.change(["antenna_servo"], "activate", 10.0):
            break
    assert clock.run(10.0, lambda: statuses[-1].mode == "holding")
    clock.t_s += jump_s
    assert clock.run(10.0, lambda: "jumped by" in statuses[-1].fault), statuses[-1]
    assert float(statuses[-1].fault.split()[-2]) == pytest.approx(jump_s, abs=0.1)
    clock.run(1.0)
    assert max(abs(p[axis] - START_RAD[axis]) for p in joints for axis in (0, 1)) < math.radians(0.01)


@pytest.mark.parametrize(
    ("node", "text", "key"),
    [
        ("antenna_servo", "safety: {watch: {jump_deg: -1.0}}", "jump_deg"),
        ("antenna_servo", "safety: {wnd: {gust_limit_m_s: 20.0}}", "safety.wnd.gust_limit_m_s"),
    ],
)
def test_bad_yaml_leaves_the_node_unconfigured_and_names_the_key(
    live: SimpleNamespace, node: str, text: str, key: str
) -> None:
    started = live.start([node], f"/**/{node}: {{ros__parameters: {{{text}}}}}", state="configure")
    assert started.refused == [node]
    assert key in started.processes.complaint(node)


def test_a_wrap_file_that_disagrees_with_the_encoder_keeps_the_antenna_from_moving(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    """The file says another turn than the absolute encoder: somebody must look at the cables before anything moves."""
    wrap = tmp_path / "wrap.json"
    wrap.write_text(json.dumps({"azimuth_rad": START_RAD[0] - 2.0 * math.pi}))
    statuses = [AntennaStatus()]
    live.node.create_subscription(AntennaStatus, "antenna_status", statuses.append, STREAM)
    live.start(["antenna_servo"], SERVO.format(wrap=wrap))
    live.spin_until(lambda: statuses[-1].mode == "fault", "the doubt")
    assert "look at the cables, then reset" in statuses[-1].fault
    assert ask(live, Trigger, "antenna_servo/reset_fault", Trigger.Request()).success
    live.spin_until(lambda: statuses[-1].mode == "holding", "the reset")
