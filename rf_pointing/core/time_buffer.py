"""A quantity over the last seconds, known at the instants at which it came, linear in between."""

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["TimeBuffer"]

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
