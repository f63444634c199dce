"""Two pointing controllers of one antenna, live in wall time: one is killed in a pass, and the other goes on with it."""

import math
import os
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import AntennaStatus, CommandSignature, PointingError, TrackingStatus

from rf_pointing.core.signals import STANDBY
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from test.scripts import script_module

from .conftest import executable, live_graph

pytestmark = [pytest.mark.graph, pytest.mark.alone]

STATION = "leo_3m7"
NODES = ("antenna_servo", "rf_receiver", "ephemeris_publisher", "conscan_tracker", "bias_calibrator")
ROLES = ("first", "second")
HELD_S = 8.0
TAKEN_S = 1.0
"""What the one that stands by may take."""


class Station:
    """The nodes of a simulated dish, both controllers, and the client of a pass."""

    def __init__(self, live: SimpleNamespace, folder: Path) -> None:
        self.live, self.folder, self.running = live, folder, dict[str, Any]()
        self.commands, self.errors = list[tuple[float, str]](), list[tuple[float, float]]()
        self.modes, self.tracking, self.held_s = list[tuple[float, str]](), TrackingStatus(), -math.inf
        node = live.node
        node.create_subscription(CommandSignature, "command_signature", self._on_command, STREAM)
        node.create_subscription(PointingError, "sim/pointing_error", self._on_error, STREAM)
        node.create_subscription(AntennaStatus, "antenna_status", self._on_antenna, STATUS)
        node.create_subscription(TrackingStatus, "tracking_status", self._on_tracking, STREAM)
        self.client = ActionClient(node, TrackPass, "track_pass")
        script_module("benchmarks/two_computers.py").write_elements(folder / "flyer.tle", STATION)
        self._start("nodes", "station_process", *NODES)
        for role in ROLES:
            self.start(role)

    def start(self, role: str) -> None:
        more = ["-p", f"lifecycle.standby:={role}", "-p", f"command_key_file:={self.folder / 'key'}"]
        self._start(role, "pointing_controller", more=more)

    def _start(self, what: str, program: str, *words: str, more: list[str] | None = None) -> None:
        key = {"antenna_servo": {"command_key_file": str(self.folder / "key")}}
        seen = {"source": {"elements": str(self.folder / "flyer.tle"), "satellite": "FLYER"}}
        own = self.folder / "own.yaml"
        own.write_text(
            "".join(
                f"/**/{name}: {{ros__parameters: {str(values).replace(chr(39), '')}}}\n"
                for name, values in {**key, "ephemeris_publisher": seen, "rf_receiver": seen}.items()
            )
        )
        line = [
            executable(program), *words, "--ros-args", "-r", f"__ns:={self.live.namespace}", "-p",
            f"station:={STATION}",
        ]  # fmt: skip
        line += ["-p", "lifecycle.autostart:=true", "--params-file", str(own), *(more or [])]
        with (self.folder / f"{what}.log").open("ab") as log:
            self.running[what] = subprocess.Popen(line, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def close(self) -> None:
        for process in self.running.values():
            process.send_signal(signal.SIGINT)
        for process in self.running.values():
            process.wait(20.0)

    def kill(self, role: str) -> float:
        """End a controller as a crash does; return when (UTC)."""
        self.running[role].kill()
        self.running[role].wait()
        return time.time()

    def _on_command(self, message: CommandSignature) -> None:
        self.commands.append((seconds_from_stamp(message.header.stamp), message.commander))

    def _on_error(self, message: PointingError) -> None:
        error_rad = math.hypot(message.cross_elevation, message.elevation)
        self.errors.append((seconds_from_stamp(message.header.stamp), error_rad))

    def _on_antenna(self, message: AntennaStatus) -> None:
        self.modes.append((time.time(), f"{message.mode}{message.fault}"))

    def _on_tracking(self, message: TrackingStatus) -> None:
        self.tracking = message
        if not message.held:
            self.held_s = math.inf
        elif math.isinf(self.held_s):
            self.held_s = time.monotonic()

    def track(self) -> tuple[Any, Any]:
        """Begin the pass, and wait until the target is held for a while; return its goal and result."""
        sent = self.client.send_goal_async(TrackPass.Goal(satellite="FLYER"))
        self.live.spin_until(sent.done, "an answer to the goal")
        assert sent.result().accepted
        result = sent.result().get_result_async()
        self.held_s = math.inf
        self.live.spin_until(
            lambda: result.done() or time.monotonic() - self.held_s > HELD_S, f"a held target, {self.tracking.reason}"
        )
        assert not result.done(), result.result().result.message
        return sent.result(), result

    def wait(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        self.live.spin_until(lambda: time.monotonic() > end_s, "time")

    def succession(self, role: str) -> SimpleNamespace:
        """Kill the controller that works, and return what the other made of it."""
        commander = self.commands[-1][1]
        killed_s = self.kill(role)
        self.wait(HELD_S)
        last_s = max(t_s for t_s, name in self.commands if name == commander)
        next_s = min(t_s for t_s, name in self.commands if name != commander and t_s > last_s)
        before, after = (
            [error for t_s, error in self.errors if low_s < t_s <= high_s]
            for low_s, high_s in ((killed_s - HELD_S, killed_s), (killed_s, killed_s + HELD_S))
        )
        found = SimpleNamespace(
            gap_s=next_s - last_s, before_rad=max(before), after_rad=max(after), held=self.tracking.held,
            modes={mode for t_s, mode in self.modes if t_s > killed_s}, beamwidth_rad=self.tracking.beamwidth,
            commanders={name for t_s, name in self.commands if t_s > next_s}, load=os.getloadavg()[0],
        )  # fmt: skip
        print(vars(found))
        return found


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Any:
    """Two passes: in the first the first controller is killed, in the second the other one."""
    folder = tmp_path_factory.mktemp("standby")
    with live_graph(folder, ros_domain) as live:
        station = Station(live, folder)
        try:
            found_s = time.monotonic()
            live.spin_until(lambda: station.commands and station.modes, "a controller that works")
            found = SimpleNamespace(begun_s=time.monotonic() - found_s, first=station.commands[0][1])
            goal, result = station.track()
            found.one = station.succession("first")
            found.goes_on = not result.done()
            station.start("first")
            station.wait(HELD_S)
            found.after_return = {name for t_s, name in station.commands if t_s > time.time() - 1.0}
            goal.cancel_goal_async()
            live.spin_until(result.done, "the end of the pass")
            found.end = result.result().result.message
            goal, result = station.track()
            found.two = station.succession("second")
            found.goes_on_too = not result.done()
            # One that comes back in the middle of a pass has not seen its goal.
            station.start("second")
            station.wait(HELD_S)
            station.kill("first")
            live.spin_until(result.done, "the end of the second pass")
            found.end_too = result.result().result.message
            yield found
        finally:
            station.close()
            for path in folder.glob("*.log"):
                print(path.name, path.read_text()[-3000:])


def test_the_other_controller_commands_within_a_second_and_the_antenna_does_not_stop(flown: SimpleNamespace) -> None:
    for each in (flown.one, flown.two):
        assert each.gap_s < TAKEN_S
        assert each.modes == {"tracking"}
        assert each.held


def test_the_beam_does_not_jump(flown: SimpleNamespace) -> None:
    for each in (flown.one, flown.two):
        assert each.after_rad < each.before_rad + 0.1 * each.beamwidth_rad


def test_exactly_one_commands_and_one_that_comes_back_stands_by(flown: SimpleNamespace) -> None:
    assert not flown.first.endswith(STANDBY)
    assert flown.one.commanders == flown.after_return == {f"{flown.first}{STANDBY}"}
    assert flown.two.commanders == {flown.first}


def test_the_client_keeps_its_goal_and_can_cancel_it(flown: SimpleNamespace) -> None:
    assert flown.goes_on
    assert flown.goes_on_too
    assert flown.end == "the goal was cancelled"


def test_a_client_whose_pass_both_have_lost_is_answered(flown: SimpleNamespace) -> None:
    assert flown.end_too == "pointing_controller was killed in the pass; send the goal again"
