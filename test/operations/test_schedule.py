"""The schedule: which pass is next, pre-emption, late starts, two antennas, and what happens in between."""

import json
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.operations.pass_list import read_passes, to_calendar, to_csv, to_json
from rf_pointing.operations.schedule import BetweenParams, PassState, Schedule, ScheduledPass
from rf_pointing.planning import AxisLimits, AxisRates

RATES = AxisRates((math.radians(6.0),) * 2, (math.radians(6.0),) * 2)
LIMITS = AxisLimits(
    azimuth_min_rad=math.radians(-270.0), azimuth_max_rad=math.radians(270.0), elevation_min_rad=0.0,
    elevation_max_rad=math.radians(90.0),
)  # fmt: skip
PARK = (0.0, math.radians(45.0))


def a_pass(
    identity: str,
    aos_s: float,
    *,
    los_s: float | None = None,
    azimuth: tuple[float, float] = (10.0, 100.0),
    **changes: Any,
) -> ScheduledPass:
    begin, end = map(math.radians, azimuth)
    values = {
        "id": identity, "target": identity, "aos_t_s": aos_s, "los_t_s": aos_s + 600.0 if los_s is None else los_s,
        "peak_rad": 0.7, "azimuth_path_rad": (begin, min(begin, end), max(begin, end), end),
        "elevation_rad": (0.1, 0.1),
    }  # fmt: skip
    return ScheduledPass(**(values | changes))


def schedule_of(*passes: ScheduledPass, antenna: str = "", **params: Any) -> Schedule:
    made = Schedule(LIMITS, RATES, BetweenParams(**params), antenna)
    made.add(passes)
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
    schedule.add([a_pass("b", 1100.0, priority=5)])
    schedule.replan(10.0, PARK)
    assert planned(schedule) == ["b"]
    schedule.remove(["b"])
    schedule.replan(20.0, PARK)
    assert planned(schedule) == ["a"]
    with pytest.raises(ValueError, match="pass 'c' is not in the schedule"):
        schedule.remove(["c"])


def test_active_pass_is_neither_replaced_nor_removed() -> None:
    schedule = schedule_of(a_pass("a", 1000.0))
    schedule.entry("a").state = PassState.ACTIVE
    with pytest.raises(ValueError, match="cannot be replaced"):
        schedule.add([a_pass("a", 2000.0)])
    with pytest.raises(ValueError, match="being tracked"):
        schedule.remove(["a"])


def test_a_pass_of_higher_priority_ends_the_present_one_in_time_to_turn_to_it() -> None:
    schedule = schedule_of(a_pass("a", 1000.0), gap_s=5.0)
    schedule.replan(900.0, PARK)
    entry = schedule.entry("a")
    entry.state = PassState.ACTIVE
    assert schedule.ends_s(entry, 1100.0) == entry.item.los_t_s
    schedule.add([a_pass("urgent", 1400.0, priority=9, azimuth=(200.0, 250.0)), a_pass("equal", 1300.0)])
    schedule.replan(1100.0, (math.radians(30.0), 0.4))
    assert planned(schedule) == ["urgent"]
    # From either end of the present pass, 100 and 10 deg, to the start at 200 deg, or at -160 deg on the other turn.
    start = schedule.entry("urgent").turn[0]
    slew_s = max(RATES.slew_s((math.radians(end), 0.1), start) for end in (10.0, 100.0))
    assert schedule.ends_s(entry, 1100.0) == pytest.approx(1400.0 - slew_s - 5.0)


def test_a_late_pass_is_joined_while_enough_of_it_is_left() -> None:
    schedule = schedule_of(a_pass("a", 1000.0), least_s=60.0)
    schedule.replan(1300.0, PARK)
    assert planned(schedule) == ["a"]
    assert schedule.begins_s(schedule.entry("a"), PARK) < 1300.0
    schedule.replan(1545.0, PARK)
    assert planned(schedule) == []
    assert schedule.entry("a").state == PassState.MISSED


def test_what_one_antenna_plans_the_other_does_not_and_takes_over_when_it_is_gone() -> None:
    passes = [a_pass("a", 1000.0), a_pass("b", 1200.0), a_pass("own", 3000.0, antenna="gs2")]
    first, second = schedule_of(*passes, antenna="gs1"), schedule_of(*passes, antenna="gs2")
    first.replan(0.0, PARK)
    second.replan(0.0, PARK, first.claims)
    assert len(planned(first)) == 1
    assert set(planned(first)) | set(planned(second)) == {"a", "b", "own"}
    assert "own" in planned(second)
    assert not set(planned(first)) & set(planned(second))
    assert second.entry(planned(first)[0]).reason == "another antenna tracks it"
    second.replan(10.0, PARK, ())
    assert len(planned(second)) == 2


@pytest.mark.parametrize(
    ("wait_s", "azimuth_deg", "expected"),
    [
        (300.0, 0.0, "hold"),
        (300.0, 250.0, "unwind"),
        (3000.0, 0.0, "park"),
        (3000.0, 250.0, "park"),
        (20000.0, 0.0, "stow"),
    ],
)
def test_between_passes_the_rule_depends_on_the_time_and_the_turn(
    wait_s: float, azimuth_deg: float, expected: str
) -> None:
    schedule = schedule_of(a_pass("a", 1000.0 + wait_s + 60.0 + 60.0, azimuth=(-20.0, 60.0)))
    place = (math.radians(azimuth_deg), math.radians(45.0))
    schedule.replan(1000.0, place)
    rest, goal = schedule.between(1000.0, place)
    assert rest == expected
    if rest == "unwind":
        # At the start of the next pass, on its turn: the next pass needs no unwind.
        assert goal == schedule.entry("a").turn[0]
        assert abs(goal[0] - schedule.entry("a").turn[0][0]) < 1e-9


def test_without_anything_left_the_antenna_is_stowed() -> None:
    assert schedule_of().between(0.0, PARK) == ("stow", None)


def test_state_goes_out_and_in_unchanged() -> None:
    schedule = schedule_of(
        a_pass("a", 1000.0), a_pass("b", 1100.0, priority=1), a_pass("c", 9000.0, azimuth_path_rad=None)
    )
    schedule.replan(0.0, PARK)
    kept = json.loads(json.dumps(schedule.state()))
    other = schedule_of()
    other.restore(kept)
    assert other.state() == schedule.state()
    assert planned(other) == planned(schedule)


# Lists


@pytest.mark.parametrize("form", ["json", "csv", "calendar"])
def test_a_list_goes_out_and_in_unchanged(form: str) -> None:
    rng = np.random.default_rng(3)
    passes = [
        a_pass(
            f"p{k}", 1.1e9 + 1000.0 * k + round(float(rng.uniform()), 3), priority=int(rng.integers(-3, 9)),
            azimuth=tuple(map(float, rng.uniform(-90.0, 400.0, 2).round(6))), name=f"SAT, {k}", antenna="gs2" * (k % 2),
            sensor="program" * (k % 3 == 0), peak_rad=math.radians(round(float(rng.uniform(5.0, 90.0)), 6)),
            elevation_rad=(math.radians(5.0), math.radians(6.5)), element_age_s=3600.0 * k,
        )
        for k in range(7)
    ]  # fmt: skip
    text = {"json": to_json, "csv": to_csv, "calendar": lambda each: to_calendar(each, "Station", 1.1e9)}[form](passes)
    back = read_passes(text)
    for one, other in zip(passes, back, strict=True):
        assert (one.id, one.name, one.priority, one.antenna, one.sensor) == (
            other.id,
            other.name,
            other.priority,
            other.antenna,
            other.sensor,
        )
        assert other.aos_t_s == pytest.approx(one.aos_t_s, abs=1e-3)
        assert other.azimuth_path_rad == pytest.approx(one.azimuth_path_rad, abs=1e-7)
        assert other.peak_rad == pytest.approx(one.peak_rad, abs=1e-7)


def test_a_foreign_calendar_gives_target_and_times() -> None:
    text = (
        "BEGIN:VCALENDAR\r\nVERSION:2.0\r\nPRODID:x\r\nBEGIN:VEVENT\r\nUID:1\r\nSUMMARY:NOAA 19\r\n"
        "DTSTART:20260101T010000Z\r\nDTEND:20260101T011000Z\r\nEND:VEVENT\r\nEND:VCALENDAR\r\n"
    )
    (one,) = read_passes(text)
    assert (one.target, one.duration_s) == ("NOAA 19", 600.0)
    assert one.azimuth_path_rad is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"passes": 3}', "must be a list of passes"),
        ('[{"target": "a", "aos_utc": "2026-01-01T00:00:00Z"}]', "row 1: los_utc is missing"),
        ('[{"aos_utc": "2026-01-01T00:00:00Z", "los_utc": "2026-01-01T00:10:00Z"}]', "row 1: target='' of pass"),
        ("target,aos_utc,los_utc\na,2026-01-01T00:10:00Z,2026-01-01T00:00:00Z\n", "row 1: aos=.* must be < los="),
        ("target,aos_utc,los_utc,peak_elevation_deg\na,2026-01-01T00:00:00Z,2026-01-01T00:10:00Z,x\n", "'x' must be a number"),
        ("target,aos_utc,los_utc\na,soon,later\n", "row 1"),
        ("BEGIN:VCALENDAR\nBEGIN:VEVENT\n", "not a calendar|must have dtstart"),
        ("id,target,aos_utc,los_utc\n" + "x,a,2026-01-01T00:00:00Z,2026-01-01T00:10:00Z\n" * 2, "pass x is in the list twice"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_list_is_refused_with_its_row(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_passes(text)


def test_only_what_was_planned_is_taken_from_a_plan_unless_all_is_asked_for() -> None:
    rows = [{"target": n, "fate": f, "aos_utc": "2026-01-01T00:00:00Z", "los_utc": "2026-01-01T00:10:00Z"}
            for n, f in (("a", "tracked"), ("b", "yields"), ("c", "barred"))]  # fmt: skip
    text = json.dumps({"passes": rows})
    assert [each.target for each in read_passes(text, every=False)] == ["a"]
    assert [each.target for each in read_passes(text)] == ["a", "b", "c"]
