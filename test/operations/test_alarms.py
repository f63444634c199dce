"""The book of alarms: its order, what a second raise keeps and changes, which messages go out, and its file."""

import pytest

from rf_pointing.operations.alarms import ERROR, MOST_HISTORY, WARNING, Alarm, AlarmBook


class Told:
    """A book and what it has told: event, name and time."""

    def __init__(self, quiet_s: float = 100.0) -> None:
        self.rows: list[tuple[str, str, str]] = []
        self.book = AlarmBook(lambda event, alarm: self.rows.append((event, alarm.name, alarm.message)), quiet_s)

    @property
    def events(self) -> list[str]:
        rows, self.rows = self.rows, []
        return [event for event, *_ in rows]


def test_a_book_is_quiet_for_ten_minutes_unless_it_is_told_otherwise() -> None:
    events: list[str] = []
    book = AlarmBook(lambda event, _: events.append(event))
    for t_s in (0.0, 1.0, 599.0, 600.5):
        book.raise_("x", WARNING, "m", t_s)
        book.clear("x", t_s + 0.5)
    # Raised at 0, cleared at 0.5; the next message is due 600 s after that one.
    assert events == ["raised", "cleared", "raised", "cleared"]


def test_the_worst_come_first_and_of_one_level_the_oldest() -> None:
    book = Told().book
    for name, level, t_s in (("a", WARNING, 3.0), ("b", ERROR, 2.0), ("c", WARNING, 1.0), ("d", ERROR, 4.0)):
        book.raise_(name, level, name, t_s)
    book.raise_("gone", ERROR, "gone", 0.0)
    book.clear("gone", 5.0)
    assert [each.name for each in book.lasting] == ["b", "d", "c", "a"]


def test_an_alarm_begins_with_what_is_said_of_it_and_unacknowledged() -> None:
    book = Told().book
    book.raise_("x", ERROR, "text", 7.0, "look")
    (alarm,) = book.lasting
    assert alarm == Alarm("x", ERROR, "text", 7.0, "look", None, False, 1, 7.0)
    assert alarm.lasts
    book.clear("x", 9.0)
    assert alarm.cleared_t_s == 9.0
    assert not alarm.lasts


def test_one_that_comes_back_begins_anew_and_counts_on() -> None:
    told = Told()
    told.book.raise_("x", ERROR, "first", 1.0, "ask")
    told.book.acknowledge("x", 2.0)
    told.book.clear("x", 3.0)
    assert told.events == ["raised", "cleared"]
    told.book.raise_("x", WARNING, "second", 50.0)
    # Its level, message and need of an operator are those of now; the count is that since it was acknowledged.
    assert told.book.alarms["x"] == Alarm("x", WARNING, "second", 50.0, "", None, False, 1, 3.0)
    assert told.events == []
    told.book.clear("x", 51.0)
    assert told.events == [], "nobody was told that it came back"


@pytest.mark.parametrize(
    ("first", "second", "tells"),
    [("", "ask", True), ("ask", "ask", False), ("", "", False), ("ask", "", False)],
)
def test_one_that_comes_back_is_told_in_the_quiet_time_if_it_now_needs_an_operator(
    first: str, second: str, tells: bool
) -> None:
    told = Told()
    told.book.raise_("x", WARNING, "m", 0.0, first)
    told.book.clear("x", 1.0)
    told.events  # noqa: B018
    told.book.raise_("x", WARNING, "m", 2.0, second)
    assert told.events == (["raised"] if tells else [])


def test_one_that_lasts_is_told_again_when_it_gets_worse_or_urgent_and_only_then() -> None:
    told = Told()
    told.book.raise_("x", WARNING, "a", 0.0)
    for level, text, ask, events in (
        (WARNING, "b", "", ["raised"]),
        (ERROR, "c", "", ["worse"]),
        (WARNING, "d", "", []),
        (ERROR, "e", "look", ["urgent"]),
        (ERROR, "f", "look again", []),
        (ERROR, "g", "", []),
        (ERROR, "h", "look", ["urgent"]),
    ):
        told.book.alarms["x"].acknowledged = True
        told.book.raise_("x", level, text, 1.0, ask)
        alarm = told.book.alarms["x"]
        assert (alarm.message, alarm.ask) == (text, ask)
        assert told.events == events, text
        # What is told must be acknowledged again.
        assert alarm.acknowledged is (events in ([], ["raised"])), text
        assert alarm.level == (WARNING if text == "b" else ERROR)
        assert (alarm.count, alarm.raised_t_s) == (1, 0.0)
    assert [row[1] for row in told.book.history] == ["raised", "worse", "urgent", "urgent"]


def test_the_end_of_an_alarm_is_told_if_its_beginning_was_or_after_the_quiet_time() -> None:
    told = Told(quiet_s=100.0)
    told.book.raise_("x", WARNING, "m", 10.0)
    told.book.clear("x", 20.0)
    assert told.events == ["raised", "cleared"]
    told.book.raise_("x", WARNING, "m", 30.0)
    told.book.clear("x", 119.0)
    assert told.events == []
    # 100 s after the last message it may be told again.
    told.book.raise_("x", WARNING, "m", 120.0)
    assert told.events == ["raised"]
    told.book.clear("x", 121.0)
    told.book.clear("x", 122.0)
    told.book.clear("never there", 123.0)
    assert told.events == ["cleared"]
    told.book.raise_("x", WARNING, "m", 130.0)
    told.book.clear("x", 221.0)
    assert told.events == ["cleared"], "nobody was told that it came back, but the quiet time is over"
    assert [row[:2] for row in told.book.history] == [
        (10.0, "raised"), (20.0, "cleared"), (30.0, "raised"), (119.0, "cleared"), (120.0, "raised"),
        (121.0, "cleared"), (130.0, "raised"), (221.0, "cleared"),
    ]  # fmt: skip


def test_acknowledging_is_noted_and_counts_anew() -> None:
    book = Told().book
    with pytest.raises(ValueError, match="there is no alarm 'x'; there are: none"):
        book.acknowledge("x", 0.0)
    for name, level in (("a", WARNING), ("b", ERROR), ("gone", WARNING)):
        book.raise_(name, level, f"of {name}", 1.0)
    book.clear("gone", 2.0)
    assert book.acknowledge("", 3.0) == ["b", "a"]
    assert book.history[-2:] == [(3.0, "acknowledged", "b", ERROR, "of b"), (3.0, "acknowledged", "a", WARNING, "of a")]
    assert [(each.acknowledged, each.count) for each in book.alarms.values()] == [(True, 0), (True, 0), (False, 1)]
    assert book.acknowledge("gone", 4.0) == ["gone"]
    assert book.alarms["gone"].acknowledged
    with pytest.raises(ValueError, match="there are: a, b, gone"):
        book.acknowledge("c", 5.0)


def test_the_newest_two_thousand_rows_of_the_history_are_kept() -> None:
    book = Told().book
    book.raise_("x", WARNING, "m", 0.0)
    book.history = [(float(k), "raised", "x", WARNING, "m") for k in range(MOST_HISTORY + 1)]
    kept = book.state()
    assert len(kept["history"]) == 2000
    assert (kept["history"][0][0], kept["history"][-1][0]) == (1.0, 2000.0)
    other = Told().book
    other.restore(kept)
    assert other.history == book.history[1:]
    assert other.alarms == book.alarms
