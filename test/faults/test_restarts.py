"""Every node of a live station is killed in turn: it is back within 3 s, by itself, with what it knew.

Measured from the start of the new process to its first output, without the time for which the processor was given to
others: on a loaded machine that is most of it, and says nothing about the node.  What is left grows with the slowness
of the machine.
"""

import math
import os
import signal
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rf_pointing_msgs.msg import AntennaStatus, Monopulse, PassList, PointingError, PointingModel, TrackingStatus
from rf_pointing_msgs.srv import SelectTarget
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from test.conftest import within
from test.graph.conftest import ask

pytestmark = pytest.mark.graph

RESTART_S = 3.0
LOOK_S = 0.02
START_S = 1_151_384_000.0
NAMES = ("simulation_clock", "antenna_servo", "ephemeris_publisher", "bias_calibrator", "pointing_controller", "rf_receiver",
         "monopulse_tracker", "conscan_tracker")  # fmt: skip
PACING = ("simulation_clock", "antenna_servo")
"""Time goes on no faster than these two are given a processor."""


class Stopwatch:
    """Time that passes while neither this process nor one of those watched waits for a processor."""

    def __init__(self, *watched: int) -> None:
        self._paths = [Path(f"/proc/{process}/schedstat") for process in (*watched, os.getpid())]
        self.net_s, self._wall_s, self._delays_s = 0.0, time.monotonic(), self._read()

    def look(self) -> float:
        """Add the time since the last look, and return the sum."""
        wall_s = time.monotonic()
        if wall_s - self._wall_s < LOOK_S:
            return self.net_s
        delays_s = self._read()
        waited_s = max(now - before for now, before in zip(delays_s, self._delays_s, strict=True))
        self.net_s += max(0.0, wall_s - self._wall_s - waited_s)
        self._wall_s, self._delays_s = wall_s, delays_s
        return self.net_s

    def _read(self) -> list[float]:
        return [1e-9 * int(path.read_text().split()[1]) for path in self._paths]


class Station:
    """A whole simulated station whose nodes bring themselves up, and what they say."""

    def __init__(self, live: SimpleNamespace, yaml: str, processes: int = 8) -> None:
        self.live, self.heard, self.health, self.times = live, {}, {}, []
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        live.node.create_subscription(Clock, "clock", lambda m: self.times.append(seconds_from_stamp(m.clock)), STREAM)
        self.listen("simulation_clock", Clock, "clock", STREAM)
        self.listen("antenna_servo", AntennaStatus, "antenna_status", STREAM)
        self.listen("ephemeris_publisher", PassList, "passes", LATCHED)
        self.listen("bias_calibrator", PointingModel, "pointing_model", LATCHED)
        self.listen("pointing_controller", TrackingStatus, "tracking_status", STREAM)
        self.listen("rf_receiver", Monopulse, "monopulse", STREAM)
        self.listen("monopulse_tracker", PointingError, "pointing_error", STREAM, lambda m: m.sensor == "monopulse")
        self.listen("conscan_tracker", PointingError, "pointing_error", STREAM, lambda m: m.sensor != "monopulse")
        self.processes: NodeProcesses = live.start(
            list(NAMES), yaml, autostart=True, simulated=True, processes=processes
        )
        self.run_until(lambda: set(NAMES) <= set(self.heard), f"all of {', '.join(NAMES)}")

    def listen(self, name: str, kind: Any, topic: str, qos: Any, wanted: Callable[[Any], bool] = bool) -> None:
        def take(message: Any) -> None:
            if wanted(message):
                self.heard[name] = message

        self.live.node.create_subscription(kind, topic, take, qos)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("ephemeris_publisher: target"):
                self.health |= {pair.key: pair.value for pair in status.values}

    def run_until(self, condition: Callable[[], bool], what: str) -> None:
        self.live.spin_until(condition, what)

    def run(self, seconds: float) -> None:
        """Let simulated time go on."""
        end_s = self.times[-1] + seconds
        self.run_until(lambda: self.times[-1] >= end_s, f"{seconds} s of simulated time")

    def kill(self, name: str) -> None:
        """End a process as a crash does, and wait until it is gone and all that it said has been heard."""
        os.kill(self.processes.process_id(name), signal.SIGKILL)
        self.run_until(lambda: name in self.processes.ended(), f"the end of {name}")
        gone_s = time.monotonic() + 0.3
        self.run_until(lambda: time.monotonic() > gone_s, "the last messages")
        for each in self.processes.ended():
            self.heard.pop(each, None)

    def restart(self, name: str) -> None:
        """Start it again with the nodes of its process, and wait until all are heard."""
        names = list(self.processes.ended())
        self.processes.start(names, autostart=True)
        watch = Stopwatch(*(self.processes.process_id(each) for each in {name, *PACING}))
        self.run_until(lambda: watch.look() >= 0.0 and set(names) <= set(self.heard), ", ".join(names))
        print(f"{name} back after {watch.net_s:.2f} s")
        assert within(watch.net_s, RESTART_S), f"{name} took {watch.net_s:.2f} s"

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        return ask(self.live, kind, name, request)


def settings(folder: Path) -> str:
    return f"""/**/antenna_servo:
  ros__parameters: {{state_file: {folder}/antenna.json, wrap_file: {folder}/wrap.json, wind: {{mean_speed_m_s: 0.0}}}}
/**/ephemeris_publisher:
  ros__parameters: {{publisher: {{state_file: {folder}/target.json}}}}
/**/simulation_clock:
  ros__parameters: {{start_s: {START_S}, speed: 1.0}}
"""


def double(name: str, value: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))


def test_every_node_is_killed_in_turn_and_is_back_within_3_s_with_what_it_knew(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    station = Station(live, settings(tmp_path))
    check_ephemeris(station)
    check_clock(station)
    check_servo(station)
    check_calibrator(station)
    for name in ("rf_receiver", "monopulse_tracker", "conscan_tracker", "pointing_controller"):
        station.kill(name)
        station.restart(name)
    assert station.heard["pointing_controller"].mode == "idle"


def test_what_shares_a_process_is_killed_together_and_is_back_within_3_s_with_what_it_knew(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    """What moves, with the clock, whose time goes on where it stood; then what predicts, decides and measures."""
    station = Station(live, settings(tmp_path), processes=2)
    check_servo(station)
    station.run(1.0)
    assert all(later >= sooner for sooner, later in pairwise(station.times))
    check_ephemeris(station)
    assert station.heard["pointing_controller"].mode == "idle"


def check_ephemeris(station: Station) -> None:
    """The target that was selected and the offset that was set are those after the restart, not those configured."""
    answer = station.ask(SelectTarget, "ephemeris_publisher/select_target", SelectTarget.Request(target="6251"))
    assert answer.success, answer.message
    station.ask(SetParametersAtomically, "ephemeris_publisher/set_parameters_atomically",
                SetParametersAtomically.Request(parameters=[double("source.along_track_offset_s", 0.25)]))  # fmt: skip
    told = station.heard["ephemeris_publisher"].target
    assert told != "CBERS 2"
    station.run_until(lambda: station.health.get("along_track_offset_s") == "0.25", "the offset on /diagnostics")
    station.kill("ephemeris_publisher")
    station.health.clear()
    station.restart("ephemeris_publisher")
    assert station.heard["ephemeris_publisher"].target == told
    station.run_until(lambda: station.health.get("along_track_offset_s") == "0.25", "the offset on /diagnostics")


def check_servo(station: Station) -> None:
    """It stands where it stood, on its turn, with its brakes set as they were."""
    joints: list[list[float]] = []
    station.live.node.create_subscription(JointState, "joint_states", lambda m: joints.append(list(m.position)), STREAM)
    assert station.ask(Trigger, "antenna_servo/park", Trigger.Request()).success
    station.run_until(lambda: station.heard["antenna_servo"].mode == "parking", "the motion")
    station.run(3.0)
    assert station.ask(Trigger, "antenna_servo/disable", Trigger.Request()).success
    station.run_until(lambda: station.heard["antenna_servo"].mode == "disabled", "the brakes")
    stood = joints[-1]
    station.kill("antenna_servo")
    joints.clear()
    station.restart("antenna_servo")
    station.run_until(lambda: len(joints) > 3, "joint states")
    assert station.heard["antenna_servo"].mode == "disabled"
    assert station.heard["antenna_servo"].fault == ""
    assert max(abs(a - b) for a, b in zip(joints[-1], stood, strict=True)) < math.radians(0.1)


def check_calibrator(station: Station) -> None:
    """The model in force is told again, bit for bit."""
    told = station.heard["bias_calibrator"]
    station.kill("bias_calibrator")
    station.restart("bias_calibrator")
    again = station.heard["bias_calibrator"]
    assert (again.name, again.terms) == (told.name, told.terms)
    assert list(again.values) == list(told.values)


def check_clock(station: Station) -> None:
    """Time goes on where it stood, it never goes back, and the antenna does not notice."""
    stamps: list[float] = []
    joints: list[list[float]] = []
    station.live.node.create_subscription(JointState, "joint_states", lambda m: joints.append(list(m.position)), STREAM)
    station.live.node.create_subscription(
        AntennaStatus, "antenna_status", lambda m: stamps.append(seconds_from_stamp(m.header.stamp)), STREAM
    )
    station.run(1.0)
    station.kill("simulation_clock")
    station.restart("simulation_clock")
    station.run(1.0)
    assert all(later >= sooner for sooner, later in pairwise(station.times))
    assert len(stamps) > 15
    assert all(later - sooner == pytest.approx(0.1, abs=0.001) for sooner, later in pairwise(stamps)), "none is missing"
    status = station.heard["antenna_servo"]
    assert (status.mode, status.fault) == ("holding", "")
    assert max(abs(a - b) for a, b in zip(joints[-1], joints[0], strict=True)) < math.radians(0.01)
