"""Which of many passes one antenna tracks: conflicts, turns between passes, and who yields to whom.

Priorities are strict: passes of a lower one take only the time that higher ones leave.  Within one
priority the plan has the largest sum of

    worth = share * (0.2 + sin(peak elevation))

so of two passes that exclude each other the higher one is taken, and two that peak at 20 deg are
worth as much as one at 62 deg.  The share is what is likely to be received of a pass.
The sum is maximised exactly, by dynamic programming over the passes in order of rise; every turn of
the azimuth travel at which a pass fits is a node of its own, so the antenna is unwound where there
is time for it.  Turns are straight, from rest to rest at the rates of the axes.
"""

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.core.types import TURN, Array, Pair
from rf_pointing.planning.limits import AxisLimits, AxisRates

# What a pass counts however low it is.  With much more a day of short passes near the horizon would
# beat every high one, with nothing a low pass of another satellite would never be wanted.
_COUNT_WORTH = 0.2
# Turning decides between equally good plans: a whole day of it counts less than a pass.
_TURNING_WORTH = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One pass that could be tracked, with the axis positions at its ends for each turn that fits.

    `turns` holds pairs of start and end, each azimuth and elevation.
    """

    name: str
    aos_t_s: float
    los_t_s: float
    peak_rad: float
    priority: float
    turns: tuple[tuple[Pair, Pair], ...]
    share: float = 1.0
    """Share of the worth that counts: of a part of a pass, below clouds, or with old elements."""

    @property
    def worth(self) -> float:
        """Worth of the pass among those of its priority."""
        return self.share * (_COUNT_WORTH + math.sin(self.peak_rad))


Chain = list[tuple[Candidate, int]]
"""Passes in order of time, each with the number of its turn."""


def turns_within(
    limits: AxisLimits, azimuth_path_rad: tuple[float, float, float, float], elevation_rad: Pair,
    mount: Kinematics = LEVEL,
) -> tuple[tuple[Pair, Pair], ...]:  # fmt: skip
    """Return the axis positions at both ends of a pass for each turn that fits the azimuth travel.

    `azimuth_path_rad` holds the azimuth at the start, the smallest, the largest and that at the
    end, continuous over the pass.  An elevation axis that reaches beyond the zenith adds the
    plunged positions.  Of another `mount` the lower axis takes the place of the azimuth.
    """
    begin, low, high, end = azimuth_path_rad
    if not mount.level:
        # What lies between both ends is for the certificate to judge.
        places = zip((begin, end), elevation_rad, strict=True)
        (begin, rise), (end, set_) = (mount.axes_at(*place) for place in places)
        begin, end = math.remainder(begin, TURN), math.remainder(end, TURN)
        low, high, elevation_rad = min(begin, end), max(begin, end), (rise, set_)
    sides = [(0.0, elevation_rad)]
    if math.pi - min(elevation_rad) <= limits.elevation_max_rad:
        sides.append((math.pi, (math.pi - elevation_rad[0], math.pi - elevation_rad[1])))
    return tuple(
        ((begin + over + k * TURN, rise), (end + over + k * TURN, set_))
        for over, (rise, set_) in sides
        for k in range(
            math.ceil((limits.azimuth_min_rad - low - over) / TURN),
            math.floor((limits.azimuth_max_rad - high - over) / TURN) + 1,
        )
    )


def schedule(
    candidates: Sequence[Candidate], axes: AxisRates, start: tuple[float, Pair], gap_s: float = 0.0,
    known: dict[tuple[bytes, bytes], tuple[list[Candidate], Chain]] | None = None,
) -> list[tuple[int, int]]:  # fmt: skip
    """Return, in order of time, the passes to track and their turns, as numbers of both.

    The antenna is at rest at `start`, UTC in s and the position of the axes; `gap_s` is kept
    between two passes in addition to the turn.  `known` keeps the best chain of each priority for
    later calls with the same axes, start and gap: most of them change a few passes of one.
    """
    known = {} if known is None else known
    chosen: Chain = []
    for priority in sorted({one.priority for one in candidates}, reverse=True):
        rank = [one for one in candidates if one.priority == priority and one.turns]
        fixed = [one for one, _ in chosen]
        key = _identity(rank), _identity(fixed)
        if key not in known:
            # With the candidates: others must not come to their places in memory.
            known[key] = [*rank, *fixed], _best_chain(rank, fixed, axes, start, gap_s)
        chosen = known[key][1]
    numbers = {id(one): k for k, one in enumerate(candidates)} if chosen else {}
    return [(numbers[id(one)], turn) for one, turn in chosen]


def _identity(candidates: Sequence[Candidate]) -> bytes:
    return np.fromiter(map(id, candidates), np.int64, len(candidates)).tobytes()


def reasons_against(
    candidates: Sequence[Candidate], tracked: Sequence[tuple[int, int]], axes: AxisRates,
    start: tuple[float, Pair], gap_s: float = 0.0,
) -> dict[int, str]:  # fmt: skip
    """Return why each candidate with a turn is not in the result `tracked` of `schedule`."""
    reasons, kept = _Reasons(candidates, tracked, axes, start, gap_s), {k for k, _ in tracked}
    return {k: reasons.of(one) for k, one in enumerate(candidates) if k not in kept and one.turns}


def turn_s(axes: AxisRates, start: Array, end: Array) -> Array:
    """Return the time (n,) from rest to rest between positions (n, 2), both axes at once."""
    distance, rate = np.abs(end - start), np.array(axes.rate_rad_s)
    acceleration = np.array(axes.acceleration_rad_s2)
    short = 2.0 * np.sqrt(distance / acceleration)
    return np.asarray(
        np.where(distance < rate**2 / acceleration, short, distance / rate + rate / acceleration).max(axis=-1)
    )


def _best_chain(
    free: Sequence[Candidate], fixed: Sequence[Candidate], axes: AxisRates, start: tuple[float, Pair], gap_s: float
) -> Chain:
    """Return all of `fixed` (in order of time) and those of `free` that make the best plan."""
    # Node 0 is the antenna at rest; the rest are the turns of the passes in order of rise.
    order = sorted([*free, *fixed], key=lambda one: (one.aos_t_s, one.los_t_s))
    nodes = [(k, turn) for k, one in enumerate(order) for turn in range(len(one.turns))]
    numbers, turns = np.array([(-1, 0), *nodes]).T
    begins = np.array([start[0], *(order[k].aos_t_s for k, _ in nodes)])
    ends = np.array([start[0], *(order[k].los_t_s for k, _ in nodes)])
    from_rad = np.array([start[1], *(order[k].turns[turn][0] for k, turn in nodes)])
    to_rad = np.array([start[1], *(order[k].turns[turn][1] for k, turn in nodes)])
    worths = [one.worth for one in order]
    worth = np.array([0.0, *(worths[k] for k, _ in nodes)])
    # The level is how many fixed passes a plan has behind it: a plan may not go past one of them.
    kept = set(map(id, fixed))
    held = np.array([False, *(id(order[k]) in kept for k, _ in nodes)])
    rises = np.array([one.aos_t_s for one in fixed])
    level = np.searchsorted(rises, begins, side="right")
    needed = level - held
    sets = np.argsort(ends, kind="stable")
    places = np.concatenate([from_rad, to_rad])
    longest_s = gap_s + float(turn_s(axes, places.min(axis=0), places.max(axis=0)))
    best, before = np.full(len(numbers), -np.inf), np.full(len(numbers), -1)
    best[0] = 0.0
    # Plans that end long enough ago for any turn: the best of each level is enough.
    rested: dict[int, int] = {}
    old = near = 0
    # The turns of one pass follow on each other.
    firsts = (np.flatnonzero(np.diff(numbers)) + 1).tolist()
    for first, last in itertools.pairwise([*firsts, len(numbers)]):
        begin_s = begins[first]
        while old < len(sets) and ends[sets[old]] <= begin_s - longest_s:
            node, old = int(sets[old]), old + 1
            if best[node] > best[rested.get(int(level[node]), node)] or int(level[node]) not in rested:
                rested[int(level[node])] = node
        near = max(near, old)
        while near < len(sets) and ends[sets[near]] <= begin_s:
            near += 1
        window = sets[old:near]
        window = window[level[window] == needed[first]]
        rest = rested.get(int(needed[first]))
        if rest is not None:
            # A partial plan worth less than one that already rests cannot become the best.
            window = np.append(window[best[window] > best[rest] - _TURNING_WORTH * longest_s], rest)
        if not len(window):
            continue
        turning = turn_s(axes, to_rad[window], from_rad[first:last, np.newaxis])
        # The antenna at rest needs no gap: nothing is tracked before.
        apart = np.where(window == 0, 0.0, gap_s)
        in_time = ends[window] + turning + apart <= begin_s
        value = np.where(in_time, best[window] - _TURNING_WORTH * turning, -np.inf)
        k = np.argmax(value, axis=1)
        best[first:last], before[first:last] = worth[first:last] + value.max(axis=1), window[k]
    # Without a free pass the antenna's own node, or the plan of the fixed ones, is complete.
    complete = np.flatnonzero(level == len(fixed))
    node, chain = int(complete[np.argmax(best[complete])]), Chain()
    while node > 0:
        chain.append((order[numbers[node]], int(turns[node])))
        node = int(before[node])
    return chain[::-1]


class _Reasons:
    """Why passes are not tracked, against the passes that are."""

    def __init__(
        self, candidates: Sequence[Candidate], tracked: Sequence[tuple[int, int]], axes: AxisRates,
        start: tuple[float, Pair], gap_s: float,
    ) -> None:  # fmt: skip
        self._tracked = [(candidates[k], candidates[k].turns[turn]) for k, turn in tracked]
        self._begins = [one.aos_t_s for one, _ in self._tracked]
        self._axes, self._start, self._gap_s = axes, start, gap_s

    def of(self, one: Candidate) -> str:
        """Return the reason against one candidate."""
        # Tracked passes do not overlap, so those in conflict with one are neighbours.
        last = first = bisect.bisect_left(self._begins, one.los_t_s)
        while first > 0 and self._tracked[first - 1][0].los_t_s > one.aos_t_s:
            first -= 1
        # One of a lower priority only takes the time that this one had to leave.
        others = [other for other, _ in self._tracked[first:last] if other.priority >= one.priority]
        if others:
            return "overlaps " + " and ".join(_overlap(one, other) for other in others) + _why(one, others)
        return self._turning(one)

    def _turning(self, one: Candidate) -> str:
        """Return the two passes between which the antenna cannot slew in time."""
        held = [pair for pair in self._tracked if pair[0].priority >= one.priority]
        before = [pair for pair in held if pair[0].los_t_s <= one.aos_t_s]
        after = [pair for pair in held if pair[0].aos_t_s >= one.los_t_s]
        origin, since_s, place, gap_s = "where the antenna is at the start", *self._start, 0.0
        if before:
            last, turn = before[-1]
            origin, since_s, place, gap_s = last.name, last.los_t_s, turn[1], self._gap_s
        legs = [(f"from {origin}", since_s, one.aos_t_s, gap_s, [(place, turn[0]) for turn in one.turns])]
        if after:
            following, turn = after[0]
            pairs = [(mine[1], turn[0]) for mine in one.turns]
            legs.append((f"to {following.name}", one.los_t_s, following.aos_t_s, self._gap_s, pairs))
        short = []
        for name, begin_s, end_s, apart_s, pairs in legs:
            needed_s = apart_s + min(self._axes.slew_s(*pair) for pair in pairs)
            if needed_s > end_s - begin_s:
                short.append(f"{name}: {needed_s:.0f} s are needed and {end_s - begin_s:.0f} s are free")
        # Each of the two could be in time, but not on one and the same turn.
        return "no time to turn " + " and ".join(short or [f"on one turn {' and '.join(leg[0] for leg in legs)}"])


def _overlap(one: Candidate, other: Candidate) -> str:
    shared_s = min(one.los_t_s, other.los_t_s) - max(one.aos_t_s, other.aos_t_s)
    return f"{other.name} for {shared_s:.0f} s"


def _why(one: Candidate, others: Sequence[Candidate]) -> str:
    highest = max(other.priority for other in others)
    own, other = _stated(one.priority), _stated(highest)
    if highest > one.priority:
        lends = f": what stays up for long lends its time to passes of its priority {own}"
        return lends if own == other else f": priority {other} is above {own}"
    peak, best = math.degrees(one.peak_rad), math.degrees(max(other.peak_rad for other in others))
    if len(others) == 1 and best >= peak:
        return f": of equal priority {own} the higher peak, {best:.1f} deg against {peak:.1f} deg"
    # It peaks higher and yields all the same: it would exclude more than the one that it meets, or
    # its elements are older.
    return f": of equal priority {own} the plan with more passes, or higher or better known ones"


def _stated(priority: float) -> str:
    # What stays up for long ranks half a step below the passes of its priority.
    return f"{math.ceil(priority) if math.isfinite(priority) else priority:g}"
