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
from threading import enumerate as running_threads
from types import SimpleNamespace
from typing import Any

import pytest
import requests

from rf_pointing.commands import fetch_elements, plan_calibration, plan_passes
from rf_pointing.commands.fetch_elements import LONGEST_WAIT_S, Outcome, Record, refresh
from rf_pointing.ephemeris import read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_files import cache_folder, element_files, kept_file
from rf_pointing.ephemeris.source import load_catalogue
from test.conftest import within
from test.ephemeris.oem_text import teme_states, text_of

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
    return lambda after_s=0.0, **options: refresh(
        source.address, tmp_path, NOW_S + after_s, **{"timeout_s": 8.0, **options}
    )


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
    early = ask(2 * RULE_S - 1.0)
    assert (early.state, early.problem) == (bad.state, bad.problem)
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
    others = set(running_threads())
    source.drip_s = 0.05
    begin_s = time.monotonic()
    slow = ask(RULE_S, timeout_s=1.0)
    assert within(time.monotonic() - begin_s, 3.0)
    assert slow.state == "kept"
    assert slow.problem.endswith("has not answered in full after 1 s")
    # What still reads must not keep the process.
    assert all(one.daemon for one in set(running_threads()) - others)
    assert slow.file.read_text() == tle_text()


def test_a_server_that_is_not_there_may_be_tried_again_in_a_minute(tmp_path: Path) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{closed.getsockname()[1]}/gp.php"
        gone = refresh(address, tmp_path, NOW_S, timeout_s=8.0)
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


@pytest.mark.parametrize(
    ("address", "every_s", "allowed_s"),
    [
        ("https://celestrak.org/NORAD/elements/gp.php", None, 7200.0),
        ("https://celestrak.org/NORAD/elements/gp.php", 7200.0, 7200.0),
        ("https://WWW.Celestrak.com/x", None, 7200.0),
        ("https://www.space-track.org/x", None, 3600.0),
        ("https://space-track.org/x", 5000.0, 5000.0),
        ("https://example.org/x", None, 7200.0),
        ("https://example.org/x", 0.0, 0.0),
        ("https://not-celestrak.org/x", 60.0, 60.0),
    ],
)
def test_the_interval_is_that_of_the_source_and_of_the_user(
    address: str, every_s: float | None, allowed_s: float
) -> None:
    assert fetch_elements.allowed_interval_s(address, every_s) == allowed_s


@pytest.mark.parametrize("headers", [{"ETag": '"a1"'}, {"Last-Modified": "Tue, 27 Jun 2006 06:00:00 GMT"}])
def test_one_of_tag_and_time_is_enough_to_know_that_nothing_has_changed(
    headers: dict[str, str], source: Source, ask: Callable[..., Outcome]
) -> None:
    source.headers = headers
    ask()
    source.status, source.body = 304, b""
    assert ask(RULE_S).state == "unchanged"


@pytest.mark.parametrize(
    ("status", "wait", "again_s"),
    [
        (503, None, 0.0),
        (503, "3000", 3000.0),
        (503, "Wed, 28 Jun 2006 13:56:40 GMT", 3000.0),
        (503, "Wed, 28 Jun 2006 12:06:40 GMT", 0.0),
        (503, "soon", 0.0),
        (200, None, 0.0),
    ],
)
def test_a_source_without_a_rule_is_requested_again_when_it_wants(
    status: int, wait: str | None, again_s: float, source: Source, ask: Callable[..., Outcome],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(fetch_elements, "time", SimpleNamespace(time=lambda: NOW_S))
    source.status, source.headers = status, {} if wait is None else {"Retry-After": wait}
    source.body = b"no elements"
    asked = ask(every_s=0.0)
    assert asked.problem
    assert asked.record.again_t_s(0.0) == NOW_S + again_s


@pytest.mark.parametrize(
    ("error", "complaint", "wait_s"),
    [
        (requests.ConnectTimeout("timed out"), "cannot be reached: timed out", 60.0),
        (requests.exceptions.SSLError("bad certificate"), "cannot be reached: bad certificate", 60.0),
        (requests.exceptions.ProxyError("no proxy"), "cannot be reached: no proxy", 60.0),
        (requests.ReadTimeout("slow"), "has not answered after 60 s", 0.0),
        (requests.exceptions.ChunkedEncodingError("half"), "broke off: half", 0.0),
        (requests.ConnectionError("reset by peer"), "broke off: reset by peer", 0.0),
        (requests.ConnectionError(), "broke off", 0.0),
        (requests.TooManyRedirects("31 redirects"), ": 31 redirects", 0.0),
    ],
)
def test_a_failed_request_counts_where_the_server_had_it(
    error: Exception, complaint: str, wait_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[float] = []

    def fail(_address: str, *, timeout: float, **_options: Any) -> None:
        limits.append(timeout)
        raise error

    monkeypatch.setattr(requests, "get", fail)
    found = refresh("http://example.org/x", tmp_path / "a" / "b", NOW_S, every_s=0.0)
    assert found.state == "none"
    assert complaint in found.problem
    assert found.record.again_t_s(0.0) == NOW_S + wait_s
    assert found.record.requested_t_s == (NOW_S if wait_s == 0.0 else 0.0)
    # A whole answer may take a minute.
    assert limits == [60.0]


def test_an_answer_is_read_no_further_than_the_longest_file(
    source: Source, ask: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetch_elements, "MOST_BYTES", 50_000)
    # Read to its end, it would be half of what was promised.
    source.body, source.promised = b"x" * 100_000, 5000
    assert ask().problem.endswith("sent 65536 bytes, must be <= 50000")
    source.body, source.promised = tle_text().encode(), 0
    monkeypatch.setattr(fetch_elements, "MOST_BYTES", len(source.body))
    assert ask(RULE_S).state == "new"


HEAD = "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,"
HEAD += "MEAN_ANOMALY,EPHEMERIS_TYPE,CLASSIFICATION_TYPE,NORAD_CAT_ID,ELEMENT_SET_NO,REV_AT_EPOCH,BSTAR,"
ROW = "A,2006-001A,2006-06-27T00:00:00,15.1,.001,98,10,20,30,0,U,799500123,999,1,.0001,"
CSV = f"{HEAD}MEAN_MOTION_DDOT,MEAN_MOTION_DOT\n{ROW}0,.00012345"
JSON = (
    '[\n {"OBJECT_NAME": "A", "OBJECT_ID": "2006-001A", "EPOCH": "2006-06-27T00:00:00", "MEAN_MOTION": 15.1, '
    '"ECCENTRICITY": 0.001, "INCLINATION": 98, "RA_OF_ASC_NODE": 10, "ARG_OF_PERICENTER": 20, "MEAN_ANOMALY": 30, '
    '"EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": 123, "ELEMENT_SET_NO": 999, "REV_AT_EPOCH": 1, '
    '"BSTAR": 0.0001, "MEAN_MOTION_DOT": 0.0001, "MEAN_MOTION_DDOT": 0}\n]'
)


@pytest.mark.parametrize(
    ("body", "promised", "headers"),
    [
        (CSV.encode(), 0, {}),
        (f"{len(CSV):x}\r\n{CSV}\r\n0\r\n\r\n".encode(), None, {"Transfer-Encoding": "chunked"}),
        (JSON.encode(), None, {}),
        (f"{CSV}\n".encode(), None, {}),
    ],
)
def test_an_answer_whose_end_is_known_needs_no_last_line_end(
    body: bytes, promised: int | None, headers: dict[str, str], source: Source, ask: Callable[..., Outcome]
) -> None:
    source.body, source.promised, source.headers = body, promised, headers
    assert (ask().problem, ask().record.objects) == ("", 1)


def test_half_of_the_objects_are_taken_and_any_where_the_file_is_gone(
    source: Source, ask: Callable[..., Outcome]
) -> None:
    kept = ask()
    source.body = tle_text(2).encode()
    assert ask(RULE_S).record.objects == 2
    kept.file.unlink()
    source.body = tle_text(1).encode()
    assert "If-None-Match" not in source.asked[-1]
    # Less than half of three.
    gone = ask(2 * RULE_S)
    assert (gone.state, gone.record.objects) == ("new", 1)
    source.body = tle_text(4).encode()
    ask(3 * RULE_S)
    kept.file.unlink()
    source.body = tle_text(1).encode()
    assert ask(4 * RULE_S).state == "new"


def test_the_epochs_of_the_elements_are_kept(ask: Callable[..., Outcome]) -> None:
    epochs = sorted(one.epoch_t_s for one in read_elements(tle_text()))
    assert ask().record.epochs_t_s == (epochs[0], 0.5 * (epochs[1] + epochs[2]), epochs[3])


def test_an_ephemeris_is_kept_without_the_age_of_elements(
    source: Source, ask: Callable[..., Outcome], capsys: pytest.CaptureFixture[str]
) -> None:
    cbers = next(one for one in verification_elements() if one.catalogue_number == 28057)
    source.body = text_of(teme_states(cbers)).encode()
    kept = ask()
    assert (kept.problem, kept.record.objects, kept.record.epochs_t_s) == ("", 1, None)
    row = fetch_elements.values(kept, NOW_S)
    assert (row["oldest_h"], row["median_h"], row["newest_h"]) == (None, None, None)
    fetch_elements.show(kept, NOW_S)
    assert "age of the elements" not in capsys.readouterr().out


def test_a_record_that_cannot_be_kept_is_an_error(source: Source, ask: Callable[..., Outcome], tmp_path: Path) -> None:
    file = kept_file(source.address, tmp_path)
    file.with_name(f".{file.name}.json").mkdir()
    with pytest.raises(ValueError, match=file.name):
        ask()


def outcome(state: str = "kept", problem: str = "", **changes: Any) -> Outcome:
    epochs = (NOW_S - 60.0 * 3600.0, NOW_S - 47.9 * 3600.0, NOW_S - 1234.5678)
    fields = {"requested_t_s": NOW_S - 1000.0, "interval_s": RULE_S, "fresh_t_s": NOW_S - 1000.0, "objects": 3}
    record = Record(**{"address": "http://a/x", "epochs_t_s": epochs, "problem": problem, **fields, **changes})
    return Outcome(state=state, file=Path("kept.tle"), record=record)


def test_what_is_kept_is_printed_with_its_age(capsys: pytest.CaptureFixture[str]) -> None:
    fetch_elements.show(outcome("new"), NOW_S)
    assert capsys.readouterr().out.splitlines() == [
        "http://a/x: new",
        "  3 objects, confirmed 0.3 h ago, in kept.tle",
        "  age of the elements: newest 0.3 h, median 47.9 h, oldest 2.5 d",
        "  may be requested again at 2006-06-28T14:50:00.000Z",
    ]
    fetch_elements.show(outcome("none", "answered 403"), NOW_S)
    assert capsys.readouterr().out.splitlines()[:-1] == ["http://a/x: none", "  problem: answered 403"]


def test_what_is_kept_is_given_in_hours_as_json() -> None:
    assert fetch_elements.values(outcome(problem="answered 403"), NOW_S) == {
        "address": "http://a/x", "state": "kept", "problem": "answered 403", "file": "kept.tle", "objects": 3,
        "confirmed_age_h": 0.278, "oldest_h": 60.0, "median_h": 47.9, "newest_h": 0.343,
        "again_utc": "2006-06-28T14:50:00.000Z",
    }  # fmt: skip
    assert fetch_elements.values(outcome(fresh_t_s=0.0), NOW_S)["confirmed_age_h"] is None


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return outcomes by address, which take the place of requests; `options` are those of the last one."""
    made: dict[str, Any] = {}

    def refresh_fake(address: str, folder: Path, now_s: float, **options: Any) -> Outcome:
        made["options"] = options
        made.setdefault("order", []).append(address)
        assert folder.is_dir()
        assert now_s == NOW_S
        return made[address]

    monkeypatch.setattr(fetch_elements, "refresh", refresh_fake)
    monkeypatch.setattr(fetch_elements, "time", SimpleNamespace(time=lambda: NOW_S))
    return made


A, B = "http://a/x", "http://b/x"


@pytest.mark.parametrize(
    ("states", "code"),
    [
        ([("new", ""), ("unchanged", "")], 0),
        ([("new", ""), ("kept", "answered 403")], 1),
        ([("kept", "answered 403"), ("none", "answered 404")], 2),
    ],
)
@pytest.mark.parametrize("json_too", [False, True])
def test_the_exit_code_is_that_of_the_worst_address(
    states: list[tuple[str, str]], code: int, json_too: bool, requested: dict[str, Any], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    for address, (state, problem) in zip((A, B), states, strict=True):
        requested[address] = outcome(state, problem, address=address)
    assert run("--cache", str(tmp_path), *(["--json"] if json_too else []), A, B) == code
    shown = capsys.readouterr()
    if json_too:
        assert [row["state"] for row in json.loads(shown.out)] == [state for state, _ in states]
    else:
        assert [line for line in shown.out.splitlines() if line.startswith("http")] == [
            f"{address}: {state}" for address, (state, _) in zip((A, B), states, strict=True)
        ]
    assert shown.err.splitlines() == [f"fetch_elements: {problem}" for _, problem in states if problem]


@pytest.mark.parametrize(
    ("line", "every_s", "timeout_s"),
    [("", None, 60.0), ("--every 0 --timeout 0.1", 0.0, 0.1), ("--every 720 --timeout 3600", 2592000.0, 3600.0)],
)
def test_interval_and_time_limit_are_those_of_the_user(
    line: str, every_s: float | None, timeout_s: float, requested: dict[str, Any], tmp_path: Path
) -> None:
    requested[A] = outcome("new")
    assert run("--cache", str(tmp_path), *line.split(), A) == 0
    assert requested["options"] == {"every_s": every_s, "timeout_s": timeout_s}


@pytest.mark.parametrize("line", ["--every 720.1", "--every -0.1", "--timeout 3601", "--timeout 0.09"])
def test_beyond_their_ranges_they_are_refused(line: str, requested: dict[str, Any]) -> None:
    assert run(*line.split(), A) == 2
    assert requested == {}


def test_kept_addresses_are_listed_or_requested_again(
    source: Source, ask: Callable[..., Outcome], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    ask()
    first = source.address
    source.address += "&MORE=1"
    ask()
    cache, both = ["--cache", str(tmp_path)], sorted([first, source.address])

    def listed(*line: str) -> list[str]:
        assert run(*cache, "--json", *line) == 0
        return [row["address"] for row in json.loads(capsys.readouterr().out)]

    assert listed("--list") == both
    assert listed("--list", first) == [first]
    assert run(*cache, "--list", "http://other/x") == 2
    assert "keeps no elements of these addresses" in capsys.readouterr().err
    asked = len(source.asked)
    assert asked == 2
    monkeypatch.setattr(fetch_elements, "time", SimpleNamespace(time=lambda: NOW_S + RULE_S))
    assert listed() == both
    assert len(source.asked) == 4
    # One address alone, which is not due again.
    assert listed(first) == [first]
    assert len(source.asked) == 4


def test_a_command_without_any_elements_ends_with_the_reason(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    fetch_elements.current_elements.cache_clear()
    source.status = 403
    with pytest.raises(ValueError, match=r"elements='http://127.*: .*answered 403 Forbidden"):
        fetch_elements.current_elements(source.address)
    fetch_elements.current_elements.cache_clear()
    source.status, source.address = 200, source.address + "&MORE=1"
    fetch_elements.current_elements(source.address)
    assert capsys.readouterr().err == ""
