"""A campaign: passes, or pieces of them, that fill every sector of the sky in the least time.

Two greedy plans are made and the one that ends first is taken.  One goes through the candidates in order of time and, of
those that overlap, keeps the one with more points where they are still missing: good for few passes.  The other goes on
with the candidate that brings most missing points per second from the end of the last one, slew included: good for many.
When the last sector is full, passes whose points others make up for are struck out again, the poorest first.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.candidate_pass import CandidatePass
from rf_pointing.calibration.coverage import Coverage, SectorRule
from rf_pointing.core import Params, parameter

__all__ = ["Campaign", "Slew", "plan_campaign"]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Plan = tuple[list[int], Counts, float | None]

_TURN = 2.0 * math.pi


@dataclass(frozen=True, kw_only=True)
class Slew(Params):
    """Time from the last point of a pass to the first point of the next: travel of the slower axis, and the rest.

    `travel_rad` are the ends of the azimuth travel: cables that cannot turn on may make the shorter way impossible.
    """

    rate_rad_s: float = parameter(math.radians(1.8), "mean axis rate of a slew", low=1e-5, high=10.0)
    settle_s: float = parameter(30.0, "stop, settling and acquisition", low=0.0, high=3600.0)
    travel_rad: tuple[float, ...] = parameter(
        (), "lower and upper end of the azimuth travel; none: it turns without end", low=-20.0, high=20.0
    )

    def check_together(self) -> None:
        """Refuse a travel that is no pair or less than a turn."""
        if self.travel_rad and (len(self.travel_rad) != 2 or self.travel_rad[1] - self.travel_rad[0] < _TURN):
            raise ValueError(f"travel_rad={self.travel_rad} must be two ends at least a turn apart")

    def ends_rad(self, azimuth_rad: Array) -> tuple[float, float]:
        """Return first and last azimuth of a pass (n,) on the turn on which most of it lies within the travel."""
        path = np.unwrap(azimuth_rad)
        if self.travel_rad:
            low, high = self.travel_rad
            turns = _TURN * (np.arange(-2.0, 3.0) - np.floor(path[0] / _TURN))
            outside = np.maximum(low - np.min(path) - turns, 0.0) + np.maximum(np.max(path) + turns - high, 0.0)
            path = path + turns[np.lexsort((np.abs(path[0] + turns), outside))[0]]
        return float(path[0]), float(path[-1])

    def time_s(self, ends_rad: Array, starts_rad: Array) -> Array:
        """Return the time between directions (..., 2), azimuth and elevation; without ends azimuth by the shorter way."""
        azimuth, elevation = np.moveaxis(np.abs(starts_rad - ends_rad), -1, 0)
        if not self.travel_rad:
            azimuth = np.abs(np.mod(azimuth + np.pi, _TURN) - np.pi)
        time: Array = np.maximum(azimuth, elevation) / self.rate_rad_s + self.settle_s
        return time

    def allows(self, one: CandidatePass, other: CandidatePass) -> bool:
        """Return whether one antenna can track both."""
        first, then = sorted((one, other), key=lambda candidate: candidate.start_t_s)
        end = np.array([self.ends_rad(first.track.azimuth_rad)[1], first.track.elevation_rad[-1]])
        start = np.array([self.ends_rad(then.track.azimuth_rad)[0], then.track.elevation_rad[0]])
        return bool(then.start_t_s - first.end_t_s >= self.time_s(end, start))


@dataclass(frozen=True, eq=False)
class Campaign:
    """Passes to track in order of time, what they fill, and when the last sector is full (None: never)."""

    passes: tuple[CandidatePass, ...]
    coverage: Coverage
    full_at_t_s: float | None


def plan_campaign(
    candidates: Sequence[CandidatePass], rule: SectorRule, slew: Slew, already: Counts | None = None
) -> Campaign:
    """Return the campaign; candidates may be whole passes or pieces of them.

    `already` (sectors,) are the points that an interrupted campaign has taken; the coverage counts them.  Where the
    candidates cannot fill the sky, all useful passes are returned, `full_at_t_s` is None and the coverage names the thin
    sectors.
    """
    begun = np.zeros(rule.count, dtype=np.int64) if already is None else already
    if not candidates:
        return Campaign((), Coverage(rule, begun), None)
    table = _Table(sorted(candidates, key=lambda c: c.end_t_s), rule, slew, begun)
    plans = [table.by_exchange(), table.by_rate()]
    taken, filled, full_at = min(plans, key=lambda plan: (plan[2] or math.inf, -table.gain(begun, plan[1] - begun)))
    if full_at is not None:
        taken, filled = table.without_needless(taken, filled)
    return Campaign(tuple(table.candidates[k] for k in taken), Coverage(rule, filled), full_at)


class _Table:
    """Times, directions at both ends, and points per sector of all candidates, in order of their end."""

    def __init__(self, candidates: Sequence[CandidatePass], rule: SectorRule, slew: Slew, begun: Counts) -> None:
        self._begun = begun
        self.candidates, self._rule, self._slew = candidates, rule, slew
        tracks = [c.track for c in candidates]
        self._start = np.array([c.start_t_s for c in candidates])
        self._end = np.array([c.end_t_s for c in candidates])
        azimuth = np.array([slew.ends_rad(t.azimuth_rad) for t in tracks])
        elevation = np.array([(t.elevation_rad[0], t.elevation_rad[-1]) for t in tracks])
        self._from, self._to = np.moveaxis(np.stack([azimuth, elevation], axis=-1), 1, 0)
        self._counts = np.array([rule.coverage(t.azimuth_rad, t.elevation_rad).counts for t in tracks])

    def gain(self, filled: Counts, more: Counts) -> int:
        """Return how many points `more` brings where they are missing."""
        return int(self._gains(filled, more))

    def by_exchange(self) -> Plan:
        """Take candidates in order of their end, each in place of poorer ones that it overlaps."""
        taken: list[int] = []
        filled = self._begun
        for k in range(len(self.candidates)):
            ready = self._end[taken] + self._slew.time_s(self._to[taken], self._from[k])
            rivals = [other for other, t_s in zip(taken, ready, strict=True) if t_s > self._start[k]]
            theirs: Counts = np.sum(self._counts[rivals], axis=0, dtype=np.int64)
            without = filled - theirs
            if self.gain(without, self._counts[k]) <= self.gain(without, theirs):
                continue
            taken = [*(other for other in taken if other not in rivals), k]
            filled = without + self._counts[k]
            if self._full(filled):
                return taken, filled, float(self._end[k])
        return taken, filled, None

    def by_rate(self) -> Plan:
        """Go on with the candidate that brings most missing points per second."""
        taken: list[int] = []
        filled = self._begun
        now_s, ready = float(np.min(self._start)), np.full(len(self.candidates), -np.inf)
        while not self._full(filled):
            rate = self._gains(filled, self._counts) / np.maximum(self._end - now_s, 1e-9)
            rate[self._start < ready] = 0.0
            best = int(np.argmax(rate))
            if rate[best] <= 0.0:
                return taken, filled, None
            taken.append(best)
            filled = filled + self._counts[best]
            now_s = float(self._end[best])
            ready = now_s + self._slew.time_s(self._to[best], self._from)
        return taken, filled, now_s

    def without_needless(self, taken: list[int], filled: Counts) -> tuple[list[int], Counts]:
        """Strike out what the others make up for."""
        for k in sorted(taken, key=lambda k: int(np.sum(self._counts[k]))):
            reduced = filled - self._counts[k]
            if self._full(reduced):
                taken, filled = [other for other in taken if other != k], reduced
        return taken, filled

    def _full(self, filled: Counts) -> bool:
        return bool(np.all(filled >= self._rule.fewest))

    def _gains(self, filled: Counts, more: Counts) -> Counts:
        missing = np.maximum(self._rule.fewest - filled, 0)
        gains: Counts = np.sum(np.minimum(more, missing), axis=-1)
        return gains
