"""Simulation time: where it begins, and when it may advance.

Time is never ahead of the wall clock, and never far ahead of the graph.

Each paced stream states by how much its newest stamp may lag the next tick.  A stream that stays
silent for longer than the patience is no longer waited for until its next message; nor is a stream
whose messages are further apart than expected.  The essential stream is the antenna's: while it is
silent, time runs no faster than the wall clock.

A clock that brings itself up continues from the time at which a killed clock was (`ClockMemory`),
else from the newest time that the nodes of a running graph report (`ClockStart`).
"""

import math
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rf_pointing.core import Params, parameter

LISTEN_S = 1.5
"""How long a clock that brings itself up waits for the time of a running graph."""
# Every node reports its time once a second.
LONGEST_LISTEN_S = 5.0
"""The same while other nodes are seen and their time has not been reported yet."""
SETTLE_S = 0.2
"""After the first report: time for the other nodes to report a newer time."""
RESUME_S = 20.0
"""A graph waits no longer than this for a killed clock."""
_RECORD = struct.Struct("<3d")
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
        # No longer, until its next message.
        stream.waited_for, stream.waiting_since_s = False, None
        stream.abandoned += 1
        return 0.0


@dataclass(frozen=True, kw_only=True)
class ClockParams(Params):
    """Simulation time."""

    start_s: float = parameter(0.0, "UTC seconds since 1970 at which time starts; 0: now", 0.0, 4.0e9)
    speed: float = parameter(1.0, "simulated seconds per second; 0: as fast as the graph follows", 0.0, 1e4)
    tick_s: float = parameter(0.02, "step of simulation time", 0.001, 1.0)
    errors_in_time: bool = parameter(
        True, "whether time waits for pointing_error; not behind a real receiver: it measures later"
    )


class ClockMemory:
    """The newest time of one clock in a file, from which a killed clock continues.

    `start_s` is where the clock's time begins, `wall_s` a steady clock of the machine, and
    `open_file(path, flags)` opens or makes the file.  A clock that ends in order leaves no file.
    """

    def __init__(self, path: Path, start_s: float, open_file: Callable[[Path, int], int]) -> None:
        self._path, self._start_s, self._open = path, start_s, open_file
        self._file: int | None = None

    def recover(self, wall_s: float) -> float | None:
        """Return where a clock of the same start was killed at most `RESUME_S` ago, else None."""
        try:
            # A file of another start, of another boot, or a torn one does not count.
            with os.fdopen(os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as file:
                start_s, kept_wall_s, t_s = _RECORD.unpack(file.read(_RECORD.size + 1))
        except (OSError, struct.error):
            return None
        return t_s if start_s == self._start_s and 0.0 <= wall_s - kept_wall_s <= RESUME_S else None

    def keep(self, t_s: float, wall_s: float) -> None:
        """Write the time of a tick, before it is published."""
        if self._file is None:
            self._file = self._open(self._path, os.O_WRONLY)
            os.ftruncate(self._file, 0)
        # Written in place, 24 bytes: the kernel keeps them when the process dies.
        os.pwrite(self._file, _RECORD.pack(self._start_s, wall_s, t_s), 0)

    def forget(self) -> None:
        """Remove the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        self._path.unlink(missing_ok=True)


class ClockStart:
    """Waits for the time of a running graph: a new start would set it back.

    Times in seconds, `wall_s` from a steady clock.
    """

    def __init__(self, pacer: Pacer, resumed_s: float | None, wall_s: float) -> None:
        self._pacer, self._resumed, self._since_wall_s = pacer, resumed_s is not None, wall_s
        self._reported, self._reported_wall_s = False, math.inf
        if resumed_s is not None:
            pacer.start_s = resumed_s

    def report(self, stated_s: float, wall_s: float) -> None:
        """Note the time of a node of the graph: the newest of all counts, until time runs."""
        # An older one would be a jump back for every node, and once time runs it cannot be set.
        if self._pacer.ticks > 0:
            return
        self._reported = True
        self._pacer.start_s = max(self._pacer.start_s, stated_s)
        if stated_s > 0.0:
            self._reported_wall_s = min(self._reported_wall_s, wall_s)

    def known(self, wall_s: float, neighbours: bool) -> bool:
        """Return whether time may run; `neighbours`: whether other nodes of the graph are seen."""
        if self._resumed or wall_s - self._reported_wall_s >= SETTLE_S:
            return True
        patience_s = LONGEST_LISTEN_S if neighbours and not self._reported else LISTEN_S
        return wall_s - self._since_wall_s >= patience_s
