"""Elements that are replaced while the publisher runs: by a file, and by a server through the command."""

import dataclasses
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_files import element_files, version_of
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.ros import element_updates
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.element_updates import ElementUpdates

STATE = LifecycleState(state_id=1, label="unconfigured")
CBERS = find_elements(verification_elements(), "28057")
START_S = CBERS.epoch_t_s + 3600.0


def tle_text(ahead_s: float = 0.0) -> str:
    moved = dataclasses.replace(CBERS, epoch_t_s=CBERS.epoch_t_s - ahead_s)
    return "\n".join(("CBERS 2", *tle_lines(moved))) + "\n"


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *arguments: Any) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Yield the address of a server of the files in tmp_path, with a cache folder of the test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    made.daemon_threads = True
    Thread(target=made.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{made.server_port}/cbers.tle"
    made.shutdown()
    made.server_close()


@pytest.fixture
def make_publisher(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Any]]:
    made = []

    def make(elements: str) -> Any:
        node = EphemerisPublisher()
        made.append(node)
        node.set_parameters([Parameter("source.elements", value=elements)])
        monkeypatch.setattr(node, "now_s", lambda: START_S)
        assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
        assert node.on_activate(STATE) == TransitionCallbackReturn.SUCCESS
        return node

    yield make
    for node in made:
        node.end()
        node.lock.release()
        node.destroy_node()


def test_a_replaced_file_comes_into_force_between_passes_and_not_in_one(
    make_publisher: Callable[[str], Any], tmp_path: Path
) -> None:
    file = tmp_path / "cbers.tle"
    file.write_text(tle_text())
    node = make_publisher(str(file))
    first = node._passes[0]
    node._renew(START_S)
    assert node._passes[0] == first
    file.write_text(tle_text(ahead_s=30.0))
    node._renew(0.5 * (first.aos_t_s + first.los_t_s))
    assert node._passes[0] == first
    node._renew(START_S)
    assert node._passes[0].aos_t_s == pytest.approx(first.aos_t_s - 30.0, abs=3.0)
    assert node._health().level == OK


def test_a_broken_file_leaves_the_elements_in_force_and_is_a_warning(
    make_publisher: Callable[[str], Any], tmp_path: Path
) -> None:
    file = tmp_path / "cbers.tle"
    file.write_text(tle_text())
    node = make_publisher(str(file))
    first = node._passes[0]
    file.write_text(tle_text()[:-20])
    node._renew(START_S)
    assert node._passes[0] == first
    assert node._health().level == WARN
    assert "elements were not renewed: cbers.tle: line" in node._health().message
    file.write_text(tle_text())
    node._renew(START_S)
    assert node._health().level == OK


def test_stale_elements_are_a_warning_with_their_error(make_publisher: Callable[[str], Any], tmp_path: Path) -> None:
    file = tmp_path / "cbers.tle"
    file.write_text(tle_text(ahead_s=5.0 * 86400.0))
    health = make_publisher(str(file))._health()
    assert health.level == WARN
    assert "elements of CBERS 2 are stale: 5.0 days from their epoch, expected error along the track" in health.message


def test_an_address_is_fetched_when_nothing_is_kept_and_renewed_by_the_command(
    server: str, make_publisher: Callable[[str], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cbers.tle").write_text(tle_text())
    node = make_publisher(server)
    first = node._passes[0]
    (kept,) = element_files(server)
    # The same address within the rule: the command runs and sends nothing.
    (tmp_path / "cbers.tle").write_text(tle_text(ahead_s=30.0))
    monkeypatch.setattr(element_updates, "EVERY_S", 0.0)
    before = version_of(server)
    node._updates._run()
    node._updates._process.wait(timeout=60.0)
    assert version_of(server) == before
    # The next time the source allows it.
    kept.with_name(f".{kept.name}.json").unlink()
    node._updates._run()
    node._updates._run()
    node._updates._process.wait(timeout=60.0)
    node._renew(START_S)
    assert node._passes[0].aos_t_s == pytest.approx(first.aos_t_s - 30.0, abs=3.0)
    assert node._health().level == OK


def test_a_failing_source_is_a_warning_and_the_kept_elements_stay(server: str, tmp_path: Path) -> None:
    (tmp_path / "cbers.tle").write_text(tle_text())
    ElementUpdates(server).require()
    (kept,) = element_files(server)
    kept.with_name(f".{kept.name}.json").unlink()
    (tmp_path / "cbers.tle").unlink()
    updates = ElementUpdates(server)
    assert not updates.changed()
    updates._process.wait(timeout=60.0)
    assert not updates.changed()
    assert "answered 404" in updates.problem
    assert kept.read_text() == tle_text()


def test_an_address_that_gives_nothing_is_the_reason_why_a_node_cannot_be_configured(server: str) -> None:
    with pytest.raises(ValueError, match=r"elements='http://127.0.0.1:.*': http://.*answered 404"):
        ElementUpdates(server).require()


ADDRESS = "https://example.org/cbers.tle"


class Process:
    """A command that fetches: runs until the test ends it."""

    def __init__(self, command: list[str]) -> None:
        self.command, self.returncode, self.errors, self.killed = command, None, "", 0

    def poll(self) -> int | None:
        return self.returncode

    def communicate(self) -> tuple[None, str]:
        return None, self.errors

    def kill(self) -> None:
        self.killed += 1


@pytest.fixture
def source(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the surroundings of an address: `version` of what is kept, the wall clock, and what was started."""
    made = SimpleNamespace(version="", t_s=5000.0, started=[], runs=[], answer=None)

    def popen(command: list[str], **_options: Any) -> Process:
        made.started.append(Process(command))
        return made.started[-1]

    def run(command: list[str], **options: Any) -> Any:
        made.runs.append((command[-1], options["timeout"]))
        return made.answer()

    monkeypatch.setattr(element_updates, "version_of", lambda _location: made.version)
    monkeypatch.setattr(element_updates.time, "monotonic", lambda: made.t_s)
    monkeypatch.setattr(element_updates.subprocess, "Popen", popen)
    monkeypatch.setattr(element_updates.subprocess, "run", run)
    return made


def test_the_command_runs_each_ten_minutes_and_once_at_a_time(source: Any) -> None:
    source.version = "a"
    updates = ElementUpdates(ADDRESS)
    assert not updates.changed()
    (first,) = source.started
    assert first.command[-1] == ADDRESS
    source.t_s += 700.0
    assert not updates.changed()
    assert len(source.started) == 1, "it still runs"
    first.returncode, source.version = 0, "b"
    assert updates.changed()
    updates.accept()
    assert not updates.changed()
    assert len(source.started) == 2, "700 s after the first"
    source.started[1].returncode = 0
    updates.changed()
    for after_s, count in ((599.0, 2), (1.0, 3)):
        source.t_s += after_s
        updates.changed()
        assert len(source.started) == count


def test_a_failure_of_the_command_is_the_problem_until_it_succeeds(source: Any) -> None:
    source.version = "a"
    updates = ElementUpdates(ADDRESS)
    for returncode, errors, problem in (
        (1, "fetch_elements: no route\nfetch_elements: answered 503\n", "answered 503"),
        (1, "", ""),
        (0, "a note\n", ""),
    ):
        updates.changed()
        source.started[-1].returncode, source.started[-1].errors = returncode, errors
        updates.changed()
        assert updates.problem == problem
        source.t_s += 600.0


def test_the_end_kills_the_command_once(source: Any) -> None:
    updates = ElementUpdates(ADDRESS)
    updates.end()
    updates.changed()
    updates.end()
    updates.end()
    assert [each.killed for each in source.started] == [1]


def test_files_start_no_command_and_kept_elements_are_not_waited_for(source: Any) -> None:
    updates = ElementUpdates("/var/cbers.tle")
    updates.require()
    assert not updates.changed()
    source.version = "a"
    assert updates.changed()
    ElementUpdates(ADDRESS).require()
    assert (source.runs, source.started) == ([], [])


def test_elements_that_were_never_there_are_waited_for_ninety_seconds(source: Any) -> None:
    updates = ElementUpdates(ADDRESS)

    def arrives() -> Any:
        source.version = "a"

    source.answer = arrives
    updates.require()
    assert source.runs == [(ADDRESS, 90.0)]
    assert not updates.changed()
    assert source.started == [], "the next one in ten minutes"
    source.t_s += 600.0
    updates.changed()
    assert len(source.started) == 1


@pytest.mark.parametrize(
    ("done", "words"),
    [
        (SimpleNamespace(stderr="fetch_elements: first\nfetch_elements: answered 404\n", returncode=1), "answered 404"),
        (SimpleNamespace(stderr="", returncode=7), "fetch_elements ended with exit code 7"),
        (subprocess.TimeoutExpired("fetch", 90.0), "were not fetched within 90 s"),
    ],
)
def test_without_elements_the_reason_names_the_address(source: Any, done: Any, words: str) -> None:
    def answer() -> Any:
        if isinstance(done, Exception):
            raise done
        return done

    source.answer = answer
    with pytest.raises(ValueError, match=f"^elements='{ADDRESS}'.* ?{words}$"):
        ElementUpdates(ADDRESS).require()
