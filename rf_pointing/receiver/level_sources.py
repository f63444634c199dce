"""Sources of a level: instruments that answer (SCPI, rigctld), and receivers that send text."""

import re
import shlex
import subprocess
import time
from collections.abc import Sequence

from rf_pointing.receiver.params import COMMAND
from rf_pointing.receiver.source import WAIT_S, Arrival, ByteSource, Level

LONGEST_LINE = 4096
ANSWER_S = 2.0
SCPI_REQUEST = "CALC:MARK1:Y?"


class LineSource(ByteSource):
    """Lines of text; `ask` makes one request and waits for its line."""

    _text = b""

    def greet(self) -> None:
        self._text = b""
        self._due_s = time.monotonic()

    def line(self) -> str | None:
        """Return the next line, None after `WAIT_S` without one; a datagram is a line."""
        if b"\n" not in self._text:
            data = self.receive()
            self._text += data + (
                b"\n" if data and self.transport == "udp" and not data.endswith(b"\n") else b""
            )
        if len(self._text) > LONGEST_LINE and b"\n" not in self._text[:LONGEST_LINE]:
            self._text = b""
            self.refuse("line without an end")
        if b"\n" not in self._text:
            return None
        line, self._text = self._text.split(b"\n", 1)
        return line.decode("latin-1").strip()

    def ask(self, request: str) -> str | None:
        """Send a request when it is due; return its answer, None before that.

        Raises ConnectionError when no answer comes: a late one would be taken for the next.
        """
        now_s = time.monotonic()
        if not self.due(now_s):
            return None
        self.send(f"{request}\n".encode())
        while time.monotonic() - now_s < ANSWER_S:
            if answer := self.line():
                return answer
        raise ConnectionError(f"no answer to {request} within {ANSWER_S:.0f} s")

    def due(self, now_s: float) -> bool:
        """Return whether the next request is due; wait for a while where it is not."""
        if now_s < self._due_s:
            time.sleep(min(self._due_s - now_s, WAIT_S))
            return False
        self._due_s = max(self._due_s + self.params.period_s, now_s)
        return True

    def level(self, begun_s: float, text: str) -> Sequence[Arrival]:
        """Return the level in a text that was measured between `begun_s` and now."""
        found = re.search(self.params.level.pattern, text)
        if found is None:
            self.refuse("line without a level")
            return ()
        groups = found.groupdict()
        try:
            value = float(groups["level"])
            self.params.level.db(value)
        except (KeyError, TypeError, ValueError):
            # Some modems print nan without a signal.
            self.refuse("line without a level")
            return ()
        # A receiver may print a lot between its levels.
        self._reads.clear()
        lock = groups.get("lock")
        now_s = self.now_s()
        # An instrument measures between request and answer.
        middle_s = now_s - 0.5 * min(max(now_s - begun_s, 0.0), ANSWER_S)
        locked = None if lock is None else lock == self.params.level.locked
        return (Level(middle_s - self.params.link.latency_s, value, locked),)


class Scpi(LineSource):
    """A spectrum analyser or power meter that answers SCPI on a TCP socket (port 5025)."""

    def read(self) -> Sequence[Arrival]:
        begun_s = self.now_s()
        answer = self.ask(self.params.level.request or SCPI_REQUEST)
        if answer is None:
            return ()
        # Analysers answer 9.91E+37 for "not a number".
        if "9.9" in answer and "E+37" in answer.upper():
            self.losses["not measured"] += 1
            return ()
        return self.level(begun_s, answer)


class Rigctl(LineSource):
    """The signal strength of Hamlib's rigctld, or of GQRX, which answers in dBFS."""

    def read(self) -> Sequence[Arrival]:
        begun_s = self.now_s()
        answer = self.ask(self.params.level.request or "l STRENGTH")
        if answer is None:
            return ()
        if answer.startswith("RPRT"):
            raise ConnectionError(f"the rig refuses its level: {answer}")
        return self.level(begun_s, answer)


class TextLevel(LineSource):
    """A beacon receiver or modem that sends its level by itself, on request, or to a program."""

    @property
    def transport(self) -> str:  # type: ignore[override]
        return self.params.level.transport

    @property
    def where(self) -> str:
        command = self.params.level.request if self.transport == COMMAND else ""
        return f"level from {shlex.split(command)[0]}" if command else super().where

    def open(self) -> None:
        if self.transport != COMMAND:
            super().open()
        elif not self.params.level.request:
            raise ValueError("level.request must be the command line that prints the level")
        self.greet()

    def ask(self, request: str) -> str | None:
        """Make a request; of a command, run it without a shell, and return what it prints."""
        if self.transport != COMMAND:
            return super().ask(request)
        if not self.due(time.monotonic()):
            return None
        words = shlex.split(request)
        try:
            ran = subprocess.run(
                words, capture_output=True, text=True, timeout=ANSWER_S, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise ConnectionError(f"{words[0]} has not ended after {ANSWER_S:.0f} s") from error
        if ran.returncode:
            raise ConnectionError(
                f"{words[0]} ended with {ran.returncode}: {ran.stderr.strip()[:200]}"
            )
        return ran.stdout.strip()

    def read(self) -> Sequence[Arrival]:
        begun_s, request = self.now_s(), self.params.level.request
        text = self.ask(request) if request else self.line()
        return self.level(begun_s if request else self.now_s(), text) if text else ()
