"""The schedule: which pass is next, pre-emption, late starts, two antennas, and what happens in between."""

import json
import math
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.operations.schedule import IN_WORK, OPEN, BetweenParams, PassState, Schedule, ScheduledPass
from rf_pointing.planning import AxisLimits, AxisRates
from test.conftest import within

RATES = AxisRates((math.radians(6.0),) * 2, (math.radians(6.0),) * 2)
LIMITS = AxisLimits(
    azimuth_min_rad=math.radians(-270.0), azimuth_max_rad=math.radians(270.0), elevation_min_rad=0.0,
    elevation_max_rad=math.radians(90.0),
)  # fmt: skip
PARK = (0.0, math.radians(45.0))


def a_pass(
    identity: str, aos_s: float, *, los_s: float | None = None,
    azimuth: tuple[float, float] = (10.0, 100.0), **changes: Any,
) -> ScheduledPass:  # fmt: skip
    begin, end = map(math.radians, azimuth)
    values = {
        "id": identity, "target": identity, "aos_t_s": aos_s, "los_t_s": aos_s + 600.0 if los_s is None else los_s,
        "peak_rad": 0.7, "azimuth_path_rad": (begin, min(begin, end), max(begin, end), end),
        "elevation_rad": (0.1, 0.1),
    }  # fmt: skip
    return ScheduledPass(**(values | changes))


def schedule_of(*passes: ScheduledPass, antenna: str = "", **params: Any) -> Schedule:
    made = Schedule(LIMITS, RATES, BetweenParams(**params), antenna)
    made.change(passes)
    return made


def planned(schedule: Schedule) -> list[str]:
    return [each.item.id for each in schedule.in_order if each.planned and each.state == PassState.WAITING]


def test_of_two_passes_at_once_the_higher_priority_is_planned_and_the_other_says_why() -> None:
    schedule = schedule_of(a_pass("low", 1000.0, peak_rad=1.5), a_pass("high", 1200.0, priority=2))
    schedule.replan(0.0, PARK)
    assert planned(schedule) == ["high"]
    assert "priority 2 is above 0" in schedule.entry("low").reason
    assert schedule.entry("low").state == PassState.YIELDS


def test_a_change_while_it_runs_plans_anew() -> None:
    schedule = schedule_of(a_pass("a", 1000.0))
    schedule.replan(0.0, PARK)
    schedule.change([a_pass("b", 1100.0, priority=5)])
    schedule.replan(10.0, PARK)
    assert planned(schedule) == ["b"]
    schedule.change([], ["b"])
    schedule.replan(20.0, PARK)
    assert planned(schedule) == ["a"]


_IDS = st.sampled_from("abcdef")


@given(st.dictionaries(_IDS, st.sampled_from(PassState)), st.lists(_IDS, unique=True), st.lists(_IDS))
def test_a_change_is_made_as_a_whole_or_not_at_all(present: dict[str, PassState], added: str, removed: str) -> None:
    schedule = schedule_of(*(a_pass(each, 1000.0) for each in present))
    for each, state in present.items():
        schedule.entry(each).state = state
    before = schedule.state()
    begun = {each for each, state in present.items() if state not in OPEN} - set(removed)
    active = {each for each, state in present.items() if state in IN_WORK}
    if set(removed) - set(present) or active & set(removed) or begun & set(added):
        with pytest.raises(ValueError, match="not in the schedule|being tracked|cannot be replaced"):
            schedule.change([a_pass(each, 2000.0) for each in added], removed)
        assert schedule.state() == before
    else:
        schedule.change([a_pass(each, 2000.0) for each in added], removed)
        assert set(schedule.entries) == (set(present) - set(removed)) | set(added)


def test_five_thousand_passes_are_planned_within_two_seconds() -> None:
    schedule = schedule_of(*(a_pass(f"p{k}", 17.0 * k, priority=k % 3) for k in range(5000)))
    begun_s = time.process_time()
    schedule.replan(0.0, PARK)
    assert within(time.process_time() - begun_s, 2.0)


def test_without_anything_left_the_antenna_is_stowed() -> None:
    assert schedule_of().between(0.0, PARK) == ("stow", None)


# Entries


def test_a_pass_that_yields_is_replaced_and_one_that_has_begun_may_come_again_unchanged() -> None:
    schedule = schedule_of(a_pass("a", 1000.0), a_pass("b", 2000.0))
    schedule.entry("a").state, schedule.entry("b").state = PassState.YIELDS, PassState.TRACKED
    schedule.change([a_pass("a", 1500.0), a_pass("b", 2000.0)])
    assert (schedule.entry("a").item.aos_t_s, schedule.entry("a").state) == (1500.0, PassState.WAITING)
    assert schedule.entry("b").state == PassState.TRACKED
    schedule.change([], ["b"])
    assert list(schedule.entries) == ["a"]


def test_entries_are_in_order_of_rise_and_of_their_ids() -> None:
    schedule = schedule_of(a_pass("c", 1000.0), a_pass("b", 3000.0), a_pass("a", 3000.0))
    assert [each.item.id for each in schedule.in_order] == ["c", "a", "b"]
    assert schedule.active is None
    schedule.entry("b").state = PassState.ACTIVE
    assert schedule.active is schedule.entry("b")


def test_a_pass_that_has_ended_is_no_longer_planned() -> None:
    schedule = schedule_of(a_pass("0", 1000.0))
    schedule.replan(0.0, PARK)
    schedule.end(schedule.entry("0"), PassState.LOST, "why")
    entry = schedule.entry("0")
    assert (entry.state, entry.reason, entry.planned) == (PassState.LOST, "why", False)


@pytest.mark.parametrize(
    ("los_s", "now_s", "missed"),
    [(1600.0, 1539.5, False), (1600.0, 1540.5, True), (1100.0, 1049.5, False), (1100.0, 1050.5, True)],
)
def test_a_pass_is_missed_when_less_than_a_minute_or_half_of_it_is_left(
    los_s: float, now_s: float, missed: bool
) -> None:
    schedule = schedule_of(a_pass("a", 1000.0, los_s=los_s), a_pass("later", 5000.0), a_pass("b", 1000.0))
    schedule.entry("a").planned = True
    schedule.entry("b").state = PassState.YIELDS
    over = schedule.expire(now_s)
    assert [each.item.id for each in over] == (["a"] if missed else [])
    entry = schedule.entry("a")
    assert (entry.state == PassState.MISSED, entry.planned) == (missed, not missed)
    assert entry.reason == ("the antenna was not ready before the end of the pass" if missed else "")
    assert schedule.expire(now_s) == []


def test_a_reason_that_is_there_stays_when_a_pass_is_missed() -> None:
    schedule = schedule_of(a_pass("a", 1000.0))
    schedule.entry("a").reason = "high wind"
    assert [each.reason for each in schedule.expire(2000.0)] == ["high wind"]


# Plans


def test_only_passes_of_this_antenna_or_of_any_are_planned_and_the_others_say_whose_they_are() -> None:
    passes = [a_pass("any", 1000.0), a_pass("own", 3000.0, antenna="gs1"), a_pass("other", 5000.0, antenna="gs2"),
              a_pass("taken", 7000.0)]  # fmt: skip
    schedule = schedule_of(*passes, antenna="gs1")
    schedule.replan(0.0, PARK, {"taken"})
    assert planned(schedule) == ["any", "own"]
    assert [(each.state, each.reason) for each in schedule.in_order] == [
        ("waiting", ""), ("waiting", ""), ("yields", "it is for the antenna gs2"), ("yields", "another antenna tracks it"),
    ]  # fmt: skip
    assert schedule.entry("other").turn is None
    # What was planned before and is taken now has no turn any more.
    schedule.replan(0.0, PARK, {"any", "own"})
    assert planned(schedule) == ["taken"]
    assert (schedule.entry("own").planned, schedule.entry("own").turn) == (False, None)


def test_a_pass_that_no_turn_fits_or_that_is_too_short_by_then_says_so() -> None:
    wide = a_pass("wide", 1000.0, azimuth=(0.0, 550.0))
    schedule = schedule_of(wide)
    schedule.replan(0.0, PARK)
    assert schedule.entry("wide").reason == "too little of it is left, or no turn of the axes fits"
    assert planned(schedule) == []


@pytest.mark.parametrize(("left_s", "joined"), [(100.0, True), (82.0, True), (78.0, False)])
def test_a_pass_that_has_risen_is_joined_when_the_antenna_can_be_there(left_s: float, joined: bool) -> None:
    """From -110 to 10 deg takes 120/6 + 1 = 21 s; of the 60 s that must be left none is spent on the way."""
    schedule = schedule_of(a_pass("a", 1000.0, azimuth=(-10.0, 100.0)), least_s=60.0)
    place = (math.radians(-130.0), 0.1)
    schedule.replan(1600.0 - left_s, place)
    assert planned(schedule) == (["a"] if joined else [])
    if joined:
        assert schedule.entry("a").turn == ((math.radians(-10.0), 0.1), (math.radians(100.0), 0.1))


def test_the_nearer_of_two_turns_decides_when_a_pass_can_be_joined() -> None:
    """200 deg is -160 deg on another turn: from -150 deg that is 10/6 + 1 s away, the other one 59 s."""
    schedule = schedule_of(a_pass("a", 1000.0, azimuth=(200.0, 250.0)), least_s=60.0)
    schedule.replan(1530.0, (math.radians(-150.0), 0.1))
    assert planned(schedule) == ["a"]
    assert schedule.entry("a").turn[0][0] == pytest.approx(math.radians(-160.0))


def test_what_is_above_the_present_pass_does_not_wait_for_it_and_what_is_not_does() -> None:
    schedule = schedule_of(a_pass("a", 1000.0, priority=3))
    schedule.replan(900.0, PARK)
    schedule.entry("a").state = PassState.ACTIVE
    schedule.change(
        [a_pass("same", 1200.0, los_s=1500.0, priority=3), a_pass("above", 1200.0, los_s=1500.0, priority=4)]
    )
    schedule.replan(1100.0, PARK)
    assert planned(schedule) == ["above"]
    schedule.change([], ["above"])
    schedule.replan(1100.0, PARK)
    assert planned(schedule) == []


def test_the_present_pass_ends_for_the_first_of_those_above_it_and_not_before_now() -> None:
    schedule = schedule_of(a_pass("a", 1000.0, azimuth=(10.0, 130.0)), gap_s=5.0)
    schedule.replan(900.0, PARK)
    entry = schedule.entry("a")
    entry.state = PassState.ACTIVE
    assert schedule.ends_s(entry, 1100.0) == 1600.0
    schedule.change([a_pass("u", 1500.0, priority=2, azimuth=(130.0, 190.0)), a_pass("v", 5000.0, priority=2)])
    schedule.replan(1100.0, PARK)
    # The longer way is that from its rise, 120 deg: 21 s.
    assert schedule.ends_s(entry, 1100.0) == pytest.approx(1500.0 - 21.0 - 5.0)
    assert schedule.ends_s(entry, 1490.0) == 1490.0
    # Without a turn of its own it is taken to be where the other begins.
    entry.turn = None
    assert schedule.ends_s(entry, 1100.0) == pytest.approx(1495.0)
    for state in (PassState.TRACKED, PassState.MISSED):
        schedule.entry("u").state = state
        assert schedule.ends_s(entry, 1100.0) == 1600.0
    schedule.entry("u").state, schedule.entry("u").planned = PassState.YIELDS, False
    assert schedule.ends_s(entry, 1100.0) == 1600.0


def test_a_pass_begins_with_its_preparation_before_the_slew_to_its_turn() -> None:
    schedule = schedule_of(a_pass("a", 1000.0), a_pass("free", 3000.0, azimuth_path_rad=None), lead_s=40.0)
    # From 70 to 10 deg.
    place = (math.radians(70.0), 0.1)
    assert schedule.begins_s(schedule.entry("a"), place) == pytest.approx(1000.0 - 11.0 - 40.0)
    turn = ((math.radians(-50.0), 0.1), (0.0, 0.1))
    schedule.entry("a").turn = turn
    assert schedule.begins_s(schedule.entry("a"), place) == pytest.approx(1000.0 - 21.0 - 40.0)
    # An unknown path: from one end of the travel to the other.
    assert schedule.begins_s(schedule.entry("free"), place) == pytest.approx(3000.0 - (340.0 / 6.0 + 1.0) - 40.0)
    schedule.replan(0.0, place)
    low, high = math.radians(-270.0), math.radians(270.0)
    assert schedule.entry("free").turn == ((low, 0.0), (high, 0.0))


@pytest.mark.parametrize(
    ("wait_s", "azimuth_deg", "rest"),
    [
        (1199.0, 0.0, "hold"), (1201.0, 0.0, "park"), (14399.0, 0.0, "park"), (14401.0, 0.0, "stow"),
        (600.0, 169.0, "hold"), (600.0, 171.0, "unwind"), (600.0, -189.0, "hold"), (600.0, -191.0, "unwind"),
        (1.0, 171.0, "unwind"), (-1.0, 171.0, "hold"), (1201.0, 171.0, "park"),
    ],
)  # fmt: skip
def test_the_rest_between_two_passes_is_that_of_the_usual_bounds(wait_s: float, azimuth_deg: float, rest: str) -> None:
    """20 min, 4 h and 180 deg; the pass begins at -10 deg."""
    schedule = schedule_of(a_pass("a", 50_000.0, azimuth=(-10.0, 60.0)))
    place = (math.radians(azimuth_deg), 0.1)
    schedule.entry("a").planned = True
    start = (math.radians(-10.0), 0.1)
    schedule.entry("a").turn = (start, start)
    now_s = schedule.begins_s(schedule.entry("a"), place) - wait_s
    assert schedule.between(now_s, place) == (rest, start if rest == "unwind" else None)
    # Without a turn there is nowhere to unwind to.
    schedule.entry("a").turn = None
    assert schedule.between(now_s, place)[0] != "unwind"


def test_the_next_pass_is_the_first_that_is_planned_and_waits() -> None:
    schedule = schedule_of(a_pass("a", 1000.0), a_pass("b", 3000.0), a_pass("c", 5000.0))
    assert schedule.next() is None
    for name in "abc":
        schedule.entry(name).planned = True
    schedule.entry("a").state = PassState.ACTIVE
    assert schedule.next() is schedule.entry("b")
    schedule.entry("b").planned = False
    assert schedule.next() is schedule.entry("c")


def test_a_restored_schedule_is_the_same_in_every_field() -> None:
    schedule = schedule_of(
        a_pass(
            "a", 1000.0, element_age_s=7200.0, name="n", sensor="s", band="S", antenna="gs1", priority=4, peak_rad=1.25
        ),
        a_pass("b", 5000.0, azimuth_path_rad=None),
    )
    entry = schedule.entry("a")
    entry.tracked_s, entry.lost_s, entry.loss_db, entry.planned = 1.0, 2.0, 3.0, True
    entry.state, entry.reason, entry.turn = PassState.YIELDS, "why", ((1.0, 2.0), (3.0, 4.0))
    other = schedule_of(a_pass("old", 1.0))
    other.restore(json.loads(json.dumps(schedule.state())))
    assert list(other.entries) == ["a", "b"]
    assert other.entry("a") == entry
    back = other.entry("b")
    assert (back.state, back.planned, back.turn, back.item.azimuth_path_rad) == (PassState.WAITING, False, None, None)
    assert math.isnan(back.item.element_age_s)
