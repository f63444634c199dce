"""Interface between a control unit and an antenna's drive, whatever its protocol.

A drive never waits: `step` does what is due at a time that the caller gives, once a control tick,
and returns the newest reading.  Set points are taken at once and sent when the device can take
them.  Angles are those of the device, in the order azimuth, elevation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rf_pointing.core.types import Pair

POSITION, RATE = "position", "rate"


@dataclass(frozen=True, slots=True, kw_only=True)
class Capabilities:
    """Set points that a drive takes, and how finely and how fast it moves.

    `set_points` is "position" or "rate"; `resolution_rad` one step of set points and encoders;
    `rate_rad_s` the largest rates; `travel_rad` the lower and the upper ends (azimuth, elevation)
    that the device accepts, None when it does not state them; `period_s` the time between two
    readings, `latency_s` between a set point and the motion.  `one_turn`: the azimuth is read
    modulo 360 deg.
    """

    set_points: str
    resolution_rad: Pair
    rate_rad_s: Pair
    period_s: float
    latency_s: float = 0.0
    travel_rad: tuple[Pair, Pair] | None = None
    one_turn: bool = False
    has_elevation: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveReading:
    """Measurement of the device within +-`within_s` of `t_s`, in the clock of `Drive.step`.

    `rate_rad_s` is None without tachometers, `temperature_k` without a thermometer; `alarm` is the
    device's own reason not to move, "" for none; `at_limit` the axes at a limit switch.
    """

    t_s: float
    position_rad: Pair
    rate_rad_s: Pair | None = None
    at_limit: tuple[bool, bool] = (False, False)
    status: str = ""
    alarm: str = ""
    temperature_k: float | None = None
    within_s: float = 0.0

    def age_s(self, t_s: float) -> float:
        """Return how old the reading is at `t_s`."""
        return t_s - self.t_s


class Drive:
    """Base of every drive; a drive of one's own overrides what its device can do.

    `problem` is why there is no current reading, "" while the device answers; `losses` counts what
    was lost on the way, by name.
    """

    capabilities: Capabilities
    problem: str = ""
    losses: Mapping[str, int] = {}
    now_s: Callable[[], float] | None = None
    """Clock that stamps an answer when it is read; without one it has the time of its step."""
    truth_rad: Pair | None = None
    """Where a simulated device really is; None from a real one."""

    def step(self, t_s: float) -> DriveReading | None:
        """Do what is due at `t_s` without waiting; return the newest reading, None before it."""
        raise NotImplementedError

    def clock_stepped(self, by_s: float) -> None:
        """Take note that the clock of `step` was set ahead by `by_s`, or back."""

    def go_to(self, position_rad: Pair) -> None:
        """Take a position set point in place of the one before."""
        raise NotImplementedError(f"{type(self).__name__} takes no position set points")

    def turn(self, rate_rad_s: Pair) -> None:
        """Take a rate set point in place of the one before."""
        raise NotImplementedError(f"{type(self).__name__} takes no rate set points")

    def stop(self) -> None:
        """Stop as fast as the device can, forget the set point, and set brakes where there are."""
        raise NotImplementedError

    def enable(self) -> None:
        """Power the device and release its brakes; nothing moves."""

    def close(self) -> None:
        """Release the device."""
