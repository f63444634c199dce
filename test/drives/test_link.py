"""Links to devices: a read never waits."""

import os
import pty
import time

from rf_pointing.drives.link import SerialLink


def test_reading_a_silent_serial_port_does_not_wait() -> None:
    """Every tick reads it: a wait would stop the axes."""
    device, port = pty.openpty()
    link = SerialLink(os.ttyname(port), 9600)
    begun_s = time.monotonic()
    assert [link.read() for _ in range(5)] == [b""] * 5
    assert time.monotonic() - begun_s < 2.0
    os.write(device, b"+0123+0045\r\n")
    assert link.read() == b"+0123+0045\r\n"
    link.close()
    os.close(device)
    os.close(port)
