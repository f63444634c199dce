"""Which station of a network tracks which pass: an integer programme over all of them at once.

What one station decides by dynamic programming (`planning/schedule.py`: worth, strict priorities,
turns of the azimuth) several decide together, because a satellite has one owner at a time:

    maximise    sum worth x + reward of the contact that is owed
    subject to  sum x <= 1  over what excludes each other on a station (overlap, slew)
                sum x <= 1  over the options of one target that last at the same time

x is 0 or 1 for each option and turn of the azimuth.  Pairs that exclude each other are gathered in
cliques, without which the bound of the linear programme is of no use.  HiGHS solves it and bounds
how far the choice is from the best one.
"""

import math
from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.core.types import Array, BoolArray, IntArray
from rf_pointing.planning.limits import AxisRates
from rf_pointing.planning.schedule import Candidate, turn_s

# Worth of a second of contact that a target is owed: a short high pass has less per second.
OWED_WORTH_S = 0.02
# A part that begins so near to where the part before it ends goes on without a slew.
CONTINUED_RAD = 1e-3
# Longest time of the solver, and the share of the bound at which its search ends.
SOLVING_S, WITHIN = 20.0, 1e-4
# With more nodes only those are integers that cost a plan of fractions at most so much.
MANY_NODES, NEAR_WORTH = 3000, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """A pass, or a part of it, that one station could track.

    Options of one `target` have one owner at a time.  Parts of one pass over one station share
    `whole`: where one ends another goes on.
    """

    candidate: Candidate
    station: int
    target: Hashable
    whole: Hashable


@dataclass(frozen=True, slots=True, kw_only=True)
class Owed:
    """Contact that a target is owed between two times, in s."""

    target: Hashable
    begin_t_s: float
    end_t_s: float
    least_s: float


@dataclass(frozen=True, slots=True)
class Assignment:
    """Options to track in order of rise, and the largest share by which a plan could be better.

    `better_by` is infinite where the time has not sufficed for a bound.
    """

    taken: tuple[int, ...]
    better_by: float


class Programme:
    """The choice among options of the stations of `axes`, as rows sum x <= 1 over their nodes.

    A node is an option with one of its turns; `gap_s` is kept between two passes of a station
    besides the slew.
    """

    def __init__(self, options: Sequence[Option], axes: Sequence[AxisRates], gap_s: float = 0.0) -> None:
        from scipy.sparse import csr_array

        self._options, self._gap_s, self._axes = options, gap_s, axes
        nodes = [(k, turn) for k, one in enumerate(options) for turn in range(len(one.candidate.turns))]
        self._number = np.array([k for k, _ in nodes], dtype=np.int64)
        ends = [options[k].candidate.turns[turn] for k, turn in nodes]
        self._from_rad, self._to_rad = (np.array([each[side] for each in ends]) for side in (0, 1))
        of = [options[k].candidate for k, _ in nodes]
        self._begin_s, self._end_s = (np.array([getattr(one, f"{name}_t_s") for one in of]) for name in ("aos", "los"))
        self._worth, self._priority = (np.array([getattr(one, name) for one in of]) for name in ("worth", "priority"))
        numbers: dict[Hashable, int] = {}
        wholes = [(options[k].station, options[k].whole) for k, _ in nodes]
        self._whole = np.array([numbers.setdefault(whole, len(numbers)) for whole in wholes])
        cliques = [clique for group in self._groups("station") for clique in self._exclusive(group)]
        owners = self._groups("target")
        cliques += [clique for group in owners for clique in _at_once(group, self._begin_s, self._end_s)]
        columns = np.concatenate([np.array([], dtype=np.int64), *cliques])
        rows = np.repeat(np.arange(len(cliques)), [len(clique) for clique in cliques])
        self._rows = csr_array((np.ones(len(columns)), (rows, columns)), shape=(len(cliques), len(nodes)))

    def assign(
        self, *, owed: Sequence[Owed] = (), held: Collection[int] = (),
        barred: Collection[int] = (), solving_s: float = SOLVING_S,
    ) -> Assignment:  # fmt: skip
        """Return which options the stations track.

        Parameters
        ----------
        owed : contact that comes before the worth of passes, within their priority.
        held : options that are taken in any case; they must not exclude each other.
        barred : options that are not taken.
        solving_s : longest time of the solver for all priorities together.
        """
        better_by, taken = 0.0, set(held)
        levels = sorted(set(self._priority.tolist()), reverse=True)
        usable = ~np.isin(self._number, list(barred))
        for priority in levels:
            level = usable & (self._priority == priority)
            mine = [each for each in owed if any(self._options[k].target == each.target for k in self._number[level])]
            chosen, share = self._solved(level, taken, mine, solving_s / len(levels))
            better_by, taken = max(better_by, share), taken | chosen
        return Assignment(tuple(sorted(taken, key=lambda k: self._options[k].candidate.aos_t_s)), better_by)

    def _groups(self, of: str) -> list[IntArray]:
        """Return the nodes of each station or target, in order of rise."""
        found: dict[Hashable, list[int]] = {}
        for node in np.lexsort((self._end_s, self._begin_s)).tolist():
            found.setdefault(getattr(self._options[self._number[node]], of), []).append(node)
        return [np.array(group) for group in found.values()]

    def _exclusive(self, group: IntArray) -> Iterator[IntArray]:
        """Give the cliques of nodes of one station: at once, or without time to turn between."""
        yield from _at_once(group, self._begin_s, self._end_s)
        axes = self._axes[self._options[self._number[group[0]]].station]
        places = np.concatenate([self._from_rad[group], self._to_rad[group]])
        longest_s = self._gap_s + float(turn_s(axes, places.min(axis=0), places.max(axis=0)))
        begins, by_end = self._begin_s[group], group[np.argsort(self._end_s[group], kind="stable")]
        ends, seen = self._end_s[by_end], set[tuple[int, ...]]()
        for node in by_end.tolist():
            end_s = self._end_s[node]
            near = group[np.searchsorted(begins, end_s) : np.searchsorted(begins, end_s + longest_s)]
            after = near[self._too_near(np.array([node]), near, axes)[0]]
            while len(after):
                # Those that last when the latest of them begins exclude each other.
                together = after[self._end_s[after] > self._begin_s[after[-1]]]
                after = after[self._end_s[after] <= self._begin_s[after[-1]]]
                before = by_end[np.searchsorted(ends, end_s) :]
                before = before[self._begin_s[before] < end_s]
                whole = self._too_near(before, together, axes).all(axis=1)
                clique = np.unique([node, *before[whole], *together])
                if (key := tuple(clique.tolist())) not in seen:
                    seen.add(key)
                    yield clique

    def _too_near(self, first: IntArray, then: IntArray, axes: AxisRates) -> BoolArray:
        """Return (m, n) where a node of `then` begins before the antenna is there from `first`."""
        distance = np.abs(self._from_rad[then] - self._to_rad[first][:, None])
        needed_s = self._gap_s + turn_s(axes, self._to_rad[first][:, None], self._from_rad[then])
        goes_on = (self._whole[first][:, None] == self._whole[then]) & (
            self._end_s[first][:, None] == self._begin_s[then]
        )
        needed_s[goes_on & (distance.max(axis=-1) < CONTINUED_RAD)] = 0.0
        return np.asarray(self._begin_s[then] < self._end_s[first][:, None] + needed_s)

    def _solved(
        self, free: BoolArray, fixed: Collection[int], owed: Sequence[Owed], solving_s: float
    ) -> tuple[set[int], float]:
        """Return the options taken of `free` nodes, and by what share a plan could be better."""
        from scipy.optimize import Bounds, LinearConstraint, linprog, milp
        from scipy.sparse import csr_array, hstack, vstack

        held = np.isin(self._number, list(fixed))
        nodes = np.flatnonzero(free | held)
        count, names, which = len(owed), *np.unique(self._number[held], return_inverse=True)
        once = csr_array((np.ones(len(which)), (which, np.flatnonzero(held))), shape=(len(names), len(held)))
        contact = np.array([self._contact_s(each) for each in owed]).reshape(count, len(held))
        # One column more for each contact owed: the seconds of it that are given.
        given = csr_array(np.eye(count).reshape(count, count))
        rows, equal = self._rows[:, nodes], once[:, nodes]
        rows = rows[np.diff(rows.indptr) > 1]
        if count:
            ones, none = csr_array((rows.shape[0], count)), csr_array((len(names), count))
            rows = vstack([hstack([rows, ones]), hstack([-csr_array(contact[:, nodes]), given])]).tocsr()
            equal = hstack([equal, none]).tocsr()
        high = np.concatenate([np.ones(rows.shape[0] - count), np.zeros(count)])
        value = np.concatenate([np.where(held, 0.0, self._worth)[nodes], np.full(count, OWED_WORTH_S)])
        most = np.concatenate([np.ones(len(nodes)), [each.least_s for each in owed]])
        bound, columns = math.inf, np.arange(len(value))
        if len(nodes) > MANY_NODES:
            found = linprog(
                -value, A_ub=rows, b_ub=high, A_eq=equal, b_eq=np.ones(len(names)),
                bounds=np.column_stack([np.zeros(len(value)), most]), method="highs-ds",
            )  # fmt: skip
            if found.x is not None:
                bound = -float(found.fun)
                # What a node would cost the plan.  The best plan hardly holds one that costs much.
                cost = -value - rows.T @ found.ineqlin.marginals - equal.T @ found.eqlin.marginals
                near = (found.x > 1e-6) | (cost <= NEAR_WORTH)
                columns = np.flatnonzero(near | (np.arange(len(value)) >= len(nodes)))
        once = LinearConstraint(equal[:, columns], 1.0, 1.0)
        limits = [once, LinearConstraint(rows[:, columns], -np.inf, high)]
        for sums in (each.A for each in limits):
            # HiGHS of scipy 1.11 takes indices of 32 bits.
            sums.indices, sums.indptr = sums.indices.astype(np.int32), sums.indptr.astype(np.int32)
        found = milp(
            -value[columns], integrality=(columns < len(nodes)).astype(int), bounds=Bounds(0.0, most[columns]),
            constraints=[each for each in limits if each.A.shape[0]],
            options={"time_limit": solving_s, "mip_rel_gap": WITHIN},
        )  # fmt: skip
        if found.x is None:
            return self._one_by_one(free | held, held), math.inf
        best = -float(found.fun)
        if len(columns) == len(value) and found.mip_dual_bound is not None:
            bound = min(bound, -float(found.mip_dual_bound))
        taken = nodes[columns[(found.x > 0.5) & (columns < len(nodes))]]
        return set(self._number[taken].tolist()), max(0.0, bound - best) / max(best, 1e-9) if bound > 1e-9 else 0.0

    def _contact_s(self, owed: Owed) -> Array:
        mine = np.array([self._options[k].target == owed.target for k in self._number])
        shared_s = np.minimum(self._end_s, owed.end_t_s) - np.maximum(self._begin_s, owed.begin_t_s)
        return np.where(mine, np.maximum(shared_s, 0.0), 0.0)

    def _one_by_one(self, free: BoolArray, held: BoolArray) -> set[int]:
        """Return a choice by falling worth, where the solver has found none in its time."""
        columns, used, taken = self._rows.tocsc(), np.zeros(self._rows.shape[0]), set[int]()
        for node in np.lexsort((-self._worth, ~held)):
            rows = columns.indices[columns.indptr[node] : columns.indptr[node + 1]]
            if free[node] and not used[rows].any():
                used[rows] = 1.0
                taken.add(int(self._number[node]))
        return taken


def _at_once(group: IntArray, begin_s: Array, end_s: Array) -> Iterator[IntArray]:
    """Give the largest sets of nodes, in order of rise, that last at one time."""
    ends = np.sort(end_s[group])
    begins = begin_s[group]
    for place in range(len(group)):
        # Where the next one begins before any ends, its set contains this one.
        following = begins[place + 1] if place + 1 < len(group) else np.inf
        next_end = ends[np.searchsorted(ends, begins[place], side="right")]
        if following < next_end:
            continue
        lasting = group[: place + 1][end_s[group[: place + 1]] > begins[place]]
        if len(lasting) > 1:
            yield lasting
