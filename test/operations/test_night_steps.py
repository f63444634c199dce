"""One step of the night at a time: when each thing leaves, what is counted, and what the records say."""

import json
import math
from typing import Any

import pytest

from rf_pointing.core.pass_outcome import LOSS_OF_SIGNAL
from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.executor import BlockState
from rf_pointing.operations.night import Night, NightState
from rf_pointing.operations.procedure import read_procedure
from rf_pointing.operations.recovery import read_table
from rf_pointing.operations.schedule import PassState, Schedule, ScheduledPass
from test.operations.test_schedule import LIMITS, RATES, a_pass

GIVEN = ("id", "target", "sensor", "search_from", "patience_s", "aos", "los", "name", "priority")
NAMES: dict[str, tuple[str, ...]] = {
    "track": GIVEN, "unwind": ("azimuth", "elevation"),
    **dict.fromkeys(("record", "end_record", "park", "stow", "stop_pass", "reset", "lamp"), ()),
}  # fmt: skip
PASS = f"""
version: 1
name: pass
parameters: {{{", ".join(f"{name}: null" for name in GIVEN)}}}
blocks:
  record: {{directives: [{{send: record}}], optional: true, skippable: true, timeout_s: 5}}
  track:
    directives:
      - send: track
        with: {{{", ".join(f'{name}: "${{{name}}}"' for name in GIVEN)}}}
        expect: {{tracking.target: {{is_not: ""}}}}
    timeout_s: 20
  pass:
    after: [track]
    then: {{tracking.target: "", tracking.reason: loss of signal}}
    fails: {{tracking.target: "", tracking.reason: {{is_not: loss of signal}}}}
    timeout_s: ${{patience_s}}
"""
TABLE = """
version: 1
actions:
  park: {send: park, expect: {antenna.mode: parked}, timeout_s: 50}
  stow: {send: stow, expect: {antenna.mode: stowed}, timeout_s: 50}
  unwind: {send: unwind, with: {azimuth: "${azimuth}", elevation: "${elevation}"}, timeout_s: 50}
  stop_pass: {send: stop_pass, expect: {tracking.target: ""}, timeout_s: 20}
  end_record: {send: end_record, timeout_s: 20}
  reset: {send: reset, timeout_s: 20}
causes:
  trouble: {when: {a.trouble: {is_not: ""}}, text: "{a.trouble}", night: wait}
  storm: {when: {a.storm: {is_not: ""}}, text: "{a.storm}", night: weather}
  halt: {when: {a.halt: {is_not: ""}}, text: "{a.halt}", night: stop}
  broken: {when: {a.broken: {is_not: ""}}, text: "{a.broken}", do: [reset], tries: 2, every_s: 10}
  unheld: {when: {pass.unheld_s: {above: 30}}, text: not held}
"""
START = (math.radians(10.0), 0.1)
"""Where the passes of `a_pass` begin: no slew is needed there, and a pass is begun 60 s before its rise."""


class Bench:
    """A night, what the station shows, and what was sent in each step; every request is accepted in the next one."""

    def __init__(self, *passes: ScheduledPass, begun_s: float | None = 0.0, blocks: str = PASS, **options: Any) -> None:
        params = {key: options.pop(key) for key in list(options) if key in BetweenParams.__dataclass_fields__}
        schedule = Schedule(LIMITS, RATES, BetweenParams(**params))
        schedule.add(passes)
        self.saved: list[str] = []
        self.told: list[tuple[str, str]] = []
        options = {"notify": lambda event, alarm: self.told.append((event, alarm.name))} | options
        self.night = Night(
            schedule, read_procedure(blocks, NAMES), read_table(TABLE, NAMES, AlarmParams()), self._send,
            save=lambda: self.saved.append(str(self.night.state_name)), **options,
        )  # fmt: skip
        self.shown: dict[str, Any] = {
            "antenna.mode": "holding", "antenna.azimuth": START[0], "antenna.elevation": START[1], "antenna.fault": "",
            "tracking.mode": "idle", "tracking.target": "", "tracking.reason": "start",
        }  # fmt: skip
        self.sent: list[tuple[int, str, dict[str, Any]]] = []
        self.answers = True
        self._new: list[tuple[int, str]] = []
        if begun_s is not None:
            self.night.start(begun_s)

    def _send(self, number: int, name: str, arguments: dict[str, Any]) -> None:
        self.sent.append((number, name, arguments))
        self._new.append((number, name))

    def show(self, **values: Any) -> None:
        self.shown |= {name.replace("__", "."): value for name, value in values.items()}

    def at(self, t_s: float, **values: Any) -> list[str]:
        """Show these values from now on, step, and return the names of what was sent."""
        self.show(**values)
        for name, value in self.shown.items():
            device, _, attribute = name.partition(".")
            self.night.take(device, {attribute: value}, t_s)
        new, self._new = self._new, []
        for number, _ in new if self.answers else ():
            self.night.respond(number, True, "", t_s)
        self.night.step(t_s)
        return [name for _, name in self._new]

    def begin(self, t_s: float) -> list[str]:
        """Let the pass begin at `t_s`; what it sends leaves in the next step."""
        assert self.at(t_s) == []
        return self.at(t_s + 0.5)

    def track(self, t_s: float, name: str = "a") -> None:
        """Let the pass begin at `t_s` and be tracked a second later."""
        assert "track" in self.begin(t_s)
        self.at(
            t_s + 1.0, tracking__target=name, tracking__mode="conscan", tracking__reason="", tracking__held=True,
            recorder__state="recording",
        )  # fmt: skip

    def counts(self, tracked_s: float, lost_s: float, loss_db: float) -> dict[str, float]:
        return {
            "tracking__seconds_tracked": tracked_s,
            "tracking__seconds_lost": lost_s,
            "tracking__mean_loss": loss_db,
        }

    def ended(self, reason: str = LOSS_OF_SIGNAL) -> dict[str, Any]:
        return {"tracking__target": "", "tracking__mode": "idle", "tracking__reason": reason, "tracking__held": False}

    @property
    def events(self) -> list[tuple[float, str, str]]:
        """What the night itself has noted since they were asked for: time, event, detail."""
        rows = [(e.t_s, e.event, e.detail) for e in self.night.journal if not e.directive]
        self.night.journal.clear()
        return rows


# Begin


def test_a_pass_begins_a_minute_before_its_rise_with_all_that_the_schedule_says() -> None:
    one = Bench(a_pass("a", 1000.0, name="nm", priority=4))
    assert one.at(939.5) == []
    assert (one.night.active_id, one.night.reason) == ("", "hold until nm")
    assert one.begin(940.0) == ["record", "track"]
    assert (one.night.active_id, one.night.reason) == ("a", "")
    assert one.sent[1] == (2, "track", {
        "id": "a", "target": "a", "sensor": "auto", "search_from": 940.0, "patience_s": 720.0, "aos": 1000.0,
        "los": 1600.0, "name": "nm", "priority": 4,
    })  # fmt: skip
    assert one.night.book.quiet_s == 600.0, "unless another time is given"
    entry = one.night.schedule.entry("a")
    assert (entry.state, entry.reason) == (PassState.ACTIVE, "")
    assert ("begun", "") in [row[1:] for row in one.events]


@pytest.mark.parametrize(
    ("own", "usual", "sensor"), [("", "program", "program"), ("array", "program", "array"), ("", "auto", "auto")]
)
def test_a_pass_has_its_own_sensor_or_that_of_the_night(own: str, usual: str, sensor: str) -> None:
    one = Bench(a_pass("a", 30.0, sensor=own), sensor=usual)
    one.begin(1.0)
    arguments = one.sent[1][2]
    # No search begins before 1970.
    assert (arguments["sensor"], arguments["search_from"]) == (sensor, 0.0)


def test_nothing_begins_before_the_place_of_the_antenna_is_known_and_new() -> None:
    one = Bench(a_pass("a", 1000.0))
    for missing in ("azimuth", "elevation"):
        value = one.shown.pop(f"antenna.{missing}")
        one.at(945.0)
        assert one.night.active_id == ""
        one.shown[f"antenna.{missing}"] = value
        if missing == "azimuth":
            one.night.expected_state._actual.pop("antenna.elevation")
    one.night.expected_state._actual.pop("antenna.azimuth")
    one.at(946.0)
    assert one.night.active_id == "a"
    one = Bench(a_pass("a", 1000.0))
    one.at(935.0)
    one.shown.clear()
    one.at(941.0)
    assert one.night.active_id == "", "6 s old"
    one = Bench(a_pass("a", 1000.0))
    one.at(935.5)
    one.shown.clear()
    one.at(940.4)
    assert one.night.active_id == "a"


def test_while_it_is_paused_nothing_begins_and_a_pass_in_work_goes_on() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0))
    one.at(900.0)
    one.night.pause(910.0)
    assert one.at(950.0) == []
    assert one.at(951.0, a__broken="it broke") == [], "no recovery either"
    one.night.resume(960.0)
    assert one.at(960.0, a__broken="") == []
    assert one.at(960.5) == ["record", "track"]
    one.night.pause(961.0)
    one.at(962.0, tracking__target="a", tracking__reason="")
    one.at(1601.0, **one.ended())
    assert [(record.id, record.attempts) for record in one.night.records] == [("a", 1)]
    assert one.night.state_name == NightState.PAUSED
    assert [row for row in one.events if row[1] in ("paused", "resumed")] == [
        (910.0, "paused", ""), (960.0, "resumed", ""), (961.0, "paused", ""),
    ]  # fmt: skip


@pytest.mark.parametrize(("cause", "state"), [("trouble", "missed"), ("storm", "weather")])
def test_a_pass_that_cannot_begin_is_over_with_the_cause_as_its_reason(cause: str, state: str) -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 9000.0))
    one.at(900.0, **{f"a__{cause}": "it rains"})
    assert one.at(1000.0) == []
    assert one.night.reason == "it rains"
    assert one.night.records == []
    one.at(1541.0)
    (record,) = one.night.records
    assert (record.id, record.state, record.reason, record.attempts, record.recorded) == (
        "a",
        state,
        "it rains",
        0,
        False,
    )
    assert (record.tracked_s, record.lost_s, record.loss_db) == (0.0, 0.0, 0.0)
    assert one.night.schedule.entry("a").state == state
    assert (1541.0, state, "it rains") in one.events
    assert len(one.night.records) == 1
    one.at(1542.0)
    assert len(one.night.records) == 1


# What is counted


def flown(tracked: tuple[float, float, float], **options: Any) -> Bench:
    one = Bench(a_pass("a", 1000.0, name="nm", element_age_s=7200.0), a_pass("z", 90_000.0), **options)
    one.track(940.0)
    one.at(1600.0, **one.counts(*tracked))
    one.at(1601.0, **one.ended())
    return one


def test_the_record_of_a_pass_has_its_seconds_and_its_mean_loss() -> None:
    one = flown((480.0, 90.0, 2.0))
    (record,) = one.night.records
    assert (record.id, record.name, record.aos_t_s, record.los_t_s) == ("a", "nm", 1000.0, 1600.0)
    assert (record.state, record.reason, record.attempts, record.recorded) == ("tracked", LOSS_OF_SIGNAL, 1, True)
    assert (record.tracked_s, record.lost_s, record.element_age_h, record.causes) == (480.0, 120.0, 2.0, ())
    # 570 s of the 600 s were received with 2 dB less.
    assert record.loss_db == pytest.approx(2.0 - 10.0 * math.log10(570.0 / 600.0))
    entry = one.night.schedule.entry("a")
    assert (entry.state, entry.tracked_s, entry.planned) == (PassState.TRACKED, 480.0, False)
    assert one.night.active_id == ""


@pytest.mark.parametrize(
    ("counts", "tracked_s", "lost_s", "loss_db"),
    [
        ((700.0, 50.0, 0.0), 600.0, 0.0, 0.0),
        ((500.0, 100.0, 60.0), 500.0, 100.0, 40.0),
        ((0.0, 0.0, 0.0), 0.0, 600.0, 40.0),
    ],
)
def test_a_record_never_has_more_than_the_pass_nor_less_than_the_sidelobes(
    counts: tuple[float, float, float], tracked_s: float, lost_s: float, loss_db: float
) -> None:
    record = flown(counts).night.records[0]
    assert (record.tracked_s, record.lost_s) == (tracked_s, lost_s)
    assert record.loss_db == pytest.approx(loss_db)


@pytest.mark.parametrize(
    ("least", "tracked_s", "state", "reason"),
    [
        (None, 481.0, "tracked", LOSS_OF_SIGNAL),
        (None, 479.0, "lost", "80 % of the pass was held, must be >= 80 %"),
        (0.3, 190.0, "tracked", LOSS_OF_SIGNAL),
        (0.3, 120.0, "lost", "20 % of the pass was held, must be >= 30 %"),
    ],
)
def test_a_pass_is_tracked_if_enough_of_it_was_held(
    least: float | None, tracked_s: float, state: str, reason: str
) -> None:
    options = {} if least is None else {"least_share": least}
    record = flown((tracked_s, 0.0, 0.0), **options).night.records[0]
    assert (record.state, record.reason) == (state, reason)


def test_two_attempts_are_counted_together_and_a_controller_that_begins_at_zero_takes_nothing_away() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0), least_share=0.5)
    one.track(940.0)
    one.at(1200.0, **one.counts(100.0, 20.0, 1.0))
    # The controller is killed: what it had counted stays.
    one.at(1201.0, **one.counts(0.0, 0.0, 0.0), **one.ended("killed"))
    assert one.night.blocks() == ["pass: anomaly, tracking.target='' and tracking.reason=killed"]
    assert one.at(1205.9) == []
    assert one.at(1206.0) == []
    assert one.at(1206.5) == ["record", "track"]
    assert ("tried again", "attempt 2") in [row[1:] for row in one.events]
    # What the controller shows of the pass before is not of this attempt.
    one.at(1207.0, **one.counts(150.0, 20.0, 9.0))
    one.at(1208.0, tracking__target="a", tracking__reason="", tracking__held=True, **one.counts(0.0, 0.0, 0.0))
    one.at(1599.0, **one.counts(300.0, 10.0, 3.0))
    one.at(1601.0, **one.ended())
    (record,) = one.night.records
    assert (record.tracked_s, record.attempts, record.state) == (400.0, 2, "tracked")
    received = (120.0 * 10.0**-0.1 + 310.0 * 10.0**-0.3) / 600.0
    assert record.loss_db == pytest.approx(-10.0 * math.log10(received))
    assert record.causes == ("tracking.target='' and tracking.reason=killed",)


def test_reasons_of_attempts_are_named_when_too_little_was_held() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.at(1200.0, **one.ended("one"))
    one.at(1206.0)
    one.at(1206.5)
    one.at(1207.0, tracking__target="a", tracking__reason="")
    one.at(1601.0, **one.ended())
    assert one.night.records[0].reason == (
        "0 % of the pass was held, must be >= 80 %: tracking.target='' and tracking.reason=one"
    )


def unheld_s(one: Bench) -> float:
    return one.night.expected_state.actual("pass.unheld_s").value


def test_the_time_without_the_target_counts_in_the_pass_from_when_it_was_held_last() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.track(940.0)
    for t_s, held, expected in (
        (999.0, False, 0.0), (1000.0, False, 0.0), (1010.0, False, 10.0), (1012.0, True, 0.0), (1020.0, False, 8.0),
        (1600.0, False, 588.0), (1601.0, False, 0.0),
    ):  # fmt: skip
        one.at(t_s, tracking__held=held)
        assert unheld_s(one) == pytest.approx(expected), t_s
    assert [name for event, name in one.told if event == "raised"] == ["unheld"]
    one.at(1602.0, **one.ended())
    assert unheld_s(one) == 0.0


def test_no_time_without_the_target_counts_before_the_pass_was_begun_nor_while_nothing_is_tracked() -> None:
    one = Bench(a_pass("a", 1000.0))
    # Held is what another pass before has left.
    one.at(990.0, tracking__held=True, a__trouble="x")
    one.at(1200.0, tracking__held=False, a__trouble="")
    one.at(1201.0)
    assert unheld_s(one) == 0.0
    one.at(1205.0, tracking__target="a", tracking__reason="")
    assert unheld_s(one) == 5.0
    one.night.skip("", 1206.0)
    one.at(1207.0)
    assert unheld_s(one) == 0.0, "it is being ended"


# Attempts


def failing(reason: str = "broke", **options: Any) -> Bench:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0), **options)
    one.track(940.0)
    one.at(1100.0, **one.ended(reason))
    return one


def test_attempts_are_five_seconds_apart_and_five_more_with_each_up_to_thirty() -> None:
    one, waits, t_s = failing(), [], 1100.0
    for number in range(1, 8):
        failed_s = t_s
        while one.night._work.number == number:
            t_s += 0.5
            one.at(t_s)
        waits.append(t_s - failed_s)
        one.at(t_s + 0.5)
        one.at(t_s + 1.0, tracking__target="a", tracking__reason="")
        t_s += 2.0
        one.at(t_s, **one.ended("broke"))
    assert waits == [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 30.0]
    assert one.night.records == []


@pytest.mark.parametrize("why", ["trouble", "paused", "action", "antenna.mode", "tracking.mode"])
def test_no_attempt_begins_while_something_speaks_against_it(why: str) -> None:
    one = failing()
    if why == "paused":
        one.night.pause(1101.0)
    elif why == "trouble":
        one.show(a__trouble="x")
    elif why == "action":
        one.show(a__broken="x")
        one.answers = False
    else:
        del one.shown[why]
    for t_s in (1102.0, 1107.0, 1110.0):
        one.at(t_s)
        assert one.night._work.number == 1
    if why == "paused":
        one.night.resume(1111.0)
    one.answers = True
    one.show(a__trouble="", a__broken="", antenna__mode="holding", tracking__mode="idle")
    for t_s in (1112.0, 1130.0, 1131.0):
        one.at(t_s)
    assert one.night._work.number == 2


def test_what_is_left_of_an_attempt_is_stopped_before_the_next() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.answers = False
    assert one.begin(940.0) == ["record", "track"]
    # The response is lost: after 20 s the attempt has failed, though the controller has the pass.
    one.at(961.0, tracking__target="a", tracking__reason="")
    assert one.night.blocks() == [
        "record: anomaly, record: no response for 5 s", "track: anomaly, track: no response for 20 s"
    ]  # fmt: skip
    assert one.at(965.0) == []
    assert one.at(966.0) == []
    assert one.at(966.5) == ["stop_pass"]
    one.answers = True
    assert one.at(967.0, **one.ended("stop was requested")) == []
    assert one.at(967.5) == ["record", "track"]


@pytest.mark.parametrize(("left_s", "lost"), [(61.0, False), (59.0, True)])
@pytest.mark.parametrize("cause", ["", "a storm"])
def test_a_pass_of_which_too_little_is_left_is_lost_for_the_cause_or_the_failure(
    left_s: float, lost: bool, cause: str
) -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.at(1600.0 - left_s, a__storm=cause, **one.ended("broke"))
    if lost:
        (record,) = one.night.records
        reason = "tracking.target='' and tracking.reason=broke"
        assert (record.state, record.reason) == (("weather", cause) if cause else ("lost", reason))
    else:
        assert one.night.records == []


def test_half_of_a_short_pass_must_be_left() -> None:
    for failed_s, lost in ((1024.0, False), (1026.0, True)):
        one = Bench(a_pass("a", 1000.0, los_s=1050.0), a_pass("z", 90_000.0))
        one.track(940.0)
        one.at(failed_s, **one.ended("broke"))
        assert bool(one.night.records) is lost


def test_a_refusal_of_the_pass_is_known_until_one_is_tracked() -> None:
    one = failing(least_share=0.0)
    assert one.night.expected_state.actual("pass.refused").value == ""
    one.at(1106.0)
    one.at(1106.5)
    one.at(1107.0, tracking__target="a", tracking__reason="", track__refused="the Sun")
    one.at(1108.0, **one.ended("broke"))
    assert one.night.expected_state.actual("pass.refused").value == "the Sun"
    one.at(1400.0)
    one.at(1400.5)
    one.at(1401.0, tracking__target="a", tracking__reason="")
    one.at(1545.0, **one.ended("broke"))
    assert one.night.expected_state.actual("pass.refused").value == "the Sun"
    assert [record.state for record in one.night.records] == ["lost"]


def test_a_refusal_is_forgotten_with_a_pass_that_was_tracked() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0), least_share=0.0)
    one.night.expected_state.observe("pass.refused", "the Sun", 900.0)
    one.track(940.0)
    one.at(1601.0, **one.ended())
    assert one.night.expected_state.actual("pass.refused").value == ""


def test_a_night_that_is_being_stopped_tries_no_pass_again() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.night.stop(1000.0)
    one.at(1100.0, **one.ended("broke"))
    (record,) = one.night.records
    assert (record.state, record.reason) == ("lost", "tracking.target='' and tracking.reason=broke")


# Ends


def test_a_pass_is_ended_ten_seconds_after_its_end_and_is_tracked() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    assert one.at(1610.0, **one.counts(590.0, 0.0, 0.0)) == []
    one.at(1610.5)
    assert one.at(1611.0) == ["stop_pass"]
    one.at(1611.0, **one.ended("stop was requested"))
    one.at(1611.5)
    (record,) = one.night.records
    assert (record.state, record.reason, record.tracked_s) == ("tracked", LOSS_OF_SIGNAL, 590.0)
    assert "the schedule ends it here" in [row[2] for row in one.events if row[1] == "ended early"]


def test_a_pass_that_ended_by_itself_is_not_ended_again() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    assert one.at(1620.0, **one.ended(), recorder__state="idle") == []
    assert [row for row in one.events if row[1] == "ended early"] == []


def test_a_pass_that_yields_is_stopped_in_time_and_counts_what_it_had() -> None:
    one = Bench(a_pass("a", 1000.0), least_share=0.1)
    one.track(940.0)
    # From either end of the present pass 150 deg at most, 26 s, and 5 s in addition.
    one.night.schedule.add([a_pass("u", 1400.0, priority=2, azimuth=(160.0, 240.0))])
    one.night.change(1200.0)
    assert one.at(1201.0, **one.counts(200.0, 5.0, 0.0)) == []
    end_s = one.night.schedule.ends_s(one.night.schedule.entry("a"), 1201.0)
    assert end_s == pytest.approx(1400.0 - 26.0 - 5.0)
    assert one.at(end_s - 0.5) == []
    one.at(end_s + 0.5, **one.counts(300.0, 50.0, 0.0))
    assert one.at(end_s + 1.0) == ["stop_pass"]
    assert one.night.records == [], "the controller still has it"
    one.at(end_s + 1.5, **one.ended("stop was requested"))
    one.at(end_s + 2.0)
    (record,) = one.night.records
    assert (record.id, record.state, record.tracked_s) == ("a", "lost", 300.0)
    assert record.reason == "it yields to a pass of a higher priority"


@pytest.mark.parametrize("missing", ["response", "end"])
def test_a_pass_that_is_ended_early_is_over_when_it_was_answered_and_the_controller_has_let_go(missing: str) -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.night.skip("", 1100.0)
    one.answers = False
    assert one.at(1101.0) == ["stop_pass"]
    if missing == "response":
        one.at(1102.0, **one.ended("stop was requested"))
        assert one.night.records == []
        one.night.respond(one.sent[-1][0], True, "", 1103.0)
    else:
        one.night.respond(one.sent[-1][0], False, "not now", 1102.0)
        one.at(1102.0)
        assert (one.night.blocks()[0], one.night.records) == ("pass: executing", [])
        one.show(**one.ended("stop was requested"))
    one.at(1103.0)
    assert [record.state for record in one.night.records] == ["skipped"]


def test_the_recording_is_ended_with_its_pass_and_only_if_there_is_one() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    assert one.at(1601.0, **one.ended()) == []
    assert one.at(1601.5) == ["end_record"]
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.at(1601.0, recorder__state="idle", **one.ended())
    assert "end_record" not in one.at(1601.5)


def test_a_pass_is_recorded_if_the_block_of_the_recorder_was_completed() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.begin(940.0)
    one._new.clear()
    one.night.respond(1, False, "no space", 941.0)
    one.night.respond(2, True, "", 941.0)
    one.at(942.0, tracking__target="a", tracking__reason="")
    one.at(1601.0, **one.ended())
    assert [(record.recorded, record.attempts) for record in one.night.records] == [(False, 1)]
    without = PASS.replace(
        "  record: {directives: [{send: record}], optional: true, skippable: true, timeout_s: 5}\n", ""
    )
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0), blocks=without)
    one.track(940.0)
    one.at(1601.0, **one.ended())
    assert [record.recorded for record in one.night.records] == [False]


def test_causes_of_a_pass_are_what_was_raised_from_ten_minutes_before_it_and_what_lasted_since() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    book = one.night.book
    for name, raised_s, cleared_s in (
        ("old", 399.0, 390.0), ("lasting", 399.0, None), ("early", 401.0, 402.0), ("late", 1600.0, 1600.5),
        ("after", 1600.5, 1600.6),
    ):  # fmt: skip
        book.raise_(name, 1, f"of {name}", raised_s)
        if cleared_s is not None:
            book.clear(name, cleared_s)
    book.raise_("worse", 1, "first", 300.0)
    book.raise_("worse", 2, "second", 1200.0)
    one.track(940.0)
    one.at(1601.0, **one.ended())
    (record,) = one.night.records
    assert record.causes == (
        "early: of early", "late: of late", "worse: second", "lasting: of lasting",
    )  # fmt: skip


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
    one = Bench(a_pass("a", 1000.0, element_age_s=planned_s), a_pass("z", 90_000.0))
    one.track(940.0)
    if seen is not None:
        one.night.take("elements", {"age_h": seen[1]}, seen[0])
    one.at(1601.0, **one.ended())
    assert one.night.records[0].element_age_h == age_h


# Targets


def test_the_pass_of_the_target_is_the_one_that_shares_most_with_that_of_the_schedule() -> None:
    one = Bench(a_pass("a", 1000.0))
    seen = lambda name: one.night.expected_state.actual(f"ephemeris.{name}").value  # noqa: E731
    one.night.take_passes("x", [(1000.0, 1600.0, "whole")], 900.0)
    assert (seen("target"), seen("pass"), seen("pass_found")) == ("x", None, False), "no pass is in work"
    one.at(940.0)
    windows = [(0.0, 1000.0, "before"), (900.0, 1010.0, "10 s"), (1500.0, 1700.0, "100 s"), (1300.0, 1400.0, "too"),
               (1600.0, 1900.0, "after")]  # fmt: skip
    one.night.take_passes("x", windows, 941.0)
    assert (seen("pass"), seen("pass_found")) == ("100 s", True)
    one.night.take_passes("x", [(999.0, 1000.5, "short")], 942.0)
    assert seen("pass") == "short"
    one.night.take_passes("x", [(0.0, 1000.0, "before"), (1700.0, 1800.0, "after")], 943.0)
    assert (seen("pass"), seen("pass_found")) == (None, False)


# Requests


def test_requests_are_refused_where_they_do_not_fit_and_are_kept_and_noted_where_they_do() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0), begun_s=None)
    night = one.night
    for name in ("pause", "resume", "stop", "abort"):
        with pytest.raises(ValueError, match="the executive is idle, must be "):
            getattr(night, name)(0.0)
    assert (night.finished, one.saved) == (True, [])
    night.start(5.0)
    assert (night.begun_s, math.isnan(night.ended_s), night.finished) == (5.0, True, False)
    with pytest.raises(ValueError, match="^the executive is running$"):
        night.start(6.0)
    with pytest.raises(ValueError, match="the executive is running, must be paused"):
        night.resume(6.0)
    night.pause(7.0)
    for name, message in (("start", "^the executive is paused$"), ("pause", "is paused, must be running")):
        with pytest.raises(ValueError, match=message):
            getattr(night, name)(7.5)
    night.resume(8.0)
    night.change(9.0)
    night.stop(10.0)
    night.stop(11.0)
    assert one.saved == ["running", "paused", "running", "running", "stopping", "stopping"]
    assert one.events == [
        (5.0, "started", "2 passes"), (7.0, "paused", ""), (8.0, "resumed", ""), (9.0, "schedule changed", "2 passes"),
        (10.0, "stop was requested", ""), (11.0, "stop was requested", ""),
    ]  # fmt: skip
    # One that is being stopped may go on, with what it has done so far.
    night.records.append("kept")
    night.start(12.0)
    assert (night.state_name, night.begun_s, night.records) == (NightState.RUNNING, 5.0, ["kept"])


def test_a_night_that_begins_anew_has_no_records_and_no_history() -> None:
    one = Bench(begun_s=None)
    one.night.records.append("old")
    one.night.book.raise_("x", 1, "m", 0.0)
    one.night.start(5.0)
    assert (one.night.records, one.night.book.history) == ([], [])


def test_a_stopped_night_ends_after_its_pass_and_an_aborted_one_at_once() -> None:
    for request in ("stop", "abort"):
        one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0))
        one.track(940.0)
        getattr(one.night, request)(1100.0)
        sent = one.at(1101.0, recorder__state="idle")
        assert (one.night._action is not None) is (request == "abort")
        assert sent == (["stop_pass"] if request == "abort" else [])
        one.at(1102.0, **one.ended("stop was requested" if request == "abort" else LOSS_OF_SIGNAL))
        for t_s in (1102.5, 1103.0, 1103.5):
            one.at(t_s)
        assert one.sent[-1][1] == "stow"
        assert not one.night.finished
        one.at(1104.0, antenna__mode="stowed")
        one.at(1105.0)
        assert one.night.finished
        assert (one.night.reason, one.night.ended_s >= 1104.0) == ("stop was requested", True)
        first, second = one.night.records
        assert (second.id, second.state, second.reason) == ("b", "missed", "stop was requested")
        assert first.reason == ("the night was aborted" if request == "abort" else one.night.records[0].reason)
        assert one.events[-1][1:] == ("ended", "stop was requested")


def test_an_aborted_night_without_a_pass_is_stopped() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.night.abort(10.0)
    assert one.night.state_name == NightState.STOPPING


def test_passes_and_blocks_are_skipped_by_their_names() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0), a_pass("c", 5000.0), a_pass("d", 7000.0))
    one.night.schedule.entry("c").state = PassState.YIELDS
    assert one.night.skip("c", 10.0) == "pass c is skipped"
    assert one.night.skip("b", 10.0) == "pass b is skipped"
    for name in "bc":
        entry = one.night.schedule.entry(name)
        assert (entry.state, entry.reason) == (PassState.SKIPPED, "skipped by the operator")
    with pytest.raises(ValueError, match="pass b is skipped"):
        one.night.skip("b", 11.0)
    with pytest.raises(ValueError, match="pass 'e' is not in the schedule"):
        one.night.skip("e", 11.0)
    with pytest.raises(ValueError, match="no pass is in work: name the one to skip"):
        one.night.skip("", 11.0)
    one.at(940.0)
    assert one.night.skip("record", 940.5) == "block record is skipped"
    assert one.night._work.executor.runs["record"].state == BlockState.SKIPPED
    assert "skipped" in [row[1] for row in one.events]
    with pytest.raises(ValueError, match="track must not be skipped"):
        one.night.skip("track", 940.5)
    assert one.night.skip("a", 941.0) == "pass a is skipped"
    one.at(942.0)
    (record,) = one.night.records
    assert (record.id, record.state, record.reason) == ("a", "skipped", "skipped by the operator")
    assert one.night.schedule.entry("d").state == PassState.WAITING


def test_a_skipped_pass_that_is_tracked_is_stopped_once() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0))
    one.track(940.0)
    one.night.skip("", 1100.0)
    one.night.skip("", 1100.5)
    assert one.at(1101.0) == ["stop_pass"]
    assert [row for row in one.events if row[1] == "ended early"] == [
        (1100.0, "ended early", "skipped by the operator")
    ]


# Recovery


def test_an_action_is_tried_while_it_runs_and_while_it_is_being_stopped_one_at_a_time() -> None:
    one = Bench(a_pass("a", 1000.0))
    assert one.at(10.0, a__broken="it broke") == []
    assert ("recovery", "broken: reset") in [row[1:] for row in one.events]
    assert one.at(10.5) == ["reset"]
    assert one.night.blocks() == ["reset: executing"]
    assert one.at(11.0) == []
    assert one.night.blocks() == []
    assert one.at(19.5) == []
    one.at(20.0)
    assert one.at(20.5) == ["reset"]
    assert one.at(40.0) == [], "twice, as the table says"
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0))
    one.track(940.0)
    one.night.stop(1000.0)
    one.at(1001.0, a__broken="it broke")
    assert one.at(1001.5) == ["reset"]


def test_an_action_that_fails_is_given_up() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.answers = False
    one.at(10.0, a__broken="x")
    one.at(10.5)
    assert one.at(30.5) == []
    assert one.night.blocks() == ["reset: executing"]
    one.at(31.0)
    # Its time is over; the second try begins in the same step.
    assert one.night.recovery.ongoing["broken"].tried == 2
    assert len([name for _, name, _ in one.sent if name == "reset"]) == 1


# Rest


def resting(rest: str, mode: str = "holding", place: tuple[float, float] = START) -> Bench:
    aos_s = {"hold": 1000.0, "unwind": 1000.0, "park": 5000.0, "stow": 20_000.0}[rest]
    one = Bench(a_pass("a", aos_s, name="nm"))
    one.show(antenna__mode=mode, antenna__azimuth=place[0], antenna__elevation=place[1])
    return one


FAR = (math.radians(-175.0), 0.1)


@pytest.mark.parametrize(
    ("rest", "mode", "acts"),
    [
        ("hold", "parked", False), ("hold", "holding", False),
        ("park", "holding", True), ("park", "parking", False), ("park", "parked", False), ("park", "stowed", False),
        ("park", "stowing", False), ("park", "fault", True),
        ("stow", "holding", True), ("stow", "parked", True), ("stow", "stowing", False), ("stow", "stowed", False),
        ("unwind", "holding", True), ("unwind", "parked", False), ("unwind", "stowed", False), ("unwind", "disabled", False),
    ],
)  # fmt: skip
def test_between_two_passes_the_antenna_is_brought_to_rest_unless_it_is_there(rest: str, mode: str, acts: bool) -> None:
    one = resting(rest, mode, FAR if rest == "unwind" else START)
    one.at(100.0)
    assert one.night.reason == f"{rest} until nm"
    assert one.at(100.5) == ([rest] if acts else [])
    if rest == "unwind" and acts:
        assert one.sent[0][2] == {"azimuth": START[0], "elevation": START[1]}


def test_a_rest_that_is_not_reached_is_requested_again_after_a_minute() -> None:
    one, sent = resting("park"), []
    for k in range(360):
        sent += [(0.5 * k, name) for name in one.at(0.5 * k)]
    # It may take 50 s, which ends an attempt; the next one is a minute after the one before.
    assert sent == [(0.5, "park"), (60.5, "park"), (120.5, "park")]


def test_another_rest_is_requested_at_once() -> None:
    one = resting("park")
    one.at(100.0)
    assert one.at(100.5) == ["park"]
    one.at(101.0, antenna__mode="parked")
    one.night.schedule.remove(["a"])
    one.night.schedule.add([a_pass("b", 30_000.0)])
    one.night.change(102.0)
    one.at(102.0)
    assert one.night.reason == "stow until b"
    assert one.at(102.5) == ["stow"]


# The end of the night


@pytest.mark.parametrize(("mode", "fault", "stows"), [
    ("holding", "", True), ("stowed", "", False), ("stowing", "", False), ("holding", "broken", False),
])  # fmt: skip
def test_the_night_ends_with_the_antenna_stowed_if_it_can_be(mode: str, fault: str, stows: bool) -> None:
    one = Bench()
    one.show(antenna__mode=mode, antenna__fault=fault)
    one.at(10.0)
    assert one.night.finished is not stows
    assert one.at(10.5) == (["stow"] if stows else [])
    if stows:
        one.at(11.0)
        assert not one.night.finished
        one.at(12.0, antenna__mode="stowed")
        one.at(12.5)
    assert (one.night.finished, one.night.reason) == (True, "the schedule is done")
    assert one.saved[-1] == "idle"


def test_a_night_whose_last_stow_fails_ends_without_a_second() -> None:
    one = Bench()
    sent = [name for k in range(240) for name in one.at(0.5 * k)]
    assert sent == ["stow"]
    assert one.night.finished
    assert 50.0 <= one.night.ended_s <= 53.0


def test_a_night_goes_on_while_a_pass_is_planned_and_what_only_yields_is_no_reason_to() -> None:
    one = Bench(a_pass("a", 1000.0, antenna="other"))
    one.at(10.0, antenna__mode="stowed")
    assert one.night.finished
    assert one.night.records == []
    assert one.night.schedule.entry("a").state == PassState.YIELDS
    one = Bench(a_pass("a", 1000.0))
    one.at(10.0, antenna__mode="stowed")
    assert not one.night.finished


def test_a_cause_that_stops_the_night_ends_it_with_its_text() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("yields", 1000.0, peak_rad=0.1))
    one.at(10.0)
    assert one.night.schedule.entry("yields").state == PassState.YIELDS
    one.at(11.0, antenna__mode="stowed", a__halt="fire")
    assert (one.night.finished, one.night.reason, one.night.ended_s) == (True, "fire", 11.0)
    # What was planned is missed; what was to be left out stays so.
    assert [(each.id, each.state, each.reason) for each in one.night.records] == [("a", "missed", "fire")]
    assert one.night.schedule.entry("yields").state == PassState.YIELDS


# Responses


def test_responses_that_nobody_waits_for_are_noted() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.night.respond(77, True, "what?", 5.0)
    one.night.fail(77, "what?", 5.0)
    assert (5.0, "unexpected response", "77: what?") in one.events


def test_a_report_of_failure_ends_the_attempt_with_its_text() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.begin(940.0)
    one.at(941.0)
    one.night.fail(2, "the goal was aborted", 942.0)
    assert (942.0, "anomaly", "the goal was aborted") in one.events
    assert one.night.blocks() == ["track: anomaly, the goal was aborted"]


def test_numbers_of_long_ago_are_forgotten() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.begin(940.0)
    one.night._numbers |= dict.fromkeys(range(3, 1000), one.night._numbers[1])
    one.night._number = 1000
    one.answers = False
    one.night.skip("record", 941.0)
    one.night._begin_action("reset", 941.0)
    one.night.step(941.0)
    assert (1 in one.night._numbers, 2 in one.night._numbers, 1001 in one.night._numbers) == (False, True, True)


# State


def test_what_leaves_is_kept_before_and_progress_once() -> None:
    one = Bench(a_pass("a", 1000.0))
    order: list[str] = []
    one.night._send = lambda _number, name, _arguments: order.append(name)
    one.night._save = lambda: order.append("kept")
    one.at(900.0)
    order.clear()
    one.at(901.0)
    assert order == [], "nothing has changed"
    one.at(940.0)
    assert order == ["kept", "kept"], "that it has begun, and its blocks"
    order.clear()
    one.at(940.5)
    assert order == ["kept", "record", "kept", "track", "kept"]
    order.clear()
    one.night.respond(1, True, "", 940.75)
    one.at(940.75)
    assert order == ["kept"]
    order.clear()
    one.at(941.0)
    assert order == []


def restored(one: Bench, now_s: float) -> Bench:
    other = Bench(begun_s=None)
    other.night.restore(json.loads(json.dumps(one.night.state())), now_s)
    return other


def test_a_restored_night_is_the_same_and_waits_for_new_views_of_antenna_and_controller() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0), begun_s=2.5)
    one.track(940.0)
    one.at(1099.0, **one.counts(100.0, 3.0, 1.0))
    one.at(1100.0, **one.ended("broke"))
    one.night.records.append(flown((500.0, 1.0, 0.5)).night.records[0])
    other = restored(one, 1101.0)
    assert other.night.records == one.night.records
    assert (other.night.active_id, other.night.begun_s, other.night.state_name) == ("a", 2.5, NightState.RUNNING)
    attempt, before = other.night._work, one.night._work
    for name in ("id", "begun_s", "number", "failed_s", "reasons", "received_s", "tracked_s", "following", "ending"):
        assert getattr(attempt, name) == getattr(before, name), name
    assert (attempt.tracked_s, attempt.received_s) == (100.0, pytest.approx(103.0 * 10.0**-0.1))
    assert [row[1:] for row in other.events if row[1] == "restored"] == [("restored", ""), ("restored", "running")]
    for missing in ("antenna.mode", "tracking.mode"):
        other = restored(one, 1101.0)
        value = other.shown.pop(missing)
        assert other.at(1110.0) == []
        other.night.expected_state.observe(missing, value, 1110.0)
        # 6 s old is no view of now.
        assert other.at(1116.0) == []
        other.shown[missing] = value
    assert other.at(1117.0, **other.ended("broke")) == []
    assert other.at(1117.5) == ["record", "track"]
    assert "goes on after a restart" in [row[1] for row in other.events]


def test_a_restored_pass_that_is_tracked_goes_on_without_being_sent_again() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("z", 90_000.0), least_share=0.5)
    one.track(940.0)
    one.at(942.0)
    other = restored(one, 1200.0)
    other.night.least_share = 0.5
    other.show(tracking__target="a", tracking__mode="conscan", tracking__reason="", **other.counts(400.0, 0.0, 0.0))
    assert other.at(1201.0) == []
    assert other.night.blocks() == ["pass: executing"]
    other.at(1601.0, **other.ended())
    assert [(each.id, each.state, each.tracked_s) for each in other.night.records] == [("a", "tracked", 400.0)]


def test_a_state_of_before_its_first_start_begins_when_it_is_restored() -> None:
    one = Bench(a_pass("a", 1000.0), begun_s=None)
    state = one.night.state()
    assert (state["version"], state["state"], state["begun_s"], state["attempt"]) == (1, "idle", None, None)
    other = restored(one, 77.0)
    assert other.night.begun_s == 77.0
    one.night.start(3.0)
    assert one.night.state()["begun_s"] == 3.0


def test_the_alarms_of_before_a_restart_are_there_afterwards() -> None:
    one = Bench(a_pass("a", 1000.0))
    one.at(10.0, a__storm="gust")
    other = restored(one, 11.0)
    assert [each.name for each in other.night.book.lasting] == ["storm"]
    # It was told before the restart.
    other.at(12.0, a__storm="gust")
    assert other.told == []


# The plan


def test_the_plan_is_made_anew_after_a_minute_and_after_every_change() -> None:
    one = Bench(a_pass("a", 1000.0))
    plans: list[float] = []
    replan = one.night.schedule.replan
    one.night.schedule.replan = lambda now_s, place, taken: (plans.append(now_s), replan(now_s, place, taken))
    for k in range(250):
        one.at(0.5 * k)
    assert plans == [0.0, 60.5, 121.0]
    one.night.change(125.0)
    one.at(125.0)
    assert plans[-1] == 125.0
    one.at(939.0)
    one.track(940.0)
    plans.clear()
    for t_s in (960.0, 980.0, 1001.0, 1030.0, 1062.0):
        one.at(t_s)
    assert plans == [1001.0, 1062.0], "in a pass as well"


def test_what_another_antenna_tracks_is_left_out() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0))
    one.night.taken = {"a"}
    one.at(10.0)
    assert one.night.schedule.entry("a").reason == "another antenna tracks it"
    assert one.night.schedule.next() is one.night.schedule.entry("b")
