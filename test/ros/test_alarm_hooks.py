"""Alarms leave the station: a program, a webhook, an e-mail, each through a server of the test's own."""

import json
import socketserver
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any, ClassVar

import pytest

from rf_pointing.ros import alarm_hooks
from rf_pointing.ros.alarm_hooks import AlarmHooks, HookParams
from test.conftest import within


def until(condition: Callable[[], bool], what: str) -> None:
    deadline_s = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline_s, what
        time.sleep(0.01)


@contextmanager
def serving(server: Any) -> Iterator[int]:
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def raise_one(hooks: AlarmHooks) -> None:
    hooks.put("raised", "full_disk", 1, "0 GB are free; $(reboot)", "free space", "2026-01-01T00:00:00Z")


def test_a_program_gets_the_message_on_its_input_and_no_shell_reads_it(tmp_path: Path) -> None:
    program, out = tmp_path / "hook", tmp_path / "out.json"
    program.write_text(f"#!{sys.executable}\nimport sys\nopen({str(out)!r}, 'w').write(sys.stdin.read())\n")
    program.chmod(0o755)
    hooks = AlarmHooks(HookParams(command=str(program)), "Dish")
    raise_one(hooks)
    hooks.close(20.0)
    assert hooks.sent == 1
    assert json.loads(out.read_text()) == {
        "station": "Dish", "event": "raised", "alarm": "full_disk", "level": "warning", "message": "0 GB are free; $(reboot)",
        "to_do": "free space", "utc": "2026-01-01T00:00:00Z",
    }  # fmt: skip


class Webhook(BaseHTTPRequestHandler):
    answers: ClassVar[list[int]] = []
    bodies: ClassVar[list[Any]] = []

    def do_POST(self) -> None:
        self.bodies.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(self.answers.pop(0) if self.answers else 200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


def test_a_webhook_that_fails_is_tried_again_and_then_gets_each_message_once() -> None:
    Webhook.answers, Webhook.bodies = [503, 503], []
    with serving(HTTPServer(("127.0.0.1", 0), Webhook)) as port:
        hooks = AlarmHooks(HookParams(webhook=f"http://127.0.0.1:{port}/alarms", retry_s=0.1), "Dish")
        raise_one(hooks)
        until(lambda: hooks.sent == 1, "the message")
        hooks.put("cleared", "full_disk", 1, "80 GB are free", "", "2026-01-01T01:00:00Z")
        until(lambda: hooks.sent == 2, "the second message")
        hooks.close()
    assert [body["event"] for body in Webhook.bodies] == ["raised", "raised", "raised", "cleared"]
    assert (hooks.failed, hooks.problem) == (0, "")


def test_a_server_that_does_not_answer_is_reported_and_delays_nothing() -> None:
    hooks = AlarmHooks(HookParams(webhook="http://127.0.0.1:9/none", retry_s=0.1), "Dish")
    began_s = time.monotonic()
    raise_one(hooks)
    assert within(time.monotonic() - began_s, 0.1)
    until(lambda: hooks.failed == 1, "the failure")
    assert "webhook" in hooks.problem
    hooks.close()


class Mailbox(socketserver.StreamRequestHandler):
    mails: ClassVar[list[str]] = []

    def handle(self) -> None:
        """Speak as much SMTP (RFC 5321) as a sender needs."""
        self.wfile.write(b"220 test\r\n")
        while line := self.rfile.readline().decode():
            word = line[:4].upper()
            if word == "DATA":
                self.wfile.write(b"354 go on\r\n")
                body = []
                while (row := self.rfile.readline().decode()) != ".\r\n":
                    body.append(row)
                self.mails.append("".join(body))
            self.wfile.write(b"221 bye\r\n" if word == "QUIT" else b"250 ok\r\n")
            if word == "QUIT":
                return


def test_an_e_mail_reaches_its_server_with_what_to_do() -> None:
    Mailbox.mails = []
    with serving(socketserver.ThreadingTCPServer(("127.0.0.1", 0), Mailbox)) as port:
        params = HookParams(mail_server=f"127.0.0.1:{port}", mail_to="night@example.org", mail_from="dish@example.org")
        hooks = AlarmHooks(params, "Dish")
        raise_one(hooks)
        until(lambda: hooks.sent == 1, "the mail")
        hooks.close()
    (mail,) = Mailbox.mails
    assert "Subject: Dish: full_disk raised (warning)" in mail
    assert "To: night@example.org" in mail
    assert "to_do: free space" in mail


def test_without_any_way_nothing_is_started() -> None:
    hooks = AlarmHooks(HookParams(), "Dish")
    raise_one(hooks)
    hooks.close()
    assert (hooks.sent, hooks.failed) == (0, 0)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"mail_server": "localhost:25"}, "mail_to='' must name a receiver"),
        ({"mail_server": "localhost", "mail_to": "a@b"}, "must be host:port"),
        ({"webhook": "ftp://x"}, "must begin with http"),
    ],
)
def test_wrong_addresses_are_refused(params: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HookParams(**params)


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the pauses between two tries, which pass at once."""
    made: list[float] = []
    monkeypatch.setattr(alarm_hooks.time, "sleep", made.append)
    return made


@pytest.mark.parametrize(
    ("failures", "sent", "failed", "pauses"), [(0, 1, 0, 0), (1, 1, 0, 1), (2, 1, 0, 2), (3, 0, 1, 2)]
)
def test_a_message_is_tried_three_times_with_a_pause_between(
    monkeypatch: pytest.MonkeyPatch, waits: list[float], failures: int, sent: int, failed: int, pauses: int
) -> None:
    tries: list[tuple[Any, dict[str, Any]]] = []

    def run(command: list[str], **options: Any) -> None:
        tries.append((command, options))
        if len(tries) <= failures:
            raise subprocess.CalledProcessError(3, command)

    monkeypatch.setattr(alarm_hooks.subprocess, "run", run)
    hooks = AlarmHooks(HookParams(command="/usr/bin/hook", retry_s=7.5), "Dish")
    raise_one(hooks)
    hooks.close(20.0)
    assert (hooks.sent, hooks.failed, waits) == (sent, failed, [7.5] * pauses)
    assert len(tries) == min(failures + 1, 3)
    assert hooks.problem == ("" if sent else "command: Command '['/usr/bin/hook']' returned non-zero exit status 3.")
    command, options = tries[0]
    assert (command, options["timeout"], options["check"], options["text"]) == (["/usr/bin/hook"], 10.0, True, True)


@pytest.mark.parametrize(("level", "word"), [(0, "ok"), (1, "warning"), (2, "error")])
def test_levels_have_words(monkeypatch: pytest.MonkeyPatch, level: int, word: str) -> None:
    bodies: list[Any] = []
    monkeypatch.setattr(
        alarm_hooks.subprocess, "run", lambda *_, **options: bodies.append(json.loads(options["input"]))
    )
    hooks = AlarmHooks(HookParams(command="hook"), "Dish")
    hooks.put("raised", "wind", level, "22 m/s", "", "2026-01-01T00:00:00Z")
    hooks.close(20.0)
    assert [body["level"] for body in bodies] == [word]


def test_beyond_a_thousand_messages_that_wait_each_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, gate = threading.Event(), threading.Event()

    def run(*_: Any, **__: Any) -> None:
        begun.set()
        assert gate.wait(20.0)

    monkeypatch.setattr(alarm_hooks.subprocess, "run", run)
    hooks = AlarmHooks(HookParams(command="hook"), "Dish")
    raise_one(hooks)
    assert begun.wait(20.0)
    for _ in range(1000):
        raise_one(hooks)
    assert hooks.failed == 0
    raise_one(hooks)
    raise_one(hooks)
    assert (hooks.failed, hooks.problem) == (2, "1000 messages wait to be sent")
    gate.set()
    until(lambda: hooks.sent == 1001, "what waits")
    hooks.close()


def test_every_way_gets_each_message_and_one_that_fails_stops_no_other(
    monkeypatch: pytest.MonkeyPatch, waits: list[float]
) -> None:
    mails: list[Any] = []

    class Server:
        def __init__(self, host: str, port: int, timeout: float) -> None:
            assert (host, port, timeout) == ("mail.example.org", 2525, 10.0)

        def __enter__(self) -> "Server":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def send_message(self, mail: Any) -> None:
            mails.append(mail)

    def broken(*_: Any, **__: Any) -> None:
        raise OSError("no such program")

    monkeypatch.setattr(alarm_hooks.smtplib, "SMTP", Server)
    monkeypatch.setattr(alarm_hooks.subprocess, "run", broken)
    hooks = AlarmHooks(
        HookParams(
            command="hook", mail_server="mail.example.org:2525", mail_to="a@b.org, c@d.org", mail_from="x@y.org"
        ),
        "Dish",
    )
    raise_one(hooks)
    hooks.put("cleared", "full_disk", 0, "80 GB are free", "", "2026-01-01T01:00:00Z")
    hooks.close(20.0)
    assert (hooks.sent, hooks.failed, len(waits)) == (2, 2, 4)
    first, second = mails
    assert (first["From"], first["To"]) == ("x@y.org", "a@b.org, c@d.org")
    assert first["Subject"] == "Dish: full_disk raised (warning)"
    assert first.get_content().splitlines() == [
        "utc: 2026-01-01T00:00:00Z", "message: 0 GB are free; $(reboot)", "to_do: free space",
    ]  # fmt: skip
    assert second["Subject"] == "Dish: full_disk cleared (ok)"
    assert second.get_content().splitlines() == ["utc: 2026-01-01T01:00:00Z", "message: 80 GB are free"]


@pytest.mark.parametrize(
    "params",
    [
        {"mail_server": "localhost:25", "mail_to": "a@b"},
        {"mail_to": "a@b"},
        {"webhook": "http://x"},
        {"webhook": "https://x"},
    ],
)
def test_whole_addresses_are_taken(params: dict[str, str]) -> None:
    HookParams(**params)
