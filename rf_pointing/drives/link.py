"""Bytes to and from a device, over a serial port or TCP, without ever waiting for them.

Reading and writing take what is possible now.  Only opening can wait (a host that does not answer,
a port that is slow to open), so it has a thread of its own.  A lost link is an OSError.
"""

import math
import os
import socket
import threading
from typing import Protocol

import serial

from rf_pointing.drives.params import LinkParams

CONNECT_S = 3.0
CHUNK = 4096


class Link(Protocol):
    """An open link to a device."""

    def read(self) -> bytes:
        """Return what has arrived, b"" for nothing; OSError when the link is lost."""
        ...

    def write(self, data: bytes) -> None:
        """Send `data`; OSError when the link is lost or takes no more."""
        ...

    def close(self) -> None:
        """Release the link."""
        ...


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


def link_name(params: LinkParams) -> str:
    """Return where the device is, in words."""
    return params.device or f"{params.host}:{params.port}"


def open_link(params: LinkParams, baud: int) -> Link:
    """Open the link of the parameters; OSError says why it cannot be opened."""
    if params.device:
        return SerialLink(params.device, params.baud or baud)
    return TcpLink(params.host, params.port)


class Opening:
    """An attempt to open a link, in a thread of its own."""

    def __init__(self, params: LinkParams, baud: int) -> None:
        self._params, self._baud = params, baud
        self._link: Link | None = None
        self._error: OSError | None = None
        self._abandoned, self._lock = False, threading.Lock()
        self._thread = threading.Thread(target=self._open, name="open drive", daemon=True)
        self._thread.start()

    def result(self) -> Link | None:
        """Return the open link, None while it is being opened; raise OSError when it cannot."""
        if self._thread.is_alive():
            return None
        if self._error is not None:
            raise self._error
        return self._link

    def abandon(self) -> None:
        """Close the link, now or as soon as it is open."""
        with self._lock:
            self._abandoned = True
            if self._link is not None:
                self._link.close()

    def _open(self) -> None:
        try:
            link = open_link(self._params, self._baud)
        except (OSError, ValueError) as error:
            # pyserial raises ValueError for a speed that the port does not have.
            self._error = error if isinstance(error, OSError) else OSError(str(error))
            return
        with self._lock:
            if self._abandoned:
                link.close()
            self._link = link


class KeptLink:
    """A link that is opened again whenever it is lost; the waits double up to the longest.

    `link` is None until it is open; `problem` says why until the device is known to answer.
    """

    def __init__(self, name: str, params: LinkParams, baud: int) -> None:
        self._where, self._params, self._baud = f"{name} at {link_name(params)}", params, baud
        self.problem = f"{self._where} is not connected yet"
        self.link: Link | None = None
        self._opening: Opening | None = None
        self._retry_s, self._wait_s = -math.inf, params.first_retry_s

    def step(self, t_s: float) -> bool:
        """Go on with the opening; return whether the link has just been opened."""
        if self.link is not None:
            return False
        if self._opening is None:
            if t_s >= self._retry_s:
                self._opening = Opening(self._params, self._baud)
            return False
        try:
            self.link = self._opening.result()
        except OSError as error:
            self._opening = None
            self._back_off(t_s, f"{error.strerror or error}")
            return False
        if self.link is None:
            return False
        self._opening = None
        return True

    def lose(self, t_s: float, why: str) -> None:
        """Close the link, and wait before it is opened again."""
        if self.link is not None:
            self.link.close()
        self.link = None
        self._back_off(t_s, why)

    def answers(self) -> None:
        """Note that the device has answered."""
        self.problem, self._wait_s = "", self._params.first_retry_s

    def shift(self, by_s: float) -> None:
        """Keep the wait as long as it was when the clock has been set."""
        self._retry_s += by_s

    def close(self) -> None:
        """Close the link for good."""
        if self.link is not None:
            self.link.close()
        elif self._opening is not None:
            self._opening.abandon()
        self.link = self._opening = None
        self.problem = f"{self._where} is closed"

    def _back_off(self, t_s: float, why: str) -> None:
        self.problem = f"{self._where}: {why}"
        self._retry_s = t_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._params.longest_retry_s)
