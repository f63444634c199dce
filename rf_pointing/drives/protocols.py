"""The words of antenna controllers: requests as bytes, answers out of bytes that arrive anyhow.

    hamlib    rotctld's extended protocol: "+p" -> "get_pos:", "Azimuth: ", "Elevation: ", "RPRT 0"
    gs232     Yaesu GS-232A/B: "C2" -> "+0aaa+0eee" (A) or "AZ=aaa  EL=eee" (B), "Waaa eee", "S"
    easycomm  II and III: "AZ EL" -> "AZaaa.a ELeee.e", "AZaaa.a ELeee.e", "SA SE"; III: "GE" errors
    spid      Rot1Prog, Rot2Prog, MD-01: 13-byte commands, answers of 5 or 12 bytes

Controllers of one kind differ in how they write a position: each has a table of dialects, which are
recognised at every connection.  Boards without an elevation axis are one of them.

`take` consumes what is complete in a buffer and leaves the rest: an answer may come in pieces, late
or between noise.  Angles here are degrees, as on the wire.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

from rf_pointing.core import Pair, require_choice

POSITION, DONE, REFUSED, LIMITS = "position", "done", "refused", "limits"
ALARM, STATUS, NOISE = "alarm", "status", "noise"
LONGEST_LINE = 200
# Any controller's azimuth and elevation; beyond, a byte was lost.
SENSIBLE_DEG = ((-360.0, 720.0), (-90.0, 270.0))


@dataclass(frozen=True, slots=True)
class Request:
    """Bytes to send; `answer` is the kind of answer that ends it, "" where none comes."""

    name: str
    data: bytes
    answer: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer; `angles_deg` are azimuth and elevation, for limits the two ends of each."""

    kind: str
    text: str = ""
    angles_deg: tuple[float, ...] = ()


class DeviceProtocol:
    """The words of one kind of controller; a subclass gives the requests and reads the answers.

    `ask` requests the position, `stop` stops both axes, `greeting` is what is sent first on every
    connection, `also` what is read once a second with the position.
    """

    name = ""
    baud = 9600
    resolution_deg: Pair = (1.0, 1.0)
    has_elevation = True
    ask: Request
    stop: Request
    greeting: tuple[Request, ...] = ()
    also: tuple[Request, ...] = ()

    def connected(self) -> None:
        """Forget what was half read on the connection before."""

    def go_to(self, azimuth_deg: float, elevation_deg: float) -> Request:
        """Return the set point."""
        raise NotImplementedError

    def take(self, buffer: bytearray) -> list[Answer]:
        """Return the complete answers of `buffer` and remove them from it."""
        found: list[Answer] = []
        # Lines end with CR, LF or both; an endless one is cut.
        while (match := re.search(rb"[\r\n]", buffer)) or len(buffer) > LONGEST_LINE:
            end = match.start() if match else LONGEST_LINE
            line = bytes(buffer[:end]).strip()
            del buffer[: end + 1]
            found.extend(self._line(line) if line else ())
        return found

    def _line(self, line: bytes) -> Iterator[Answer]:
        raise NotImplementedError


def _position(azimuth_deg: float, elevation_deg: float, text: bytes = b"") -> Answer:
    """Return a position, or noise where no controller could have meant it."""
    for angle, (low, high) in zip((azimuth_deg, elevation_deg), SENSIBLE_DEG, strict=True):
        if not low <= angle <= high:
            return _noise(text)
    return Answer(POSITION, angles_deg=(azimuth_deg, elevation_deg))


def _noise(text: bytes) -> Answer:
    return Answer(NOISE, repr(text)[2:-1])


LIMIT_NAMES = ("Minimum Azimuth", "Maximum Azimuth", "Minimum Elevation", "Maximum Elevation")
"""Names of the ends of the travel in rotctld's extended form."""
RPRT_ERRORS = {
    -1: "invalid parameter", -2: "invalid configuration", -4: "not implemented",
    -5: "communication timed out", -6: "input or output error", -8: "protocol error",
    -9: "rejected", -11: "not available",
}  # fmt: skip
"""Codes of rotctld and what they mean, for its client here and for its server."""


def refused_text(name: str, code: int) -> str:
    """Return a refused request with its code and what that means."""
    return f"{name}: RPRT {code} ({RPRT_ERRORS.get(code, 'unknown error')})"


AZIMUTH = "azimuth"
"""Model of a controller that turns the azimuth alone."""
_ANGLE = rb"([+-]?[0-9]{1,3}(?:\.[0-9]+)?)"
_SIGNED = rb"([+-][0-9]{4}|[+-][0-9]{3}(?:\.[0-9]+)?)"


@dataclass(frozen=True)
class Dialect:
    """How a controller writes its position; `model` names it in the description."""

    model: str
    position: re.Pattern[bytes]

    @property
    def has_elevation(self) -> bool:
        """Whether it has a second axis."""
        return self.position.groups == 2


def _dialect(model: str, form: bytes, angle: bytes = _ANGLE) -> Dialect:
    # An azimuth alone must be the whole line: it may be the rest of a longer one.
    begin = b".*" if form.count(b"%s") == 2 else b""
    return Dialect(model, re.compile(begin + form.replace(b"%s", angle), re.DOTALL))


class LineProtocol(DeviceProtocol):
    """Controllers that answer in lines, in one of a few dialects recognised at every connection."""

    dialects: ClassVar[tuple[Dialect, ...]] = ()
    SURE = 3
    """Answers without an elevation after which the axis is missing: one may be half an answer."""

    def __init__(self, model: str = "") -> None:
        self._named = next((one for one in self.dialects if one.model == model), None)
        self._alone = 0
        self.connected()

    @property
    def has_elevation(self) -> bool:  # type: ignore[override]
        return self._spoken is None or self._spoken.has_elevation

    def connected(self) -> None:
        # The count stays: a slow board may need more than one connection.
        self._spoken = self._named

    def _heard(self, line: bytes) -> Answer | None:
        """Return the position in a line, None without one."""
        for each in (self._spoken,) if self._spoken else self.dialects:
            if found := each.position.fullmatch(line):
                self._alone = 0 if each.has_elevation else self._alone + 1
                if not (each.has_elevation or self._spoken or self._alone >= self.SURE):
                    return Answer(REFUSED, "an azimuth alone, which may be the rest of an answer")
                self._spoken = each
                elevation = float(found[2]) if each.has_elevation else 0.0
                return _position(float(found[1]), elevation, line)
        return None


class HamlibProtocol(DeviceProtocol):
    """Hamlib's rotctld; every line of its extended protocol names what it is."""

    name = "rotctld"
    resolution_deg = (0.01, 0.01)
    ask = Request("get_pos", b"+p\n", POSITION)
    stop = Request("stop", b"+S\n", DONE)
    greeting = (Request("dump_state", b"+\\dump_state\n", LIMITS),)
    _FIELD = re.compile(rb"((?:Minimum |Maximum )?(?:Azimuth|Elevation)): (-?[0-9]+(?:\.[0-9]+)?)")
    _BEGIN = re.compile(rb"(get_pos|set_pos|stop|dump_state):(.*)")

    def __init__(self, model: str = "") -> None:
        self.has_elevation = model != AZIMUTH
        self.connected()

    def connected(self) -> None:
        self._block = ""
        self._fields: dict[str, float] = {}

    def go_to(self, azimuth_deg: float, elevation_deg: float) -> Request:
        return Request("set_pos", f"+P {azimuth_deg:.6f} {elevation_deg:.6f}\n".encode(), DONE)

    def _line(self, line: bytes) -> Iterator[Answer]:
        if begin := self._BEGIN.fullmatch(line):
            self._block, self._fields = begin[1].decode(), {}
        elif field := self._FIELD.fullmatch(line):
            self._fields[field[1].decode()] = float(field[2])
        elif end := re.fullmatch(rb"RPRT (-?[0-9]+)", line):
            yield from self._end(int(end[1]))
        elif re.fullmatch(rb"rot_type=Az(imuth)?", line):
            self.has_elevation = False
        elif self._block != "dump_state":
            yield _noise(line)

    def _end(self, code: int) -> Iterator[Answer]:
        block, fields, self._block, self._fields = self._block, self._fields, "", {}
        if code:
            yield Answer(REFUSED, refused_text(block or "request", code))
        elif block == "get_pos":
            # A line that was lost leaves a position without one of its angles.
            whole = {"Azimuth", "Elevation"} <= set(fields)
            part = Answer(NOISE, "get_pos in part")
            yield _position(fields["Azimuth"], fields["Elevation"]) if whole else part
        elif block == "dump_state":
            whole = set(LIMIT_NAMES) <= set(fields)
            yield Answer(LIMITS, "", tuple(fields[name] for name in LIMIT_NAMES) if whole else ())
        else:
            yield Answer(DONE, block)


class Gs232Protocol(LineProtocol):
    """Yaesu GS-232A and GS-232B and what copies them; whole degrees, three digits."""

    name = "GS-232"
    stop = Request("S", b"S\r")
    dialects = (
        _dialect("b", rb"AZ\s*=\s*%s[\s,]*EL\s*=\s*%s"), _dialect("a", rb"%s[\s,]*%s", _SIGNED),
        _dialect("b_azimuth", rb"AZ\s*=\s*%s"), _dialect("a_azimuth", rb"%s", _SIGNED),
    )  # fmt: skip
    _azimuth_alone = False
    """Whether C2 was refused, which boards without elevation do not know."""

    @property
    def ask(self) -> Request:  # type: ignore[override]
        name = "C" if self._azimuth_alone or not self.has_elevation else "C2"
        return Request(name, f"{name}\r".encode(), POSITION)

    def go_to(self, azimuth_deg: float, elevation_deg: float) -> Request:
        # Three digits: a negative angle has no form on this wire.
        azimuth, elevation = max(0, round(azimuth_deg)), max(0, round(elevation_deg))
        if not self.has_elevation:
            return Request("M", f"M{azimuth:03d}\r".encode())
        return Request("W", f"W{azimuth:03d} {elevation:03d}\r".encode())

    def _line(self, line: bytes) -> Iterator[Answer]:
        if position := self._heard(line):
            yield position
        elif line.startswith(b"?"):
            self._azimuth_alone = self._spoken is None and not self._azimuth_alone
            yield Answer(REFUSED, "the controller answered ?>")
        else:
            yield _noise(line)


class EasycommProtocol(LineProtocol):
    """Easycomm II; III adds the error register."""

    name = "Easycomm"
    resolution_deg = (0.1, 0.1)
    ask = Request("AZ EL", b"AZ EL\n", POSITION)
    stop = Request("SA SE", b"SA SE\n")
    ERRORS: ClassVar = {1: "sensor error", 2: "jam", 4: "homing error"}
    dialects = (
        _dialect("azel", rb"AZ\s*=?\s*%s[\s,]*EL\s*=?\s*%s(?:\s+UP.*)?"),
        _dialect(AZIMUTH, rb"AZ\s*=?\s*%s"),
    )

    def __init__(self, model: str) -> None:
        version, _, dialect = model.partition("_")
        super().__init__(dialect)
        self.also = (Request("GE", b"GE\n", STATUS),) if version == "3" else ()

    def go_to(self, azimuth_deg: float, elevation_deg: float) -> Request:
        elevation = f" EL{elevation_deg:.1f}" if self.has_elevation else ""
        return Request("AZ EL set", f"AZ{azimuth_deg:.1f}{elevation}\n".encode())

    def _line(self, line: bytes) -> Iterator[Answer]:
        if position := self._heard(line):
            yield position
        elif alarm := re.search(rb"AL([ -~]+)$", line):
            yield Answer(ALARM, f"alarm {alarm[1].decode()}")
        elif errors := re.search(rb"GE([0-9]{1,3})$", line):
            bits = int(errors[1])
            yield Answer(STATUS)
            yield Answer(ALARM, ", ".join(name for bit, name in self.ERRORS.items() if bits & bit))
        elif not re.search(rb"(GS[0-9]+|VE[ -~]*)$", line):
            yield _noise(line)


class SpidProtocol(DeviceProtocol):
    """SPID Rot1Prog (azimuth alone), Rot2Prog and MD-01, which answers set points too.

    Whether there is an elevation is seen by the length of an answer, whatever the model was named.
    """

    START, END, SET = 0x57, 0x20, 0x2F
    PULSES = (1, 2, 4, 5, 10)
    ask = Request("status", bytes([START, *bytes(10), 0x1F, END]), POSITION)
    stop = Request("stop", bytes([START, *bytes(10), 0x0F, END]), POSITION)
    # The pulses per degree are the controller's setting; set points need them.
    greeting = (ask,)

    def __init__(self, model: str) -> None:
        self.name, self.has_elevation = f"SPID {model}", model != "rot1"
        self.baud = 1200 if model == "rot1" else 600
        self.resolution_deg = (1.0, 1.0) if model == "rot1" else (0.5, 0.5)
        self._answers_set = model == "md01"
        self._pulses: tuple[int, ...] = ()

    def go_to(self, azimuth_deg: float, elevation_deg: float) -> Request:
        angles = azimuth_deg + 360.0, elevation_deg + 360.0
        texts, answer = [f"{round(angles[0]):03d}0".encode(), bytes(4)], ""
        pulses: tuple[int, ...] = (0, 0)
        if self.has_elevation:
            answer = POSITION if self._answers_set else ""
            pulses = self._pulses or tuple(round(1.0 / step) for step in self.resolution_deg)
            counts = (round(angle * each) for angle, each in zip(angles, pulses, strict=True))
            texts = [f"{count:04d}".encode() for count in counts]
        middle = b"".join(text + bytes([each]) for text, each in zip(texts, pulses, strict=True))
        return Request("set", bytes([self.START, *middle, self.SET, self.END]), answer)

    def take(self, buffer: bytearray) -> list[Answer]:
        found = []
        # The fifth byte of a long answer is a digit, of a short one its end.
        while len(buffer) >= (size := 5 if buffer[4:5] == bytes([self.END]) else 12) or (
            buffer and buffer[0] != self.START
        ):
            answer = self._packet(bytes(buffer[:size]))
            if answer is None:
                # Not a packet here: the next byte may begin one.
                found.append(_noise(bytes(buffer[:1])))
                del buffer[:1]
            else:
                found.append(answer)
                self.has_elevation = size == 12
                del buffer[:size]
        return found

    def _packet(self, packet: bytes) -> Answer | None:
        if packet[0] != self.START or packet[-1] != self.END or len(packet) < 5:
            return None
        short = len(packet) == 5
        # A short answer has no tenths.
        digits = packet[1:4] + bytes(5) if short else packet[1:5] + packet[6:10]
        first, second = (1, 1) if short else (packet[5], packet[10])
        if any(digit > 9 for digit in digits) or not {first, second} <= {*self.PULSES}:
            return None
        self.resolution_deg = 1.0 / first, 1.0 / second
        azimuth, elevation = (
            100.0 * a + 10.0 * b + c + 0.1 * d - 360.0 for a, b, c, d in (digits[:4], digits[4:])
        )
        if short:
            return _position(azimuth, 0.0, packet)
        self._pulses = first, second
        return _position(azimuth, elevation, packet)


PROTOCOLS: dict[str, tuple[Callable[[str], DeviceProtocol], tuple[str, ...]]] = {
    "hamlib": (HamlibProtocol, ("", AZIMUTH)),
    "gs232": (Gs232Protocol, ("", *(one.model for one in Gs232Protocol.dialects))),
    "easycomm": (EasycommProtocol, ("2", "3", "2_azimuth", "3_azimuth")),
    "spid": (SpidProtocol, ("rot2", "rot1", "md01")),
}
"""Words and models (`drive.model`) of each type; the first is meant by an empty one."""


def protocol_of(type_: str, model: str) -> DeviceProtocol:
    """Return the words of a type of drive; ValueError for a model that it does not have."""
    make, models = PROTOCOLS[type_]
    require_choice(f"{type_}: drive.model", model or models[0], models)
    return make(model or models[0])


def turns_azimuth_alone(type_: str, model: str) -> bool:
    """Return whether this model of a type is known to have no elevation axis."""
    known = type_ in PROTOCOLS and model in PROTOCOLS[type_][1]
    return known and not protocol_of(type_, model).has_elevation
