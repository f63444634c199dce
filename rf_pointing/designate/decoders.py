"""Reports from receivers of aircraft, drones and balloons: one decoder for each protocol.

    adsb      SBS/BaseStation text of dump1090 and others, TCP port 30003
    sonde     JSON "payload summaries" of radiosonde_auto_rx and horus_utils, UDP port 55672
    mavlink   GLOBAL_POSITION_INT (33) in MAVLink 1 and 2 frames, UDP port 14550

Reports have the time of their arrival.  The date of SBS is local time of another computer,
MAVLink counts from the start of its autopilot, and a sonde's `time` is whole seconds of GPS: none
is a UTC that a station could rely on.  Sources: MAVLink, "Packet serialization" (CRC-16/MCRF4XX
over the frame without its first byte, then CRC_EXTRA); horus_utils wiki, "Payload Summary".
"""

import math
import struct
from collections.abc import Iterator
from typing import Any, TypeVar

from rf_pointing.core import is_number, name_of, parse_json
from rf_pointing.designate.report import Report, ReportNoise

Velocity = tuple[float, float, float]
T = TypeVar("T")
FOOT_M, KNOT_M_S = 0.3048, 1852.0 / 3600.0
# Older parts of an aircraft's state do not belong to its newest place.
PARTS_S = 10.0
# Aircraft that are remembered at most: whoever sends text may invent names.
MOST_HEARD = 1000
POSITION_INT, POSITION_EXTRA = 33, 104
POSITION_FIELDS = struct.Struct("<IiiiihhhH")
# First byte of a frame, by version: length of the header, and where the message number is.
FRAMES = {0xFE: (6, slice(5, 6)), 0xFD: (10, slice(7, 10))}
SIGNATURE_BYTES, CHECKSUM_BYTES = 13, 2


class Decoder:
    """Base of the decoders: bytes of a line or datagram at the time of its arrival."""

    transport, port = "udp", 0

    def __init__(self, noise: ReportNoise) -> None:
        self.noise = noise

    def take(self, data: bytes, t_s: float) -> list[Report]:
        """Return the reports in the data; ValueError for what cannot be read."""
        raise NotImplementedError


class Adsb(Decoder):
    """One line of SBS: positions of message types 2 and 3, velocities of type 4, by ICAO24."""

    transport, port = "tcp", 30003

    def __init__(self, noise: ReportNoise) -> None:
        super().__init__(noise)
        self._heights: dict[str, tuple[float, float]] = {}
        self._velocities: dict[str, tuple[float, Velocity]] = {}

    def take(self, data: bytes, t_s: float) -> list[Report]:
        fields = data.decode("latin-1").strip().split(",")
        if len(fields) < 17:
            raise ValueError("line that is not SBS")
        # SEL, ID, AIR, STA and CLK report on the receiver's screen, not on the sky.
        if fields[0] != "MSG":
            return []
        name = fields[4].strip().upper()
        if not 1 <= len(name) <= 6:
            raise ValueError("line without an ICAO24 address")
        height, speed, course, latitude, longitude, climb = map(_number, fields[11:17])
        if height is not None:
            _remember(self._heights, name, t_s, height * FOOT_M)
        if speed is not None and course is not None:
            east, north = math.sin(math.radians(course)), math.cos(math.radians(course))
            velocity = (
                speed * KNOT_M_S * east, speed * KNOT_M_S * north, (climb or 0.0) * FOOT_M / 60.0,
            )  # fmt: skip
            _remember(self._velocities, name, t_s, velocity)
        if latitude is None or longitude is None:
            return []
        known = _recent(self._heights, name, t_s)
        if known is None:
            raise ValueError("position without a height")
        place = latitude, longitude, known
        return [Report.of_place(t_s, name, place, self.noise, _recent(self._velocities, name, t_s))]


class Sonde(Decoder):
    """One JSON object a datagram; `vel_h`, `vel_v` [m/s] and heading where the decoder has them."""

    port = 55672

    def take(self, data: bytes, t_s: float) -> list[Report]:
        try:
            given = parse_json(data.decode())
        except ValueError as error:
            raise ValueError("datagram that is not JSON") from error
        if not isinstance(given, dict):
            raise ValueError("datagram that is not a JSON object")
        if given.get("type") != "PAYLOAD_SUMMARY":
            return []
        place = _numbers(given, "latitude", "longitude", "altitude")
        if not place or not isinstance(given.get("callsign"), str):
            raise ValueError("payload summary without callsign, latitude, longitude and altitude")
        # Speed and heading are -1 where the decoder has neither.
        velocity = None
        moving = _numbers(given, "vel_h", "heading", "vel_v")
        if moving and moving[1] >= 0.0:
            level, heading, up = moving[0], math.radians(moving[1]), moving[2]
            velocity = level * math.sin(heading), level * math.cos(heading), up
        name = name_of(given["callsign"])
        return [Report.of_place(t_s, name, place, self.noise, velocity)]


class Mavlink(Decoder):
    """Frames of a datagram; the target is named by the number of its system."""

    port = 14550

    def take(self, data: bytes, t_s: float) -> list[Report]:
        return [
            found for frame in _frames(data) if (found := self._report(*frame, t_s)) is not None
        ]

    def _report(self, number: int, system: int, payload: bytes, t_s: float) -> Report | None:
        if number != POSITION_INT:
            return None
        # MAVLink 2 cuts off zeros at the end.
        whole = payload.ljust(POSITION_FIELDS.size, b"\0")[: POSITION_FIELDS.size]
        _, latitude, longitude, height_mm, _, north, east, down, _ = POSITION_FIELDS.unpack(whole)
        velocity = 0.01 * east, 0.01 * north, -0.01 * down
        place = 1e-7 * latitude, 1e-7 * longitude, 1e-3 * height_mm
        return Report.of_place(t_s, str(system), place, self.noise, velocity)


DECODERS: dict[str, type[Decoder]] = {"adsb": Adsb, "sonde": Sonde, "mavlink": Mavlink}
"""Decoders by the names that an address begins with."""


def crc_mavlink(data: bytes) -> int:
    """Return the CRC-16/MCRF4XX of bytes."""
    crc = 0xFFFF
    for byte in data:
        step = (byte ^ crc) & 0xFF
        step = (step ^ (step << 4)) & 0xFF
        crc = (crc >> 8) ^ (step << 8) ^ (step << 3) ^ (step >> 4)
    return crc


def _frames(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield message number, system and payload of each frame; ValueError for a damaged one.

    Only the frames whose content is used have their checksum compared: its CRC_EXTRA is a number
    of each message.
    """
    place = 0
    while place < len(data):
        if data[place] not in FRAMES:
            raise ValueError("datagram that is not MAVLink")
        header, where = FRAMES[data[place]]
        head = data[place : place + header]
        if len(head) < header:
            raise ValueError("MAVLink frame that is cut off")
        # Signed frames are read without a check: the key is between autopilot and its station.
        signed = head[0] == 0xFD and head[2] & 1
        body = place + header + head[1]
        end = body + CHECKSUM_BYTES + (SIGNATURE_BYTES if signed else 0)
        if end > len(data):
            raise ValueError("MAVLink frame that is cut off")
        number = int.from_bytes(head[where], "little")
        if number == POSITION_INT:
            sent = int.from_bytes(data[body : body + CHECKSUM_BYTES], "little")
            if crc_mavlink(data[place + 1 : body] + bytes([POSITION_EXTRA])) != sent:
                raise ValueError("MAVLink frame with a wrong checksum")
        yield number, head[where.start - 2], data[place + header : body]
        place = end


def _number(text: str) -> float | None:
    """Return the number of a field, None for an empty one; ValueError for another text."""
    if not text.strip():
        return None
    try:
        return float(text)
    except ValueError as error:
        raise ValueError("line with a field that is not a number") from error


def _numbers(given: dict[str, Any], *names: str) -> list[float]:
    """Return the numbers of these keys, none of them where one is missing."""
    found = [given.get(name) for name in names]
    return [float(each) for each in found if each is not None] if all(map(is_number, found)) else []


def _remember(kept: dict[str, tuple[float, T]], name: str, t_s: float, value: T) -> None:
    if len(kept) >= MOST_HEARD and name not in kept:
        kept.clear()
    kept[name] = t_s, value


def _recent(kept: dict[str, tuple[float, T]], name: str, t_s: float) -> T | None:
    known = kept.get(name)
    return known[1] if known is not None and t_s - known[0] <= PARTS_S else None
