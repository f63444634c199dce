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

from rf_pointing.station.clients import alarm_hooks
from rf_pointing.station.clients.alarm_hooks import AlarmHooks, HookParams


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
    hooks = AlarmHooks(HookParams(mail_to="a@b"), "Dish")
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


@pytest.mark.parametrize("failures", [0, 1, 2, 3])
def test_a_message_is_tried_three_times_with_a_pause_between(monkeypatch: pytest.MonkeyPatch, failures: int) -> None:
    tries: list[tuple[Any, dict[str, Any]]] = []
    pauses: list[float] = []

    def run(command: list[str], **options: Any) -> None:
        tries.append((command, options))
        if len(tries) <= failures:
            raise subprocess.CalledProcessError(3, command)

    monkeypatch.setattr(alarm_hooks.time, "sleep", pauses.append)
    monkeypatch.setattr(alarm_hooks.subprocess, "run", run)
    hooks = AlarmHooks(HookParams(command="/usr/bin/hook", retry_s=7.5), "Dish")
    raise_one(hooks)
    hooks.close(20.0)
    assert (hooks.sent, hooks.failed, len(tries)) == (failures < 3, failures == 3, min(failures + 1, 3))
    assert pauses == [7.5] * (len(tries) - 1)
    problem = "command: Command '['/usr/bin/hook']' returned non-zero exit status 3."
    assert hooks.problem == (problem if failures == 3 else "")
    command, options = tries[0]
    assert (command, options["timeout"], options["check"]) == (["/usr/bin/hook"], 10.0, True)


def test_beyond_a_thousand_messages_that_wait_each_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, gate = threading.Event(), threading.Event()

    def run(*_: Any, **__: Any) -> None:
        begun.set()
        assert gate.wait(20.0)

    monkeypatch.setattr(alarm_hooks.subprocess, "run", run)
    hooks = AlarmHooks(HookParams(command="hook"), "Dish")
    raise_one(hooks)
    assert begun.wait(20.0)
    for _ in range(1002):
        raise_one(hooks)
    assert (hooks.failed, hooks.problem) == (2, "1000 messages wait to be sent")
    gate.set()
    until(lambda: hooks.sent == 1001, "what waits")
    hooks.close()


def test_every_way_gets_each_message_and_one_that_fails_stops_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    Webhook.answers, Webhook.bodies = [503, 503], []
    with serving(HTTPServer(("127.0.0.1", 0), Webhook)) as port:
        address = f"http://127.0.0.1:{port}/alarms"
        hooks = AlarmHooks(HookParams(command="/none/hook", webhook=address, retry_s=0.1), "Dish")
        for level in range(3):
            hooks.put("raised", "wind", level, "22 m/s", "", "2026-01-01T00:00:00Z")
        hooks.close(20.0)
    assert (hooks.sent, hooks.failed) == (3, 3)
    assert [body["level"] for body in Webhook.bodies] == ["ok", "ok", "ok", "warning", "error"]
