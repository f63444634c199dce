"""The plan of one antenna: never two at once, time for every turn, the best sum, and reasons that hold."""

import itertools
import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, Candidate, reasons_against, schedule, turns_within
from rf_pointing.planning.schedule import turn_s

AXES = AxisRates((math.radians(1.8), math.radians(1.2)), (math.radians(0.8), math.radians(0.5)))
START = (0.0, (0.3, 1.2))
LIMITS = AxisLimits(azimuth_min_rad=math.radians(-270.0), azimuth_max_rad=math.radians(270.0))
GAP_S = 20.0


def candidates(random: np.random.Generator, count: int, span_s: float, priorities: int) -> list[Candidate]:
    made = []
    for number in range(count):
        aos = random.uniform(0.0, span_s)
        begin, change = random.uniform(0.0, 2.0 * math.pi), random.uniform(-3.0, 3.0)
        path = (begin, min(begin, begin + change), max(begin, begin + change), begin + change)
        made.append(
            Candidate(
                name=f"S{number}", aos_t_s=aos, los_t_s=aos + random.uniform(120.0, 900.0),
                peak_rad=random.uniform(0.1, 1.5), priority=int(random.integers(priorities)),
                turns=turns_within(LIMITS, path, (0.09, 0.09)),
            )
        )  # fmt: skip
    return made


def feasible(made: list[Candidate], chain: list[tuple[int, int]]) -> bool:
    at_s, place, gap_s = START[0], START[1], 0.0
    for number, turn in chain:
        one = made[number]
        if one.aos_t_s - at_s < gap_s + AXES.slew_s(place, one.turns[turn][0]):
            return False
        at_s, place, gap_s = one.los_t_s, one.turns[turn][1], GAP_S
    return True


def best_by_trial(made: list[Candidate], numbers: list[int], needed: set[int]) -> float:
    """Return the largest sum of worth of the free ones over all subsets and turns that contain the needed."""
    best = -math.inf
    for size in range(len(numbers) + 1):
        for subset in itertools.combinations(numbers, size):
            if not needed <= set(subset):
                continue
            order = sorted(subset, key=lambda k: made[k].aos_t_s)
            turns = itertools.product(*(range(len(made[k].turns)) for k in order))
            if any(feasible(made, list(zip(order, turn, strict=True))) for turn in turns):
                best = max(best, sum(made[k].worth for k in order if k not in needed))
    return best


@pytest.mark.parametrize("priorities", [1, 3])
def test_the_plan_is_the_best_one_by_trial_of_all(priorities: int, random: np.random.Generator) -> None:
    dropped = 0
    for _ in range(40):
        made = candidates(random, 8, 4000.0, priorities)
        plan = schedule(made, AXES, START, GAP_S)
        assert feasible(made, plan)
        tracked = {k for k, _ in plan}
        dropped += len(made) - len(tracked)
        needed: set[int] = set()
        # Priorities are strict: what a higher one has taken stays.
        for priority in sorted({one.priority for one in made}, reverse=True):
            numbers = [k for k, one in enumerate(made) if one.priority == priority and one.turns]
            wanted = best_by_trial(made, [*numbers, *needed], needed)
            mine = {k for k in tracked if made[k].priority == priority}
            assert sum(made[k].worth for k in mine) == pytest.approx(wanted, abs=1e-3)
            needed |= mine
    assert dropped > 80


def test_every_reason_names_a_pass_that_stands_in_the_way(random: np.random.Generator) -> None:
    made = candidates(random, 150, 86400.0, 3)
    plan = schedule(made, AXES, START, GAP_S)
    assert feasible(made, plan)
    reasons = reasons_against(made, plan, AXES, START, GAP_S)
    assert len(plan) + len(reasons) == len([one for one in made if one.turns])
    tracked = {made[k].name: made[k] for k, _ in plan}
    kinds = set()
    for number, reason in reasons.items():
        one = made[number]
        if reason.startswith("overlaps"):
            names = [word.split(" for ")[0] for word in reason.removeprefix("overlaps ").split(": ")[0].split(" and ")]
            for other in (tracked[name] for name in names):
                assert min(one.los_t_s, other.los_t_s) > max(one.aos_t_s, other.aos_t_s)
                assert other.priority >= one.priority
            kinds.add("priority" if "is above" in reason else "peak" if "higher peak" in reason else "plan")
        else:
            assert reason.startswith("no time to turn ")
            kinds.add("turn")
            # It could not be added to the passes of its own and higher priorities on any turn.
            held = [(k, t) for k, t in plan if made[k].priority >= one.priority]
            for turn in range(len(one.turns)):
                chain = sorted([*held, (number, turn)], key=lambda pair: made[pair[0]].aos_t_s)
                assert not feasible(made, chain)
    assert kinds == {"priority", "peak", "plan", "turn"}


def test_a_pass_fits_every_turn_of_the_travel_and_no_other() -> None:
    path = (math.radians(350.0), math.radians(350.0), math.radians(440.0), math.radians(440.0))
    (only,) = turns_within(LIMITS, path, (0.1, 0.2))
    assert np.degrees(only[0][0]) == pytest.approx(-10.0)
    assert np.degrees(only[1][0]) == pytest.approx(80.0)
    assert (only[0][1], only[1][1]) == (0.1, 0.2)
    both = turns_within(LIMITS, tuple(np.radians([200.0, 200.0, 250.0, 250.0])), (0.1, 0.1))
    assert sorted(round(math.degrees(turn[0][0])) for turn in both) == [-160, 200]
    narrow = LIMITS.replace(azimuth_min_rad=0.0, azimuth_max_rad=math.radians(359.0))
    assert turns_within(narrow, path, (0.1, 0.2)) == ()
    over = narrow.replace(elevation_max_rad=math.radians(176.0))
    (plunged,) = turns_within(over, path, (0.1, 0.2))
    assert np.degrees(plunged[0][0]) == pytest.approx(170.0)
    assert (plunged[0][1], plunged[1][1]) == pytest.approx((math.pi - 0.1, math.pi - 0.2))


def test_the_time_of_many_turns_is_that_of_each(random: np.random.Generator) -> None:
    places = random.uniform(-3.0, 3.0, (50, 2)) * random.uniform(0.0, 1.0, (50, 1)) ** 4
    wanted = [AXES.slew_s(tuple(place), (0.1, 0.2)) for place in places]
    assert turn_s(AXES, places, np.array([0.1, 0.2])) == pytest.approx(wanted, rel=1e-12)


def test_nothing_to_track_is_an_empty_plan() -> None:
    assert schedule([], AXES, START) == []
    lost = Candidate(name="A", aos_t_s=5.0, los_t_s=9.0, peak_rad=0.5, priority=0, turns=())
    assert schedule([lost], AXES, START) == []
    assert reasons_against([lost], [], AXES, START) == {}


def test_the_first_pass_of_a_plan_is_named_by_one_that_overlaps_it() -> None:
    turns = turns_within(LIMITS, (1.0, 1.0, 2.0, 2.0), (0.1, 0.1))
    made = [
        Candidate(name=name, aos_t_s=aos, los_t_s=aos + 600.0, peak_rad=peak, priority=0, turns=turns)
        for name, aos, peak in (("A", 1000.0, 1.2), ("B", 1200.0, 0.3), ("C", 5000.0, 1.2))
    ]
    plan = schedule(made, AXES, START, GAP_S)
    assert {k for k, _ in plan} == {0, 2}
    assert reasons_against(made, plan, AXES, START, GAP_S)[1].startswith("overlaps A for ")
