"""Links to devices: a read never waits, and a link that is lost or full says so."""

import os
import pty
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator

import pytest

from rf_pointing.drives import LinkParams
from rf_pointing.drives.link import Link, SerialLink, abandon, opening
from test.conftest import within


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """The device's end of a serial line, and the name of the port."""
    device, port = pty.openpty()
    tty.setraw(port)
    yield device, os.ttyname(port)
    os.close(device)
    os.close(port)


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as one:
        one.settimeout(5.0)
        yield one


def until(found: Callable[[], object]) -> object:
    """Wait for a true value, 5 s at most."""
    latest_s = time.monotonic() + 5.0
    while not (value := found()) and time.monotonic() < latest_s:
        time.sleep(0.002)
    assert value
    return value


def fill(link: Link, data: bytes) -> None:
    for _ in range(100_000):
        link.write(data)


def test_reading_a_silent_serial_port_does_not_wait(terminal: tuple[int, str]) -> None:
    """Every tick reads it: a wait would stop the axes."""
    device, port = terminal
    link = SerialLink(port, 9600)
    begun_s = time.monotonic()
    assert [link.read() for _ in range(5)] == [b""] * 5
    assert within(time.monotonic() - begun_s, 2.0)
    os.write(device, b"+0123+0045\r\n")
    assert until(link.read) == b"+0123+0045\r\n"
    link.close()


def test_a_serial_port_is_this_programs_alone_until_it_is_closed(terminal: tuple[int, str]) -> None:
    link = SerialLink(terminal[1], 9600)
    with pytest.raises(OSError, match="lock"):
        SerialLink(terminal[1], 9600)
    link.close()
    SerialLink(terminal[1], 9600).close()


def test_a_serial_port_that_takes_no_more_is_a_lost_link(terminal: tuple[int, str]) -> None:
    link = SerialLink(terminal[1], 9600)
    with pytest.raises(ConnectionError, match="takes no more"):
        fill(link, b"x" * 100_000)
    # Full to the last byte: one more is not taken for sent.
    with pytest.raises(ConnectionError, match="takes no more"):
        fill(link, b"x")
    link.close()


def test_a_link_is_opened_meanwhile_and_closed_when_it_is_abandoned(server: socket.socket) -> None:
    found = opening(LinkParams(host="127.0.0.1", port=server.getsockname()[1]), 9600)
    assert until(found.result)
    client, _ = server.accept()
    client.settimeout(5.0)
    abandon(found)
    assert client.recv(10) == b""
    client.close()


def test_a_link_that_opens_after_it_was_abandoned_is_closed_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, closed, threads = threading.Event(), threading.Event(), []

    class Slow:
        def close(self) -> None:
            closed.set()

    def slowly(*_: object) -> Slow:
        threads.append(threading.current_thread())
        go_on.wait(5.0)
        return Slow()

    monkeypatch.setattr("rf_pointing.drives.link.open_link", slowly)
    found = opening(LinkParams(), 9600)
    assert not found.done()
    until(lambda: threads)
    # A port that never opens must not keep the program from ending.
    assert threads[0].daemon
    abandon(found)
    assert not closed.is_set()
    go_on.set()
    assert closed.wait(5.0)


def test_a_link_that_cannot_be_opened_says_why() -> None:
    found = opening(LinkParams(device="/dev/nothing"), 9600)
    with pytest.raises(OSError, match="/dev/nothing"):
        until(found.result)
