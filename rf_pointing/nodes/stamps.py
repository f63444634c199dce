"""ROS time and the core's UTC seconds.

A float holds today's UTC seconds to 0.24 microseconds, so stamps are kept on whole microseconds: a
time that was read from a stamp gives the same stamp again.
"""

import struct

from builtin_interfaces.msg import Time


def seconds_from_stamp(stamp: Time) -> float:
    """Return UTC seconds since 1970; the inverse is `stamp_from_seconds`."""
    return float(stamp.sec + stamp.nanosec * 1e-9)


def seconds_from_raw(raw: bytes) -> float:
    """Return the stamp of a serialised message that begins with its header, undecoded."""
    # CDR: 4 bytes of encapsulation, then the header's stamp.
    seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
    return float(seconds + nanoseconds * 1e-9)


def stamp_from_seconds(t_s: float) -> Time:
    """Return the stamp of `t_s`, rounded to a microsecond."""
    microseconds = round(t_s * 1e6)
    return Time(sec=microseconds // 1_000_000, nanosec=microseconds % 1_000_000 * 1000)
