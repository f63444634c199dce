"""Debian's rotctld with its dummy rotator (6 deg/s, 0.01 deg), and rigctld with its dummy rig, started by a test."""

import shutil
import signal
import socket
import subprocess
import time


class RealRotctld:
    """`rotctld -m 1` on a port of its own."""

    NAME, OPTIONS = "rotctld", ("-m", "1")

    def __init__(self) -> None:
        program = shutil.which(self.NAME)
        assert program, f"{self.NAME} is missing: sudo apt-get install libhamlib-utils"
        self._program = program
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(
            [self._program, *self.OPTIONS, "-T", "127.0.0.1", "-t", str(self.port)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        for _ in range(200):
            try:
                socket.create_connection(("127.0.0.1", self.port), 0.5).close()
            except OSError:
                time.sleep(0.02)
            else:
                return
        raise AssertionError(f"{self.NAME} does not listen")

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def go(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Let another client send it somewhere."""
        with socket.create_connection(("127.0.0.1", self.port), 1.0) as client:
            client.sendall(f"P {azimuth_deg:.2f} {elevation_deg:.2f}\n".encode())
            assert client.recv(100).strip() == b"RPRT 0"

    def position(self) -> tuple[float, float]:
        """Return what another client reads, in degrees."""
        with socket.create_connection(("127.0.0.1", self.port), 1.0) as client:
            client.sendall(b"p\n")
            text = b""
            while text.count(b"\n") < 2:
                text += client.recv(100)
        azimuth, elevation = text.split()[:2]
        return float(azimuth), float(elevation)


class RealRigctld(RealRotctld):
    """`rigctld -m 1` with a key."""

    NAME, OPTIONS = "rigctld", ("-m", "1", "-P", "RIG")

    def hang(self, *, hangs: bool) -> None:
        """Stop the process, or let it go on."""
        self._process.send_signal(signal.SIGSTOP if hangs else signal.SIGCONT)

    def ask(self, line: str) -> str:
        """Return what another client gets for a line."""
        with socket.create_connection(("127.0.0.1", self.port), 2.0) as client:
            client.sendall(f"{line}\n".encode())
            return client.recv(200).decode().strip()
