"""Quantities over the last seconds, known at the instants at which they came, linear in between.

`BeamPosition` compares two of them at the time of a radio measurement: encoder angles and a
commanded direction, which arrive as streams of their own.
"""

import math
from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.signals import JointReading

Array = NDArray[np.float64]
KEPT_S = 2.0


@dataclass
class TimeBuffer:
    """Values of any one shape in order of time; those older than `kept_s` are dropped."""

    kept_s: float = KEPT_S
    times: list[float] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)

    def add(self, t_s: float, value: Array) -> None:
        """Note the value at `t_s`; a step back in time forgets what was known."""
        if self.times and t_s <= self.times[-1]:
            self.clear()
        self.times.append(t_s)
        self.values.append(value)
        while self.times[-1] - self.times[0] > self.kept_s:
            del self.times[0], self.values[0]

    def clear(self) -> None:
        """Forget everything."""
        self.times.clear()
        self.values.clear()

    def at(self, t_s: float) -> Array | None:
        """Return the value, None when `t_s` is not covered."""
        after = bisect_left(self.times, t_s)
        if after >= len(self.times) or (after == 0 and self.times[0] > t_s):
            return None
        if self.times[after] == t_s:
            return self.values[after]
        before = after - 1
        share = (t_s - self.times[before]) / (self.times[after] - self.times[before])
        mixed: Array = self.values[before] + share * (self.values[after] - self.values[before])
        return mixed


class BeamPosition:
    """Offset of the beam from the commanded direction, on the sky, over the last seconds."""

    def __init__(self) -> None:
        self._joints, self._centre = TimeBuffer(), TimeBuffer()

    def clear(self) -> None:
        """Forget everything, for a new pass."""
        self._joints.clear()
        self._centre.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints.add(reading.t_s, reading.position_rad)

    def take_centre(self, t_s: float, direction_rad: Array) -> None:
        """Note the commanded direction (2,), axis angles."""
        self._centre.add(t_s, direction_rad)

    def too_old(self, t_s: float) -> bool:
        """Whether `t_s` lies before all that is known, so that its offset will never be."""
        return any(bool(series.times) and t_s < series.times[0] for series in (self._joints, self._centre))

    def offset(self, t_s: float) -> Array | None:
        """Return cross-elevation and elevation (2,) of the beam off the direction, or None.

        On the sky, also while the dish is over the top.
        """
        joints, centre = self._joints.at(t_s), self._centre.at(t_s)
        if joints is None or centre is None:
            return None
        away: Array = (joints - centre) * np.array([math.cos(float(joints[1])), 1.0])
        # Over the top the cosine is negative, and up on the sky is down for the axis.
        return -away if centre[1] > 0.5 * math.pi else away
