"""When simulation time may advance: never ahead of the wall clock, never far ahead of the graph.

Each paced stream states by how much its newest stamp may lag the next tick.  A stream that stays
silent for longer than the patience is no longer waited for until its next message; nor is a stream
whose messages are further apart than expected.  The essential stream is the antenna's: while it is
silent, time runs no faster than the wall clock.
"""

from dataclasses import dataclass, field

LARGEST_SPACING_S = 0.25
"""Usual streams have a period of 0.1 s; conscan, once a scan, has seconds."""


@dataclass
class PacedStream:
    """Newest stamp of one stream, and by how much it may lag the next tick (below 0: lead it).

    Messages further apart than `spacing_s` make it a sparse stream, for which time does not wait.
    """

    allowed_lag_s: float
    essential: bool = False
    spacing_s: float = LARGEST_SPACING_S
    newest_s: float | None = None
    waited_for: bool = True
    waiting_since_s: float | None = None
    waits: int = 0
    abandoned: int = 0

    def received(self, stamp_s: float) -> None:
        """Note the stamp of a message."""
        sparse = self.newest_s is not None and stamp_s - self.newest_s > self.spacing_s
        self.newest_s = stamp_s if self.newest_s is None else max(self.newest_s, stamp_s)
        self.waited_for, self.waiting_since_s = not sparse, None


@dataclass
class Pacer:
    """Decides tick by tick; all times in seconds, `wall_s` from a steady clock."""

    start_s: float
    tick_s: float
    speed: float
    streams: dict[str, PacedStream]
    patience_s: float = 1.0
    long_patience_s: float = 5.0
    ticks: int = 0
    _origin_wall_s: float | None = field(default=None)
    _ticked_wall_s: float = field(default=0.0)

    @property
    def now_s(self) -> float:
        """Simulation time of the newest tick."""
        return self.start_s + self.ticks * self.tick_s

    def begin(self, wall_s: float) -> None:
        """Let time run from `wall_s` on."""
        for stream in self.streams.values():
            # A node that follows the clock publishes nothing before its first period is over, so
            # its stream counts as received now; one that is published ahead of time counts from
            # its first message.
            if stream.newest_s is None and stream.allowed_lag_s > 0.0:
                stream.newest_s = self.now_s
            elif stream.newest_s is None:
                stream.waited_for = False
        self._origin_wall_s = wall_s - (self.ticks * self.tick_s / self.speed if self.speed else 0.0)

    def wait_s(self, wall_s: float) -> float:
        """Return how long to wait before the next tick; 0 means now."""
        if self._origin_wall_s is None:
            return 0.5
        if self.speed:
            early_s = self._origin_wall_s + (self.ticks + 1) * self.tick_s / self.speed - wall_s
            if early_s > 0.0:
                return early_s
        # The longest of the waits: time advances when every stream allows it.
        return max((self._hold_s(stream, wall_s) for stream in self.streams.values()), default=0.0)

    def advance(self, wall_s: float) -> float:
        """Take the next tick and return its time."""
        self.ticks += 1
        self._ticked_wall_s = wall_s
        if self.speed and self._origin_wall_s is not None:
            due_s = self._origin_wall_s + self.ticks * self.tick_s / self.speed
            # Time lost to a slow graph is not made up: a burst of ticks would slow it further.
            if wall_s - due_s > self.patience_s:
                self._origin_wall_s += wall_s - due_s
        return self.now_s

    def _hold_s(self, stream: PacedStream, wall_s: float) -> float:
        next_s = self.now_s + self.tick_s
        # A thousandth of a tick covers the rounding of stamps to microseconds.
        if stream.newest_s is not None and stream.newest_s + stream.allowed_lag_s >= next_s - 1e-3 * self.tick_s:
            stream.waiting_since_s = None
            return 0.0
        if not stream.waited_for:
            return max(0.0, self._ticked_wall_s + self.tick_s - wall_s) if stream.essential else 0.0
        if stream.waiting_since_s is None:
            stream.waiting_since_s = wall_s
            stream.waits += 1
        # At full speed nobody waits for the clock, so it can wait longer for the graph.
        patience_s = self.long_patience_s if stream.essential or not self.speed else self.patience_s
        left_s = stream.waiting_since_s + patience_s - wall_s
        if left_s > 0.0:
            return left_s
        stream.waited_for, stream.waiting_since_s = False, None
        stream.abandoned += 1
        return 0.0
