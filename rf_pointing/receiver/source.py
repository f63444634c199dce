"""Sources of a signal: one base class with one loop, whatever the protocol.

    closed --wait--> open --> read, read, ... --> silent, refused or gone --> closed

The loop has a thread of its own, so a source may wait; the station's part never does: `step` takes
what has arrived.  Waits to reconnect double up to the longest.  Every arrival is stamped when it is
read, with the clock of the station.
"""

import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

import serial

from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.receiver.spectrum import IqSamples, Samples

WAIT_S = 0.1
"""Longest wait of one `read`."""
CONNECT_S = 3.0
CHUNK = 262144
FEWEST_REFUSED = 10
KEPT_S = 2.0
"""Arrivals older than this are dropped when the station does not take them."""


@dataclass(frozen=True, slots=True)
class Level:
    """A level as a device reports it; `locked` where it says so."""

    t_s: float
    value: float
    locked: bool | None = None

    @property
    def taken_s(self) -> float:
        """When it counts as arrived."""
        return self.t_s


class Arrival(Protocol):
    """One thing that a source reads: samples, a level, or what a decoder makes of a line."""

    @property
    def taken_s(self) -> float:
        """When it arrived."""


class Source:
    """Base of every source; one of your own overrides `open`, `read` and `close`.

    `now_s` is the clock of the station, in seconds; a source stamps what it reads with it.
    """

    name = "source"

    def __init__(self, params: SignalReceiverParams, now_s: Callable[[], float]) -> None:
        self.params, self.now_s = params, now_s
        self.steady_s = time.monotonic
        """Clock of silence; a simulation that runs slower than time goes gives its own."""
        self.problem = f"{self.where} is not connected yet"
        self.losses: Counter[str] = Counter()
        self.index = 0
        """Samples received, lost ones included."""
        self._arrived: deque[Any] = deque()
        self._reads: deque[str] = deque(maxlen=50)
        """The newest reads: "" for arrivals, else why they are refused."""
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def where(self) -> str:
        """Where the source is, in words."""
        link = self.params.link
        return f"{self.params.type} at {link.device or link.file or f'{link.host}:{link.port}'}"

    def open(self) -> None:
        """Connect; may wait some seconds.  OSError or ValueError says why it cannot."""

    def read(self) -> Sequence[Arrival]:
        """Wait at most `WAIT_S` for what comes next; OSError when the source is lost."""
        raise NotImplementedError

    def close(self) -> None:
        """Release the device."""

    def step(self) -> list[Any]:
        """Return what has arrived since the last step; the first one starts the loop."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self.where, daemon=True)
            self._thread.start()
        found = []
        while self._arrived:
            found.append(self._arrived.popleft())
        return found

    def end(self) -> None:
        """End the loop and release the device."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0 * CONNECT_S)

    def iq(
        self, samples: Samples, clipped: float = 0.0, t_s: float | None = None,
        centre_hz: float | None = None, rate_hz: float | None = None,
    ) -> IqSamples:  # fmt: skip
        """Return samples (channels, n) that have just been read, and count them."""
        index, self.index = self.index, self.index + samples.shape[1]
        rate_hz = rate_hz or self.params.iq.rate_hz
        return IqSamples(samples, rate_hz, index, self.now_s(), t_s, clipped, centre_hz)

    def refuse(self, what: str) -> None:
        """Count something that has arrived and could not be read."""
        self.losses[what] += 1
        self._reads.append(what)

    @property
    def garbage(self) -> str:
        """Why most of what arrives is refused, "" while it is not."""
        refused = [each for each in self._reads if each]
        if len(refused) < FEWEST_REFUSED or 2 * len(refused) <= len(self._reads):
            return ""
        return f"garbage arrives: {len(refused)} of {len(self._reads)} times {refused[-1]}"

    def _run(self) -> None:
        link = self.params.link
        wait_s = link.first_retry_s
        while not self._ended.is_set():
            try:
                self.open()
                heard_s = self.steady_s()
                while not self._ended.is_set():
                    arrivals = self.read()
                    if arrivals:
                        heard_s, wait_s = self.steady_s(), link.first_retry_s
                        self._reads.append("")
                        self.problem = f"{self.where}: {self.garbage}" if self.garbage else ""
                        self._keep(arrivals)
                    elif (silent_s := self.steady_s() - heard_s) > link.silence_s:
                        but = f"; {self.garbage}" if self.garbage else ""
                        raise ConnectionError(f"silent for {silent_s:.1f} s{but}")
            except (OSError, ValueError, RuntimeError) as error:
                self.losses["connection"] += 1
                self.problem = f"{self.where}: {getattr(error, 'strerror', None) or error}"
            finally:
                # A device that is gone may refuse that as well.
                with suppress(OSError, RuntimeError):
                    self.close()
            self._ended.wait(wait_s)
            wait_s = min(2.0 * wait_s, link.longest_retry_s)

    def _keep(self, arrivals: Sequence[Arrival]) -> None:
        self._arrived.extend(arrivals)
        newest_s = arrivals[-1].taken_s
        while len(self._arrived) > 1 and newest_s - self._arrived[0].taken_s > KEPT_S:
            self._arrived.popleft()
            self.losses["not taken in time"] += 1


class ByteSource(Source):
    """A source of bytes over TCP, UDP or a serial port, by `transport`."""

    transport = "tcp"
    _socket: socket.socket | None = None
    _port: "serial.Serial | None" = None

    def open(self) -> None:
        link = self.params.link
        if self.transport == "serial":
            self._port = serial.Serial(link.device, link.baud, timeout=WAIT_S, exclusive=True)
        elif self.transport == "udp":
            self._socket = socket.socket(
                socket.AF_INET6 if ":" in link.host else socket.AF_INET, socket.SOCK_DGRAM
            )
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
            self._socket.bind((link.host, link.port))
            self._socket.settimeout(WAIT_S)
        else:
            self._socket = socket.create_connection((link.host, link.port), timeout=CONNECT_S)
            self._socket.settimeout(WAIT_S)
        self.greet()

    def greet(self) -> None:
        """Send what the source needs first."""

    def receive(self) -> bytes:
        """Return what has arrived, a datagram of UDP; b"" after `WAIT_S` without any."""
        if self._port is not None:
            return bytes(self._port.read(max(1, self._port.in_waiting)))
        assert self._socket is not None
        try:
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return b""
        if not data and self.transport == "tcp":
            raise ConnectionError("the source closed the connection")
        return data

    def send(self, data: bytes) -> None:
        """Send bytes."""
        if self._port is not None:
            self._port.write(data)
        elif self._socket is not None:
            self._socket.sendall(data)

    def close(self) -> None:
        for each in (self._socket, self._port):
            if each is not None:
                each.close()
        self._socket = self._port = None
