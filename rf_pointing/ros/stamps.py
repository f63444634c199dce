"""ROS time and the core's UTC seconds.

A float holds today's UTC seconds to 0.24 microseconds, so stamps are kept on whole microseconds: a
time that was read from a stamp gives the same stamp again.
"""

import struct

from builtin_interfaces.msg import Time

BILLION = 1_000_000_000
SHORTEST_BYTES = 12
"""Shortest serialised message that begins with its header."""


def seconds_from_stamp(stamp: Time) -> float:
    """Return UTC seconds since 1970; the inverse is `stamp_from_seconds`.

    Raises ValueError for a stamp before 1970 or with more than 999 999 999 ns.
    """
    return _seconds(stamp.sec, stamp.nanosec)


def seconds_from_nanoseconds(nanoseconds: int) -> float:
    """Return the UTC seconds of a time of rclpy, those of its stamp."""
    return _seconds(*divmod(nanoseconds, BILLION))


def seconds_from_raw(raw: bytes) -> float:
    """Return the stamp of a serialised message that begins with its header, undecoded."""
    # CDR: 4 bytes of encapsulation, the second of which tells the order of bytes, then the
    # header's stamp.
    if len(raw) < SHORTEST_BYTES:
        raise ValueError(f"a message of {len(raw)} bytes has no stamp, must have >= {SHORTEST_BYTES}")
    return _seconds(*struct.unpack_from("<iI" if raw[1] & 1 else ">iI", raw, 4))


def _seconds(seconds: int, nanoseconds: int) -> float:
    if seconds < 0 or nanoseconds >= BILLION:
        raise ValueError(f"stamp of {seconds} s and {nanoseconds} ns is not a time")
    return float(seconds + nanoseconds * 1e-9)


def stamp_from_seconds(t_s: float) -> Time:
    """Return the stamp of `t_s`, rounded to a microsecond."""
    microseconds = round(t_s * 1e6)
    return Time(sec=microseconds // 1_000_000, nanosec=microseconds % 1_000_000 * 1000)
