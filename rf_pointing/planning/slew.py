"""Slews from rest to rest at the machine's limits, and what is left of a motion that is stopped in the middle.

Time of a slew: t = d/v + v/a, or 2 sqrt(d/a) when v is not reached.  Each axis runs on its own, so a slew of both bends.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["HALTING_SHARES", "AxisRates", "halting_points", "slew_path", "slew_time_s"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
PATH_STEP_RAD = math.radians(0.25)
HALTING_SHARES = (0.4375, 0.75, 1.0)
"""Shares of the stopping distance v^2 / 2a after a quarter, half and all of the time to stop."""


class AxisRates(NamedTuple):
    """Largest rates (rad/s) and accelerations (rad/s^2) of azimuth and elevation."""

    rate_rad_s: Pair
    acceleration_rad_s2: Pair

    def slew_s(self, start: Pair, end: Pair) -> float:
        """Return the time from rest at one position to rest at another, both axes at once."""
        rows = zip(start, end, self.rate_rad_s, self.acceleration_rad_s2, strict=True)
        return max(slew_time_s(b - a, rate, acceleration) for a, b, rate, acceleration in rows)


def slew_time_s(distance_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> float:
    """Return the time to move one axis by `distance_rad` (either sign) from rest to rest."""
    distance = abs(distance_rad)
    if distance < rate_rad_s**2 / acceleration_rad_s2:
        return 2.0 * math.sqrt(distance / acceleration_rad_s2)
    return distance / rate_rad_s + rate_rad_s / acceleration_rad_s2


def slew_path(start: Pair, end: Pair, axes: AxisRates) -> tuple[Array, Array]:
    """Return positions and rates (n, 2) of a slew at even times, both ends included."""
    longest = max(abs(b - a) for a, b in zip(start, end, strict=True))
    times = np.linspace(0.0, axes.slew_s(start, end), max(2, math.ceil(longest / PATH_STEP_RAD) + 1))
    rows = zip(start, end, axes.rate_rad_s, axes.acceleration_rad_s2, strict=True)
    motion = [_one_axis(a, b - a, rate, acceleration, times) for a, b, rate, acceleration in rows]
    return np.column_stack([p for p, _ in motion]), np.column_stack([v for _, v in motion])


def halting_points(positions: Array, rates: Array, acceleration_rad_s2: Pair) -> Array:
    """Return where the axes come by and to rest when they are stopped at any of these motions (n, 2): (3 n, 2)."""
    stop = rates * np.abs(rates) / (2.0 * np.array(acceleration_rad_s2))
    return np.concatenate([positions + share * stop for share in HALTING_SHARES])


def _one_axis(start: float, distance: float, rate: float, acceleration: float, times: Array) -> tuple[Array, Array]:
    length, side = abs(distance), math.copysign(1.0, distance)
    rise_s = min(rate / acceleration, math.sqrt(length / acceleration))
    end_s, peak = slew_time_s(distance, rate, acceleration), acceleration * rise_s
    up, down = np.minimum(times, rise_s), np.clip(times - (end_s - rise_s), 0.0, rise_s)
    level = np.clip(times - rise_s, 0.0, max(end_s - 2.0 * rise_s, 0.0))
    travelled = 0.5 * acceleration * up**2 + peak * level + peak * down - 0.5 * acceleration * down**2
    return start + side * travelled, side * acceleration * (up - down)
