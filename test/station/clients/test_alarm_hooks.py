"""Alarms leave the station: a program, a webhook, an e-mail, each through a server of the test's own."""

import json
import shutil
import socketserver
import ssl
import subprocess
import sys
import threading
import time
from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any, ClassVar

import pytest

from rf_pointing.station.clients.alarm_hooks import TRIES, AlarmHooks, HookParams, Outlet

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="makes a certificate")


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


def raise_one(hooks: AlarmHooks, level: int = 1) -> None:
    hooks.put("raised", "full_disk", level, "0 GB are free; $(reboot)", "free space", "2026-01-01T00:00:00Z")


def counts(hooks: AlarmHooks) -> dict[str, tuple[int, int]]:
    """Return how many messages each way has sent, and how many not."""
    return {way.name: (way.sent, way.failed) for way in hooks.ways}


def program(tmp_path: Path, code: str) -> str:
    path = tmp_path / "hook"
    path.write_text(f"#!{sys.executable}\nimport sys\n{code}\n")
    path.chmod(0o755)
    return str(path)


class Webhook(BaseHTTPRequestHandler):
    answers: ClassVar[list[int]] = []
    bodies: ClassVar[list[Any]] = []

    def do_POST(self) -> None:
        self.bodies.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(self.answers.pop(0) if self.answers else 200)
        self.send_header("Location", "/elsewhere")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


class Mailbox(socketserver.StreamRequestHandler):
    mails: ClassVar[list[str]] = []
    logins: ClassVar[list[str]] = []
    tls: ClassVar[ssl.SSLContext | None] = None
    at_once: ClassVar[bool] = False
    """Whether the connection is encrypted before the first word."""

    def setup(self) -> None:
        if self.at_once and self.tls is not None and not isinstance(self.request, ssl.SSLSocket):
            self.request = self.tls.wrap_socket(self.request, server_side=True)
        super().setup()

    def finish(self) -> None:
        super().finish()
        self.request.close()

    def handle(self) -> None:
        """Speak as much SMTP (RFC 5321) as a sender needs."""
        self.wfile.write(b"220 test\r\n")
        while line := self.rfile.readline().decode():
            word = line[:4].upper()
            if word == "STAR" and self.tls is not None:
                self.wfile.write(b"220 go on\r\n")
                self.request = self.tls.wrap_socket(self.request, server_side=True)
                self.setup()
                continue
            if word == "AUTH":
                assert isinstance(self.connection, ssl.SSLSocket), "a password in the clear"
                self.logins.append(b64decode(line.split()[2]).decode())
                self.wfile.write(b"235 welcome\r\n")
                continue
            if word == "EHLO":
                self.wfile.write(b"250-test\r\n250-STARTTLS\r\n250 AUTH PLAIN\r\n")
                continue
            if word == "DATA":
                self.wfile.write(b"354 go on\r\n")
                body = []
                while (row := self.rfile.readline().decode()) != ".\r\n":
                    body.append(row)
                self.mails.append("".join(body))
            self.wfile.write(b"221 bye\r\n" if word == "QUIT" else b"250 ok\r\n")
            if word == "QUIT":
                return


def test_a_program_gets_the_message_on_its_input_and_no_shell_reads_it(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    command = program(tmp_path, f"open({str(out)!r}, 'w').write(sys.stdin.read())")
    hooks = AlarmHooks(HookParams(command=command), "Dish")
    raise_one(hooks)
    hooks.close(20.0)
    assert counts(hooks) == {"command": (1, 0)}
    assert json.loads(out.read_text()) == {
        "station": "Dish", "event": "raised", "alarm": "full_disk", "level": "warning", "message": "0 GB are free; $(reboot)",
        "to_do": "free space", "utc": "2026-01-01T00:00:00Z",
    }  # fmt: skip


@pytest.mark.parametrize(
    "secure", ["", pytest.param("starttls", marks=needs_openssl), pytest.param("tls", marks=needs_openssl)]
)
def test_an_e_mail_reaches_its_server_with_what_to_do(
    secure: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a station whose name ends in a newline, too; with TLS and a login where it is asked for."""
    Mailbox.mails, Mailbox.logins, Mailbox.at_once, secret = [], [], secure == "tls", tmp_path / "secret"
    own: dict[str, Any] = {}
    if secure:
        certificate, key = tmp_path / "localhost.pem", tmp_path / "key.pem"
        make = "openssl req -x509 -newkey rsa:2048 -nodes -subj /CN=localhost -addext subjectAltName=DNS:localhost"
        subprocess.run([*make.split(), "-keyout", key, "-out", certificate], check=True, stderr=subprocess.DEVNULL)
        Mailbox.tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        Mailbox.tls.load_cert_chain(certificate, key)
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
        secret.write_text("pass word\n")
        own = {"mail_tls": secure, "mail_user": "dish", "mail_password_file": str(secret)}
    with serving(socketserver.ThreadingTCPServer(("127.0.0.1", 0), Mailbox)) as port:
        params = HookParams(mail_server=f"localhost:{port}", mail_to="Night <night@example.org>", retry_s=0.1, **own)
        hooks = AlarmHooks(params, "Dish\n")
        if secure:
            until(lambda: "chmod 600" in hooks.ways[0].problem, "others can read the password")
            secret.chmod(0o600)
        raise_one(hooks)
        until(lambda: hooks.ways[0].sent == 1, "the mail")
        hooks.close()
    (mail,) = Mailbox.mails
    assert "Subject: Dish: full_disk raised (warning)" in mail
    assert "To: Night <night@example.org>" in mail
    assert "to_do: free space" in mail
    assert Mailbox.logins == ["\0dish\0pass word"] * bool(secure)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"mail_server": "localhost:25"}, "mail_to='' must name a receiver"),
        ({"mail_server": "localhost", "mail_to": "a@b"}, "must be host:port"),
        ({"mail_server": "localhost:99999", "mail_to": "a@b"}, "must be host:port"),
        ({"mail_server": "smtp..host:25", "mail_to": "a@b"}, "smtp..host cannot be a host"),
        ({"mail_server": "localhost:25", "mail_to": "a@b\nBcc: c@d"}, "must be one line"),
        ({"mail_server": "localhost:25", "mail_to": "night"}, "mail_to=night must be addresses"),
        ({"mail_server": "localhost:25", "mail_to": "a@b", "mail_from": ""}, "mail_from= must be addresses"),
        ({"webhook": "ftp://x"}, "must begin with http"),
        ({"webhook": "http://a..b/"}, "a..b cannot be a host"),
        ({"webhook": f"http://{'a' * 64}.org/"}, "cannot be a host"),
        ({"webhook": "http://a:99999/"}, "Port out of range"),
        ({"webhook": "http://a/\x0b"}, "must be one line"),
        ({"mail_user": "dish"}, "must be given together"),
        ({"mail_user": "dish", "mail_password_file": "secret"}, "mail_tls=none must be starttls or tls"),
        ({"mail_tls": "ssl"}, "mail_tls='ssl' must be one of none, starttls, tls"),
    ],
)
def test_what_could_never_be_sent_is_refused_at_the_start(params: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HookParams(**params)


@pytest.mark.parametrize("failures", [0, 2, 3])
def test_a_message_is_tried_three_times_and_what_came_of_it_is_told(tmp_path: Path, failures: int) -> None:
    tries = tmp_path / "tries"
    command = program(tmp_path, f"f = open({str(tries)!r}, 'a'); f.write('x'); f.flush()\n"
                                f"sys.exit(3 if f.tell() <= {failures} else 0)")  # fmt: skip
    hooks = AlarmHooks(HookParams(command=command, retry_s=0.1), "Dish")
    raise_one(hooks)
    until(lambda: counts(hooks)["command"] != (0, 0), "its end")
    assert (counts(hooks)["command"], len(tries.read_text())) == (
        (failures < 3, failures == 3),
        min(failures + 1, TRIES),
    )
    level, words, values = hooks.report()
    assert level == (failures == 3)
    assert ("returned non-zero exit status 3" in words) is (failures == 3)
    sent = "not sent" if failures == 3 else "sent"
    assert str(values["command"]).startswith(f"{sent}: raised full_disk of 2026-01-01T00:00:00Z")
    hooks.close()


@pytest.mark.parametrize("error", [ValueError("header"), UnicodeError("label"), OverflowError("port"), KeyError("x")])
def test_whatever_raises_is_counted_and_the_next_message_is_sent(error: Exception) -> None:
    raises = [error] * TRIES

    def send(_: dict[str, str]) -> None:
        if raises:
            raise raises.pop()

    way = Outlet("mail", send, lambda: None, 0.1)
    message = {"event": "raised", "alarm": "a", "utc": "now"}
    way.put(message)
    until(lambda: way.failed == 1, "three tries")
    assert way.problem == f"{type(error).__name__}: {error}"
    way.put(message)
    until(lambda: way.sent == 1, "the next one")
    assert way.problem == ""
    way.close(20.0)


def test_beyond_a_thousand_messages_that_wait_each_is_a_failure() -> None:
    begun, gate = threading.Event(), threading.Event()

    def send(_: dict[str, str]) -> None:
        begun.set()
        assert gate.wait(20.0)

    way, message = Outlet("mail", send, lambda: None, 0.1), {"event": "raised", "alarm": "a", "utc": "now"}
    way.put(message)
    assert begun.wait(20.0)
    for _ in range(1002):
        way.put(message)
    assert (way.failed, way.problem) == (2, "1000 messages wait to be sent")
    gate.set()
    until(lambda: way.sent == 1001, "what waits")
    way.close(20.0)


def test_every_way_gets_each_message_and_one_that_fails_stops_no_other() -> None:
    Webhook.answers, Webhook.bodies = [503, 302], []
    with serving(HTTPServer(("127.0.0.1", 0), Webhook)) as port:
        address = f"http://127.0.0.1:{port}/alarms"
        hooks = AlarmHooks(HookParams(command="/none/hook", webhook=address, retry_s=0.1), "Dish")
        # Tried before the first alarm.
        until(lambda: "/none/hook is not a program" in hooks.report().message, "the trial of the command")
        for level in range(3):
            raise_one(hooks, level)
        hooks.close(20.0)
    assert counts(hooks) == {"command": (0, 3), "webhook": (3, 0)}
    assert [body["level"] for body in Webhook.bodies] == ["ok", "ok", "ok", "warning", "error"]
