"""The times at which periodic work is due, on a grid that does not drift.

A timer may fire late, or twice at one time when the clock moves in steps; the work is still done once for every instant
of the grid, in order.  A clock that jumps by more than `longest_gap_s` starts a new grid.
"""

import math

__all__ = ["Schedule"]


class Schedule:
    """Grid of the whole multiples of `period_s` after `start_s`, so that two nodes of one period work at one time."""

    def __init__(self, start_s: float, period_s: float, longest_gap_s: float = 0.5) -> None:
        self._period_s = period_s
        self._longest_gap_s = max(longest_gap_s, 2.0 * period_s)
        self._origin_s, self._count = self._on_grid(start_s), 1
        self.jumped_s = 0.0

    def due(self, now_s: float) -> list[float]:
        """Return the instants up to `now_s` that have not been returned yet; `jumped_s` tells of a new grid."""
        self.jumped_s = 0.0
        late_s = now_s - self._next_s
        if abs(late_s) > self._longest_gap_s:
            self.jumped_s = late_s
            self._origin_s, self._count = self._on_grid(now_s), 0
        times = []
        while self._next_s <= now_s + 1e-3 * self._period_s:
            times.append(self._next_s)
            self._count += 1
        return times

    def _on_grid(self, t_s: float) -> float:
        return math.floor(t_s / self._period_s + 1e-4) * self._period_s

    @property
    def _next_s(self) -> float:
        return round(self._origin_s + self._count * self._period_s, 6)
