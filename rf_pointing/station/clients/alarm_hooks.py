"""Messages that leave the station with an alarm: a command, a webhook, an e-mail.

A thread of its own sends, so that a server that does not answer delays nothing.  What could not be
sent is tried three times, then counted; `problem` says why.
"""

import json
import queue
import smtplib
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from email.message import EmailMessage

from rf_pointing.core import Params, parameter

TRIES = 3
MOST_WAITING = 1000
ANSWER_S = 10.0


@dataclass(frozen=True, kw_only=True)
class HookParams(Params):
    """Where alarms go; empty: nowhere."""

    command: str = parameter("", "program that gets each message as JSON on its input; empty: none")
    webhook: str = parameter("", "http(s) address that each message is posted to as JSON; empty: none")
    mail_server: str = parameter("", "host:port of the SMTP server; empty: no e-mail")
    mail_from: str = parameter("station@localhost", "sender of the e-mails")
    mail_to: str = parameter("", "receivers of the e-mails, separated by commas")
    retry_s: float = parameter(5.0, "time between two tries to send", low=0.1, high=600.0)

    def check_together(self) -> None:
        """Refuse e-mail without a receiver, and invalid addresses."""
        if self.mail_server and not self.mail_to:
            raise ValueError(f"mail_to='' must name a receiver: mail_server={self.mail_server}")
        if self.mail_server and not self.mail_server.rpartition(":")[2].isdecimal():
            raise ValueError(f"mail_server={self.mail_server} must be host:port")
        if self.webhook and not self.webhook.startswith(("http://", "https://")):
            raise ValueError(f"webhook={self.webhook} must begin with http:// or https://")


class AlarmHooks:
    """Sends messages in their order; `sent` and `failed` count them."""

    def __init__(self, params: HookParams, station: str) -> None:
        self._params, self._station = params, station
        self._queue: queue.Queue[dict[str, str] | None] = queue.Queue(MOST_WAITING)
        self.sent = self.failed = 0
        self.problem = ""
        wanted = {"command": self._run, "webhook": self._post, "mail_server": self._mail}
        self._ways = {name: send for name, send in wanted.items() if getattr(params, name)}
        self._thread = threading.Thread(target=self._work, daemon=True) if self._ways else None
        if self._thread is not None:
            self._thread.start()

    def put(self, event: str, name: str, level: int, text: str, ask: str, utc: str) -> None:
        """Send a message soon; never blocks."""
        if self._thread is None:
            return
        message = {"station": self._station, "event": event, "alarm": name, "level": ("ok", "warning", "error")[level],
                   "message": text, "to_do": ask, "utc": utc}  # fmt: skip
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self.failed, self.problem = self.failed + 1, f"{MOST_WAITING} messages wait to be sent"

    def close(self, patience_s: float = 2.0) -> None:
        """Send what waits, as far as that is done in time."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join(patience_s)

    def _work(self) -> None:
        while (message := self._queue.get()) is not None:
            for name, send in self._ways.items():
                self._try(name, send, message)

    def _try(self, name: str, send: Callable[[dict[str, str]], None], message: dict[str, str]) -> None:
        for number in range(1, TRIES + 1):
            try:
                send(message)
            except (OSError, subprocess.SubprocessError, smtplib.SMTPException) as error:
                self.problem = f"{name}: {error}"
                if number < TRIES:
                    time.sleep(self._params.retry_s)
            else:
                self.sent, self.problem = self.sent + 1, ""
                return
        self.failed += 1

    def _run(self, message: dict[str, str]) -> None:
        # Without a shell: an alarm's text must never be a command.
        subprocess.run([self._params.command], input=json.dumps(message), text=True, timeout=ANSWER_S, check=True)

    def _post(self, message: dict[str, str]) -> None:
        # Imported when it is needed: an executive that was killed must be back soon.
        import requests

        requests.post(self._params.webhook, json=message, timeout=ANSWER_S).raise_for_status()

    def _mail(self, message: dict[str, str]) -> None:
        mail = EmailMessage()
        mail["From"], mail["To"] = self._params.mail_from, self._params.mail_to
        mail["Subject"] = f"{message['station']}: {message['alarm']} {message['event']} ({message['level']})"
        lines = (f"{key}: {message[key]}" for key in ("utc", "message", "to_do") if message[key])
        mail.set_content("\n".join(lines))
        host, _, port = self._params.mail_server.rpartition(":")
        with smtplib.SMTP(host, int(port), timeout=ANSWER_S) as server:
            server.send_message(mail)
