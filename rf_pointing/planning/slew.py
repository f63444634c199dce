"""The path of a slew: straight if it is free, else over another elevation.

Each axis runs on its own at its limits, so a slew of both bends.  A path is free when the axes can
stop anywhere on it without leaving what is allowed: the points of the path count, and all that a
stop in the middle would still run through.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.limits import AxisRates, slew_time_s

Array = NDArray[np.float64]
Pair = tuple[float, float]
# Finer than the points of a surveyed mask.
PATH_STEP_RAD = math.radians(0.25)
# Shares of the stopping distance v^2 / 2a after a quarter, half and all of the time to stop.
HALTING_SHARES = (0.4375, 0.75, 1.0)


def slew_path(start: Pair, end: Pair, axes: AxisRates) -> tuple[Array, Array]:
    """Return positions and rates (n, 2) of a slew at even times, both ends included."""
    longest = max(abs(b - a) for a, b in zip(start, end, strict=True))
    times = np.linspace(0.0, axes.slew_s(start, end), max(2, math.ceil(longest / PATH_STEP_RAD) + 1))
    rows = zip(start, end, axes.rate_rad_s, axes.acceleration_rad_s2, strict=True)
    motion = [_one_axis(a, b - a, rate, acceleration, times) for a, b, rate, acceleration in rows]
    return np.column_stack([p for p, _ in motion]), np.column_stack([v for _, v in motion])


def halting_points(positions: Array, rates: Array, acceleration_rad_s2: Pair) -> Array:
    """Return where axes stopped at any of these motions (n, 2) come by and to rest: (3 n, 2)."""
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


# Above hills and around the Sun: more than a corner cuts off.
CLEARANCE_RAD = np.radians(0.5)
# How near to a corner the next leg begins; a detour keeps its distance by more than that cuts
# off.
CORNER_RAD = np.radians(0.3)
# Elevations to try in addition to the obvious ones.
HEIGHTS = 12


class PathFinder:
    """Finds free paths between positions of the axes, within an elevation travel (low, high)."""

    def __init__(self, sky: ForbiddenSky, axes: AxisRates, elevation_travel_rad: Pair) -> None:
        self._sky, self._axes, self._travel = sky, axes, elevation_travel_rad

    def find(self, start: Pair, end: Pair, sun: Pair | None) -> list[Pair] | str:
        """Return the corners of a free path, the end included, or why there is none."""
        straight = self._barred(start, end, sun)
        if not straight:
            return [end]
        ways = []
        for height in self._heights(start, end, sun):
            corners = [(start[0], height), (end[0], height), end]
            legs = list(zip([start, *corners[:-1]], corners, strict=True))
            if not any(self._barred(a, b, sun) for a, b in legs):
                ways.append((sum(self._axes.slew_s(a, b) for a, b in legs), corners))
        return min(ways)[1] if ways else f"{straight} on the way, and no detour is free"

    def _heights(self, start: Pair, end: Pair, sun: Pair | None) -> list[float]:
        """Return elevations to turn the azimuth at: over the hills, above and below the Sun."""
        low, high = self._travel
        azimuths = np.linspace(start[0], end[0], 721)
        heights = [start[1], end[1], float(np.max(self._sky.mask.lowest_all(azimuths))) + CLEARANCE_RAD]
        if sun is not None:
            beyond = self._sky.sun_radius_rad + 2.0 * CLEARANCE_RAD
            heights += [sun[1] - beyond, sun[1] + beyond]
        heights += np.linspace(low, high, HEIGHTS).tolist()
        return [height for height in heights if low <= height <= high]

    def _barred(self, start: Pair, end: Pair, sun: Pair | None) -> str:
        positions, rates = slew_path(start, end, self._axes)
        # The axis with the shorter way arrives first.  A stop in the middle bends otherwise: behind
        # a hill it lands up to 2 deg elsewhere at 1.8 deg/s and 0.8 deg/s^2.  That clearance kept
        # everywhere would close narrow valleys instead.
        points = np.concatenate([positions, halting_points(positions, rates, self._axes.acceleration_rad_s2)])
        return self._sky.reason_of_path(points, start, end, sun, self._axes.slew_s(start, end))


class CornerPath:
    """The corners that are still ahead of a slew."""

    def __init__(self, corners: Sequence[Pair] = ()) -> None:
        self._corners = list(corners)

    def next(self, present: Pair) -> Pair | None:
        """Return the corner to go to from here, None once the last one is near."""
        while self._corners and max(abs(a - b) for a, b in zip(self._corners[0], present, strict=True)) < CORNER_RAD:
            self._corners.pop(0)
        return self._corners[0] if self._corners else None
