"""The parameters of an antenna's drive: which one, how it is reached, and how it moves."""

import math
from dataclasses import dataclass
from typing import Any

from rf_pointing.core import Pair, Params, parameter
from rf_pointing.drives.drive import POSITION, Capabilities

_NONE = (0.0, 0.0)
_FARTHEST_RAD = math.radians(450.0), math.radians(180.0)


@dataclass(frozen=True, kw_only=True)
class LinkParams(Params):
    """How a device is reached, and how long it may be silent."""

    device: str = parameter("", "serial port of the device, e.g. /dev/ttyUSB0; empty: over TCP")
    host: str = parameter("localhost", "host of the device where it is reached over TCP")
    port: int = parameter(4533, "TCP port of the device", 1, 65535)
    baud: int = parameter(0, "speed of the serial port; 0: the protocol's own", 0, 4_000_000)
    poll_period_s: float = parameter(0.2, "time between two readings of the position", 0.02, 10.0)
    answer_s: float = parameter(0.5, "time after which an answer counts as lost", 0.01, 10.0)
    silence_s: float = parameter(
        1.0, "time without a position after which the device is lost; at least two polls", 0.1, 60.0
    )
    first_retry_s: float = parameter(0.5, "wait before the first attempt to reconnect", 0.05, 60.0)
    longest_retry_s: float = parameter(
        2.0, "longest wait; it doubles from attempt to attempt", 0.05, 3600.0
    )

    ordered = ("first_retry_s <= longest_retry_s",)

    @property
    def lost_s(self) -> float:
        """Time without a position after which the device is lost."""
        return max(self.silence_s, 2.0 * self.poll_period_s)


@dataclass(frozen=True, kw_only=True)
class RotatorParams(Params):
    """A device that moves to positions by itself, at a speed of its own (azimuth, elevation)."""

    rate_rad_s: Pair = parameter((math.radians(6.0),) * 2, "speeds at which it moves", 1e-4, 10.0)
    resolution_rad: Pair = parameter(_NONE, "steps of its positions; 0: the protocol's", 0.0, 0.2)
    dead_band_rad: Pair = parameter(
        _NONE, "distances from the set point at which it does not start", 0.0, 0.2
    )
    minimum_move_rad: Pair = parameter(
        _NONE, "smallest moves that are commanded; 0: one step or the dead band", 0.0, 0.2
    )
    minimum_interval_s: float = parameter(0.5, "least time between two set points", 0.0, 60.0)
    latency_s: float = parameter(
        0.2, "time from a set point to the motion, until it has been measured", 0.0, 5.0
    )
    zero_rad: Pair = parameter(_NONE, "joint angles at which the device reads 0", -20.0, 20.0)
    travel_min_rad: Pair = parameter(
        _NONE, "lower ends of the joint angles that it reaches", -20.0, 20.0
    )
    travel_max_rad: Pair = parameter(
        _FARTHEST_RAD, "upper ends of the joint angles that it reaches", -20.0, 20.0
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

    def capabilities(self, resolution_deg: Pair, **known: Any) -> Capabilities:
        """Return what a device that takes positions states; its own steps where none are set."""
        steps = zip(self.rotator.resolution_rad, resolution_deg, strict=True)
        first, second = (own or math.radians(theirs) for own, theirs in steps)
        return Capabilities(
            set_points=POSITION, resolution_rad=(first, second), one_turn=self.rotator.reads_one_turn,
            rate_rad_s=self.rotator.rate_rad_s, latency_s=self.rotator.latency_s,
            period_s=self.link.poll_period_s, **known,
        )  # fmt: skip
