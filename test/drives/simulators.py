"""Rotator controllers on a pseudo terminal or a TCP port, byte by byte as their command tables have them.

Tables: Yaesu GS-232A and GS-232B manuals ("Azimuth/Elevation control commands"), the Easycomm I-III specification
(G7UPN, A. Schultze), the SPID protocol of Rot1Prog and Rot2Prog, and the extended response protocol of rotctld(1).
Time is an argument: a test steps a simulator and an antenna together, at any speed.
"""

import contextlib
import math
import os
import pty
import re
import select
import socket
import tty
from collections.abc import Iterator

from rf_pointing.drives import RotatorModel, RotatorParams

MODEL = RotatorParams(latency_s=0.15, travel_max_rad=(math.radians(450.0), math.radians(180.0)))


PIECE = 4


class Simulator:
    """A rotator behind the words of its controller; the faults are attributes.

    `silent`: reads, never answers.  `noise`: bytes put before every answer.  `pieces`: answers in pieces of four bytes, one a
    step.  `delay_s`: answers come so late.  `lie_deg`: added to the azimuth that is read.  `frozen`: the read-back
    stands still.  `deaf`: set points and stops are lost.  `one_turn`: the azimuth is read modulo 360 deg.
    """

    resolution_deg = 1.0

    def __init__(self, start_deg: tuple[float, float] = (120.0, 45.0), params: RotatorParams = MODEL) -> None:
        step = math.radians(self.resolution_deg)
        start = math.radians(start_deg[0]), math.radians(start_deg[1])
        self.model = RotatorModel(params, (step, step), start)
        self.silent = self.pieces = self.deaf = self.one_turn = False
        self.noise, self.delay_s, self.lie_deg = b"", 0.0, 0.0
        self.frozen: tuple[float, float] | None = None
        self.received: list[bytes] = []
        self.set_points: list[tuple[float, tuple[float, float]]] = []
        self.t_s = 0.0
        self._input, self._output = bytearray(), bytearray()
        self._due: list[tuple[float, bytes]] = []
        self._open()

    def _open(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        self._slave = slave
        os.set_blocking(self._master, False)

    def unplug(self) -> None:
        """Pull the cable: the port is gone."""
        os.close(self._master)
        os.close(self._slave)
        self._master = -1

    def close(self) -> None:
        if self._master >= 0:
            self.unplug()

    def reset(self, position_deg: tuple[float, float] | None = None) -> None:
        """Restart the controller in the middle of whatever it does; it forgets its set point."""
        self.model.command(self.t_s, None)
        self._input.clear()
        self._output.clear()
        self._due.clear()
        if position_deg is not None:
            self.model.position_rad = [math.radians(each) for each in position_deg]

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 4096) if select.select([self._master], [], [], 0.0)[0] else b""
        except OSError:
            return b""

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self._master, data)

    def step(self, t_s: float) -> None:
        """Take what was sent by `t_s`, move, and answer."""
        self.t_s = t_s
        self.model.step(t_s)
        if self._master < 0:
            return
        self._input += self._read()
        for command in self._commands():
            self.received.append(command)
            answer = self._answer(command)
            if answer and not self.silent:
                self._due.append((t_s + self.delay_s, self.noise + answer))
        while self._due and self._due[0][0] <= t_s:
            self._output += self._due.pop(0)[1]
        count = PIECE if self.pieces else len(self._output)
        if count and self._output:
            self._write(bytes(self._output[:count]))
            del self._output[:count]

    def _angles(self) -> tuple[float, float]:
        """Return what the read-back shows, in degrees."""
        azimuth, elevation = (math.degrees(each) for each in self.model.encoders())
        if self.frozen is not None:
            azimuth, elevation = self.frozen
        azimuth += self.lie_deg
        return azimuth % 360.0 if self.one_turn else azimuth, elevation

    def freeze(self) -> None:
        self.frozen = self._angles()

    def _go(self, azimuth_deg: float, elevation_deg: float) -> None:
        self.set_points.append((self.t_s, (azimuth_deg, elevation_deg)))
        if not self.deaf:
            self.model.command(self.t_s, (math.radians(azimuth_deg), math.radians(elevation_deg)))

    def _stop(self) -> None:
        if not self.deaf:
            self.model.command(self.t_s, None)

    def _commands(self) -> Iterator[bytes]:
        """Yield the lines that are complete."""
        while match := re.search(rb"[\r\n]", self._input):
            line = bytes(self._input[: match.start()])
            del self._input[: match.end()]
            if line.strip():
                yield line

    def _answer(self, command: bytes) -> bytes:
        raise NotImplementedError


class Gs232(Simulator):
    """GS-232A (`b=False`) or GS-232B: every command is ended by CR and answered by CR, data by CR LF.

    A board without `elevation` knows neither C2 nor W.
    """

    def __init__(
        self, b: bool = True, start_deg: tuple[float, float] = (120.0, 45.0), *, elevation: bool = True
    ) -> None:
        self._b, self._elevation = b, elevation
        super().__init__(start_deg)

    def _answer(self, command: bytes) -> bytes:
        azimuth, elevation = (round(each) for each in self._angles())
        if command.upper() == b"C" and not self._elevation:
            return (f"AZ={azimuth:03d}" if self._b else f"+0{azimuth:03d}").encode() + b"\r\n"
        if (match := re.fullmatch(rb"M([0-9]{3})", command)) and not self._elevation:
            self._go(int(match[1]), 0.0)
            return b"\r"
        if command.upper() == b"C2" and self._elevation:
            return (
                f"AZ={azimuth:03d}  EL={elevation:03d}" if self._b else f"+0{azimuth:03d}+0{elevation:03d}"
            ).encode() + b"\r\n"
        if command.upper() == b"S":
            self._stop()
            return b"\r"
        if (match := re.fullmatch(rb"[Ww]([0-9]{3}) ([0-9]{3})", command)) and self._elevation:
            goal = int(match[1]), int(match[2])
            if goal[0] > 450 or goal[1] > 180:
                return b"?>\r\n"
            self._go(*goal)
            return b"\r"
        return b"?>\r\n"


class Easycomm(Simulator):
    """Easycomm II, with `version=3` the registers of III: commands ended by space, CR or LF; data requests are echoed."""

    resolution_deg = 0.1

    def __init__(self, version: int = 2, start_deg: tuple[float, float] = (120.0, 45.0)) -> None:
        self._version, self.errors = version, 0
        super().__init__(start_deg)

    def alarm(self, text: str) -> None:
        """Send what nobody requested, as the specification allows."""
        self._output += f"AL{text}\n".encode()

    def _answer(self, command: bytes) -> bytes:
        words, answers = command.split(), []
        goal = list(self._angles())
        wanted = False
        for word in words:
            name, value = word[:2], word[2:]
            if name in (b"AZ", b"EL"):
                axis = (b"AZ", b"EL").index(name)
                if value:
                    assert re.fullmatch(rb"-?[0-9]+\.[0-9]", value), "one decimal place"
                    goal[axis], wanted = float(value), True
                else:
                    answers.append(name + f"{self._angles()[axis]:.1f}".encode())
            elif name in (b"SA", b"SE"):
                self._stop()
            elif name == b"GE" and self._version == 3:
                answers.append(b"GE%d" % self.errors)
        if wanted:
            self._go(*goal)
        return b" ".join(answers) + b"\n" if answers else b""


class Spid(Simulator):
    """Rot2Prog with two pulses per degree, or Rot1Prog: commands of 13 bytes, answers of 12 or 5; set is not answered."""

    def __init__(self, model: str = "rot2", start_deg: tuple[float, float] = (120.0, 45.0)) -> None:
        self._size, self._md = (5 if model == "rot1" else 12), model == "md01"
        self.pulses = 10 if self._md else 2
        self.resolution_deg = 1.0 if model == "rot1" else 1.0 / self.pulses
        super().__init__(start_deg)

    def _commands(self) -> Iterator[bytes]:
        while len(self._input) >= 13:
            if self._input[0] != 0x57 or self._input[12] != 0x20:
                del self._input[:1]
                continue
            command = bytes(self._input[:13])
            del self._input[:13]
            yield command

    def _answer(self, command: bytes) -> bytes:
        kind = command[11]
        if kind == 0x0F:
            self._stop()
        elif kind == 0x2F:
            first, second = command[1:5], command[6:10]
            if self._size == 5:
                assert first[3:4] == b"0"
                self._go(float(int(first[:3]) - 360), 0.0)
            else:
                self._go(int(first) / self.pulses - 360.0, int(second) / self.pulses - 360.0)
            if not self._md:
                return b""
        return self._position()

    def _position(self) -> bytes:
        azimuth, elevation = (round(10.0 * (each + 360.0)) for each in self._angles())
        first, second = ([int(digit) for digit in f"{each:04d}"] for each in (azimuth, elevation))
        if self._size == 5:
            return bytes([0x57, *first[:3], 0x20])
        return bytes([0x57, *first, self.pulses, *second, self.pulses, 0x20])


class Rotctld(Simulator):
    """rotctld's extended response protocol over TCP, one client at a time."""

    resolution_deg = 0.01
    travel_deg = ((-180.0, 450.0), (0.0, 180.0))
    kind = b"AzEl"

    def _open(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.port = self._server.getsockname()[1]
        self._client: socket.socket | None = None
        self._master = 0

    def unplug(self) -> None:
        """End the program: the port is closed."""
        self.hang_up()
        self._server.close()
        self._master = -1

    def hang_up(self) -> None:
        """Close the connection."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _read(self) -> bytes:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            self.hang_up()
            self._client = client
            self._client.setblocking(False)
            self._input.clear()
        try:
            return self._client.recv(4096) if self._client is not None else b""
        except OSError:
            return b""

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            if self._client is not None:
                self._client.sendall(data)

    def _answer(self, command: bytes) -> bytes:
        if command == b"+\\dump_state":
            (west, east), (low, high) = self.travel_deg
            ends = (
                f"Minimum Azimuth: {west:.6f}\nMaximum Azimuth: {east:.6f}\n"
                f"Minimum Elevation: {low:.6f}\nMaximum Elevation: {high:.6f}\n"
            )
            return (
                b"dump_state:\nrotctld Protocol Ver: 1\nRotor Model: 1\n%sSouth Zero: 0\nrot_type=%s\ndone\nRPRT 0\n"
            ) % (ends.encode(), self.kind)
        if command == b"+p":
            azimuth, elevation = self._angles()
            elevation = elevation if self.kind == b"AzEl" else 0.0
            return f"get_pos:\nAzimuth: {azimuth:.2f}\nElevation: {elevation:.2f}\nRPRT 0\n".encode()
        if command == b"+S":
            self._stop()
            return b"stop:\nRPRT 0\n"
        if match := re.fullmatch(rb"\+P (-?[0-9.]+) (-?[0-9.]+)", command):
            goal = float(match[1]), float(match[2])
            inside = all(low <= angle <= high for angle, (low, high) in zip(goal, self.travel_deg, strict=True))
            if inside:
                self._go(*goal)
            return b"set_pos: %s %s\nRPRT %d\n" % (match[1], match[2], 0 if inside else -1)
        return b"RPRT -4\n"
