"""Stamps keep whole microseconds, in both directions."""

import struct

import numpy as np
import pytest
from builtin_interfaces.msg import Time

from rf_pointing.ros.stamps import seconds_from_raw, seconds_from_stamp, stamp_from_seconds


def test_a_time_that_came_from_a_stamp_goes_back_to_the_same_stamp(random: np.random.Generator) -> None:
    for microseconds in random.integers(0, 4_000_000_000_000_000, 500).tolist():
        stamp = Time(sec=microseconds // 1_000_000 % 2**31, nanosec=microseconds % 1_000_000 * 1000)
        assert stamp_from_seconds(seconds_from_stamp(stamp)) == stamp


@pytest.mark.parametrize(
    ("t_s", "sec", "nanosec"), [(0.0, 0, 0), (1.9999999, 2, 0), (1_151_384_323.813083, 1_151_384_323, 813_083_000)]
)
def test_seconds_are_rounded_to_a_microsecond(t_s: float, sec: int, nanosec: int) -> None:
    assert stamp_from_seconds(t_s) == Time(sec=sec, nanosec=nanosec)
    assert seconds_from_stamp(Time(sec=sec, nanosec=nanosec)) == pytest.approx(t_s, abs=1e-6)


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 750_000_000), (1, 1_000_000_000)])
def test_a_stamp_that_can_be_none_is_refused(sec: int, nanosec: int) -> None:
    with pytest.raises(ValueError, match=f"stamp of {sec} s and {nanosec} ns is not a time"):
        seconds_from_stamp(Time(sec=sec, nanosec=nanosec))
    with pytest.raises(ValueError, match=f"stamp of {sec} s and {nanosec} ns is not a time"):
        seconds_from_raw(b"\0\1\0\0" + struct.pack("<iI", sec, nanosec))


def test_the_order_of_bytes_is_that_of_the_sender() -> None:
    assert seconds_from_raw(b"\0\1\0\0" + struct.pack("<iI", 7, 500_000_000)) == 7.5
    assert seconds_from_raw(b"\0\0\0\0" + struct.pack(">iI", 7, 500_000_000)) == 7.5
    with pytest.raises(ValueError, match="a message of 11 bytes has no stamp, must have >= 12"):
        seconds_from_raw(bytes(11))
