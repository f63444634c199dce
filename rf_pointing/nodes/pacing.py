"""When simulation time may go on: not before the wall clock says so, and never far ahead of the graph.

Every paced stream states by how much its newest stamp may lag the next tick.  A stream counts while it flows: one that has
not been heard of, or that falls silent for longer than the patience, is no longer waited for until it is heard again.
"""

from dataclasses import dataclass, field

__all__ = ["PacedStream", "Pacer"]


@dataclass
class PacedStream:
    """Newest stamp of one stream, and by how much it may lag the clock (negative: it must be ahead)."""

    allowed_lag_s: float
    newest_s: float = 0.0
    spacing_s: float = 0.0
    waiting_since_s: float | None = None
    waits: int = 0
    abandoned: int = 0

    def heard(self, stamp_s: float) -> None:
        """Note a message; what matters of it is its stamp."""
        self.spacing_s = stamp_s - self.newest_s
        self.newest_s = max(self.newest_s, stamp_s)
        self.waiting_since_s = None


@dataclass
class Pacer:
    """Decides tick by tick; all times in seconds, `wall_s` from a steady clock."""

    start_s: float
    tick_s: float
    speed: float
    streams: dict[str, PacedStream]
    patience_s: float = 0.25
    ticks: int = 0
    _origin_wall_s: float | None = field(default=None)

    @property
    def now_s(self) -> float:
        """Simulation time of the newest tick."""
        return self.start_s + self.ticks * self.tick_s

    def begin(self, wall_s: float) -> None:
        """Let time run from `wall_s` on."""
        self._origin_wall_s = wall_s - (self.ticks * self.tick_s / self.speed if self.speed else 0.0)

    def wait_s(self, wall_s: float) -> float:
        """Return how long to wait before the next tick; 0 means now."""
        if self._origin_wall_s is None:
            return 0.5
        if self.speed:
            early_s = self._origin_wall_s + (self.ticks + 1) * self.tick_s / self.speed - wall_s
            if early_s > 0.0:
                return early_s
        return max((self._hold_s(stream, wall_s) for stream in self.streams.values()), default=0.0)

    def advance(self, wall_s: float) -> float:
        """Take the next tick and return its time; a pace lost to the graph is not made up in a rush."""
        self.ticks += 1
        if self.speed and self._origin_wall_s is not None:
            due_s = self._origin_wall_s + self.ticks * self.tick_s / self.speed
            if wall_s - due_s > self.patience_s:
                self._origin_wall_s += wall_s - due_s
        return self.now_s

    def _hold_s(self, stream: PacedStream, wall_s: float) -> float:
        flowing = stream.newest_s > 0.0 and stream.spacing_s <= self.patience_s
        if not flowing or stream.newest_s + stream.allowed_lag_s >= self.now_s + (1.0 - 1e-3) * self.tick_s:
            stream.waiting_since_s = None
            return 0.0
        if stream.waiting_since_s is None:
            stream.waiting_since_s = wall_s
            stream.waits += 1
        left_s = stream.waiting_since_s + self.patience_s - wall_s
        if left_s > 0.0:
            return left_s
        stream.spacing_s = 2.0 * self.patience_s
        stream.abandoned += 1
        return 0.0
