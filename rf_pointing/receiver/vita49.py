"""Packets of ANSI/VITA 49.2 as IEEE-ISTO 4900-2021 (DIFI) uses them, and a source of them over UDP.

    word 0   type 4 | class 1 | indicators 3 | TSI 2 | TSF 2 | count 4 | size in words 16
    then     stream identifier, class identifier (2 words), seconds UTC, picoseconds (2 words)

Data packets (type 1) carry signed samples of 8 or 16 bits, context packets (type 4) sample rate,
frequency and format.  Everything is big-endian.  Three channels are three streams with the same
time stamps; the lowest identifier is the sum.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.receiver.source import Arrival, ByteSource
from rf_pointing.receiver.spectrum import Samples

DATA, CONTEXT = 1, 4
DIFI_OUI = 0x6A621E
HEADER = struct.Struct(">IIIIIQ")
UTC_PICOSECONDS = 0b0110
"""TSI = 1 (UTC), TSF = 2 (picoseconds), as they stand in word 0."""
FIXED_POINT = 2.0**20
"""Frequencies are 64-bit numbers with 20 bits after the point."""
# Context fields in the order of the packet: bit of the indicator and size in bytes.
FIELDS = dict(zip(range(30, 14, -1), (4, 8, 8, 8, 8, 8, 4, 4, 4, 8, 8, 4, 4, 8, 4, 8), strict=True))
RF_FREQUENCY, SAMPLE_RATE, FORMAT = 27, 21, 15
MOST_WAITING = 64
"""Packets of one stream that wait for those of the others."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet; seconds and picoseconds are those of its first sample, `count` is modulo 16."""

    kind: int
    stream: int
    count: int
    seconds: int
    picoseconds: int
    payload: bytes

    def __post_init__(self) -> None:
        if not 0 <= self.picoseconds < 10**12:
            raise ValueError(f"picoseconds={self.picoseconds} must be >= 0 and < 10^12")


@dataclass(frozen=True, slots=True)
class Context:
    """Contents of a context packet; None for fields that it leaves out."""

    rate_hz: float | None = None
    centre_hz: float | None = None
    bits: int | None = None


def encode_packet(packet: Packet) -> bytes:
    """Return the bytes of a packet, the inverse of `decode_packet`."""
    words = (HEADER.size + len(packet.payload)) // 4
    if len(packet.payload) % 4 or words > 0xFFFF:
        raise ValueError(f"payload of {len(packet.payload)} bytes must be whole words and < 262 kB")
    first = packet.kind << 28 | 1 << 27 | UTC_PICOSECONDS << 20 | packet.count << 16 | words
    whole = HEADER.pack(
        first, packet.stream, DIFI_OUI, packet.kind & 0xFFFF, packet.seconds, packet.picoseconds
    )
    return whole + packet.payload


def decode_packet(data: bytes) -> Packet:
    """Return the packet of a datagram; ValueError for what is not one with UTC and picoseconds."""
    if len(data) < HEADER.size:
        raise ValueError(f"{len(data)} bytes are too short for a packet")
    first, stream, _, _, seconds, picoseconds = HEADER.unpack_from(data)
    if not first >> 27 & 1 or first >> 20 & 0xF not in (UTC_PICOSECONDS, 0b1010):
        raise ValueError(
            "a packet must have a class identifier, and a time in seconds and picoseconds"
        )
    size = 4 * (first & 0xFFFF)
    if not HEADER.size <= size <= len(data):
        raise ValueError(f"size {size} of a packet must be that of its {len(data)} bytes")
    return Packet(
        first >> 28, stream, first >> 16 & 0xF, seconds, picoseconds, data[HEADER.size : size]
    )


def encode_context(context: Context) -> bytes:
    """Return the payload of a context packet, the inverse of `decode_context`."""
    indicator, fields = 0, b""
    for bit, value in ((RF_FREQUENCY, context.centre_hz), (SAMPLE_RATE, context.rate_hz)):
        if value is not None:
            indicator |= 1 << bit
            fields += struct.pack(">q", round(value * FIXED_POINT))
    if context.bits is not None:
        indicator |= 1 << FORMAT
        # Link efficient, complex cartesian, signed fixed point; sizes less one.
        fields += struct.pack(
            ">II", 1 << 31 | 1 << 29 | (context.bits - 1) << 6 | (context.bits - 1), 0
        )
    return struct.pack(">I", indicator) + fields


def decode_context(payload: bytes) -> Context:
    """Return what a context packet says; ValueError where it is cut off."""
    try:
        (indicator,) = struct.unpack_from(">I", payload)
        found: dict[int, int] = {}
        at = 4
        for bit, size in FIELDS.items():
            if indicator >> bit & 1:
                (found[bit],) = struct.unpack_from(">q" if size == 8 else ">i", payload, at)
                at += size
    except struct.error as error:
        raise ValueError("a context packet is cut off") from error
    return Context(
        rate_hz=found[SAMPLE_RATE] / FIXED_POINT if SAMPLE_RATE in found else None,
        centre_hz=found[RF_FREQUENCY] / FIXED_POINT if RF_FREQUENCY in found else None,
        bits=(found[FORMAT] >> 32 & 0x3F) + 1 if FORMAT in found else None,
    )


def encode_samples(samples: Samples) -> bytes:
    """Return samples (n,), full scale 1, as signed integers of 16 bits."""
    scale = 2.0**15
    parts = np.clip(np.rint(samples.view(np.float32) * scale), -scale, scale - 1.0)
    return bytes(parts.astype(">i2").tobytes())


def decode_samples(payload: bytes, bits: int = 16) -> tuple[Samples, float]:
    """Return samples (n,), full scale 1, and the share at the ends of the scale."""
    raw = np.frombuffer(payload, dtype=">i2" if bits == 16 else np.int8)
    scale = 2.0 ** (bits - 1)
    clipped = float(np.count_nonzero((raw == -scale) | (raw == scale - 1.0))) / max(len(raw), 1)
    return (raw.astype(np.float32) * np.float32(1.0 / scale)).view(np.complex64), clipped


class Vita49(ByteSource):
    """DIFI over UDP: samples with time stamps, in one or three streams."""

    transport = "udp"

    def __init__(self, params: SignalReceiverParams, now_s: Callable[[], float]) -> None:
        super().__init__(params, now_s)
        # Kept over a silence: samples may come before the next context.
        self._contexts: dict[int, Context] = {}

    def greet(self) -> None:
        self._waiting: dict[int, dict[tuple[int, int], Packet]] = {}
        self._counts: dict[int, int] = {}
        self._origin: tuple[int, int, int] | None = None

    def read(self) -> Sequence[Arrival]:
        data = self.receive()
        if not data:
            return ()
        try:
            packet = decode_packet(data)
            if packet.kind == CONTEXT:
                self._contexts[packet.stream] = decode_context(packet.payload)
            return self._data(packet) if packet.kind == DATA else ()
        except ValueError:
            self.refuse("packet that is not DIFI")
            return ()

    def _data(self, packet: Packet) -> Sequence[Arrival]:
        due = self._counts.get(packet.stream, packet.count)
        self.losses["packet"] += (packet.count - due) % 16
        self._counts[packet.stream] = (packet.count + 1) % 16
        wanted, stamp = self.params.signal.channels, (packet.seconds, packet.picoseconds)
        waiting = self._waiting.setdefault(packet.stream, {})
        waiting[stamp] = packet
        while len(waiting) > MOST_WAITING:
            del waiting[next(iter(waiting))]
        streams = sorted(self._waiting)[:wanted]
        if len(streams) < wanted or any(stamp not in self._waiting[each] for each in streams):
            return ()
        packets = [self._waiting[each].pop(stamp) for each in streams]
        context = self._contexts.get(streams[0], Context())
        bits = context.bits or 16
        if bits not in (8, 16) or len({len(each.payload) for each in packets}) > 1:
            raise ValueError(f"samples of {bits} bits must be of 8 or 16")
        decoded = [decode_samples(each.payload, bits) for each in packets]
        rate_hz = context.rate_hz or self.params.iq.rate_hz
        samples = np.stack([each for each, _ in decoded])
        clipped = max(share for _, share in decoded)
        return (self._placed(samples, clipped, stamp, rate_hz, context.centre_hz),)

    def _placed(
        self, samples: Samples, clipped: float, stamp: tuple[int, int], rate_hz: float,
        centre_hz: float | None,
    ) -> Arrival:  # fmt: skip
        """Return the samples with their index, which follows from their time: lost ones count."""
        seconds, picoseconds = stamp
        if self._origin is not None:
            from_s, from_ps, base = self._origin
            ahead = base + round(((seconds - from_s) + 1e-12 * (picoseconds - from_ps)) * rate_hz)
            # A clock of whole samples may be one off.
            if abs(ahead - self.index) > 1:
                self.index = max(ahead, self.index + 1)
        self._origin = seconds, picoseconds, self.index
        t_s = seconds + 1e-12 * picoseconds
        return self.iq(samples, clipped, t_s, centre_hz, rate_hz)
