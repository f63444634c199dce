"""The parameters of an antenna's drive: which one, how it is reached, and how it moves."""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter

_TURN = 2.0 * math.pi


@dataclass(frozen=True, kw_only=True)
class LinkParams(Params):
    """How a device is reached, and how long it may be silent."""

    device: str = parameter("", "serial port of the device, e.g. /dev/ttyUSB0; empty: over TCP")
    host: str = parameter("localhost", "host of the device where it is reached over TCP")
    port: int = parameter(4533, "TCP port of the device", low=1, high=65535)
    baud: int = parameter(
        0, "speed of the serial port; 0: the protocol's own", low=0, high=4_000_000
    )
    poll_period_s: float = parameter(
        0.2, "time between two readings of the position", low=0.02, high=10.0
    )
    answer_s: float = parameter(
        0.5, "time after which an answer counts as lost", low=0.01, high=10.0
    )
    silence_s: float = parameter(
        1.0,
        "time without a position after which the device is lost; at least two polls",
        low=0.1,
        high=60.0,
    )
    first_retry_s: float = parameter(
        0.5, "wait before the first attempt to reconnect", low=0.05, high=60.0
    )
    longest_retry_s: float = parameter(
        2.0, "longest wait; it doubles from attempt to attempt", low=0.05, high=3600.0
    )

    ordered = ("first_retry_s <= longest_retry_s",)

    @property
    def lost_s(self) -> float:
        """Time without a position after which the device is lost."""
        return max(self.silence_s, 2.0 * self.poll_period_s)


@dataclass(frozen=True, kw_only=True)
class RotatorParams(Params):
    """A device that moves to positions by itself, at a speed of its own (azimuth, elevation)."""

    rate_rad_s: tuple[float, float] = parameter(
        (math.radians(6.0),) * 2, "speeds at which it moves", low=1e-4, high=10.0
    )
    resolution_rad: tuple[float, float] = parameter(
        (0.0, 0.0), "steps of its positions; 0: the protocol's", low=0.0, high=0.2
    )
    dead_band_rad: tuple[float, float] = parameter(
        (0.0, 0.0), "distances from the set point at which it does not start", low=0.0, high=0.2
    )
    minimum_move_rad: tuple[float, float] = parameter(
        (0.0, 0.0),
        "smallest moves that are commanded; 0: one step or the dead band",
        low=0.0,
        high=0.2,
    )
    minimum_interval_s: float = parameter(
        0.5, "least time between two set points", low=0.0, high=60.0
    )
    latency_s: float = parameter(
        0.2, "time from a set point to the motion, until it has been measured", low=0.0, high=5.0
    )
    zero_rad: tuple[float, float] = parameter(
        (0.0, 0.0), "joint angles at which the device reads 0", low=-20.0, high=20.0
    )
    travel_min_rad: tuple[float, float] = parameter(
        (0.0, 0.0), "lower ends of the joint angles that it reaches", low=-20.0, high=20.0
    )
    travel_max_rad: tuple[float, float] = parameter(
        (math.radians(450.0), math.radians(180.0)),
        "upper ends of the joint angles that it reaches",
        low=-20.0,
        high=20.0,
    )
    reads_one_turn: bool = parameter(False, "whether it reads the azimuth modulo 360 deg")
    takes_one_turn: bool = parameter(False, "whether its azimuth set points are modulo 360 deg")

    ordered = ("travel_min_rad < travel_max_rad",)


@dataclass(frozen=True, kw_only=True)
class DriveParams(Params):
    """The drive of an antenna."""

    type: str = parameter(
        "simulated",
        "the drive: simulated, simulated_rotator, hamlib, gs232, easycomm, spid, topic, or one of an entry point",
    )
    model: str = parameter(
        "",
        "dialect: gs232 a, b, a_azimuth or b_azimuth (empty: recognised), hamlib azimuth, "
        "easycomm 2, 3, 2_azimuth or 3_azimuth, spid rot1, rot2 or md01; empty: 2 and rot2",
    )
    options: str = parameter("", "text for a drive of one's own")
    link: LinkParams = parameter(LinkParams(), "how the device is reached")
    rotator: RotatorParams = parameter(RotatorParams(), "how a device that takes positions moves")
