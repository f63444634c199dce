"""Elements that are fetched by the command: when it runs, what its failure says, and what stays."""

import subprocess
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rf_pointing.ephemeris import element_updates, find_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_files import element_files
from rf_pointing.ephemeris.element_updates import ElementUpdates
from test.ephemeris.element_server import Source

TEXT = "\n".join(("CBERS 2", *tle_lines(find_elements(verification_elements(), "28057")))) + "\n"
ADDRESS = "https://example.org/cbers.tle"


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def test_an_address_is_fetched_when_nothing_is_kept_and_renewed_by_the_command(
    source: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    source.body = TEXT.encode()
    ElementUpdates(source.address).require()
    (kept,) = element_files(source.address)
    monkeypatch.setattr(element_updates, "EVERY_S", 0.0)
    source.body = TEXT.replace("CBERS 2", "CBERS").encode()
    for status, changes, problem in ((200, True, ""), (404, False, "answered 404")):
        # Within the source's rule the command sends nothing: the note of the last request is taken away.
        kept.with_name(f".{kept.name}.json").unlink()
        source.status = status
        updates, deadline_s = ElementUpdates(source.address), time.monotonic() + 60.0
        while not (updates.changed() if changes else updates.problem or updates.changed()):
            assert time.monotonic() < deadline_s
            time.sleep(0.05)
        assert problem in updates.problem
        updates.end()
        assert kept.read_text() == TEXT.replace("CBERS 2", "CBERS")


def test_an_address_that_gives_nothing_is_the_reason_why_a_node_cannot_be_configured(source: Source) -> None:
    source.status = 404
    with pytest.raises(ValueError, match=r"elements='http://127.0.0.1:.*': http://.*answered 404"):
        ElementUpdates(source.address).require()


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
def surroundings(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the surroundings of an address: `version` of what is kept, the wall clock, and what was started."""
    made = SimpleNamespace(version="a", t_s=5000.0, started=[], runs=[], answer=None)

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


def test_the_command_runs_each_ten_minutes_and_once_at_a_time(surroundings: Any) -> None:
    updates = ElementUpdates(ADDRESS)
    for after_s, ended, count in ((0.0, False, 1), (700.0, False, 1), (0.0, True, 1), (0.0, True, 2), (599.0, True, 2),
                                  (1.0, False, 3)):  # fmt: skip
        surroundings.t_s += after_s
        if ended:
            surroundings.started[-1].returncode = 0
        assert not updates.changed()
        assert len(surroundings.started) == count
    assert surroundings.started[0].command[-1] == ADDRESS
    surroundings.version = "b"
    assert updates.changed()
    updates.accept()
    assert not updates.changed()
    updates.end()
    updates.end()
    assert [each.killed for each in surroundings.started] == [0, 0, 1]


def test_a_failure_of_the_command_is_the_problem_until_it_succeeds(surroundings: Any) -> None:
    updates = ElementUpdates(ADDRESS)
    for returncode, errors, problem in (
        (1, "fetch_elements: no route\nfetch_elements: answered 503\n", "answered 503"), (1, "", ""), (0, "a note\n", ""),
    ):  # fmt: skip
        updates.changed()
        surroundings.started[-1].returncode, surroundings.started[-1].errors = returncode, errors
        updates.changed()
        assert updates.problem == problem
        surroundings.t_s += 600.0


@pytest.mark.parametrize(
    ("done", "words"),
    [
        (SimpleNamespace(stderr="fetch_elements: first\nfetch_elements: answered 404\n", returncode=1), "answered 404"),
        (SimpleNamespace(stderr="", returncode=7), "fetch_elements ended with exit code 7"),
        (subprocess.TimeoutExpired("fetch", 90.0), "were not fetched within 90 s"),
    ],
)
def test_without_elements_the_reason_names_the_address(surroundings: Any, done: Any, words: str) -> None:
    def answer() -> Any:
        if isinstance(done, Exception):
            raise done
        return done

    surroundings.version, surroundings.answer = "", answer
    with pytest.raises(ValueError, match=f"^elements='{ADDRESS}'.* ?{words}$"):
        ElementUpdates(ADDRESS).require()
