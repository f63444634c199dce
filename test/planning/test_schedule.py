"""The plan of one antenna: never two at once, time for every turn, the best sum, and reasons that hold."""

import itertools
import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, Candidate, reasons_against, turns_within
from rf_pointing.planning.schedule import schedule, turn_s

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


def at(
    name: str, aos_t_s: float, los_t_s: float, *azimuths: float, peak_rad: float = 0.5, priority: int = 0
) -> Candidate:
    """A pass whose azimuth stays, on each of these turns."""
    turns = tuple((((azimuth, 0.5), (azimuth, 0.5))) for azimuth in azimuths)
    return Candidate(name=name, aos_t_s=aos_t_s, los_t_s=los_t_s, peak_rad=peak_rad, priority=priority, turns=turns)


REST = (0.0, (0.0, 0.5))
# 10 s from rest to rest over this azimuth.
STEP_RAD = math.radians(1.8) * (10.0 - 1.8 / 0.8)


def test_of_two_equal_plans_the_one_that_turns_less_is_taken() -> None:
    passes = [at("A", 100.0, 200.0, 3.0, 0.5), at("B", 1000.0, 1100.0, 0.6, 2.9), at("C", 2000.0, 2100.0, 0.4)]
    assert schedule(passes, AXES, REST) == [(0, 1), (1, 0), (2, 0)]
    # But a pass counts for more than a day of turning.
    far = [at("A", 100.0, 200.0, 0.0), at("B", 3000.0, 3100.0, 4.7, peak_rad=0.01), at("C", 9000.0, 9100.0, 0.0)]
    assert schedule(far, AXES, REST) == [(0, 0), (1, 0), (2, 0)]


def test_reasons_say_how_long_passes_overlap_and_what_decides() -> None:
    tracked = at("A", 100.0, 300.0, 0.0, peak_rad=0.8)
    level = "of equal priority 0"
    for one, words in (
        (at("B", 250.0, 400.0, 0.0, peak_rad=0.8), f"50 s: {level} the higher peak, 45.8 deg against 45.8 deg"),
        (at("B", 50.0, 120.0, 0.0, peak_rad=0.3), f"20 s: {level} the higher peak, 45.8 deg against 17.2 deg"),
        (
            at("B", 50.0, 120.0, 0.0, peak_rad=0.9),
            f"20 s: {level} the plan with more passes, or higher or better known ones",
        ),
        (at("B", 50.0, 120.0, 0.0, priority=-1), "20 s: priority 0 is above -1"),
    ):
        assert reasons_against([tracked, one], [(0, 0)], AXES, REST)[1] == f"overlaps A for {words}"
    two = [
        at("A", 100.0, 300.0, 0.0, peak_rad=0.3),
        at("C", 350.0, 500.0, 0.0, peak_rad=0.3),
        at("B", 250.0, 390.0, 0.0),
    ]
    assert reasons_against(two, [(0, 0), (1, 0)], AXES, REST)[2] == (
        "overlaps A for 50 s and C for 40 s: of equal priority 0 the plan with more passes, or higher or better known ones"
    )


def test_reasons_say_from_and_to_what_there_is_no_time_to_turn() -> None:
    """10 s for each step of azimuth, and a gap of 20 s between passes."""
    kept = [at("A", 50.0, 100.0, 0.0), at("D", 300.0, 400.0, 0.0)]

    def why(one: Candidate) -> str:
        return reasons_against([*kept, one], [(0, 0), (1, 0)], AXES, REST, 20.0)[2]

    assert why(at("B", 129.0, 200.0, STEP_RAD)) == "no time to turn from A: 30 s are needed and 29 s are free"
    assert why(at("B", 150.0, 271.0, STEP_RAD)) == "no time to turn to D: 30 s are needed and 29 s are free"
    assert why(at("B", 128.0, 275.0, STEP_RAD)) == (
        "no time to turn from A: 30 s are needed and 28 s are free and to D: 30 s are needed and 25 s are free"
    )
    assert why(at("B", 8.0, 20.0, STEP_RAD)) == (
        "no time to turn from where the antenna is at the start: 10 s are needed and 8 s are free"
    )
    assert why(at("B", 450.0, 460.0, 10.0 * STEP_RAD)).startswith("no time to turn from D: ")
    # Each of two turns is in time for one of its neighbours only.
    split = Candidate(
        name="B", aos_t_s=129.0, los_t_s=271.0, peak_rad=0.5, priority=0,
        turns=(((0.0, 0.5), (STEP_RAD, 0.5)), ((STEP_RAD, 0.5), (0.0, 0.5))),
    )  # fmt: skip
    assert why(split) == "no time to turn on one turn from A and to D"
    # A pass of a lower priority is in nobody's way.
    low = [at("A", 50.0, 100.0, 0.0, priority=-1), kept[1]]
    found = reasons_against([*low, at("B", 90.0, 271.0, STEP_RAD)], [(0, 0), (1, 0)], AXES, REST, 20.0)[2]
    assert found == "no time to turn to D: 30 s are needed and 29 s are free"
