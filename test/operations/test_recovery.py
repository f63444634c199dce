"""The recovery table as a file that a station may change, and what it makes of what is seen."""

import json
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.operations import AlarmParams, Condition, ExpectedState
from rf_pointing.operations.alarms import ERROR, WARNING, AlarmBook
from rf_pointing.operations.dictionary import TABLES, read_tables
from rf_pointing.operations.recovery import Cause, Recovery, RecoveryTable, read_table

NAMES = {"reset": (), "go": ("azimuth",)}


def test_the_shipped_tables_belong_together_and_cover_what_they_must() -> None:
    tables = read_tables(AlarmParams())
    assert {"latched_fault", "lost_node", "lost_drive", "lost_signal", "rejected_certificate", "full_disk",
            "stale_elements", "high_wind"} <= {cause.name for cause in tables.recovery.causes}  # fmt: skip
    assert {"park", "stow", "unwind", "stop_pass", "end_record"} <= set(tables.recovery.actions)
    assert {"select_target", "track", "calibrate_feed", "record", "park", "stow", "unwind", "accept_model"} <= set(
        tables.directives
    )


def test_a_station_adds_directives_and_changes_the_recovery(tmp_path: Any) -> None:
    own, table = tmp_path / "own.yaml", tmp_path / "recovery.yaml"
    own.write_text(
        "version: 1\ndirectives:\n  transmitter_off: {service: tx/off, type: std_srvs/srv/Trigger}\n"
        "  park: {service: crane/park, type: std_srvs/srv/Trigger}\n"
    )
    shipped = (TABLES / "recovery.yaml").read_text()
    table.write_text(
        shipped.replace("  park: {send: park,", "  silence: {send: transmitter_off}\n  park: {send: park,")
    )
    tables = read_tables(AlarmParams(), str(own), recovery=str(table))
    assert tables.directives["park"].address == "crane/park"
    assert "silence" in tables.recovery.actions
    with pytest.raises(ValueError, match=r"recovery.yaml: actions|transmitter_off"):
        read_tables(AlarmParams(), recovery=str(table))


def cause_of(row: str, *, actions: str = "{reset: {send: reset}, go: {send: go}}", **thresholds: Any) -> Cause:
    text = f"version: 1\nactions: {actions}\ncauses: {{some_cause: {row}}}"
    (cause,) = read_table(text, NAMES, AlarmParams(**thresholds)).causes
    return cause


def test_what_a_cause_does_not_say_is_usual() -> None:
    when = (Condition(attribute="a.b", test="is", wanted=1),)
    assert cause_of("{when: {a.b: 1}}") == Cause(
        name="some_cause", when=when, unless=(), for_s=0.0, level=ERROR, text="some cause", again="",
        do=(), not_by_itself="", reported_by_another="", tries=0,
        every_s=10.0, ask="", night="continue", last="continue",
    )  # fmt: skip
    assert cause_of("{when: {a.b: 1}, night: weather}").last == "weather"
    whole = (
        "{when: {a.b: 1}, unless: {a.b: 1}, for_s: '${fault_s}', level: warning, text: t,"
        " again: a.c, do: [go, reset], not_by_itself: 'x|y', reported_by_another: z,"
        " tries: 3, every_s: 0.5, ask: q, night: wait, last: stop}"
    )
    assert cause_of(whole, fault_s=7.5) == Cause(
        name="some_cause", when=when, unless=when, for_s=7.5, level=WARNING, text="t", again="a.c",
        do=("go", "reset"), not_by_itself="x|y", reported_by_another="z",
        tries=3, every_s=0.5, ask="q", night="wait", last="stop",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("{}", "causes.some_cause.when must map attributes to values"),
        ("{when: {}}", "causes.some_cause.when must have at least one condition"),
        ("{when: {a.b: 1}, for_s: true}", "causes.some_cause.for_s=True must be a number >= 0"),
        ("{when: {a.b: 1}, every_s: x}", "every_s='x' must be a number >= 0"),
        ("{when: {a.b: 1}, every_s: -0.5}", "every_s=-0.5 must be a number >= 0"),
        ("{when: {a.b: 1}, tries: .inf}", "tries=inf must be a number >= 0"),
        ("{when: {a.b: 1}, tries: -1}", "tries=-1 must be a number >= 0"),
        ("{when: {a.b: 1}, not_by_itself: '('}", "is not a regular expression"),
        ("{when: {a.b: 1}, reported_by_another: '('}", "reported_by_another='[(]' is not a regular expression"),
        ("{when: {a.b: 1}, for_s: '${fault}'}", "fault must be one of the thresholds node_silent_s"),
        ("{when: {a.b: 1}, asks: look}", "unknown asks; known are"),
        ("{when: {a.b: 1}, level: 3}", "level=3 must be one of warning, error"),
        ("{when: {a.b: 1}, night: sleep}", "night='sleep' must be one of continue, wait, weather, stop"),
        ("{when: {a.b: 1}, last: sleep}", "last='sleep' must be one of continue"),
        ("{when: {a.b: 1}, do: [x, go, b]}", "causes.some_cause.do: b, x must be one of go, reset"),
        ("{when: {a.b: {above: '${quick}'}}}", "causes.some_cause.when.a.b.above=..quick.: quick must be one of"),
        ("{when: {a.b: {one_of: ['${quick}']}}}", "causes.some_cause.when.a.b.one_of=..quick.: quick must be"),
    ],
)
def test_a_cause_that_cannot_be_watched_is_refused(row: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cause_of(row)


@pytest.mark.parametrize(
    "text", ["[1]", "version: 1\nactions: {}\ncauses: {}\nmore: {}", "version: 2\nactions: {}\ncauses: {}"]
)
def test_a_file_that_is_no_table_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="must have version: 1, actions and causes"):
        read_table(text, NAMES, AlarmParams())


@pytest.mark.parametrize(
    ("key", "given"), [("actions", "[1]"), ("actions", "{a: 1}"), ("causes", "{a: 1}"), ("causes", "3")]
)
def test_actions_and_causes_map_names_to_keys(key: str, given: str) -> None:
    rows = {"actions": "{}", "causes": "{}"} | {key: given}
    with pytest.raises(ValueError, match=f"^{key} must map names to their keys$"):
        read_table(f"version: 1\nactions: {rows['actions']}\ncauses: {rows['causes']}", NAMES, AlarmParams())


def test_an_action_is_a_procedure_of_one_block_that_may_be_given_a_place() -> None:
    with pytest.raises(ValueError, match="send='fly' must be one of go, reset"):
        cause_of("{when: {a.b: 1}}", actions="{reset: {send: fly}}")
    table = read_table(
        "version: 1\nactions: {go: {send: go, with: {azimuth: '${azimuth}'}, when: {a.b: 1}, timeout_s: 7}}\ncauses: {}",
        NAMES, AlarmParams(),
    )  # fmt: skip
    action = table.actions["go"]
    assert action.parameters == {"azimuth": 0.0, "elevation": 0.0}
    (block,) = action.blocks.values()
    assert (block.name, block.timeout_s, [each.name for each in block.directives]) == ("go", 7.0, ["go"])
    assert [str(each) for each in block.directives[0].when] == ["a b must be 1"]


def test_thresholds_are_filled_in_wherever_they_stand() -> None:
    cause = cause_of("{when: {a.b: {one_of: ['${fault_s}', x]}}, text: 'not ${fault_s} here'}", fault_s=3.0)
    assert cause.when[0].wanted == (3.0, "x")
    assert cause.text == "not ${fault_s} here"


SHIPPED = read_tables(AlarmParams()).recovery


class Watched:
    """A recovery of one or two causes, or by the shipped table, and the expected_state that it watches."""

    def __init__(self, causes: str = "") -> None:
        self.expected_state = ExpectedState()
        text = f"version: 1\nactions: {{reset: {{send: reset}}, go: {{send: go}}}}\ncauses:\n{causes}"
        self.told: list[tuple[str, str]] = []
        book = AlarmBook(lambda event, alarm: self.told.append((event, alarm.name)), 600.0)
        table = read_table(text, NAMES, AlarmParams()) if causes else SHIPPED
        self.recovery = Recovery(table, self.expected_state, book)

    def see(self, t_s: float, **values: object) -> None:
        for name, value in values.items():
            self.expected_state.observe(name.replace("__", "."), value, t_s)
        self.recovery.step(t_s)


def test_a_cause_is_an_alarm_once_it_has_lasted_and_begins_anew_when_it_was_away() -> None:
    one = Watched("  x: {when: {a.b: 1}, for_s: 5, text: 'b is {a.b}', night: wait, ask: q}")
    for t_s, value in ((0.0, 1), (4.9, 1), (5.0, 2), (6.0, 1), (10.9, 1)):
        one.see(t_s, a__b=value)
        assert (one.recovery.book.lasting, one.recovery.effect()) == ([], ("continue", ""))
    one.see(11.0, a__b=1)
    (alarm,) = one.recovery.book.lasting
    assert (alarm.name, alarm.level, alarm.message, alarm.ask, alarm.raised_t_s) == ("x", ERROR, "b is 1", "q", 11.0)
    assert one.recovery.effect() == ("wait", "b is 1")
    one.see(12.0, a__b=2)
    assert one.recovery.book.lasting == []
    assert one.recovery.effect() == ("continue", "")


def test_what_must_not_be_tried_is_asked_for_at_once() -> None:
    one = Watched(
        "  x: {when: {a.b: {is_not: ''}}, do: [reset], not_by_itself: hard, tries: 2, text: '{a.b}', ask: look,"
        " night: wait, last: stop}"
    )
    one.see(0.0, a__b="past the hard limit")
    assert (one.recovery.due(0.0), one.recovery.effect()[0]) == (None, "stop")
    assert one.recovery.book.lasting[0].ask == "look"


def test_all_conditions_of_a_cause_hold_together() -> None:
    one = Watched("  x: {when: {a.b: 1, a.c: 2}}")
    one.see(0.0, a__b=1, a__c=1)
    assert one.recovery.ongoing == {}
    one.see(1.0, a__b=1, a__c=2)
    assert list(one.recovery.ongoing) == ["x"]


def test_the_actions_of_a_cause_take_turns_with_their_time_between_them() -> None:
    one = Watched(
        "  x: {when: {a.b: 1}, for_s: 1, do: [reset, go], tries: 3, every_s: 4, night: wait, last: stop, ask: q}"
    )
    tried = []
    for k in range(40):
        t_s = 0.5 * k
        one.see(t_s, a__b=1)
        due = one.recovery.due(t_s)
        # Nobody is needed while something is left to try, nor before the last try had its time.
        if one.recovery.book.lasting:
            assert one.recovery.book.lasting[0].ask == ("q" if t_s >= 13.0 else "")
            assert one.recovery.effect()[0] == ("stop" if t_s >= 13.0 else "wait")
        if due:
            tried.append((t_s, *due))
            one.recovery.note_try("x", t_s)
    assert tried == [(1.0, "x", "reset"), (5.0, "x", "go"), (9.0, "x", "reset")]
    one.recovery.note_try("not there", 20.0)


@pytest.mark.parametrize(("away_s", "tries"), [(1799.0, 1), (1801.0, 0)])
def test_a_cause_that_comes_back_within_half_an_hour_has_the_tries_of_before(away_s: float, tries: int) -> None:
    one = Watched("  x: {when: {a.b: 1}, do: [reset], tries: 5, every_s: 2000}")
    one.see(0.0, a__b=1)
    assert one.recovery.due(0.0) == ("x", "reset")
    one.recovery.note_try("x", 0.0)
    one.see(10.0, a__b=2)
    one.see(10.0 + away_s, a__b=1)
    assert one.recovery.ongoing["x"].tried == tries
    assert (one.recovery.due(10.0 + away_s) is None) is (tries == 1)
    assert one.recovery.ongoing["x"].since_s == 10.0 + away_s


def test_the_gravest_cause_says_how_the_night_goes_on() -> None:
    one = Watched("\n".join(f"  {name}: {{when: {{a.{name}: 1}}, night: {night}}}" for name, night in (
        ("b", "weather"), ("c", "continue"), ("d", "stop"), ("e", "wait"), ("f", "wait"))))  # fmt: skip
    for k, (seen, effect) in enumerate((
        ("c", ("continue", "c")), ("e", ("wait", "e")), ("f", ("wait", "e")), ("b", ("weather", "b")),
        ("d", ("stop", "d")),
    )):  # fmt: skip
        one.see(0.1 * k, **{f"a__{seen}": 1})
        assert one.recovery.effect() == effect


def test_devices_have_causes_of_their_own_by_the_whole_name_of_the_attribute() -> None:
    one = Watched("  x: {when: {'*.t': {above: 5}, a.on: true}, text: '{device} {*.t} {a.on} {*.none} {b.t}', ask: q}")
    one.see(0.0, a__on=True, b__t=7.12345, c__t=6, d__t=1.0, e__start=9.0, f__t__t=9.0)
    assert [(each.name, each.message) for each in one.recovery.book.lasting] == [
        ("x b", "b 7.123 True unknown 7.123"), ("x c", "c 6 True unknown 7.123"),
    ]  # fmt: skip
    one.see(1.0, a__on=True, b__t=1.0, c__t=6)
    assert [each.name for each in one.recovery.book.lasting] == ["x c"]
    assert one.told[-1] == ("cleared", "x b")


def test_age_and_test_of_a_condition_stay_when_it_is_made_one_of_a_device() -> None:
    one = Watched("  x: {when: {'*.t': {below: 5, max_age_s: 30}}}")
    one.expected_state.observe("b.t", 1.0, 0.0)
    one.recovery.step(29.0)
    assert list(one.recovery.ongoing) == ["x b"]
    one.recovery.step(31.0)
    assert list(one.recovery.ongoing) == []


def test_alarms_of_before_a_restart_end_if_their_causes_have_gone_and_others_stay() -> None:
    one = Watched("  x: {when: {'*.t': {above: 5}}}\n  y: {when: {a.b: 1}}")
    for name in ("x b", "x c", "y", "other"):
        one.recovery.book.raise_(name, ERROR, name, 0.0)
    one.see(1.0, b__t=9.0)
    assert {each.name for each in one.recovery.book.lasting} == {"x b", "other"}


@pytest.mark.parametrize("acts", [True, False])
def test_nothing_is_tried_and_nobody_is_waited_for_in_vain_while_the_device_cannot_be_reached(acts: bool) -> None:
    one = Watched(
        "  x: {when: {a.fault: {is_not: ''}}, unless: {d.problem: {is_not: ''}}, do: [reset], tries: 2, every_s: 10,"
        " ask: '{a.fault}: look', again: a.fault}"
    )
    one.recovery.acts, tried = acts, []
    for k in range(700):
        one.see(float(k), a__fault="lost", d__problem="refused" if 3 <= k < 603 else "")
        if due := one.recovery.due(float(k)):
            tried.append(k)
            one.recovery.note_try(due[0], float(k))
    assert tried == ([0, 603] if acts else [])
    (alarm,) = one.recovery.book.lasting
    assert (alarm.ask, alarm.about) == ("lost: look", "lost")
    # A restart forgets no try: half an hour counts from when the cause was there last.
    state = json.loads(json.dumps(one.recovery.state()))
    again = Watched("  x: {when: {a.fault: {is_not: ''}}, do: [reset], tries: 2}")
    again.recovery.restore(state, 5000.0)
    again.see(5001.0, a__fault="lost")
    assert again.recovery.ongoing["x"].tried == (2 if acts else 0)


def test_what_cannot_be_reached_from_the_start_is_not_raised_before_it_can() -> None:
    one = Watched("  x: {when: {a.fault: {is_not: ''}}, unless: {d.problem: {is_not: ''}}, for_s: 2, ask: look}")
    for t_s, problem, raised in ((0.0, "refused", 0), (9.0, "refused", 0), (10.0, "", 0), (11.5, "", 1)):
        one.see(t_s, a__fault="lost", d__problem=problem)
        assert len(one.recovery.book.lasting) == raised, t_s


@given(back_s=st.floats(0.1, 1e5), at_s=st.integers(0, 90))
def test_a_clock_that_is_set_back_lengthens_no_wait(back_s: float, at_s: int) -> None:
    """Tries come when they would have come: 5 of them, 20 s apart, from 2 s after the cause on."""

    def tries(back_s: float) -> list[int]:
        cause = cause_of("{when: {a.b: 1}, for_s: 2, do: [reset], tries: 5, every_s: 20}")
        seen, found = ExpectedState(), list[int]()
        recovery = Recovery(RecoveryTable((cause,), {}), seen, AlarmBook(lambda *_: None, 600.0))
        for wall_s in range(130):
            if wall_s == at_s:
                seen.set_back(back_s)
                recovery.set_back(back_s)
            now_s = 1e6 + wall_s - (back_s if wall_s >= at_s else 0.0)
            seen.observe("a.b", 1, now_s)
            recovery.step(now_s)
            if due := recovery.due(now_s):
                recovery.note_try(due[0], now_s)
                found.append(wall_s)
        return found

    usual = tries(0.0)
    assert len(usual) == 5
    # The rounding of such times may cost a step.
    assert tries(back_s) == pytest.approx(usual, abs=5)


@pytest.mark.parametrize("helps", [True, False])
def test_a_drive_that_was_lost_and_found_is_one_alarm_unless_its_fault_stays(helps: bool) -> None:
    """By the shipped table: the fault that it leaves is reset without a word, and told when no try has helped."""
    one, told = Watched(), list[tuple[int, str, str]]()
    # Another fault has used four of its five tries just before.
    one.recovery.restore({"latched_fault": (4, -100.0, -50.0)}, 0.0)
    fault, tried_k = "", 1000
    for k in range(300):
        lost = "refused" if 10 <= k < 70 else ""
        # The antenna takes two steps to do it.
        fault = "drive lost: refused" if lost else "" if helps and k > tried_k + 1 else fault
        one.see(float(k), antenna__fault=fault, drive__problem=lost)
        told += [(k, *each) for each in one.told[len(told) :]]
        if due := one.recovery.due(float(k)):
            one.recovery.note_try(due[0], float(k))
            tried_k = k
    assert told[:2] == [(13, "raised", "lost_drive"), (70, "cleared", "lost_drive")]
    # Five tries from 2 s after the drive has come back, and 20 s for each.
    assert [row for row in told[2:] if row[1] != "reminder"] == ([] if helps else [(171, "raised", "latched_fault")])


@pytest.mark.parametrize("wind", ["", "gust 30 m/s, limit 25 m/s"])
def test_a_pass_that_the_wind_interrupts_is_one_alarm(wind: str) -> None:
    one = Watched()
    for k in range(120):
        seen = {"tracking__target": "A", "tracking__held": k < 10, "tracking__seconds_lost": max(0.0, k - 10.0)}
        one.see(float(k), **seen, antenna__high_wind=wind if 10 <= k < 100 else "")
    assert [name for event, name in one.told if event == "raised"] == ["high_wind" if wind else "lost_signal"]


@given(outages=st.lists(st.integers(2, 120), min_size=6, max_size=12))
def test_what_a_lost_drive_leaves_is_reset_after_every_outage(outages: list[int]) -> None:
    """By the shipped table, 2 s after the drive is back, however many outages there were in half an hour.

    A loss of more than 3 s is the one alarm, and the night never waits for a hand.
    """
    one, t_s, fault = Watched(), 0.0, ""
    for lasts_s in outages:
        for k in range(lasts_s + 40):
            t_s += 1.0
            lost = "refused" if k < lasts_s else ""
            fault = "drive lost: refused" if lost else fault
            one.see(t_s, antenna__fault=fault, drive__problem=lost)
            assert one.recovery.effect()[0] in ("continue", "wait")
            if due := one.recovery.due(t_s):
                one.recovery.note_try(due[0], t_s)
                assert not lost
                assert k <= lasts_s + 3
                fault = ""
        assert fault == ""
    events = [(event, name) for _, event, name, *_ in one.recovery.book.history]
    assert events == [("raised", "lost_drive"), ("cleared", "lost_drive")] * sum(each > 3 for each in outages)


SEEN = {
    "antenna.fault": "azimuth encoder jumped by 0.400 deg", "servo.silent_s": 31.25, "recorder.missing_s": 31.25,
    "drive.problem": "no answer", "antenna.high_wind": "gust 26.0 m/s, limit 25.0 m/s", "tracking.target": "NOAA 19",
    "tracking.held": False, "tracking.seconds_lost": 12.5, "tracking.mode": "coast", "tracking.reason": "no carrier",
    "pass.refused": "elevation below the horizon", "next.missing": "no drive", "next.in_s": 30.0, "next.name": "METEOR",
    "next.due": "in 30 s", "radio.failed": "the radio does not answer", "executive.lost": "no executive_status for 9 s",
    "mail.not_sent": "connection refused", "clocks.offset_ms": 9e5, "clocks.problem": "the clocks differ by 900 s",
    "antenna.sun_margin_rad": -0.01, "antenna.sun": "the Sun reaches the beam in 280 s",
    "computer.memory_free_mb": 1.0, "disk.free_gb": 0.01, "elements.age_h": 9e3, "elements.target": "NOAA 19",
    "executive.problem": "No space left on device", "partner.silent": "gs2",
}  # fmt: skip


@pytest.mark.parametrize("cause", SHIPPED.causes, ids=lambda cause: cause.name)
def test_every_text_of_the_shipped_table_is_filled_in_by_what_is_seen(cause: Cause) -> None:
    """Text, request and what makes it another message: nothing is unknown, and no place is left open."""
    holds_off = {each.attribute for each in cause.unless}
    named = re.findall(r"{([\w.*]+)}", f"{cause.text} {cause.ask}")
    seen, book = ExpectedState(), AlarmBook(lambda *_: None, 600.0)
    recovery = Recovery(RecoveryTable((cause,), SHIPPED.actions), seen, book, acts=False)
    for t_s in (0.0, 1e5):
        for name, value in SEEN.items():
            if name not in holds_off:
                seen.observe(name, value, t_s)
        recovery.step(t_s)
    assert len(book.lasting) == 1
    (alarm,) = book.lasting
    assert not re.search(r"[{}$]|unknown", f"{alarm.message} {alarm.ask}")
    for name in named:
        value = alarm.name.split()[-1] if name == "device" else SEEN[next(k for k in SEEN if fits(name, k))]
        shown = f"{value:.4g}" if isinstance(value, float) else str(value)
        assert shown in f"{alarm.message} {alarm.ask}", name


def fits(name: str, attribute: str) -> bool:
    """Return whether an attribute is the named one, of any device for `*`."""
    return attribute == name or (name.startswith("*.") and attribute.endswith(name[1:]))
