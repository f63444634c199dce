"""`fetch_elements` against a server on loopback that also refuses, breaks off, lies, and drips."""

import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from rf_pointing.commands import fetch_elements, plan_calibration, plan_passes
from rf_pointing.commands.fetch_elements import LONGEST_WAIT_S, Outcome, refresh
from rf_pointing.ephemeris import read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_files import cache_folder, element_files, kept_file
from rf_pointing.ephemeris.source import load_catalogue

NOW_S = 1_151_500_000.0
RULE_S = 7200.0
FRESH = [one for one in verification_elements() if abs(one.epoch_t_s - NOW_S) < 10 * 86400.0]


def tle_text(count: int = 4) -> str:
    return "".join(f"{one.name}\n" + "".join(f"{line}\n" for line in tle_lines(one)) for one in FRESH[:count])


@dataclass
class Source:
    """A server whose answers the test sets, and what it was asked."""

    address: str = ""
    status: int = 200
    body: bytes = field(default_factory=lambda: tle_text().encode())
    headers: dict[str, str] = field(default_factory=dict)
    promised: int | None = 0
    """Content-Length beyond that of the body; None sends none."""
    drip_s: float = 0.0
    asked: list[dict[str, str]] = field(default_factory=list)


@pytest.fixture
def source() -> Iterator[Source]:
    made = Source()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            made.asked.append(dict(self.headers))
            self.send_response(made.status)
            for name, value in made.headers.items():
                self.send_header(name, value)
            if made.promised is not None and made.status != 304:
                self.send_header("Content-Length", str(len(made.body) + made.promised))
            self.end_headers()
            # The client may have had enough before the last byte.
            with contextlib.suppress(ConnectionError):
                for at in range(len(made.body) if made.drip_s else 0):
                    self.wfile.write(made.body[at : at + 1])
                    time.sleep(made.drip_s)
                if not made.drip_s and made.status != 304:
                    self.wfile.write(made.body)

        def log_message(self, *arguments: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    Thread(target=server.serve_forever, daemon=True).start()
    made.address = f"http://127.0.0.1:{server.server_port}/gp.php?GROUP=active&FORMAT=tle"
    yield made
    server.shutdown()
    server.server_close()


@pytest.fixture
def ask(source: Source, tmp_path: Path) -> Callable[..., Outcome]:
    return lambda after_s=0.0, **options: refresh(source.address, tmp_path, NOW_S + after_s, **options)


def test_an_address_is_kept_and_not_asked_again_before_the_rule(source: Source, ask: Callable[..., Outcome]) -> None:
    first = ask()
    assert (first.state, first.problem, first.record.objects) == ("new", "", 4)
    assert first.file.read_text() == tle_text()
    assert "If-None-Match" not in source.asked[0]
    for after_s in (1.0, RULE_S - 1.0):
        assert ask(after_s).state == "not due"
    assert len(source.asked) == 1
    assert ask(RULE_S).state == "new"
    assert len(source.asked) == 2


def test_what_has_not_changed_is_not_sent_again(source: Source, ask: Callable[..., Outcome]) -> None:
    source.headers = {"ETag": '"a1"', "Last-Modified": "Tue, 27 Jun 2006 06:00:00 GMT"}
    kept = ask()
    source.status, source.body = 304, b""
    again = ask(RULE_S)
    assert source.asked[1]["If-None-Match"] == '"a1"'
    assert source.asked[1]["If-Modified-Since"] == "Tue, 27 Jun 2006 06:00:00 GMT"
    assert (again.state, again.problem) == ("unchanged", "")
    assert again.record.fresh_t_s == NOW_S + RULE_S
    assert again.record.objects == 4
    assert kept.file.read_text() == tle_text()


def test_a_kept_file_that_was_changed_by_hand_is_fetched_as_a_whole(
    source: Source, ask: Callable[..., Outcome]
) -> None:
    source.headers = {"ETag": '"a1"'}
    ask().file.write_text("half of a fi")
    mended = ask(RULE_S)
    assert "If-None-Match" not in source.asked[1]
    assert mended.file.read_text() == tle_text()


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "403": ({"status": 403, "body": b"blocked"}, "answered 403 Forbidden"),
    "404": ({"status": 404, "body": b""}, "answered 404 Not Found"),
    "500": ({"status": 500, "body": b"oops"}, "answered 500 Internal Server Error"),
    "304 for nothing kept": ({"status": 304, "body": b""}, "answered 304"),
    "web page": ({"body": b"<!DOCTYPE html><html><body>log in</body></html>"}, "answered a web page"),
    "words": ({"body": b"No GP data found"}, "answered no whole set of elements ('No GP data found')"),
    "nothing": ({"body": b""}, "answered no whole set of elements"),
    "half a line": ({"body": tle_text().encode()[:-30], "promised": None}, "no whole set of elements"),
    "half of what was promised": ({"promised": 5000}, "broke off"),
    "half a JSON": ({"body": b'[{"OBJECT_NAME":"A","NORAD_CA', "promised": None}, "OMM JSON is malformed"),
    "not text": ({"body": bytes(range(128, 256))}, "no whole set of elements"),
    "fewer than half the objects": ({"body": tle_text(1).encode()}, "holds 1 objects, fewer than half of the 4"),
    "broken gzip": ({"headers": {"Content-Encoding": "gzip"}}, "127.0.0.1"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_answer_leaves_the_kept_file_and_counts_as_a_request(
    case: str, source: Source, ask: Callable[..., Outcome]
) -> None:
    if case != "304 for nothing kept":
        ask()
    changes, complaint = BAD[case]
    for name, value in changes.items():
        setattr(source, name, value)
    asked = len(source.asked)
    bad = ask(RULE_S)
    assert bad.state == ("none" if asked == 0 else "kept")
    assert complaint in bad.problem
    assert bad.file.is_file() == (asked > 0)
    if asked:
        assert bad.file.read_text() == tle_text()
        assert bad.record.fresh_t_s == NOW_S
    # Not even a failing source is asked more often than it allows.
    assert ask(2 * RULE_S - 1.0).problem == bad.problem
    assert len(source.asked) == asked + 1
    source.status, source.body, source.headers, source.promised = 200, tle_text(3).encode(), {}, 0
    healed = ask(2 * RULE_S)
    assert (healed.state, healed.problem) == ("new", "")
    assert healed.file.read_text() == tle_text(3)


def test_a_csv_cut_off_in_its_last_number_is_not_taken(source: Source, ask: Callable[..., Outcome]) -> None:
    """Without a promised length a shorter last number would be another number."""
    head = "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,"
    head += "MEAN_ANOMALY,EPHEMERIS_TYPE,CLASSIFICATION_TYPE,NORAD_CAT_ID,ELEMENT_SET_NO,REV_AT_EPOCH,BSTAR,"
    row = "A,2006-001A,2006-06-27T00:00:00,15.1,.001,98,10,20,30,0,U,799500123,999,1,.0001,"
    whole = f"{head}MEAN_MOTION_DDOT,MEAN_MOTION_DOT\r\n{row}0,.00012345\r\n".encode()
    source.body, source.promised = whole[:-4], None
    assert "ended in the middle of a line" in ask().problem
    source.body = whole
    assert ask(RULE_S).record.objects == 1


def test_bytes_that_drip_end_at_the_time_limit(source: Source, ask: Callable[..., Outcome]) -> None:
    ask()
    source.drip_s = 0.05
    begin_s = time.monotonic()
    slow = ask(RULE_S, timeout_s=1.0)
    assert time.monotonic() - begin_s < 3.0
    assert slow.state == "kept"
    assert slow.problem.endswith("has not answered in full after 1 s")
    assert slow.file.read_text() == tle_text()


def test_a_server_that_is_not_there_may_be_tried_again_in_a_minute(tmp_path: Path) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{closed.getsockname()[1]}/gp.php"
        gone = refresh(address, tmp_path, NOW_S)
    assert (gone.state, gone.record.again_t_s(RULE_S)) == ("none", NOW_S + 60.0)
    assert "cannot be reached" in gone.problem


def test_a_server_that_asks_for_patience_gets_it_within_bounds(source: Source, ask: Callable[..., Outcome]) -> None:
    source.status, source.headers = 503, {"Retry-After": "20000"}
    assert ask().record.again_t_s(RULE_S) == NOW_S + 20000.0
    source.headers = {"Retry-After": "99999999"}
    assert ask(20000.0).record.again_t_s(RULE_S) == NOW_S + 20000.0 + LONGEST_WAIT_S


def test_a_clock_that_was_set_back_does_not_block_an_address(source: Source, ask: Callable[..., Outcome]) -> None:
    ask()
    assert ask(-10.0 * 86400.0).state == "new"


def test_a_process_that_was_killed_while_it_waited_has_asked(
    source: Source, ask: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*arguments: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(fetch_elements, "_get", killed)
        with pytest.raises(KeyboardInterrupt):
            ask()
    assert ask(60.0).state == "none"
    assert source.asked == []
    assert ask(RULE_S).state == "new"


def test_two_processes_ask_once(source: Source, ask: Callable[..., Outcome]) -> None:
    source.drip_s = 0.001
    states: list[str] = []
    both = [Thread(target=lambda: states.append(ask().state)) for _ in range(2)]
    for one in both:
        one.start()
    for one in both:
        one.join()
    assert sorted(states) == ["new", "not due"]
    assert len(source.asked) == 1


@pytest.mark.parametrize(
    ("address", "every_s", "complaint"),
    [
        ("https://celestrak.org/NORAD/elements/gp.php?GROUP=active", 60.0, "every=0.0166667 h must be >= 2 h"),
        ("https://www.space-track.org/basicspacedata", 60.0, "must be >= 1 h, the rule of www.space-track.org"),
        ("https:///gp.php", None, "must be an address such as"),
    ],
)
def test_an_interval_below_the_sources_rule_is_refused(
    address: str, every_s: float | None, complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=complaint):
        refresh(address, tmp_path, NOW_S, every_s=every_s)


def run(*argv: str) -> int:
    with pytest.raises(SystemExit) as stopped:
        fetch_elements.main(list(argv))
    return int(stopped.value.code or 0)


def test_the_command_tells_the_age_and_its_exit_code_what_is_kept(
    source: Source, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cache = ["--cache", str(tmp_path)]
    assert run(*cache, source.address) == 0
    text = capsys.readouterr().out
    assert "new" in text.splitlines()[0]
    assert "4 objects, confirmed 0.0 h ago" in text
    assert "age of the elements: newest 7" in text
    source.status = 403
    assert run(*cache, "--every", "0") == 1
    assert "problem: http://127.0.0.1" in capsys.readouterr().out
    assert run(*cache, "--list", "--json") == 1
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["state"], row["objects"]) == ("kept", 4)
    assert row["newest_h"] <= row["median_h"] <= row["oldest_h"]
    assert len(source.asked) == 2


@pytest.mark.parametrize(
    ("argv", "complaint"),
    [
        (["ftp://celestrak.org/x"], "address 'ftp://celestrak.org/x' must begin with http:// or https://"),
        ([], "keeps no elements: give an address"),
        (["--every", "-1"], "-1 must be between 0 and 720"),
        (["--timeout", "0"], "0 must be between 0.1 and 3600"),
        (["--retry"], "unrecognized arguments: --retry"),
    ],
)
def test_what_cannot_be_fetched_is_refused_by_name(
    argv: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("--cache", str(tmp_path), *argv) == 2
    assert complaint in capsys.readouterr().err


def test_a_kept_file_has_the_name_that_older_versions_gave_it() -> None:
    """The digest is that of `printf %s ADDRESS | sha256sum`: an update of the package fetches nothing anew."""
    address = "https://celestrak.org/NORAD/elements/gp.php?GROUP=stations&FORMAT=json"
    assert kept_file(address, Path("cache")) == Path(
        "cache/celestrak.org_NORAD_elements_gp.php_GROUP=stations_FORMAT=json-d5eba0f8.elements"
    )


def test_the_kept_files_are_a_folder_of_elements(source: Source, ask: Callable[..., Outcome], tmp_path: Path) -> None:
    kept = ask()
    assert element_files(str(tmp_path)) == [kept.file]
    (tmp_path / "more.tle").write_text("".join(f"{line}\n" for line in tle_lines(FRESH[5])))
    (tmp_path / "notes.md").write_text("not elements")
    wanted = {one.catalogue_number for one in read_elements(tle_text())} | {FRESH[5].catalogue_number}
    assert {one.catalogue_number for one in load_catalogue(str(tmp_path))} == wanted


def test_every_command_takes_an_address_and_goes_on_with_the_kept_file(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    fetch_elements.current_elements.cache_clear()
    argv = ["--elements", source.address, "--satellite", str(FRESH[0].catalogue_number), "--json", "--hours", "24"]
    plan_passes.main(argv)
    first = json.loads(capsys.readouterr().out)
    assert first
    assert kept_file(source.address, cache_folder()).is_file()
    assert len(source.asked) == 1
    # Two hours later the source is gone: the plan is the same, and says so.
    state = kept_file(source.address, cache_folder())
    record = state.with_name(f".{state.name}.json")
    record.write_text(json.dumps(json.loads(record.read_text()) | {"requested_t_s": 0.0, "hold_t_s": 0.0}))
    source.status = 500
    fetch_elements.current_elements.cache_clear()
    plan_passes.main(argv)
    text = capsys.readouterr()
    assert json.loads(text.out) == first
    assert "answered 500 Internal Server Error; the elements that were confirmed 0.0 h ago are used" in text.err


def test_an_address_that_was_never_fetched_is_refused_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ValueError, match="has not been fetched: run fetch_elements 'https://celestrak.org/x'"):
        load_catalogue("https://celestrak.org/x")


def test_a_campaign_is_planned_from_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "day.tle").write_text(tle_text())
    with pytest.raises(SystemExit) as stopped:
        plan_calibration.main(["--elements", str(tmp_path), "--start", "2006-06-28T00:00:00", "--hours", "12"])
    assert stopped.value.code == 1
    assert "candidates fill" in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        plan_calibration.main(["--elements", str(tmp_path / "no"), "--start", "2006-06-28T00:00:00"])
    assert stopped.value.code == 2
    assert "/no' does not exist" in capsys.readouterr().err
