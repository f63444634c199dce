"""`track` on a drive that is not simulated: Debian's rotctld, in real time, without simulation_clock and rf_receiver."""

import json
import math
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rf_pointing_msgs.msg import AntennaStatus
from std_srvs.srv import Trigger

from rf_pointing.ephemeris import TopocentricTrack, read_source
from rf_pointing.report.recording import read_recording
from rf_pointing.ros.input_watchdog import INPUT_SILENCE_S
from rf_pointing.ros.qos import STREAM
from rf_pointing.station.antenna.control_unit import JOG_S
from rf_pointing.station.description import read_station
from test.conftest import within
from test.drives.rotctld import RealRotctld
from test.graph.conftest import executable, start_track
from test.graph.real_station import STATION, write_elements, write_station

pytestmark = [pytest.mark.graph, pytest.mark.alone]

MASK_DEG = 55.0
"""Above it the satellite stays for 71 s."""
RISES_S, CULMINATES_S = 30.0, 65.5
"""After the start of `track`, which needs some 15 s to bring its nodes up."""


@pytest.fixture
def rotctld() -> Iterator[RealRotctld]:
    server = RealRotctld()
    yield server
    server.kill()


@pytest.fixture
def line(rotctld: RealRotctld, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The options of a pass that rises in half a minute; what the antenna remembers is the test's own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    station = write_station(tmp_path, rotctld.port)
    site, begun_s = read_station(station).site, time.time()
    elements = write_elements(tmp_path, site, begun_s + CULMINATES_S)
    # Near the start of the pass: a slew of half a turn would take half a minute.
    start = TopocentricTrack(read_source(str(elements)).elements[0], site).target_at(begun_s + RISES_S)
    rotctld.go(math.degrees(start.azimuth_rad) - 3.0, math.degrees(start.elevation_rad) + 3.0)
    return ["--station", str(station), "--elements", str(elements), "--satellite", "OVERHEAD", "--mask", str(MASK_DEG),
            "--min-peak", "60", "--sensor", "program", "--namespace", f"/real{rotctld.port}"]  # fmt: skip


def test_a_pass_on_the_real_rotctld_is_tracked_in_real_time(line: list[str], tmp_path: Path) -> None:
    begun_s = time.time()
    track = start_track(*line, "--output", str(tmp_path / "run"))
    _, said = track.communicate(timeout=240.0)
    assert track.returncode == 0, said
    print(said, f"{time.time() - begun_s:.0f} s")
    last = said.strip().splitlines()[-1]
    assert last.startswith("track: tracked: loss of signal"), last
    assert "on source" in said
    assert "5 nodes matched and active" in said, "the tracker of its one sensor, not both"
    recording = read_recording(tmp_path / "run" / "bag")
    assert {"sim/boresight", "sim/pointing_error", "clock"}.isdisjoint(recording.topics)
    joints = recording.get("joint_states")
    assert joints is not None
    assert np.max(np.diff(joints.stamp_ns)) < 5e8, "beside another graph as well"
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    outcome = summary["outcome"]
    assert outcome["tracked"] is True
    assert outcome["counted"]["tracked_s"] == pytest.approx(71.0, abs=2.0)
    assert outcome["counted"]["held_percent"] > 99.0
    assert "Hamlib rotator" in (tmp_path / "run" / "report.html").read_text()
    assert (tmp_path / "state" / "rf_pointing").is_dir()


def test_a_rotctld_that_dies_in_mid_pass_ends_it_within_seconds_and_its_fault_outlives_the_run(
    line: list[str], rotctld: RealRotctld, tmp_path: Path
) -> None:
    track = start_track(*line, "--output", str(tmp_path / "run"))
    assert track.stderr is not None
    begun_s, lines = time.time(), [""]
    while "on source" not in lines[-1] and track.poll() is None:
        lines.append(track.stderr.readline())
    assert track.poll() is None, "".join(lines)
    time.sleep(max(0.0, begun_s + RISES_S + 12.0 - time.time()))
    where = rotctld.position()
    rotctld.kill()
    killed_s = time.time()
    _, said = track.communicate(timeout=60.0)
    took_s = time.time() - killed_s
    print(said, f"ended {took_s:.1f} s after the kill at {where}")
    assert track.returncode == 1
    last = said.strip().splitlines()[-1]
    assert last.startswith("track: NOT tracked: antenna fault: drive lost: rotctld at 127.0.0.1"), last
    assert took_s < 5.0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"]["tracked"] is False
    assert "drive lost" in summary["outcome"]["reason"]
    page = (tmp_path / "run" / "report.html").read_text()
    assert "drive lost" in page

    # The device is back; its fault is not forgotten, and nothing moves by itself.
    rotctld.start()
    again = start_track(*line, "--output", str(tmp_path / "again"))
    _, said = again.communicate(timeout=60.0)
    assert again.returncode == 1, said
    assert re.search(r"latched fault \(.*drive lost: .* \(since before the restart\)\); reset it first", said), said
    assert rotctld.position() == (0.0, 0.0)

    # Looked at and reset, what is left of the pass is tracked.
    line[line.index("--mask") + 1] = "5"
    reset = start_track(*line, "--reset-fault", "--output", str(tmp_path / "reset"))
    assert reset.stderr is not None
    lines = [""]
    while "on source" not in lines[-1] and reset.poll() is None:
        lines.append(reset.stderr.readline())
    reset.send_signal(signal.SIGINT)
    _, said = reset.communicate(timeout=60.0)
    assert "on source" in lines[-1], "".join(lines) + said
    assert any(each.startswith("track: reset of a latched fault: ") for each in lines), lines
    assert math.hypot(*rotctld.position()) > 5.0


class Watched:
    """The servo and the controller of a station in wall time, and what they publish."""

    def __init__(self, live: SimpleNamespace, station: Path) -> None:
        self.live, self.status, self.said = live, AntennaStatus(), dict[str, str]()
        live.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        parameters = f'{{"/**": {{ros__parameters: {{station: {station}}}}}}}'
        self.processes = live.start(["antenna_servo", "pointing_controller"], parameters, autostart=True)

    def until(self, condition: Callable[[], bool], what: str) -> float:
        begun_s = time.monotonic()
        self.live.spin_until(condition, what)
        return time.monotonic() - begun_s

    def ask(self, name: str) -> Trigger.Response:
        client = self.live.node.create_client(Trigger, f"antenna_servo/{name}")
        self.live.spin_until(client.service_is_ready, name)
        future = client.call_async(Trigger.Request())
        self.live.spin_until(future.done, f"the answer of {name}")
        return future.result()

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id.startswith(f"{self.live.namespace}/") and status.name.endswith(": state"):
                self.said[status.hardware_id.rpartition("/")[2]] = status.message


def test_a_station_that_boots_before_its_rotator_and_loses_it_for_a_while_needs_no_restart(
    live: SimpleNamespace, rotctld: RealRotctld, tmp_path: Path
) -> None:
    rotctld.kill()
    station = Watched(live, write_station(tmp_path, rotctld.port))
    station.until(lambda: "Connection refused" in station.said.get("antenna_servo", ""), "what it waits for")
    rotctld.start()
    took_s = station.until(lambda: station.status.mode == "holding", "the antenna")
    print(f"ready {took_s:.1f} s after rotctld")
    assert within(took_s, 30.0)
    # No publisher runs here: an active controller waits for its target.
    active = ("active", "waits for target")
    station.until(lambda: station.said.get("pointing_controller", "").startswith(active), "the controller")

    # Longer than the silence after which a node is deaf.
    rotctld.kill()
    begun_s, silent = time.monotonic(), set[str]()
    while time.monotonic() < begun_s + 2.0 * INPUT_SILENCE_S:
        live.executor.spin_once(timeout_sec=0.05)
        silent.add(station.said["antenna_servo"].partition(": rotctld")[0])
        assert station.processes.ended() == {}
    assert "joint_states are silent: drive lost" in silent
    assert station.status.fault.startswith("drive lost: rotctld at 127.0.0.1")
    rotctld.start()
    station.until(lambda: station.said["antenna_servo"] == "active", "the drive again")
    assert station.ask("reset_fault").success
    station.until(lambda: station.status.mode == "holding", "the reset")
    assert station.processes.ended() == {}


def test_a_jog_whose_client_is_killed_leaves_a_real_rotctld_at_rest(
    live: SimpleNamespace, rotctld: RealRotctld, tmp_path: Path
) -> None:
    station = Watched(live, write_station(tmp_path, rotctld.port))
    station.until(lambda: station.status.mode == "holding", "the antenna")
    line = [executable("station"), "--namespace", live.namespace, "jog", "right", "--seconds", "60"]
    client = subprocess.Popen([*line, "--fast"])
    try:
        station.until(lambda: station.status.mode == "jogging", "the jog")
        begun = rotctld.position()
        begun_s = time.monotonic()
        station.until(lambda: time.monotonic() > begun_s + 3.0, "some motion")
    finally:
        client.kill()
        client.wait()
    assert math.dist(rotctld.position(), begun) > 1.0
    took_s = station.until(lambda: station.status.mode != "jogging", "the dead man's end")
    print(f"stopped {took_s:.2f} s after the client was killed")
    assert within(took_s, JOG_S + 0.2)
    station.until(lambda: station.status.mode == "holding", "rest")
    rest = rotctld.position()
    resting_s = time.monotonic()
    station.until(lambda: time.monotonic() > resting_s + 2.0, "two seconds of it")
    assert math.dist(rotctld.position(), rest) < 0.2
    assert station.status.fault == ""


def test_the_example_of_a_driver_behind_topics_passes_the_check_and_is_slewed(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    station = tmp_path / "vendor.yaml"
    text = STATION.read_text().replace("latency_s: 0.0", "latency_s: 0.05")
    station.write_text(text.replace("type: hamlib, link: {host: 127.0.0.1, port: 4533}", "type: topic"))
    example = str(Path(__file__).parents[2] / "examples" / "topic_drive_node.py")
    driver = subprocess.Popen([sys.executable, example, "--ros-args", "-r", f"__ns:={live.namespace}"])
    try:
        line = [executable("check_drive"), "--station", str(station), "--namespace", live.namespace, "--move"]
        checked = subprocess.run(line, capture_output=True, text=True, timeout=240.0, check=False)
        print(checked.stdout, checked.stderr)
        assert checked.returncode == 0, checked.stdout + checked.stderr
        watched = Watched(live, station)
        watched.until(lambda: watched.status.mode == "holding", "the antenna")
        assert watched.ask("park").success
        watched.until(lambda: watched.status.mode == "parked", "the park position")
        assert watched.status.fault == ""
    finally:
        driver.kill()
        driver.wait()
