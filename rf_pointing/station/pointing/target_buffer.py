"""The target's coming motion, collected from messages that arrive ahead of time, as a continuous function."""

import bisect
import itertools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Motion, Quintic, Target, nearest_turn_rad

__all__ = ["TargetBuffer"]

Array = NDArray[np.float64]
LARGEST_GAP_S = 2.5
KEPT_S = 5.0


class TargetBuffer:
    """Holds the samples of one target; between two of them the motion is the quintic through both."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._motions: list[Motion] = []
        self._ranges: list[float] = []

    def clear(self) -> None:
        """Forget everything, for a new target."""
        self._times.clear()
        self._motions.clear()
        self._ranges.clear()

    def add(self, target: Target) -> None:
        """Take one sample; a later one for the same time replaces the earlier."""
        azimuth = target.azimuth_rad
        if self._motions:
            azimuth = nearest_turn_rad(azimuth, float(self._motions[-1].position[0]))
        motion = Motion(
            np.array([azimuth, target.elevation_rad]),
            np.array([target.azimuth_rate_rad_s, target.elevation_rate_rad_s]),
            np.array([target.azimuth_acceleration_rad_s2, target.elevation_acceleration_rad_s2]),
        )
        place = bisect.bisect_left(self._times, target.t_s - 1e-6)
        if place < len(self._times) and abs(self._times[place] - target.t_s) <= 1e-6:
            self._motions[place], self._ranges[place] = motion, target.range_m
        else:
            self._times.insert(place, target.t_s)
            self._motions.insert(place, motion)
            self._ranges.insert(place, target.range_m)
        while self._times[-1] - self._times[0] > KEPT_S and len(self._times) > 2:
            del self._times[0], self._motions[0], self._ranges[0]

    @property
    def known_until_s(self) -> float:
        """Time of the last sample, minus infinity without any."""
        return self._times[-1] if self._times else -math.inf

    def covers(self, start_s: float, end_s: float) -> bool:
        """Whether the motion is known all the way from `start_s` to `end_s`."""
        if not self._times or start_s < self._times[0] - 1e-6 or end_s > self._times[-1] + 1e-6:
            return False
        first = max(bisect.bisect_right(self._times, start_s) - 1, 0)
        last = bisect.bisect_left(self._times, end_s - 1e-6)
        inside = self._times[first : last + 1]
        return all(b - a <= LARGEST_GAP_S for a, b in itertools.pairwise(inside))

    def at(self, t_s: ArrayLike) -> Motion:
        """Return azimuth and elevation motion (n, 2) at the times (n,), all of which must be covered."""
        rows = [self._one(float(t)) for t in np.atleast_1d(np.asarray(t_s, dtype=np.float64))]
        return Motion(*(np.array([row[part] for row in rows]) for part in range(3)))

    def range_m(self, t_s: ArrayLike) -> Array:
        """Return the distance of the target at the times (n,), linear between samples, the nearest one outside."""
        return np.asarray(np.interp(np.asarray(t_s, dtype=np.float64), self._times, self._ranges))

    def _one(self, t_s: float) -> Motion:
        if not self.covers(t_s, t_s):
            raise ValueError(f"t_s={t_s} is outside the known motion of the target")
        after = bisect.bisect_left(self._times, t_s - 1e-6)
        if abs(self._times[after] - t_s) <= 1e-6:
            return self._motions[after]
        before, span_s = after - 1, self._times[after] - self._times[after - 1]
        return Quintic(self._motions[before], self._motions[after], span_s).at(t_s - self._times[before])
