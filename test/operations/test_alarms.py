"""The book of alarms: what an operator is told of any sequence of causes, its order, and its file."""

import json
import math
from itertools import pairwise

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from rf_pointing.operations.alarms import ERROR, MOST_HISTORY, RETURN_S, WARNING, Alarm, AlarmBook

QUIET_S = 600.0


class Told:
    """A book and what it has told: event and name."""

    def __init__(self, quiet_s: float = QUIET_S) -> None:
        self.rows: list[tuple[str, str]] = []
        self.book = AlarmBook(lambda event, alarm: self.rows.append((event, alarm.name)), quiet_s)

    @property
    def events(self) -> list[str]:
        rows, self.rows = self.rows, []
        return [event for event, _ in rows]


class AnyAlarms(RuleBasedStateMachine):
    """Whatever two causes do, an operator is told what is, in time, and without a storm."""

    def __init__(self) -> None:
        super().__init__()
        self.t_s = 0.0
        self.sent: dict[str, list[tuple[float, str, bool]]] = {"x": [], "y": []}
        self.book = AlarmBook(self.told, QUIET_S)

    def told(self, event: str, alarm: Alarm) -> None:
        self.sent[alarm.name].append((self.t_s, event, bool(alarm.ask)))

    @rule(name=st.sampled_from("xy"), level=st.sampled_from([WARNING, ERROR]), ask=st.sampled_from(["", "look"]),
          about=st.sampled_from(["", "", "", "another"]))  # fmt: skip
    def a_cause_is_there(self, name: str, level: int, ask: str, about: str) -> None:
        before = self.book.alarms.get(name)
        first = before is None
        worse = before is not None and before.lasts and before.reported[0] != 0 and level > before.level
        sent = len(self.sent[name])
        self.book.raise_(name, level, "m", self.t_s, ask, about)
        if first or worse:
            assert len(self.sent[name]) == sent + 1, "told at once"

    @rule(name=st.sampled_from("xy"))
    def a_cause_has_gone(self, name: str) -> None:
        self.book.clear(name, self.t_s)
        alarm = self.book.alarms.get(name)
        assert alarm is None or alarm.reported[0] == 0, "its end is told at once, if its begin was"

    @rule(name=st.sampled_from(["", "x", "y"]))
    def an_operator_knows(self, name: str) -> None:
        if not name or name in self.book.alarms:
            self.book.acknowledge(name, self.t_s)

    @rule(seconds=st.sampled_from([1.0, 30.0, 61.0, 300.0, 601.0]))
    def time_goes_on(self, seconds: float) -> None:
        for _ in range(math.ceil(seconds)):
            self.t_s += seconds / math.ceil(seconds)
            self.book.remind(self.t_s)

    @rule()
    def the_executive_is_killed(self) -> None:
        state = json.loads(json.dumps(self.book.state()))
        self.book = AlarmBook(self.told, QUIET_S)
        self.book.restore(state)
        assert json.loads(json.dumps(self.book.state())) == state

    @invariant()
    def an_operator_knows_what_is_and_is_reminded(self) -> None:
        for name, alarm in self.book.alarms.items():
            last_s, event, needed = self.sent[name][-1]
            quiet_s, known = self.t_s - last_s, event != "cleared"
            if alarm.lasts and (not known or (alarm.ask and not (needed and alarm.acknowledged))):
                assert quiet_s <= QUIET_S, "what lasts is told, and again while somebody is needed"
            if alarm.lasts and not known and alarm.ask:
                assert quiet_s <= RETURN_S * max(1, alarm.count - 1)
            assert alarm.lasts or not known

    @invariant()
    def there_is_no_storm(self) -> None:
        assert self.book.messages == sum(map(len, self.sent.values()))
        for rows in self.sent.values():
            events = [event for _, event, _ in rows]
            begun_s = [t_s for t_s, event, _ in rows if event in ("raised", "reminder")]
            # Without an acknowledgement between them: the n-th return waits n minutes.
            if all(row[1] != "acknowledged" for row in self.book.history):
                assert all(b - a >= RETURN_S for a, b in pairwise(begun_s))
            # A begin and an end by turns; what lies between them is told once, but for reminders.
            ends = [event for event in events if event in ("raised", "cleared")]
            assert all(a != b for a, b in pairwise(ends))


TestAnyAlarms = AnyAlarms.TestCase
TestAnyAlarms.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)


def test_a_fault_that_returns_after_a_reset_is_told_at_once_and_again_while_it_stays_for_hours() -> None:
    """Raised, needs somebody at 80 s, reset by hand at 140 s, back at 398 s for 11 h."""
    told, sent = Told(), []
    for t_s in range(40_000):
        if t_s == 140:
            told.book.clear("fault", 140.0)
        elif t_s < 140 or t_s >= 398:
            told.book.raise_("fault", ERROR, "m", float(t_s), "look" if t_s >= 80 else "")
        told.book.remind(float(t_s))
        sent += [(t_s, event) for event in told.events]
    assert sent[:5] == [(0, "raised"), (80, "urgent"), (140, "cleared"), (398, "raised"), (998, "reminder")]
    assert len(sent) == 4 + (39_999 - 398) // 600


def test_another_fault_of_the_same_cause_is_another_message_that_must_be_acknowledged() -> None:
    told = Told()
    told.book.raise_("fault", ERROR, "encoder", 0.0, "look", about="encoder")
    told.book.acknowledge("", 1.0)
    told.book.raise_("fault", ERROR, "hard limit", 2.0, "look", about="hard limit")
    assert told.events == ["raised", "changed"]
    assert not told.book.lasting[0].acknowledged


def test_a_book_that_is_held_tells_the_end_of_what_it_has_told() -> None:
    told = Told()
    told.book.raise_("lost", ERROR, "silent for 5 s", 0.0)
    told.book.held = True
    told.book.raise_("other", ERROR, "now", 10.0)
    told.book.clear("lost", 20.0)
    told.book.clear("other", 30.0)
    assert told.rows == [("raised", "lost"), ("cleared", "lost")]


def test_a_book_that_is_held_tells_afterwards_what_lasts_and_a_clock_set_back_silences_nothing() -> None:
    told = Told()
    told.book.held = True
    for name in ("gone", "lasts"):
        told.book.raise_(name, ERROR, "m", 0.0, "look")
    told.book.clear("gone", 1.0)
    assert told.events == []
    told.book.held = False
    told.book.remind(2.0)
    assert told.rows == [("raised", "lasts")]
    told.book.remind(2.0 - 86_400.0)
    assert told.events == ["raised", "reminder"]


def test_the_worst_come_first_and_of_one_level_the_oldest() -> None:
    book = Told().book
    for name, level, t_s in (("a", WARNING, 3.0), ("b", ERROR, 2.0), ("c", WARNING, 1.0), ("d", ERROR, 4.0)):
        book.raise_(name, level, name, t_s)
    book.raise_("gone", ERROR, "gone", 0.0)
    book.clear("gone", 5.0)
    assert [each.name for each in book.lasting] == ["b", "d", "c", "a"]


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
    with pytest.raises(ValueError, match="there are: a, b, gone"):
        book.acknowledge("c", 5.0)


def test_the_newest_two_thousand_rows_of_the_history_are_kept() -> None:
    book = Told().book
    book.raise_("x", WARNING, "m", 0.0)
    book.history = [(float(k), "raised", "x", WARNING, "m") for k in range(MOST_HISTORY + 1)]
    kept = book.state()
    assert len(kept["history"]) == 2000
    assert (kept["history"][0][0], kept["history"][-1][0]) == (1.0, 2000.0)
