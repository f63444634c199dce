"""From where the command was to where it shall be, without a step: a quintic that ends at rest.

A mode that ends leaves the beam somewhere beside its new path, and moving.  That difference is taken out over a time
within which |acceleration| <= 4 v/T + 5.8 d/T^2 stays below the bound, d and v the distance and the speed left over.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Motion, Quintic

__all__ = ["OffsetTransition"]

Array = NDArray[np.float64]
SHORTEST_S = 0.5
NOWHERE = np.zeros(2)


@dataclass(frozen=True)
class OffsetTransition:
    """Offset (2,) and rate (2,) at `start_s`, gone `duration_s` later."""

    start_s: float = 0.0
    duration_s: float = SHORTEST_S
    offset_rad: Array | None = None
    rate_rad_s: Array | None = None

    @classmethod
    def within(cls, start_s: float, offset_rad: Array, rate_rad_s: Array, acceleration_rad_s2: float) -> Self:
        """Return the blend that needs no more than this acceleration."""
        distance, speed = float(np.hypot(*offset_rad)), float(np.hypot(*rate_rad_s))
        bound = 4.0 * speed + math.sqrt(16.0 * speed**2 + 23.2 * acceleration_rad_s2 * distance)
        return cls(start_s, max(SHORTEST_S, bound / (2.0 * acceleration_rad_s2)), offset_rad, rate_rad_s)

    @property
    def end_s(self) -> float:
        """When nothing is left of it; the infinite past for nothing at all."""
        return -math.inf if self.offset_rad is None else self.start_s + self.duration_s

    def at(self, t_s: Array) -> tuple[Array, Array]:
        """Return offset and rate (n, 2) at the times (n,), none of them before the start."""
        if self.offset_rad is None or self.rate_rad_s is None or t_s[0] >= self.start_s + self.duration_s:
            return np.zeros((len(t_s), 2)), np.zeros((len(t_s), 2))
        since = np.clip(t_s - self.start_s, 0.0, self.duration_s)
        start, end = Motion(self.offset_rad, self.rate_rad_s, NOWHERE), Motion(NOWHERE, NOWHERE, NOWHERE)
        motion = Quintic(start, end, self.duration_s).at(since)
        return motion.position, motion.velocity
