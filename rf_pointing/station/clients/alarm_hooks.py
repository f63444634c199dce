"""Messages that leave the station with an alarm: a command, a webhook, an e-mail.

Each way out has a thread of its own, so that a server that does not answer delays nothing.  The
settings are tried at the start, before the first alarm needs them.  What could not be sent is tried
three times, then counted; whatever raises is the `problem` of its way, which the station's alarms
tell by the ways that are left.
"""

import json
import queue
import re
import shutil
import smtplib
import socket
import ssl
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass, fields
from email.message import EmailMessage
from email.utils import getaddresses
from pathlib import Path
from urllib.parse import urlsplit

from rf_pointing.core import Params, parameter, read_whole
from rf_pointing.station.pointing.status import Level, Report

TRIES = 3
MOST_WAITING = 1000
ANSWER_S = 10.0
TRIAL_S = 60.0
"""Between two trials of settings that have not worked yet: the network may come later."""
LEVEL_NAMES = ("ok", "warning", "error")
"""Levels of a message."""
NO_WAY = "no way out of the station is set: hooks.command, hooks.webhook or hooks.mail_server"
TLS = ("none", "starttls", "tls")
Message = dict[str, str]
_ADDRESS = re.compile(r"[^@\s]+@[^@\s]+")


@dataclass(frozen=True, kw_only=True)
class HookParams(Params):
    """Where alarms go; empty: nowhere."""

    command: str = parameter("", "program that gets each message as JSON on its input; empty: none")
    webhook: str = parameter("", "http(s) address that each message is posted to as JSON; empty: none")
    mail_server: str = parameter("", "host:port of the SMTP server; empty: no e-mail")
    mail_from: str = parameter("station@localhost", "sender of the e-mails")
    mail_to: str = parameter("", "receivers of the e-mails, separated by commas")
    mail_tls: str = parameter("none", "encryption of the way to the SMTP server", choices=TLS)
    mail_user: str = parameter("", "user of the SMTP server; empty: no login")
    mail_password_file: str = parameter("", "file with that password, readable by its owner alone")
    retry_s: float = parameter(5.0, "time between two tries to send", 0.1, 600.0)

    def check_together(self) -> None:
        """Refuse what could never be sent: a host, an address or a login that cannot be."""
        for name in (item.name for item in fields(self) if item.type is str):
            if not (value := str(getattr(self, name))).isprintable():
                raise ValueError(f"{name}={value!r} must be one line without control characters")
        if self.webhook:
            url = urlsplit(self.webhook)
            if url.scheme not in ("http", "https") or not url.hostname:
                raise ValueError(f"webhook={self.webhook} must begin with http:// or https://")
            _require_host("webhook", url.hostname)
            if url.port == 0:
                raise ValueError(f"webhook={self.webhook} must have a port of 1 to 65535")
        if self.mail_server:
            host, _, port = self.mail_server.rpartition(":")
            if not host or not port.isdecimal() or not 0 < int(port) < 65536:
                raise ValueError(f"mail_server={self.mail_server} must be host:port")
            _require_host("mail_server", host)
            if not self.mail_to:
                raise ValueError(f"mail_to='' must name a receiver: mail_server={self.mail_server}")
            for name, text in (("mail_from", self.mail_from), ("mail_to", self.mail_to)):
                found = getaddresses([text])
                if not found or not all(_ADDRESS.fullmatch(address) for _, address in found):
                    raise ValueError(f"{name}={text} must be addresses as in night@example.org")
        if bool(self.mail_user) != bool(self.mail_password_file):
            raise ValueError("mail_user and mail_password_file must be given together")
        if self.mail_user and self.mail_tls == "none":
            raise ValueError("mail_tls=none must be starttls or tls: a password is sent")


def _require_host(name: str, host: str) -> None:
    try:
        host.encode("idna")
    except UnicodeError as error:
        raise ValueError(f"{name}: {host} cannot be a host: {error}") from error


class Outlet:
    """One way out of the station; `last` says what came of its newest message."""

    def __init__(
        self, name: str, send: Callable[[Message], object], trial: Callable[[], object], retry_s: float
    ) -> None:
        self.name, self.sent, self.failed = name, 0, 0
        self.problem, self.last = "", "no message yet"
        self._send, self._trial, self._retry_s = send, trial, retry_s
        self._queue: queue.Queue[Message | None] = queue.Queue(MOST_WAITING)
        self._proved, self._closing = False, threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Send a message soon; never blocks."""
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self.failed, self.problem = self.failed + 1, f"{MOST_WAITING} messages wait to be sent"

    def close(self, patience_s: float) -> None:
        """Send what waits, as far as that is done in time."""
        self._closing.set()
        try:
            self._queue.put(None, timeout=patience_s)
        except queue.Full:
            return
        self._thread.join(patience_s)

    def _work(self) -> None:
        while True:
            if not self._proved:
                self._proved = self._does(self._trial)
            try:
                message = self._queue.get(timeout=None if self._proved else TRIAL_S)
            except queue.Empty:
                continue
            if message is None:
                return
            self._deliver(message)

    def _deliver(self, message: Message) -> None:
        about = f"{message['event']} {message['alarm']} of {message['utc']}"
        for number in range(1, TRIES + 1):
            if self._does(lambda: self._send(message)):
                self.sent, self._proved, self.last = self.sent + 1, True, f"sent: {about}"
                return
            if number < TRIES:
                self._closing.wait(self._retry_s)
        self.failed, self.last = self.failed + 1, f"not sent: {about}: {self.problem}"

    def _does(self, work: Callable[[], object]) -> bool:
        # Whatever raises: the end of this thread would be the end of all later alarms.
        try:
            work()
        except Exception as error:
            self.problem = f"{type(error).__name__}: {error}"
            return False
        self.problem = ""
        return True


class AlarmHooks:
    """Sends messages in their order by every way that the parameters name."""

    def __init__(self, params: HookParams, station: str) -> None:
        self._params, self._station = params, " ".join(station.split())
        wanted = {"command": (self._run, self._find), "webhook": (self._post, self._resolve),
                  "mail_server": (self._mail, lambda: self._log_in().quit())}  # fmt: skip
        self.ways = [Outlet(name, *how, params.retry_s) for name, how in wanted.items() if getattr(params, name)]

    def put(self, event: str, name: str, level: int, text: str, ask: str, utc: str) -> Message:
        """Send a message soon; never blocks.  Return it."""
        nothing = "it has ended" if event == "cleared" else "the station deals with it"
        to_do = ask or f"nothing: {nothing}"
        message = {"station": self._station, "event": event, "alarm": name, "level": LEVEL_NAMES[level],
                   "message": text, "to_do": to_do, "utc": utc}  # fmt: skip
        for way in self.ways:
            way.put(message)
        return message

    def report(self) -> Report:
        """Return what came of the newest message of each way, or why one does not work."""
        problems = "; ".join(f"{way.name}: {way.problem}" for way in self.ways if way.problem)
        values: dict[str, object] = {way.name: way.last for way in self.ways}
        values["alarms_sent"] = sum(way.sent for way in self.ways)
        values["alarms_not_sent"] = sum(way.failed for way in self.ways)
        names = ", ".join(way.name for way in self.ways)
        return Report(Level(bool(problems)), problems or names or NO_WAY, values)

    def close(self, patience_s: float = 2.0) -> None:
        """Send what waits, as far as that is done in time."""
        for way in self.ways:
            way.close(patience_s)

    def _find(self) -> None:
        if shutil.which(self._params.command) is None:
            raise FileNotFoundError(f"{self._params.command} is not a program of this user")

    def _run(self, message: Message) -> None:
        # Without a shell: an alarm's text must never be a command.
        subprocess.run([self._params.command], input=json.dumps(message), text=True, timeout=ANSWER_S, check=True)

    def _resolve(self) -> None:
        url = urlsplit(self._params.webhook)
        socket.getaddrinfo(url.hostname, url.port or url.scheme, type=socket.SOCK_STREAM)

    def _post(self, message: Message) -> None:
        # Imported when it is needed: an executive that was killed must be back soon.
        import requests

        answer = requests.post(
            self._params.webhook, json=message, timeout=ANSWER_S, allow_redirects=False
        )  # fmt: skip
        answer.raise_for_status()
        if answer.is_redirect:
            # Followed, it would become a GET without the message.
            raise OSError(f"{self._params.webhook} redirects to {answer.headers['Location']}")

    def _log_in(self) -> smtplib.SMTP:
        params = self._params
        host, _, port = params.mail_server.rpartition(":")
        context = ssl.create_default_context() if params.mail_tls != "none" else None
        address = host.strip("[]"), int(port)
        server = (
            smtplib.SMTP_SSL(*address, timeout=ANSWER_S, context=context)
            if params.mail_tls == "tls" else smtplib.SMTP(*address, timeout=ANSWER_S)
        )  # fmt: skip
        try:
            if params.mail_tls == "starttls":
                server.starttls(context=context)
            if params.mail_user:
                server.login(params.mail_user, _password(Path(params.mail_password_file)))
        except BaseException:
            server.close()
            raise
        return server

    def _mail(self, message: Message) -> None:
        mail = EmailMessage()
        mail["From"], mail["To"] = self._params.mail_from, self._params.mail_to
        # One line: a name may come from a message of anybody.
        subject = f"{message['station']}: {message['alarm']} {message['event']} ({message['level']})"
        mail["Subject"] = "".join(each if each.isprintable() else " " for each in subject)
        text = "\n".join(f"{key}: {message[key]}" for key in ("utc", "message", "to_do"))
        mail.set_content(text.encode("utf-8", "replace").decode("utf-8"))
        with self._log_in() as server:
            server.send_message(mail)


def _password(path: Path) -> str:
    if path.stat().st_mode & 0o077:
        raise PermissionError(f"{path} can be read by others: chmod 600 it")
    return read_whole(path, 4096).strip()
