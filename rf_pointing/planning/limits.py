"""The limits of the machine: travel, rates, accelerations, and the least worth of a pass.

Time of a slew from rest to rest: t = d/v + v/a, or 2 sqrt(d/a) when v is not reached.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

from rf_pointing.core import AXES, LEAST_SHARE, Pair, Params, parameter, require_finite

SAME_RAD = 1e-9


@dataclass(frozen=True, kw_only=True)
class AxisLimits(Params):
    """Travel of both axes that the controller keeps, inside the servo's own stops."""

    azimuth_min_rad: float = parameter(math.radians(-220.0), "smallest azimuth", -20.0, 20.0)
    azimuth_max_rad: float = parameter(math.radians(220.0), "largest azimuth", -20.0, 20.0)
    elevation_min_rad: float = parameter(math.radians(4.0), "smallest elevation", -3.4, 3.2)
    elevation_max_rad: float = parameter(math.radians(89.5), "largest elevation", -3.4, 3.4)

    def check_together(self) -> None:
        """Refuse an empty travel."""
        for axis in ("azimuth", "elevation"):
            low, high = getattr(self, f"{axis}_min_rad"), getattr(self, f"{axis}_max_rad")
            if low >= high:
                raise ValueError(f"{axis}_min_rad={low} must be < {axis}_max_rad={high}")

    def direct(self) -> Self:
        """Return the travel that does not go over the top."""
        return self.replace(elevation_max_rad=min(self.elevation_max_rad, 0.5 * math.pi))

    @cached_property
    def lowest_rad(self) -> Pair:
        """Smallest azimuth and elevation."""
        return self.azimuth_min_rad, self.elevation_min_rad

    @cached_property
    def highest_rad(self) -> Pair:
        """Largest azimuth and elevation."""
        return self.azimuth_max_rad, self.elevation_max_rad

    def reason(
        self, azimuth_rad: float, elevation_rad: float, encoder_rad: Pair | None = None, tolerance_rad: float = 0.0,
        names: tuple[str, str] = AXES,
    ) -> str:  # fmt: skip
        """Return "" when the position may be commanded, else which limit it breaks and by how much.

        An axis that is itself outside, by `encoder_rad`, may be commanded anywhere not further out.
        """
        for axis, wanted in enumerate((azimuth_rad, elevation_rad)):
            low, high = self.lowest_rad[axis], self.highest_rad[axis]
            if encoder_rad is not None:
                # An axis a hair outside, by rounding or a swing, must not deadlock every motion.
                low, high = min(low, encoder_rad[axis]), max(high, encoder_rad[axis])
            if not low - tolerance_rad <= wanted <= high + tolerance_rad:
                require_finite(names[axis], wanted)
                bound, past = (low, low - wanted) if wanted < low else (high, wanted - high)
                return (
                    f"{names[axis]} {math.degrees(wanted):.3f} deg is {math.degrees(past):.3f} deg "
                    f"past the limit {math.degrees(bound):.3f} deg"
                )
        return ""


def choose_turns(limits: AxisLimits, azimuth_min_rad: float, azimuth_max_rad: float, encoder_rad: float) -> int:
    """Return the whole turns to add to a pass so that all of it lies within the azimuth travel.

    Of the turns that fit, the one whose pass lies nearest to the present azimuth.  Raises
    ValueError when none fits.
    """
    turn = 2.0 * math.pi
    first = math.ceil((limits.azimuth_min_rad - azimuth_min_rad) / turn)
    last = math.floor((limits.azimuth_max_rad - azimuth_max_rad) / turn)
    if first > last:
        raise ValueError(
            f"azimuth {math.degrees(azimuth_min_rad):.1f} to {math.degrees(azimuth_max_rad):.1f} deg fits no turn within "
            f"the travel {math.degrees(limits.azimuth_min_rad):.1f} to {math.degrees(limits.azimuth_max_rad):.1f} deg"
        )
    # In the overlap of the travel two turns fit; the nearer one saves an unwinding.
    middle = 0.5 * (azimuth_min_rad + azimuth_max_rad)
    away = {turns: abs(middle + turns * turn - encoder_rad) for turns in range(first, last + 1)}
    nearest = min(away.values())
    # Half a turn either way is a tie: the lower one, not the one that the last bits prefer.
    return next(turns for turns in away if away[turns] <= nearest + SAME_RAD)


def slew_time_s(distance_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> float:
    """Return the time to move one axis by `distance_rad` (either sign) from rest to rest."""
    distance = abs(distance_rad)
    # A short way never reaches the rate: accelerate half of it, brake the other half.
    if distance < rate_rad_s**2 / acceleration_rad_s2:
        return 2.0 * math.sqrt(distance / acceleration_rad_s2)
    return distance / rate_rad_s + rate_rad_s / acceleration_rad_s2


class AxisRates(NamedTuple):
    """Largest rates (rad/s) and accelerations (rad/s^2) of azimuth and elevation."""

    rate_rad_s: Pair
    acceleration_rad_s2: Pair

    def slew_s(self, start: Pair, end: Pair) -> float:
        """Return the time from rest at one position to rest at another, both axes at once."""
        rows = zip(start, end, self.rate_rad_s, self.acceleration_rad_s2, strict=True)
        return max(slew_time_s(b - a, rate, acceleration) for a, b, rate, acceleration in rows)


@dataclass(frozen=True, kw_only=True)
class MachineParams(Params):
    """Rates and accelerations of the axes, and the least that a pass must give."""

    rate_limit_rad_s: Pair = parameter((math.radians(1.8),) * 2, "largest rates", 1e-6, 10.0)
    acceleration_limit_rad_s2: Pair = parameter((math.radians(0.8),) * 2, "largest accelerations", 1e-6, 100.0)
    # The tracking loop needs some of the rate to correct errors while the axes move at the plan's.
    reserve: float = parameter(0.05, "share of both that planning leaves to the tracking loop", 0.0, 0.5)
    sun_radius_rad: float = parameter(math.radians(1.0), "the beam stays this far from the Sun", 0.0, 0.5)
    least_share: float = parameter(
        LEAST_SHARE, "share of the pass that must be within half power for it to be tracked", 0.0, 1.0
    )
    half_power_beamwidth_rad: float = parameter(
        math.radians(0.065), "beamwidth that the loss is computed for", 1e-6, 1.4
    )
    fixed_elevation_rad: tuple[float, ...] = parameter(
        (), "where an antenna looks that turns in azimuth alone; empty: both axes turn", -0.2, 3.2
    )

    @cached_property
    def planned(self) -> AxisRates:
        """The rates and accelerations that planning may use."""
        share = 1.0 - self.reserve
        rate, acceleration = self.rate_limit_rad_s, self.acceleration_limit_rad_s2
        return AxisRates((share * rate[0], share * rate[1]), (share * acceleration[0], share * acceleration[1]))

    @property
    def axes(self) -> AxisRates:
        """Rates and accelerations of the axes."""
        return AxisRates(self.rate_limit_rad_s, self.acceleration_limit_rad_s2)

    def slew_s(self, start: Pair, end: Pair) -> float:
        """Return the time from rest at one position to rest at another, both axes at once."""
        return self.axes.slew_s(start, end)
