"""Processes that are kept running: planted programs that end, hang and write, on a wall clock of the test's own."""

import json
import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.ros import supervisor
from rf_pointing.ros.launching import Process
from rf_pointing.ros.supervisor import LOG, LOG_BYTES, LONGEST_DELAY_S, STATE, Supervisor

SLEEPS = "exec sleep 600"
PATIENCE_S = 60.0
"""Far beyond the start of a shell."""
ASKS, POINTS, MOVES = "operator_page", "pointing_controller", "antenna_servo"


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Supervisor]]:
    """Make a supervisor of shell scripts, each named after a node."""
    folder = tmp_path / "lib" / "rf_pointing"
    folder.mkdir(parents=True)
    monkeypatch.setattr("rf_pointing.ros.launching.get_package_prefix", lambda _: str(tmp_path))
    made: list[Supervisor] = []

    def supervisor_of(respawn: bool = True, show: Any = None, **scripts: str) -> Supervisor:
        for name, text in scripts.items():
            (folder / name).write_text(f"#!/bin/sh\n{text}\n")
            (folder / name).chmod(0o755)
        processes = [Process(name, "gs1", (name,), ({name: {"a": 1}},), respawn=respawn) for name in scripts]
        made.append(Supervisor(processes, tmp_path / "log", {"file": "test"}, show))
        return made[-1]

    yield supervisor_of
    for each in made:
        each.stop()


def state(tmp_path: Path, name: str) -> dict[str, object]:
    return dict(json.loads((tmp_path / "log" / STATE).read_text())["processes"][name])


def step_until(one: Supervisor, now_s: float, condition: Callable[[], bool]) -> None:
    """Step at one time of the supervisor until the machine has done what it was told."""
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        one.step(now_s)
        os.sched_yield()


def test_what_ends_is_started_again_later_each_time_and_soon_after_a_good_while(
    make: Callable[..., Supervisor], tmp_path: Path
) -> None:
    one, now_s, delays_s = make(antenna_servo="exit 3"), 0.0, []
    one.step(now_s)
    for starts in range(1, 8):
        step_until(one, now_s, lambda: state(tmp_path, MOVES)["process"] is None)
        ended_s = now_s
        while state(tmp_path, MOVES)["starts"] == starts:
            now_s += 0.25
            one.step(now_s)
        delays_s.append(now_s - ended_s)
    assert delays_s == [0.5, 1.0, 2.0, 4.0, LONGEST_DELAY_S, LONGEST_DELAY_S, LONGEST_DELAY_S]
    assert state(tmp_path, MOVES)["last_end"] == "ended with 3"
    now_s += supervisor.SETTLED_S + 1.0
    step_until(one, now_s, lambda: state(tmp_path, MOVES)["process"] is None)
    one.step(now_s + 0.6)
    assert state(tmp_path, MOVES)["starts"] == 9


def test_without_respawn_it_ends_with_the_last_process_and_with_what_that_says(make: Callable[..., Supervisor]) -> None:
    assert make(respawn=False, antenna_servo="exit 0").run([]) == 0
    assert make(respawn=False, antenna_servo="exit 0", operator_page="exit 4").run([]) == 1


def test_clients_are_ended_first_and_what_moves_last(make: Callable[..., Supervisor], tmp_path: Path) -> None:
    """Whoever asks for motion is gone before the control unit stops the antenna."""
    order = tmp_path / "order"
    script = f"trap 'echo $0 >> {order}; exit 0' INT\necho up\nwhile :; do sleep 0.05; done"
    up: list[str] = []
    one = make(show=up.append, **dict.fromkeys((MOVES, POINTS, ASKS), script))
    step_until(one, 0.0, lambda: sum(line.endswith(" up") for line in up) == 2)
    # Those that a pass waits for come up first, and with the processor to themselves.
    assert not any(ASKS in line for line in up)
    step_until(one, supervisor.LATER_S, lambda: sum(line.endswith(" up") for line in up) == 3)
    assert one.run([signal.SIGINT]) == 0
    assert [Path(line).name for line in order.read_text().splitlines()] == [ASKS, POINTS, MOVES]
    assert not (tmp_path / "log" / STATE).exists()


def test_a_log_of_any_length_stays_within_its_bound_and_every_line_is_shown(
    make: Callable[..., Supervisor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "LOG_BYTES", 4096)
    shown: list[str] = []
    one = make(show=shown.append, antenna_servo=f"for i in $(seq 400); do echo line $i; done; {SLEEPS}")
    step_until(one, 0.0, lambda: any("line 400" in line for line in shown))
    lines = [line for line in shown if "line" in line]
    assert lines == [f"[{MOVES}] line {k}" for k in range(1, 401)]
    sizes = {path.name: path.stat().st_size for path in (tmp_path / "log").glob("antenna_servo.log*")}
    assert max(sizes.values()) < 4096 + 4096
    assert LOG_BYTES == 8 * 2**20


def test_every_line_of_a_whole_station_is_one_object_with_its_node_where_json_is_chosen(
    make: Callable[..., Supervisor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line of a node, what an interpreter prints, and the lines of the launch itself."""
    monkeypatch.setenv("RF_POINTING_LOG", "json")
    shown: list[str] = []
    line = json.dumps({"t_s": 1.5, "level": "WARN", "name": "gs1.antenna_servo", "text": 'the "mode"'})
    script = f"cat <<'E'\n{line}\nTraceback \"of\" C\n[1, 2]\nlast\nE\n{SLEEPS}"
    one = make(show=shown.append, antenna_servo=script)
    step_until(one, 0.0, lambda: any("last" in line for line in shown))
    rows = [json.loads(line) for line in [*shown, *(tmp_path / "log" / LOG).read_text().splitlines()]]
    assert all({"t_s", "level", "name", "text"} <= set(row) for row in rows)
    of_node = [row for row in rows if row.get("process") == MOVES]
    assert of_node[0] == {"process": MOVES, **json.loads(line)}
    assert [(row["name"], row["text"]) for row in of_node[1:]] == [
        (MOVES, text) for text in ('Traceback "of" C', "[1, 2]", "last")
    ]  # fmt: skip
    assert {row["name"] for row in rows if "process" not in row} == {"launch"}


def test_a_disk_that_is_full_ends_nothing(
    make: Callable[..., Supervisor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What could not be started is tried again; no line of the log is worth the station."""
    one = make(antenna_servo=SLEEPS)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Process, "command", full)
        assert one.step(0.0)
    one.step(LONGEST_DELAY_S + 1.0)
    assert state(tmp_path, MOVES)["starts"] == 1
    assert "cannot be started: [Errno 28]" in (tmp_path / "log" / LOG).read_text()


@given(text=st.text(max_size=50), number=st.floats(allow_nan=False) | st.integers(-(2**40), 2**40) | st.booleans())
@settings(max_examples=50, deadline=None)
def test_parameters_reach_the_file_of_a_node_as_they_are(text: str, number: float, tmp_path_factory: object) -> None:
    """YAML would take `1e3` or `yes` for something else; what a node reads is what was given."""
    import yaml

    folder = Path(tmp_path_factory.getbasetemp())  # type: ignore[attr-defined]
    process = Process("antenna_servo", "/north/gs1", ("antenna_servo",), ({"antenna_servo": {"a": text, "b": number}},))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rf_pointing.ros.launching.get_package_prefix", lambda _: "/opt")
        words = process.command(folder)
    file = Path(words[words.index("--params-file") + 1])
    found = yaml.safe_load(file.read_text())["/**/antenna_servo"]["ros__parameters"]
    assert found == {"a": text, "b": number}
    assert math.isclose(float(found["b"]), float(number))
    assert words[:5] == ["/opt/lib/rf_pointing/antenna_servo", "--ros-args", "-r", "__ns:=/north/gs1", "-r"]
