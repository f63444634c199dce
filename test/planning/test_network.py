"""The plan of a network: one owner of a target at a time, the best by trial of all, and its bound."""

import itertools
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, Candidate, turns_within
from rf_pointing.planning.network import Assignment, Option, Owed, Programme
from rf_pointing.planning.schedule import schedule

AXES = (
    AxisRates((math.radians(1.8), math.radians(1.2)), (math.radians(0.8), math.radians(0.5))),
    AxisRates((math.radians(6.0), math.radians(6.0)), (math.radians(5.0), math.radians(5.0))),
)
LIMITS = AxisLimits(azimuth_min_rad=math.radians(-270.0), azimuth_max_rad=math.radians(270.0))
GAP_S = 20.0


def options(random: np.random.Generator, count: int, span_s: float, stations: int, priorities: int = 1) -> list[Option]:
    made = []
    for number in range(count):
        aos = random.uniform(0.0, span_s)
        begin, change = random.uniform(0.0, math.tau), random.uniform(-3.0, 3.0)
        path = (begin, min(begin, begin + change), max(begin, begin + change), begin + change)
        one = Candidate(
            name=f"S{number}", aos_t_s=aos, los_t_s=aos + random.uniform(120.0, 900.0),
            peak_rad=random.uniform(0.1, 1.5), priority=int(random.integers(priorities)),
            turns=turns_within(LIMITS, path, (0.09, 0.09)), share=random.uniform(0.3, 1.0),
        )  # fmt: skip
        station = int(random.integers(stations))
        made.append(Option(candidate=one, station=station, target=int(random.integers(3)), whole=number))
    return made


def assign(made: list[Option], axes: tuple[AxisRates, ...], gap_s: float = 0.0, **options: Any) -> Assignment:
    return Programme(made, axes, gap_s).assign(**options)


def possible(chain: list[tuple[Option, int]]) -> bool:
    """Return whether options with their turns exclude each other nowhere."""
    for (one, turn), (other, then) in itertools.permutations(chain, 2):
        first, last = one.candidate, other.candidate
        if first.aos_t_s > last.aos_t_s:
            continue
        slew_s = GAP_S + AXES[one.station].slew_s(first.turns[turn][1], last.turns[then][0])
        if one.station == other.station and last.aos_t_s - first.los_t_s < slew_s:
            return False
        if one.target == other.target and last.aos_t_s < first.los_t_s:
            return False
    return True


def best_by_trial(made: list[Option], needed: set[int], numbers: list[int]) -> float:
    best = 0.0
    for size in range(len(numbers) + 1):
        for subset in itertools.combinations(numbers, size):
            chosen = [made[k] for k in sorted(needed | set(subset))]
            turns = itertools.product(*(range(len(one.candidate.turns)) for one in chosen))
            if any(possible(list(zip(chosen, turn, strict=True))) for turn in turns):
                best = max(best, sum(made[k].candidate.worth for k in subset))
    return best


@pytest.mark.parametrize("priorities", [1, 2])
def test_the_plan_of_two_stations_is_the_best_by_trial_of_all(priorities: int, random: np.random.Generator) -> None:
    dropped = 0
    for _ in range(15):
        made = options(random, 8, 3000.0, 2, priorities)
        found = assign(made, AXES, GAP_S)
        dropped += len(made) - len(found.taken)
        needed: set[int] = set()
        for priority in reversed(range(priorities)):
            level = [k for k, one in enumerate(made) if one.candidate.priority == priority and one.candidate.turns]
            mine = {k for k in found.taken if made[k].candidate.priority == priority}
            wanted = best_by_trial(made, needed, level)
            assert sum(made[k].candidate.worth for k in mine) == pytest.approx(wanted, rel=1e-4)
            needed |= mine
        assert 0.0 <= found.better_by < 1e-3
    assert dropped > 20


def test_one_station_is_planned_as_by_dynamic_programming(random: np.random.Generator) -> None:
    made = options(random, 150, 43200.0, 1)
    apart = [Option(candidate=one.candidate, station=0, target=k, whole=k) for k, one in enumerate(made)]
    found = assign(apart, AXES[:1], GAP_S)
    # A start long before the first pass: time for every slew to it.
    chain = schedule([one.candidate for one in made], AXES[0], (-1e4, (0.3, 1.2)), GAP_S)
    wanted = sum(made[k].candidate.worth for k, _ in chain)
    assert sum(made[k].candidate.worth for k in found.taken) == pytest.approx(wanted, rel=1e-4)


def test_parts_of_a_pass_go_on_without_a_slew_and_are_handed_over() -> None:
    def part(station: int, begin_s: float, end_s: float, share: float) -> Option:
        one = Candidate(
            name="probe", aos_t_s=begin_s, los_t_s=end_s, peak_rad=0.8, priority=0, share=share,
            turns=(((begin_s * 1e-4, 0.5), (end_s * 1e-4, 0.5)),),
        )  # fmt: skip
        return Option(candidate=one, station=station, target="probe", whole="probe")

    made = [
        part(0, 0.0, 100.0, 0.4), part(0, 100.0, 200.0, 0.4), part(0, 200.0, 300.0, 0.1),
        part(1, 200.0, 400.0, 0.9),
    ]  # fmt: skip
    assert assign(made, AXES, GAP_S).taken == (0, 1, 3)


def test_contact_that_is_owed_comes_before_a_higher_pass() -> None:
    turn = (((0.0, 0.1), (1.0, 0.1)),)
    high, low = (
        Option(candidate=Candidate(name=name, aos_t_s=0.0, los_t_s=600.0, peak_rad=peak, priority=0, turns=turn),
               station=0, target=name, whole=name)
        for name, peak in (("high", 1.5), ("low", 0.2))
    )  # fmt: skip
    assert assign([high, low], AXES[:1]).taken == (0,)
    owed = Owed(target="low", begin_t_s=0.0, end_t_s=86400.0, least_s=300.0)
    assert assign([high, low], AXES[:1], owed=[owed]).taken == (1,)
    # Of another day it is owed nothing now.
    later = Owed(target="low", begin_t_s=86400.0, end_t_s=172800.0, least_s=300.0)
    assert assign([high, low], AXES[:1], owed=[later]).taken == (0,)


def test_what_is_held_stays_and_nothing_is_an_empty_plan() -> None:
    turn = (((0.0, 0.1), (1.0, 0.1)),)
    made = [
        Option(candidate=Candidate(name="one", aos_t_s=t_s, los_t_s=t_s + 300.0, peak_rad=peak, priority=0, turns=turn),
               station=0, target="one", whole=t_s)
        for t_s, peak in ((0.0, 0.2), (100.0, 1.5))
    ]  # fmt: skip
    assert assign(made, AXES[:1]).taken == (1,)
    assert assign(made, AXES[:1], held={0}).taken == (0,)
    assert assign([], AXES) == assign(made[:0], AXES, GAP_S)


def test_a_search_that_runs_out_of_time_still_gives_a_plan_that_is_possible(random: np.random.Generator) -> None:
    made = options(random, 200, 20000.0, 2)
    found = assign(made, AXES, GAP_S, solving_s=1e-6)
    assert len(found.taken) > 10
    taken = [made[k] for k in found.taken]
    for one, other in itertools.combinations(taken, 2):
        apart = one.candidate.los_t_s <= other.candidate.aos_t_s or other.candidate.los_t_s <= one.candidate.aos_t_s
        assert apart or (one.station != other.station and one.target != other.target)
