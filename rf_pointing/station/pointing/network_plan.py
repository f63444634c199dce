"""Which antenna of a network tracks which target when: the plan of each, with one owner at a time.

The passes over every antenna are those of its own plan (`multi_satellite_plan`).  Where a target is
over two of them it may be handed over, when it comes to be higher over the second one: passes are
cut into parts there, and a part counts the share of the pass's worth that its time and height have.
`planning/network.py` chooses among all parts together.  What is chosen goes through the schedule of
each antenna, which picks the turns, and through its certificates; what no branch works for is
barred, and the choice is made again.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from rf_pointing.core import DAY_S, Pair
from rf_pointing.ephemeris import CataloguePass
from rf_pointing.planning import Candidate
from rf_pointing.planning.network import Option, Owed, Programme
from rf_pointing.station.pointing.multi_satellite_plan import (
    LONG_S,
    AntennaDay,
    DayPlan,
    PlannedAntenna,
    Wish,
    turns_of,
)

# A pass is not cut nearer to its ends, nor to another cut.
SHORTEST_PART_S = 120.0
HANDOVER_POINTS, PART_STEP_S, MOST_PART_POINTS = 25, 10.0, 2000
# The pieces of a stay are cut at the ends of each other while there are so few of them.
FEW_PIECES = 60
# In a plan of more options what is further in time from a barred pass is not chosen again.
MANY_OPTIONS, APART_S = 3000, 3600.0
# Time at the horizon counts so much, next to the sine of the elevation.
COUNT_WORTH = 0.2


@dataclass(frozen=True, kw_only=True)
class NetworkDay:
    """The plan of each antenna, and the largest share by which the choice could be better.

    `visible` are the passes over each antenna, before they are cut.
    """

    days: tuple[DayPlan, ...]
    better_by: float
    visible: tuple[tuple[CataloguePass, ...], ...]


@dataclass(frozen=True)
class _Part:
    """A part of pass `number` over one antenna."""

    antenna: int
    number: int
    window: CataloguePass
    candidate: Candidate


def plan_days(
    wishes: Sequence[Wish], antennas: Sequence[PlannedAntenna], start_t_s: float, duration_s: float,
    *, names: Sequence[str], clear: Sequence[float], gap_s: float = 0.0,
    max_age_s: float = 14.0 * DAY_S,
) -> NetworkDay:  # fmt: skip
    """Return the plan of antennas that rest at the start.

    Parameters
    ----------
    names : of the antennas, for the reasons.
    clear : probability of a sky through which each of them receives: passes count so much.
    """
    offers = [_offered(wishes, antenna) for antenna in antennas]
    days = [
        AntennaDay(mine, antenna, start_t_s, duration_s, gap_s=gap_s, max_age_s=max_age_s)
        for mine, antenna in zip(offers, antennas, strict=True)
    ]
    lasting = set[int]().union(*(day.lasting for day in days))
    for day in days:
        day.share(lasting)
    visible = tuple(tuple(day.wanted) for day in days)
    owed = [
        Owed(target=id(wish.target), begin_t_s=begin_s, end_t_s=min(begin_s + DAY_S, start_t_s + duration_s),
             least_s=wish.contact_s * min(1.0, (start_t_s + duration_s - begin_s) / DAY_S))
        for wish in wishes if wish.contact_s > 0.0
        for begin_s in np.arange(start_t_s, start_t_s + duration_s - 1.0, DAY_S).tolist()
    ]  # fmt: skip
    network = _Network(days, names, clear, gap_s, owed, lasting)
    better_by = 0.0
    while True:
        better_by = max(better_by, network.choose())
        long = [(k, number) for k, day in enumerate(days) for number in day.long_in_part()]
        if not long:
            planned = tuple(day.plan(mine) for day, mine in zip(days, network.reasons(), strict=True))
            return NetworkDay(days=planned, better_by=better_by, visible=visible)
        # The most wanted ones first: what they leave is left to the next ones.
        highest = max(days[k].rank(number)[0] for k, number in long)
        for k, day in enumerate(days):
            day.cut([n for each, n in long if each == k and day.rank(n)[0] == highest])


def _offered(wishes: Sequence[Wish], antenna: PlannedAntenna) -> list[Wish]:
    """Return the wishes whose band the antenna has."""
    return [wish for wish in wishes if not wish.band or wish.band in antenna.of_band]


class _Network:
    """The parts of all passes, and those that are tracked."""

    def __init__(
        self, days: Sequence[AntennaDay], names: Sequence[str], clear: Sequence[float], gap_s: float,
        owed: Sequence[Owed], lasting: set[int],
    ) -> None:  # fmt: skip
        self._days, self._names, self._clear = days, names, clear
        self._gap_s, self._owed, self._lasting = gap_s, owed, lasting
        self._axes = [day.antenna.rules.machine.axes for day in days]
        self._chosen: list[tuple[int, _Part]] = []
        self._whole: dict[tuple[int, int, float, float], CataloguePass] = {}
        # With their passes: others must not come to their places in memory.
        self._higher: dict[tuple[int, int], tuple[CataloguePass, CataloguePass, float]] = {}
        self._cut: dict[tuple[int, tuple[float, ...]], tuple[CataloguePass, list[Candidate]]] = {}

    def choose(self) -> float:
        """Choose until no pass of the choice is barred; return by what share it could be better."""
        parts, better_by = self._parts(), 0.0
        programme = self._programme(parts)
        self._whole, held, barred = {}, set[int](), set[int]()
        while True:
            found = programme.assign(owed=self._owed, held=held, barred=barred)
            better_by = max(better_by, found.better_by)
            taken = [k for k in found.taken if k < len(parts)]
            self._chosen = [(k, parts[k]) for k in taken]
            failed = self._certified()
            if not failed:
                return better_by
            barred |= failed
            spans = [(parts[k].window.aos_t_s, parts[k].window.los_t_s) for k in failed]
            many = len(parts) > MANY_OPTIONS
            held = {k for k in taken if many and k not in failed and _apart(parts[k].window, spans)}

    def _parts(self) -> list[_Part]:
        """Return all passes, in parts where they may be handed over."""
        cuts = self._handovers()
        found = []
        for k, day in enumerate(self._days):
            for number, (window, candidate) in enumerate(zip(day.wanted, day.candidates(), strict=True)):
                candidate = dataclasses.replace(candidate, share=candidate.share * self._clear[k])
                lasts = id(window.target) in self._lasting
                first_s, last_s = window.aos_t_s + SHORTEST_PART_S, window.los_t_s - SHORTEST_PART_S
                inside = [t_s for t_s in cuts.get(id(window.target), ()) if first_s <= t_s <= last_s]
                pieces = [candidate]
                if candidate.turns and (inside or lasts):
                    key = id(window), tuple(inside)
                    if key not in self._cut:
                        self._cut[key] = window, _pieces(day, window, candidate, inside, lasts)
                    pieces = self._cut[key][1]
                for one in pieces:
                    part = dataclasses.replace(window, aos_t_s=one.aos_t_s, los_t_s=one.los_t_s)
                    found.append(_Part(k, number, part, one))
        return found

    def _handovers(self) -> dict[int, list[float]]:
        """Return the times by target at which it comes to be higher over another antenna."""
        of: dict[int, list[tuple[int, CataloguePass]]] = {}
        for k, day in enumerate(self._days):
            for window in day.wanted:
                of.setdefault(id(window.target), []).append((k, window))
        cuts: dict[int, list[float]] = {}
        for target, windows in of.items():
            windows.sort(key=lambda each: each[1].aos_t_s)
            times = []
            for place, (k, window) in enumerate(windows):
                for other, later in itertools.islice(windows, place + 1, None):
                    if later.aos_t_s >= window.los_t_s:
                        break
                    if other != k and later.los_t_s > window.los_t_s:
                        key = id(window), id(later)
                        if key not in self._higher:
                            from_s = self._higher_from(k, window, other, later)
                            self._higher[key] = window, later, from_s
                        times.append(self._higher[key][2])
            if target in self._lasting and len(windows) <= FEW_PIECES:
                # Another antenna may fill what the pieces of a stay leave between them.
                times += [t_s for _, one in windows for t_s in (one.aos_t_s, one.los_t_s)]
            kept: list[float] = []
            for t_s in sorted(times):
                if not kept or t_s - kept[-1] >= SHORTEST_PART_S:
                    kept.append(t_s)
            cuts[target] = kept
        return cuts

    def _higher_from(self, k: int, window: CataloguePass, other: int, later: CataloguePass) -> float:
        times = np.linspace(later.aos_t_s, window.los_t_s, HANDOVER_POINTS)
        first, then = (self._days[each].look(one, times)[1] for each, one in ((k, window), (other, later)))
        above = then - first
        crossed = np.flatnonzero((above[:-1] < 0.0) & (above[1:] >= 0.0))
        if not len(crossed):
            return float(0.5 * (times[0] + times[-1]))
        place = int(crossed[0])
        share = above[place] / (above[place] - above[place + 1])
        return float(times[place] + share * (times[place + 1] - times[place]))

    def _programme(self, parts: Sequence[_Part]) -> Programme:
        options = [
            Option(candidate=one.candidate, station=one.antenna, target=id(one.window.target), whole=one.number)
            for one in parts
        ]
        for k, day in enumerate(self._days):
            start_s, place = day.rest
            # A rest that ends a gap before the start: the antenna needs none to its first pass.
            rest = Candidate(
                name="start", aos_t_s=start_s - self._gap_s - 1.0, los_t_s=start_s - self._gap_s, peak_rad=0.0,
                priority=math.inf, turns=((place, place),),
            )  # fmt: skip
            options += [
                Option(candidate=one, station=k, target=(one.name, k, one.aos_t_s), whole=one.name)
                for one in (rest, *day.waits)
            ]
        return Programme(options, self._axes, self._gap_s)

    def _certified(self) -> set[int]:
        """Certify what is chosen, antenna by antenna; return the numbers of the parts that fail."""
        failed = set[int]()
        for k, day in enumerate(self._days):
            runs = self._runs(k)
            windows = [self._window(k, [one for _, one in run]) for run in runs]
            numbers = [run[0][1].number for run in runs]
            mine = list(zip(numbers, windows, strict=True))
            kept, reasons = day.take(mine, [day.candidate(window) for window in windows])
            # Parts know the azimuth at their ends only; the schedule of the antenna knows it all.
            reasons |= {n: "no time to turn to it" for n in range(len(runs)) if n not in kept}
            failed |= {place for n in reasons for place, _ in runs[n]}
            day.barred |= {numbers[n]: reasons[n] for n in reasons if windows[n] is day.wanted[numbers[n]]}
        return failed

    def _runs(self, k: int) -> list[list[tuple[int, _Part]]]:
        """Return the chosen parts over one antenna, those that follow on each other together."""
        runs: list[list[tuple[int, _Part]]] = []
        for place, one in (each for each in self._chosen if each[1].antenna == k):
            last = runs[-1][-1][1] if runs else None
            if last and (last.number, last.window.los_t_s) == (one.number, one.window.aos_t_s):
                runs[-1].append((place, one))
            else:
                runs.append([(place, one)])
        return runs

    def _window(self, k: int, run: Sequence[_Part]) -> CataloguePass:
        key = k, run[0].number, run[0].window.aos_t_s, run[-1].window.los_t_s
        if key not in self._whole:
            day = self._days[k]
            self._whole[key] = day.part(day.wanted[run[0].number], key[2], key[3])
        return self._whole[key]

    def reasons(self) -> list[dict[int, str]]:
        """Return for each antenna why it leaves passes to others."""
        owners: dict[int, list[tuple[int, CataloguePass]]] = {}
        for k, day in enumerate(self._days):
            for _, window, *_ in day.certified:
                owners.setdefault(id(window.target), []).append((k, window))
        found = []
        for k, day in enumerate(self._days):
            mine = day.reasons()
            for number in mine:
                window = day.wanted[number]
                others = {
                    self._names[other] for other, one in owners.get(id(window.target), ())
                    if other != k and one.aos_t_s < window.los_t_s and one.los_t_s > window.aos_t_s
                }  # fmt: skip
                if others:
                    mine[number] = f"tracked by {' and '.join(sorted(others))}"
            found.append(mine)
        return found


def _apart(window: CataloguePass, spans: Sequence[Pair]) -> bool:
    return all(window.aos_t_s > end + APART_S or window.los_t_s < begin - APART_S for begin, end in spans)


def _pieces(
    day: AntennaDay, window: CataloguePass, whole: Candidate, cuts: Sequence[float], lasts: bool
) -> list[Candidate]:
    """Return the parts of a pass between `cuts`, with their shares of its worth.

    Parts of a stay of hours count by their time and height, however it is cut.
    """
    count = min(MOST_PART_POINTS, max(3, math.ceil(window.duration_s / PART_STEP_S) + 1))
    ends = np.array([window.aos_t_s, *cuts, window.los_t_s])
    times = np.union1d(np.linspace(window.aos_t_s, window.los_t_s, count), ends)
    azimuth, elevation = day.look(window, times)
    azimuth += window.azimuth_path_rad[0] - azimuth[0]
    places = np.searchsorted(times, ends)
    height = COUNT_WORTH + np.sin(np.maximum(elevation, 0.0))
    weights = np.array([trapezoid(height[a : b + 1], times[a : b + 1]) for a, b in itertools.pairwise(places)])
    # A stay of `LONG_S` counts as much as a pass of its height.
    shares = whole.share * weights / (LONG_S * (COUNT_WORTH + math.sin(whole.peak_rad)) if lasts else weights.sum())
    found = []
    for number, (a, b) in enumerate(itertools.pairwise(places)):
        path = azimuth[a : b + 1]
        found.append(
            dataclasses.replace(
                whole, aos_t_s=float(ends[number]), los_t_s=float(ends[number + 1]), share=float(shares[number]),
                turns=turns_of(
                    day.antenna.rules, (float(path[0]), float(path.min()), float(path.max()), float(path[-1])),
                    (float(elevation[a]), float(elevation[b])),
                ),
            )
        )  # fmt: skip
    return found
