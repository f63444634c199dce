"""The pass in work: what is counted over its attempts, how long it was not held, and what its record says."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.pass_outcome import SIDELOBE_DB
from rf_pointing.operations import ExpectedState
from rf_pointing.operations.alarms import AlarmBook
from rf_pointing.operations.pass_work import PassWork, record_of
from rf_pointing.operations.schedule import Entry
from test.operations.test_schedule import a_pass

AOS_S, DURATION_S = 1000.0, 600.0
COUNTS = st.tuples(st.floats(0.0, 900.0), st.floats(0.0, 900.0), st.floats(0.0, 60.0))


def shown(
    t_s: float, target: str = "a", held: bool = True, counts: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> ExpectedState:
    """Return what the controller shows at a time."""
    seen, names = ExpectedState(), ("seconds_tracked", "seconds_lost", "mean_loss")
    for name, value in {"target": target, "held": held, **dict(zip(names, counts, strict=True))}.items():
        seen.observe(f"tracking.{name}", value, t_s)
    return seen


def begun(t_s: float = AOS_S - 60.0) -> PassWork:
    return PassWork("a", None, t_s)


@given(st.lists(st.lists(COUNTS, max_size=4), min_size=1, max_size=4))
def test_attempts_are_counted_together_and_a_controller_that_begins_at_zero_takes_nothing_away(
    attempts: list[list[tuple[float, float, float]]],
) -> None:
    work, entry, tracked_s, received_s = begun(), Entry(a_pass("a", AOS_S)), 0.0, 0.0
    for rows in attempts:
        most = (0.0, 0.0, 0.0)
        for counts in rows:
            work.follow(shown(AOS_S, counts=counts))
            most = counts if sum(counts[:2]) >= sum(most[:2]) else most
        work.count()
        tracked_s += most[0]
        received_s += (most[0] + most[1]) * 10.0 ** (-0.1 * most[2])
    work.give_outcome(entry)
    assert entry.tracked_s == pytest.approx(min(tracked_s, DURATION_S))
    assert entry.tracked_s + entry.lost_s == pytest.approx(DURATION_S)
    share = min(max(received_s / DURATION_S, 10.0 ** (-0.1 * SIDELOBE_DB)), 1.0)
    assert entry.loss_db == pytest.approx(-10.0 * math.log10(share), abs=1e-9)


def test_what_the_controller_shows_of_the_pass_before_is_not_counted() -> None:
    work = begun()
    work.follow(shown(AOS_S, target="", counts=(150.0, 20.0, 9.0)))
    assert work.counted == (0.0, 0.0, 0.0)
    work.follow(shown(AOS_S, counts=(1.0, 2.0, 3.0)))
    work.follow(shown(AOS_S, target="", counts=(4.0, 5.0, 6.0)))
    assert work.counted == (4.0, 5.0, 6.0), "the last of a pass that has just ended"
    work.ending = "skipped"
    work.follow(shown(AOS_S, counts=(7.0, 8.0, 9.0)))
    assert work.counted == (4.0, 5.0, 6.0)


def test_causes_of_a_pass_are_what_lasted_in_it_with_its_times_and_nothing_that_ended_before() -> None:
    book = AlarmBook(lambda *_: None)
    for name, raised_s, cleared_s in (
        ("ended", 399.0, 999.0), ("early", 401.0, 1002.0), ("late", 1600.0, 1600.5), ("after", 1600.5, 1600.6),
    ):  # fmt: skip
        book.raise_(name, 1, f"of {name}", raised_s)
        book.clear(name, cleared_s)
    book.raise_("lasting", 1, "first", 300.0)
    book.raise_("lasting", 2, "second", 1200.0)
    # What was raised in a night before is not in this history.
    book.history = [row for row in book.history if row[2] != "lasting"]
    record = record_of(Entry(a_pass("a", AOS_S)), None, book, ExpectedState())
    assert record.causes == (
        "lasting since 00:05:00: second", "early 00:06:41 to 00:16:42, 601 s: of early",
        "late 00:26:40 to 00:26:40, 0 s: of late",
    )  # fmt: skip
    assert (record.attempts, record.recorded, record.name) == (0, False, "a")


@pytest.mark.parametrize(
    ("planned_s", "seen", "age_h"),
    [
        (7200.0, None, 2.0), (math.nan, None, None), (7200.0, (939.0, 5.0), 2.0), (7200.0, (940.0, 5.0), 5.0),
        (math.nan, (1000.0, 5.0), 5.0),
    ],
)  # fmt: skip
def test_the_age_of_the_elements_is_that_of_the_pass_or_as_it_was_planned(
    planned_s: float, seen: tuple[float, float] | None, age_h: float | None
) -> None:
    state, work = ExpectedState(), begun(940.0)
    work.executor = type("", (), {"runs": {}})()
    if seen is not None:
        state.observe("elements.age_h", seen[1], seen[0])
    entry = Entry(a_pass("a", AOS_S, element_age_s=planned_s))
    assert record_of(entry, work, AlarmBook(lambda *_: None), state).element_age_h == age_h
