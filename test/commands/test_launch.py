"""The command `launch`: what it refuses in one line, what it shows, and one station at a time in a namespace."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="processes of nodes need ROS 2")
from rf_pointing.commands import launch
from rf_pointing.ros.launching import launch_files
from rf_pointing.ros.supervisor import running

START = """
import sys
from pathlib import Path
from rf_pointing.commands.launch import start
from rf_pointing.ros import launching
launching.get_package_prefix = lambda _: sys.argv[1]
nodes = [launching.Process(name, "gs1", (name,)) for name in ("antenna_servo", "operator_page")]
sys.exit(start(launching.SINGLE_ANTENNA, "gs1", [], nodes, detach="detach" in sys.argv))
"""
NODE = "#!/bin/sh\ntrap 'exit 0' INT\nwhile :; do sleep 0.05; done\n"
PATIENCE_S = 90.0


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[object, str]:
    """Run the command; return its exit code and all that it said."""
    try:
        launch.main(list(words))
        code: object = 0
    except SystemExit as ended:
        code = ended.code
    found = capsys.readouterr()
    return code, found.out + found.err


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        ("singel_antenna", "there is no launch file 'singel_antenna'; did you mean single_antenna?"),
        ("single_antenna staton:=a", "staton:= is not an argument of single_antenna; did you mean station?"),
        ("single_antenna station=a", "argument 'station=a' must be written NAME:=VALUE"),
        ("single_antenna station:=", "argument 'station:=' must be written NAME:=VALUE"),
        ("single_antenna station:=no.yaml", "no.yaml: no such file"),
        ("simulated_station.launch.py station:=dss13 speed:=fast", "speed:=fast must be a number"),
        ("stop", "nothing runs"),
        ("status nobody", "nothing runs in nobody"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_exit_code_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: str, answer: str
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    code, text = said(capsys, *words.split())
    assert (code, text.count("\n")) == (1, 1)
    assert text.startswith(f"launch: {answer}")


@pytest.mark.parametrize("name", launch_files())
def test_every_launch_file_shows_its_arguments_and_the_command_lines_of_its_nodes(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file = launch_files()[name]()
    code, text = said(capsys, f"{name}.launch.py", "--show-args")
    assert code == 0
    assert [f"'{argument.name}':" in text for argument in file.arguments] == [True] * len(file.arguments)
    given = ["station:=dss13"] if name in ("single_antenna", "simulated_station") else []
    code, text = said(capsys, name, *given, "--print")
    values = file.values(launch.pairs(given))
    assert (code, text.count("\n")) == (0, len(file.processes(values)))


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A computer with two programs for nodes; what still runs at the end is ended."""
    folder = tmp_path / "lib" / "rf_pointing"
    folder.mkdir(parents=True)
    for name in ("antenna_servo", "operator_page"):
        (folder / name).write_text(NODE)
        (folder / name).chmod(0o755)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    yield tmp_path
    for state in running():
        os.kill(state["process"], signal.SIGINT)


def until(condition: Callable[[], object]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        os.sched_yield()


def test_a_station_in_the_background_is_one_of_its_name_and_is_ended_by_it(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = [sys.executable, "-c", START, str(home)]
    done = subprocess.run([*line, "detach"], capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    assert "gs1 goes on in the background; logs: " in done.stdout
    until(lambda: len([each for state in running() for each in state["processes"].values() if each["process"]]) == 2)
    (state,) = running(["/gs1"])
    code, text = said(capsys, "status")
    assert (code, text.count("process ")) == (0, 3)
    again = subprocess.run(line, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert again.returncode == 1
    assert (
        f"/gs1/launch already runs in ROS domain {os.environ.get('ROS_DOMAIN_ID', '0')} (process {state['process']})"
        in again.stderr
    )
    node = state["processes"]["antenna_servo"]["process"]
    os.kill(node, signal.SIGKILL)
    until(lambda: running()[0]["processes"]["antenna_servo"]["process"] not in (None, node))
    assert said(capsys, "status")[1].count("was ended by SIGKILL") == 1
    code, text = said(capsys, "stop", "gs1")
    assert (code, "gs1 has ended" in text) == (0, True)
    assert running() == []


def test_ctrl_c_and_a_closed_terminal_end_all_in_order(home: Path) -> None:
    """Exit code 0, and nothing is left; every line of the nodes was shown with its name."""
    for sign in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        process = subprocess.Popen([sys.executable, "-c", START, str(home)], stdout=subprocess.PIPE, text=True)
        until(lambda: running() and len(running()[0]["processes"]) == 2)
        (state,) = running()
        process.send_signal(sign)
        text, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
        assert f"{signal.Signals(sign).name}: ends all processes" in text
        assert not any(Path(f"/proc/{each['process']}").exists() for each in state["processes"].values())
