"""Alarms without storm or silence, and the recovery table as a file that a station may change."""

from typing import Any

import pytest

from rf_pointing.operations import AlarmParams, Situation
from rf_pointing.operations.alarms import ERROR, WARNING, Alarm, AlarmBook
from rf_pointing.operations.dictionary import TABLES, read_directives, read_tables
from rf_pointing.operations.recovery import Recovery, read_table

NAMES = {"reset": (), "go": ("azimuth",)}
TABLE = """
version: 1
actions:
  reset: {send: reset, expect: {a.fault: ""}}
causes:
  fault:
    when: {a.fault: {is_not: ""}}
    for_s: ${fault_s}
    do: [reset]
    not_by_itself: hard
    tries: 2
    every_s: 10
    text: "fault {a.fault}"
    ask: look
    night: wait
    last: stop
  silent:
    when: {"*.silent_s": {above: "${node_silent_s}"}}
    text: "{device} for {*.silent_s} s"
    level: warning
"""


def book() -> tuple[AlarmBook, list[tuple[str, str]]]:
    notified: list[tuple[str, str]] = []
    return AlarmBook(lambda event, alarm: notified.append((event, alarm.name)), 600.0), notified


def test_a_cause_that_lasts_is_one_message_however_often_it_is_seen() -> None:
    alarms, notified = book()
    for k in range(1000):
        alarms.raise_("x", WARNING, f"message {k}", float(k))
    assert notified == [("raised", "x")]
    assert alarms.lasting[0].message == "message 999"


def test_a_cause_that_comes_and_goes_is_no_storm_and_is_counted() -> None:
    alarms, notified = book()
    for k in range(200):
        alarms.raise_("x", WARNING, "on", 2.0 * k)
        alarms.clear("x", 2.0 * k + 1.0)
    # 400 s, within the quiet time: one message of its raise, and one of its first end.
    assert notified == [("raised", "x"), ("cleared", "x")]
    assert alarms.alarms["x"].count == 200
    alarms.raise_("x", WARNING, "on", 2000.0)
    assert notified[-1] == ("raised", "x")


def test_what_gets_worse_is_told_at_once_and_must_be_acknowledged_again() -> None:
    alarms, notified = book()
    alarms.raise_("x", WARNING, "near", 0.0)
    assert alarms.acknowledge("", 1.0) == ["x"]
    assert alarms.lasting[0].acknowledged
    alarms.raise_("x", ERROR, "over", 2.0)
    assert notified == [("raised", "x"), ("worse", "x")]
    assert not alarms.lasting[0].acknowledged
    with pytest.raises(ValueError, match="there is no alarm 'y'; there are: x"):
        alarms.acknowledge("y", 3.0)


def test_alarms_go_out_and_in_unchanged() -> None:
    alarms, _ = book()
    alarms.raise_("x", WARNING, "near", 0.0, "do it")
    alarms.clear("x", 5.0)
    other, _ = book()
    other.restore(alarms.state())
    assert other.state() == alarms.state()
    assert isinstance(other.alarms["x"], Alarm)


def recovery(**thresholds: Any) -> tuple[Recovery, Situation]:
    situation = Situation()
    return Recovery(read_table(TABLE, NAMES, AlarmParams(**thresholds)), situation, book()[0]), situation


def test_an_action_is_tried_as_often_as_the_table_says_then_the_night_goes_on_its_last_way() -> None:
    one, situation = recovery(fault_s=2.0)
    tried = []
    for k in range(100):
        situation.observe("a.fault", "drive", float(k))
        one.step(float(k))
        if due := one.due(float(k)):
            tried.append((float(k), due))
            one.note_try(due[0], float(k))
            assert one.effect()[0] in ("wait", "stop")
    assert tried == [(2.0, ("fault", "reset")), (12.0, ("fault", "reset"))]
    assert one.effect() == ("stop", "fault drive")
    assert one.book.lasting[0].ask == "look"
    situation.observe("a.fault", "", 101.0)
    one.step(101.0)
    assert one.effect() == ("continue", "")
    assert not one.book.lasting


def test_what_must_not_be_tried_is_asked_for_at_once() -> None:
    one, situation = recovery(fault_s=0.0)
    situation.observe("a.fault", "past the hard limit", 0.0)
    one.step(0.0)
    assert one.due(0.0) is None
    assert one.effect()[0] == "stop"
    assert one.book.lasting[0].ask == "look"


def test_every_device_has_an_alarm_of_its_own() -> None:
    one, situation = recovery(node_silent_s=5.0)
    for name, silent_s in (("n1", 9.0), ("n2", 1.0), ("n3", 7.5)):
        situation.observe(f"{name}.silent_s", silent_s, 0.0)
    one.step(0.0)
    assert [(each.name, each.message) for each in one.book.lasting] == [
        ("silent n1", "n1 for 9 s"), ("silent n3", "n3 for 7.5 s")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version: 1", "version: 2", "must have version: 1"),
        ("send: reset", "send: fly", "send='fly' must be one of go, reset"),
        ("do: [reset]", "do: [fly]", "causes.fault.do: fly must be one of reset"),
        ("night: wait", "night: sleep", "night='sleep' must be one of continue, wait, weather, stop"),
        ("tries: 2", "tries: -1", "tries=-1 must be a number >= 0"),
        ("not_by_itself: hard", "not_by_itself: '('", "is no regular expression"),
        ("${fault_s}", "${fault}", "fault must be one of the thresholds node_silent_s"),
        ("ask: look", "asks: look", "unknown asks; known are"),
        ("level: warning", "level: 3", "level=3 must be one of warning, error"),
    ],
)
def test_a_mistake_in_the_table_is_refused_with_its_place(old: str, new: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_table(TABLE.replace(old, new), NAMES, AlarmParams())


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


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("{service: a/b}", "type='' must be given"),
        ("{service: a/b, type: std_srvs/Trigger}", "must be as in package/srv/Name"),
        ("{action: a, service: b, type: x/srv/Y}", "must have one of service"),
        ("{parameter: speed}", "a parameter as in node/name"),
        ("{own: record, size: 3}", "may have type and takes"),
    ],
)
def test_a_mistake_in_the_dictionary_is_refused(row: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_directives(f"version: 1\ndirectives: {{x: {row}}}")
