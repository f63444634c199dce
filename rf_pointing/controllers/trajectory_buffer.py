"""The command table: time-tagged commands sent ahead, merged, and interpolated by quintic Hermite.

Between two points the quintic has their positions, rates and accelerations, so a 10-Hz table of a
satellite pass is exact to nanoradians and its rate is analytic.  Past the last point the motion
goes on with that point's rate and acceleration for at most `extrapolation_s`; after that the sample
is "dry": the position reached, at rest.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rf_pointing.core import JointTrajectory, Motion, Params, Quintic, parameter, require_finite
from rf_pointing.core.types import Array

TABLE, EXTRAPOLATED, EARLY, DRY = "table", "extrapolated", "early", "dry"


@dataclass(frozen=True, kw_only=True)
class TrajectoryBufferParams(Params):
    """How far a table is trusted."""

    extrapolation_s: float = parameter(1.0, "longest extrapolation past the last point", low=0.0, high=5.0)
    max_gap_s: float = parameter(2.5, "longest interval between points that is interpolated", low=0.01, high=60.0)
    max_lead_s: float = parameter(3.0, "how far ahead a message may begin", low=0.1, high=60.0)
    horizon_s: float = parameter(15.0, "how far ahead a message may end", low=0.1, high=600.0)
    max_points: int = parameter(600, "points that a message may have", low=1, high=10_000)
    silence_s: float = parameter(5.0, "how long the sender of a table that moves may be silent", low=0.2, high=60.0)
    keep_s: float = parameter(2.0, "how long points of the past are kept", low=0.0, high=60.0)


class TrajectorySample(NamedTuple):
    """Position, rate and acceleration (2,) at `t_s`, and where they come from.

    `source`: "table" between points, "extrapolated" past the last one, "early" before the first one
    or before a new table begins (the nearest point, at rest), "dry" when the extrapolation has run
    out (its end, at rest).
    """

    t_s: float
    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    source: str

    @property
    def valid(self) -> bool:
        """Whether the antenna should follow this sample."""
        return self.source in (TABLE, EXTRAPOLATED)


class TrajectoryBuffer:
    """Holds the merged table; a newer message replaces the old one from its own first point on."""

    def __init__(self, params: TrajectoryBufferParams) -> None:
        self.params = params
        self._table: Array = np.zeros((0, 7))
        self._latest: Array = np.zeros((0, 7))
        self._segment: tuple[float, float, Quintic] | None = None

    @property
    def empty(self) -> bool:
        """Whether no message has been accepted since the start or the last `clear`."""
        return len(self._table) == 0

    @property
    def state(self) -> tuple[Array, Array]:
        """A copy of table and latest message, rows of t, position, velocity, acceleration."""
        return self._table.copy(), self._latest.copy()

    @state.setter
    def state(self, state: tuple[Array, Array]) -> None:
        self._table, self._latest = state[0].copy(), state[1].copy()
        self._segment = None

    def clear(self) -> None:
        """Forget every point."""
        self.state = (np.zeros((0, 7)), np.zeros((0, 7)))

    def accept(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Merge a message received at `now_s`; return "" or why not: then nothing has changed."""
        reason = self.reason_against(trajectory, now_s)
        if not reason:
            self.take(trajectory, now_s)
        return reason

    def take(self, trajectory: JointTrajectory, now_s: float) -> None:
        """Merge a message against which nothing speaks (`reason_against`)."""
        rows = _rows(trajectory)
        # A newer message replaces the older from its own first point on; before it the older holds.
        kept = self._table[self._table[:, 0] < rows[0, 0]]
        # The last point before now stays: the segment that is being flown begins there.
        past = int(kept[:, 0].searchsorted(now_s - self.params.keep_s))
        self._table = np.concatenate((kept[max(0, past - 1) :], rows))
        self._latest = rows
        self._segment = None

    def reason_against(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Return why a message received at `now_s` is too long, stale, future, a duplicate or out
        of order, "" if it is not.
        """
        require_finite("now_s", now_s)
        if len(trajectory.t_s) > self.params.max_points:
            return f"too long: it has {len(trajectory.t_s)} points, must have <= {self.params.max_points}"
        rows = _rows(trajectory)
        begins, ends = rows[0, 0], rows[-1, 0]
        if ends < now_s:
            return f"stale: its last point is {now_s - ends:.3f} s in the past"
        # A message that begins far ahead makes every later one out of order until it has begun.
        if begins > now_s + self.params.max_lead_s:
            return f"future: it begins {begins - now_s:.3f} s ahead, must be <= {self.params.max_lead_s} s"
        if ends > now_s + self.params.horizon_s:
            return f"future: it ends {ends - now_s:.3f} s ahead, must be <= {self.params.horizon_s} s"
        if len(self._latest):
            if rows.shape == self._latest.shape and (rows == self._latest).all():
                return "duplicate of the latest message"
            # Transport may swap two messages; the older one would bring back points that are
            # already replaced.
            if begins < self._latest[0, 0]:
                return f"out of order: it begins {self._latest[0, 0] - begins:.3f} s before the latest message"
        return ""

    def lead_s(self, now_s: float) -> float:
        """Return how long the table lasts from `now_s`: negative past its end, -inf if empty."""
        return float(self._table[-1, 0] - now_s) if not self.empty else -np.inf

    def at(self, t_s: float) -> TrajectorySample:
        """Return the command at `t_s`.

        Raises
        ------
        ValueError
            If the buffer is empty.
        """
        # Four ticks in five fall into the segment of the tick before: its quintic is solved once.
        if self._segment is not None and self._segment[0] <= t_s <= self._segment[1]:
            return self._between(t_s)
        require_finite("t_s", t_s)
        if self.empty:
            raise ValueError("trajectory buffer is empty: accept a message before `at`")
        times = self._table[:, 0]
        index = int(times.searchsorted(t_s, side="right")) - 1
        if index < 0:
            return _at_rest(t_s, self._table[0, 1:3], EARLY)
        if index + 1 < len(times):
            # A wider gap is two tables, not one curve: the buffer extrapolates the first, then
            # waits for the second.
            if times[index + 1] - times[index] <= self.params.max_gap_s:
                begin, end = self._table[index], self._table[index + 1]
                curve = Quintic(_motion(begin), _motion(end), end[0] - begin[0])
                self._segment = (float(begin[0]), float(end[0]), curve)
                return self._between(t_s)
            if t_s > times[index] + self.params.extrapolation_s:
                return _at_rest(t_s, self._table[index + 1, 1:3], EARLY)
        return self._beyond(t_s, index)

    def _between(self, t_s: float) -> TrajectorySample:
        assert self._segment is not None
        begin_s, _, curve = self._segment
        return TrajectorySample(t_s, *curve.at(float(t_s - begin_s)), TABLE)

    def _beyond(self, t_s: float, index: int) -> TrajectorySample:
        last = _motion(self._table[index])
        past = float(t_s - self._table[index, 0])
        reach = min(past, self.params.extrapolation_s)
        position = last.position + reach * last.velocity + 0.5 * reach**2 * last.acceleration
        # At rest where the extrapolation ends: going on further would be a guess.
        if past > self.params.extrapolation_s:
            return _at_rest(t_s, position, DRY)
        velocity = last.velocity + reach * last.acceleration
        return TrajectorySample(t_s, position, velocity, last.acceleration, TABLE if past == 0.0 else EXTRAPOLATED)


def _rows(trajectory: JointTrajectory) -> Array:
    columns = (
        trajectory.t_s[:, None],
        trajectory.position_rad,
        trajectory.velocity_rad_s,
        trajectory.acceleration_rad_s2,
    )
    return np.concatenate(columns, axis=1)


def _at_rest(t_s: float, position_rad: Array, source: str) -> TrajectorySample:
    return TrajectorySample(t_s, position_rad, np.zeros(2), np.zeros(2), source)


def _motion(row: Array) -> Motion:
    return Motion(row[1:3], row[3:5], row[5:7])
