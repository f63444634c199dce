"""`fetch_schedule` against a server on loopback that plays the SatNOGS API and a CalDAV collection."""

import contextlib
import json
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs

import pytest

from rf_pointing.commands import fetch_schedule
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import read_elements, tle_lines, verification_elements
from rf_pointing.operations.pass_list import read_passes, to_calendar, to_csv
from rf_pointing.operations.schedule import ScheduledPass

TOKEN = "0123456789abcdef0123456789abcdef01234567"
SATELLITE = verification_elements()[0]
NOW_S = float(int(time.time()))
"""The time of the collection: what is to come is hours away, however long the suite takes."""


def job(number: int, begin_s: float, seconds: float = 600.0) -> dict[str, Any]:
    """A job as `/api/jobs/` of the network gives it."""
    first, second = tle_lines(SATELLITE)
    return {
        "id": number, "start": utc_text(NOW_S + begin_s), "end": utc_text(NOW_S + begin_s + seconds),
        "ground_station": 7, "tle0": f"0 {SATELLITE.name}", "tle1": first, "tle2": second,
        "frequency": 145_825_000, "mode": "FM", "transmitter": "x" * 22, "baud": None,
    }  # fmt: skip


def caldav(*calendars: str) -> str:
    """The answer of a collection with an event in each of its files."""
    files = "".join(
        f"<d:response><d:href>/{index}.ics</d:href><d:propstat><d:prop><c:calendar-data>{text}</c:calendar-data>"
        "</d:prop></d:propstat></d:response>"
        for index, text in enumerate(calendars)
    )
    return f'<d:multistatus xmlns:d="DAV:" xmlns:c="urn:ietf:params:xml:ns:caldav">{files}</d:multistatus>'


@pytest.fixture
def server() -> Iterator[SimpleNamespace]:
    """A server with `answer`, `status` and what it was sent: method, path, headers, body."""
    played = SimpleNamespace(answer="", status=200, taken=[])

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0))).decode()
            played.taken.append((self.command, self.path, dict(self.headers), body))
            data = played.answer.encode()
            self.send_response(played.status)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        do_PUT = do_REPORT = do_GET  # noqa: N815

        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        Thread(target=running.serve_forever, daemon=True).start()
        played.jobs = f"http://127.0.0.1:{running.server_port}/api/jobs/?ground_station=7"
        yield played
        running.shutdown()


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    file = tmp_path / "token"
    file.write_text(TOKEN)
    file.chmod(0o600)
    return file


def run(*argv: object) -> int:
    with pytest.raises(SystemExit) as ended:
        fetch_schedule.main([str(each) for each in argv])
    return int(ended.value.code or 0)


def test_jobs_are_kept_and_queued_and_their_results_go_back_once(
    server: SimpleNamespace, secret: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    server.answer = json.dumps([job(11, 9000.0), job(12, 18000.0), job(10, -9000.0)])
    own = ("--cache", tmp_path / "kept", "--token-file", secret)
    files = ("--csv", tmp_path / "n.csv", "--ics", tmp_path / "n.ics", "--ccsds", tmp_path / "n.xml")
    assert run(server.jobs, *own, *files) == 0
    assert server.taken[0][2]["Authorization"] == f"Token {TOKEN}"
    assert ": new\n  3 passes" in capsys.readouterr().out
    wanted = [("satnogs-11", NOW_S + 9000.0), ("satnogs-12", NOW_S + 18000.0)]
    for path in files[1::2]:
        found = read_passes(Path(str(path)).read_text())
        assert [(each.id, each.aos_t_s) for each in found] == wanted
        assert {(each.target, each.duration_s) for each in found} == {(str(SATELLITE.catalogue_number), 600.0)}
    # The kept answer is a file of elements too: each job brings its own.
    (kept,) = (tmp_path / "kept").glob("*.schedule")
    assert read_elements(kept.read_text())[0].catalogue_number == SATELLITE.catalogue_number
    # At once nothing is requested; what the station did is told, but not of a pass that waits.
    assert run(server.jobs, *own) == 0
    assert len(server.taken) == 1
    rows = [
        {"id": "satnogs-11", "state": "tracked", "tracked_s": 590.0, "lost_s": 10.0, "loss_db": 0.1, "causes": []},
        {"id": "satnogs-12", "state": "waiting"}, {"id": "25544-1", "state": "tracked"},
    ]  # fmt: skip
    (tmp_path / "night.json").write_text(json.dumps({"passes": rows}))
    server.status, told = 503, (server.jobs, *own, "--report", tmp_path)
    assert run(*told) == 1
    server.status = 200
    assert [run(*told), run(*told)] == [0, 0]
    assert "observation 11, tracked: 200 OK\nnothing new to report" in capsys.readouterr().out
    (_, path, headers, body), *more = [each for each in server.taken if each[0] == "PUT"][1:]
    assert (path, headers["Authorization"], more) == ("/api/observations/11/", f"Token {TOKEN}", [])
    assert json.loads(parse_qs(body)["client_metadata"][0])["tracked_s"] == 590.0


def test_a_caldav_collection_gives_the_events_of_its_time(
    server: SimpleNamespace, secret: Path, tmp_path: Path
) -> None:
    begin_s = NOW_S + 9000.0
    passes = [ScheduledPass(target=name, name=name, aos_t_s=begin_s, los_t_s=begin_s + 600.0) for name in ("A", "B")]
    server.status, server.answer = 207, caldav(*(to_calendar([each], "Here", NOW_S) for each in passes))
    secret.write_text("operator:a password")
    address = server.jobs.partition("/api")[0] + "/cal/antenna/"
    given = (address, "--caldav", 2, "--cache", tmp_path / "kept", "--token-file", secret, "--csv", tmp_path / "n.csv")
    assert run(*given) == 0
    assert (tmp_path / "n.csv").read_text() == to_csv(passes)
    method, _, headers, body = server.taken[0]
    assert (method, headers["Depth"], headers["Authorization"]) == ("REPORT", "1", "Basic b3BlcmF0b3I6YSBwYXNzd29yZA==")
    assert "<c:time-range start=" in body
    # An empty collection is a schedule without passes, and a broken one leaves what is kept.
    server.answer = caldav()
    assert run(*given, "--every", 0) == 0
    assert read_passes((tmp_path / "n.csv").read_text()) == []
    server.answer = caldav("BEGIN:VCALENDAR\nBEGIN:VEVENT")
    assert run(*given, "--every", 0) == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["https://network.satnogs.org/api/jobs/", "--every", "0.5"], "every=0.00833333 h must be >= 0.0166667 h"),
        (["http://example.org/jobs", "--token-file", "{token}"], "must begin with https:// for a token or a password"),
        (["https://example.org/x", "--token-file", "{missing}"], "must be a file with a token or user:password"),
        (["https://example.org/x", "--report", "{token}"], "must be that of jobs"),
        (["ftp://example.org/x"], "must begin with http:// or https://"),
    ],
)
def test_what_cannot_be_requested_is_refused(
    given: list[str], words: str, secret: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"token": str(secret), "missing": str(tmp_path / "missing")}
    assert run(*(each.format(**names) for each in given), "--cache", tmp_path / "kept") == 2
    assert words in capsys.readouterr().err
    with contextlib.suppress(FileNotFoundError):
        assert not list((tmp_path / "kept").glob("*.schedule"))


@pytest.mark.parametrize("answer", ["<html>log in</html>", '[{"id": 1, "start": "soon", "end": "", "tle1": ""}]', "{}"])
def test_an_answer_without_a_schedule_leaves_the_kept_one(
    answer: str, server: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    server.answer = json.dumps([job(11, 9000.0)])
    given = (server.jobs, "--cache", tmp_path, "--every", 0)
    assert run(*given) == 0
    server.answer = answer
    assert run(*given) == 1
    assert "answered" in capsys.readouterr().err
    assert run("--list", "--cache", tmp_path) == 1
    assert "1 passes, confirmed" in capsys.readouterr().out
