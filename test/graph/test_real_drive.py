"""`track` on a drive that is not simulated: Debian's rotctld, in real time, without simulation_clock and rf_receiver."""

import json
import math
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.ephemeris.source import read_source
from rf_pointing.report.recording import read_recording
from rf_pointing.station.description import read_station
from test.drives.rotctld import RealRotctld
from test.graph.conftest import start_track
from test.graph.real_station import write_elements, write_station

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
    assert "6 nodes matched and active" in said
    recording = read_recording(tmp_path / "run" / "bag")
    assert {"sim/boresight", "sim/pointing_error", "clock"}.isdisjoint(recording.topics)
    joints = recording.get("joint_states")
    assert joints is not None
    assert len(joints) > 70 * 45, "50 Hz"
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
