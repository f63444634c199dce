"""Elements of an address against a server on loopback that also refuses, breaks off, lies, and drips."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from threading import enumerate as running_threads
from typing import Any
from urllib.parse import urlsplit

import pytest
import requests

from rf_pointing.ephemeris import fetching, read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_files import element_files, kept_file
from rf_pointing.ephemeris.fetching import LONGEST_WAIT_S, Outcome, refresh
from rf_pointing.ephemeris.source import load_catalogue
from test.conftest import within
from test.ephemeris.element_server import FRESH, NOW_S, RULE_S, Source, tle_text
from test.ephemeris.oem_text import teme_states, text_of
from test.ephemeris.omm_text import FIELDS, as_csv


@pytest.fixture
def ask(source: Source, tmp_path: Path) -> Callable[..., Outcome]:
    return lambda after_s=0.0, **options: refresh(
        source.address, tmp_path, NOW_S + after_s, **{"timeout_s": 8.0, **options}
    )


def test_an_address_is_kept_and_not_asked_again_before_the_rule(source: Source, ask: Callable[..., Outcome]) -> None:
    first = ask()
    assert (first.state, first.problem, first.record.objects) == ("new", "", 4)
    epochs = sorted(one.epoch_t_s for one in read_elements(tle_text()))
    assert first.record.epochs_t_s == (epochs[0], 0.5 * (epochs[1] + epochs[2]), epochs[3])
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
    "half a line": ({"body": tle_text().encode()[:-30], "promised": None}, "ended in the middle of a line"),
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
    source: Source, ask: Callable[..., Outcome], tmp_path: Path
) -> None:
    source.drip_s = 1.0
    code = "import sys; from pathlib import Path; from rf_pointing.ephemeris.fetching import refresh; "
    code += f"refresh(sys.argv[1], Path(sys.argv[2]), {NOW_S})"
    child = subprocess.Popen([sys.executable, "-c", code, source.address, str(tmp_path)])
    while not source.asked:
        assert child.poll() is None
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    source.drip_s = 0.0
    assert ask(60.0).state == "none"
    assert len(source.asked) == 1
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


def test_the_kept_files_are_a_folder_of_elements(source: Source, ask: Callable[..., Outcome], tmp_path: Path) -> None:
    kept = ask()
    assert element_files(str(tmp_path)) == [kept.file]
    (tmp_path / "more.tle").write_text("".join(f"{line}\n" for line in tle_lines(FRESH[5])))
    (tmp_path / "notes.md").write_text("not elements")
    wanted = {one.catalogue_number for one in read_elements(tle_text())} | {FRESH[5].catalogue_number}
    assert {one.catalogue_number for one in load_catalogue(str(tmp_path))} == wanted


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
        (requests.exceptions.InvalidHeader("a header"), ": a header", 0.0),
    ],
)
def test_a_failed_request_counts_where_the_server_had_it(
    error: Exception, complaint: str, wait_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[float] = []

    def fail(_method: str, _address: str, *, timeout: float, **_options: Any) -> None:
        limits.append(timeout)
        raise error

    monkeypatch.setattr(requests, "request", fail)
    found = refresh("http://example.org/x", tmp_path / "a" / "b", NOW_S, every_s=0.0)
    assert found.state == "none"
    assert complaint in found.problem
    assert found.record.again_t_s(0.0) == NOW_S + wait_s
    assert found.record.requested_t_s == (NOW_S if wait_s == 0.0 else 0.0)
    # A whole answer may take a minute.
    assert limits == [60.0]


@pytest.mark.parametrize(
    ("location", "hosts", "complaint"),
    [
        ("?again=1", (), ""),
        (
            "http://localhost:{port}/x",
            (),
            "was sent on to localhost, which only fetch_elements --redirect-to localhost",
        ),
        ("http://localhost:{port}/x", ("localhost",), ""),
        ("//127.0.0.2/x", ("localhost",), "was sent on to 127.0.0.2, which only"),
        ("http://127.0.0.1:4533/", (), "was sent on to 127.0.0.1, which only"),
        ("file:///etc/passwd", (), "was sent on to 'file:///etc/passwd', must be http"),
        ("http://[", (), "Invalid IPv6 URL"),
    ],
)
def test_another_server_is_asked_only_where_the_user_has_named_it(
    location: str, hosts: tuple[str, ...], complaint: str, source: Source, ask: Callable[..., Outcome]
) -> None:
    port = urlsplit(source.address).port
    source.redirects = [location.format(port=port)]
    found = ask(hosts=hosts)
    assert re.search(complaint, found.problem)
    assert (found.state, len(source.asked)) == (("none", 1) if complaint else ("new", 2))
    if hosts and not complaint:
        # It is kept for the nodes, which only know the address.
        source.redirects = [location.format(port=port)]
        assert ask(RULE_S).state == "new"


@pytest.mark.parametrize("value", ['\x0b"a"', "\x0c", "a" * 600, "\xe9"])
def test_a_header_that_cannot_be_sent_back_is_not_kept(value: str, source: Source, ask: Callable[..., Outcome]) -> None:
    source.headers = {"ETag": value, "Last-Modified": value}
    assert (ask().problem, ask().record.etag, ask().record.last_modified) == ("", "", "")
    record = next(ask().file.parent.glob(".*.json"))
    record.write_text(record.read_text().replace('"etag": ""', f'"etag": {json.dumps(value)}'))
    assert ask(RULE_S).state == "new"


def test_an_answer_is_read_no_further_than_the_longest_file(
    source: Source, ask: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetching, "MOST_BYTES", 50_000)
    # Read to its end, it would be half of what was promised.
    source.body, source.promised = b"x" * 100_000, 5000
    assert ask().problem.endswith("sent 65536 bytes, must be <= 50000")
    source.body, source.promised = tle_text().encode(), 0
    monkeypatch.setattr(fetching, "MOST_BYTES", len(source.body))
    assert ask(RULE_S).state == "new"


NUMBERED = {**FIELDS, "NORAD_CAT_ID": 799500123}
CSV, JSON = as_csv(NUMBERED).strip(), json.dumps([NUMBERED], indent=1)


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


def test_a_csv_cut_off_in_its_last_number_is_not_taken(source: Source, ask: Callable[..., Outcome]) -> None:
    """Without a promised length a shorter last number would be another number."""
    source.body, source.promised = as_csv({**NUMBERED, "MEAN_MOTION_DDOT": 0.00012345})[:-6].encode(), None
    assert "ended in the middle of a line" in ask().problem


def test_an_ephemeris_is_kept_without_the_age_of_elements(source: Source, ask: Callable[..., Outcome]) -> None:
    cbers = next(one for one in verification_elements() if one.catalogue_number == 28057)
    source.body = text_of(teme_states(cbers)).encode()
    kept = ask()
    assert (kept.problem, kept.record.objects, kept.record.epochs_t_s) == ("", 1, None)


def test_a_record_that_cannot_be_kept_is_an_error(source: Source, ask: Callable[..., Outcome], tmp_path: Path) -> None:
    file = kept_file(source.address, tmp_path)
    file.with_name(f".{file.name}.json").mkdir()
    with pytest.raises(ValueError, match=file.name):
        ask()
