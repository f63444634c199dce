"""The way of a slew round what is forbidden: straight if it is free, else over another elevation.

A way is free when the axes can stop anywhere on it without leaving what is allowed: not only its points count but all that
a stop in the middle would still run through.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.slew import AxisRates, halting_points, slew_path

__all__ = ["CornerPath", "WayFinder"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
CLEARANCE_RAD = np.radians(0.5)
CORNER_RAD = np.radians(0.3)
"""How near to a corner the next leg begins; a detour keeps its distance by more than that cuts off."""
HEIGHTS = 12


class WayFinder:
    """Finds ways between positions of the axes, within an elevation travel (low, high)."""

    def __init__(self, sky: ForbiddenSky, axes: AxisRates, elevation_travel_rad: Pair) -> None:
        self._sky, self._axes, self._travel = sky, axes, elevation_travel_rad

    def find(self, start: Pair, end: Pair, sun: Pair | None) -> list[Pair] | str:
        """Return the corners to go by, the end included, or why there is no way."""
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
        """Return the elevations at which the azimuth may be moved: over the hills, above and below the Sun, and others."""
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
