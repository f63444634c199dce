"""Bytes to and from a device, over a serial port or TCP, without ever waiting for them.

`read` returns what has arrived, b"" for nothing, and `write` sends all of its bytes; each raises
OSError where the link is lost.  Only opening can wait (a host that does not answer, a port that is
slow to open), so it has a thread of its own.
"""

import math
import os
import socket
import threading
from concurrent.futures import Future

import serial

from rf_pointing.drives.params import LinkParams

CONNECT_S = 3.0
CHUNK = 4096


class TcpLink:
    """A TCP connection."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), timeout=CONNECT_S)
        # A request is one short packet; Nagle's delay would hold back the second of two.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)

    def read(self) -> bytes:
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionError("the device closed the connection")
        return data

    def write(self, data: bytes) -> None:
        if self._socket.send(data) != len(data):
            raise ConnectionError("the connection takes no more")

    def close(self) -> None:
        self._socket.close()


class SerialLink:
    """A serial port of 8 bits without parity and handshake, this program's alone."""

    def __init__(self, device: str, baud: int) -> None:
        self._port = serial.Serial(device, baud, timeout=0.0, exclusive=True)

    def read(self) -> bytes:
        return bytes(self._port.read(CHUNK))

    def write(self, data: bytes) -> None:
        # Not the port's own write: without a timeout it never returns from a full buffer.
        try:
            sent = os.write(self._port.fileno(), data)
        except BlockingIOError:
            sent = 0
        if sent != len(data):
            raise ConnectionError("the serial port takes no more")

    def close(self) -> None:
        self._port.close()


Link = TcpLink | SerialLink


def open_link(params: LinkParams, baud: int) -> Link:
    """Open the link of the parameters; OSError says why it cannot be opened."""
    if params.device:
        return SerialLink(params.device, params.baud or baud)
    return TcpLink(params.host, params.port)


def opening(params: LinkParams, baud: int) -> Future[Link]:
    """Return the link that a thread of its own opens; its result raises what `open_link` does."""
    found: Future[Link] = Future()

    def work() -> None:
        try:
            found.set_result(open_link(params, baud))
        except (OSError, ValueError) as error:
            # pyserial raises ValueError for a speed that the port does not have.
            found.set_exception(error if isinstance(error, OSError) else OSError(str(error)))

    threading.Thread(target=work, name="open drive", daemon=True).start()
    return found


def abandon(found: Future[Link]) -> None:
    """Close a link, now or as soon as it is open."""
    found.add_done_callback(lambda done: None if done.exception() else done.result().close())


class KeptLink:
    """A link that is opened again whenever it is lost; the waits double up to the longest.

    `link` is None until it is open; `problem` says why until the device is known to answer.
    """

    def __init__(self, name: str, params: LinkParams, baud: int) -> None:
        self._name, self._params, self._baud = name, params, baud
        self._where = f"{name} at {params.device or f'{params.host}:{params.port}'}"
        self.problem = f"{self._where} is not connected yet"
        self.link: Link | None = None
        self._opening: Future[Link] | None = None
        self._retry_s, self._wait_s = -math.inf, params.first_retry_s

    def step(self, t_s: float) -> bool:
        """Go on with the opening; return whether the link has just been opened."""
        if self.link is None and self._opening is None and t_s >= self._retry_s:
            self._opening = opening(self._params, self._baud)
        elif self._opening is not None and self._opening.done():
            try:
                self.link = self._opening.result()
            except OSError as error:
                refused = isinstance(error, ConnectionRefusedError)
                hint = f"; is {self._name} running?" * refused
                self._back_off(t_s, f"{error.strerror or error}{hint}")
            self._opening = None
            return self.link is not None
        return False

    def lose(self, t_s: float, why: str) -> None:
        """Close the link, and wait before it is opened again."""
        if self.link is not None:
            self.link.close()
        self.link = None
        self._back_off(t_s, why)

    def answers(self) -> None:
        """Note that the device has answered."""
        self.problem, self._wait_s = "", self._params.first_retry_s

    def close(self) -> None:
        """Close the link for good."""
        if self.link is not None:
            self.link.close()
        elif self._opening is not None:
            abandon(self._opening)
        self.link = self._opening = None
        self.problem = f"{self._where} is closed"

    def _back_off(self, t_s: float, why: str) -> None:
        self.problem = f"{self._where}: {why}"
        self._retry_s = t_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._params.longest_retry_s)
