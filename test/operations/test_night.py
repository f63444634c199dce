"""The night: a small station on which anything happens at any time, and single steps where numbers are promised."""

import contextlib
import json
import math
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rf_pointing.core import AXES
from rf_pointing.core.pass_outcome import LOSS_OF_SIGNAL
from rf_pointing.operations import AlarmParams, BetweenParams, read_procedure
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.executor import block_text
from rf_pointing.operations.night import Night, NightState
from rf_pointing.operations.pass_work import filler_text, fillers_of
from rf_pointing.operations.recovery import read_table
from rf_pointing.operations.schedule import OPEN, PassState, Schedule, ScheduledPass
from rf_pointing.station.clients.station_alarms import TRIED_RAD, place_values
from test.operations.test_schedule import LIMITS, PARK, RATES, a_pass

STEP_S = 1.0
TABLES = read_tables(AlarmParams())
TRIES = next(each.tries for each in TABLES.recovery.causes if each.name == "latched_fault")


class Station:
    """An antenna and a controller that do what is commanded within seconds, and publish it to the night."""

    procedure, between, name = TABLES.procedure, BetweenParams(), ""

    def __init__(self, *passes: ScheduledPass) -> None:
        self.passes = {item.id: item for item in passes}
        self.mode, self.fault, self.wind, self.place = "parked", "", "", PARK
        self.target, self.reason, self.tracked_s, self.window = "", "start", 0.0, None
        self.silent_s, self.free_gb, self.refuses, self.recording = 0.0, 100.0, "", ""
        self.drive, self.missing = "", list[str]()
        self.scan, self.scan_ends, self.scan_ends_s = "", "complete", 0.0
        self.told: list[tuple[float, str, str]] = []
        self.sent: list[str] = []
        self.names: dict[int, str] = {}
        self.kept: list[str] = []
        self.now_s, self.speaks = 0.0, True
        self._answers: list[tuple[int, str]] = []
        self._goal: int | None = None
        self.night = self.executive()
        self.night.schedule.change(passes)
        self.night.start(0.0)

    def executive(self) -> Night:
        """Return a night that has just been started, as after its process was killed."""
        self._answers.clear()
        schedule = Schedule(LIMITS, RATES, self.between, self.name)
        told = lambda event, alarm: self.told.append((self.now_s, event, alarm.name))  # noqa: E731
        self.night = Night(
            schedule, self.procedure, TABLES.recovery, self._send, save=self._save, notify=told,
            scan_procedure=TABLES.scan,
        )  # fmt: skip
        return self.night

    def _save(self) -> None:
        self.kept = [json.dumps(self.night.state())]

    def _send(self, number: int, name: str, arguments: dict[str, Any]) -> None:
        assert json.loads(self.kept[-1])["attempt"] == json.loads(json.dumps(self.night.state()["attempt"])), name
        self.sent.append(name)
        error = self._do(name, arguments)
        if name == "select_target":
            self.names[number] = f"bird {arguments['target']}"
        if name == "track" and not error:
            self._goal = number
        self._answers.append((number, error))

    def _do(self, name: str, arguments: dict[str, Any]) -> str:
        if name == "select_target":
            item = self.passes[self.night.active_id]
            assert arguments["target"] == item.target
            self.night.take_passes(item.name, [(item.aos_t_s + 0.7, item.los_t_s + 0.7, item)], self.now_s)
        elif name == "track":
            if refused := self.fault or self.refuses:
                self.night.take("track", {"refused": refused}, self.now_s)
                return refused
            assert not self.target, "another pass is tracked"
            assert self.mode in ("holding", "tracking")
            self.window, self.target, self.tracked_s, self.mode = arguments["target_pass"], "x", 0.0, "tracking"
        elif name == "scan":
            assert arguments == {"name": self.night.active_id, "target": "x", "pattern": "cross"}
            self.scan, self.scan_ends_s = "scanning", self.now_s + 150.0
        elif name == "stop_pass":
            self._end("stop was requested")
        elif name == "reset_antenna_fault":
            if self.mode != "fault":
                return "no fault is latched"
            assert not self.drive, "a try is wasted"
            assert "hard limit" not in self.fault
            self.fault, self.mode = "", "holding"
        elif name in ("park", "stow"):
            if self.fault:
                return f"fault latched ({self.fault})"
            assert not self.target
            self.mode = {"park": "parked", "stow": "stowed"}[name]
        elif name == "release":
            if self.wind:
                return self.wind
            self.mode = "holding"
        elif name == "unwind":
            self.place = arguments["azimuth"], arguments["elevation"]
        elif name == "record":
            if self.free_gb < 1.0:
                return "No space left on device"
            self.recording = arguments["name"]
        elif name == "end_record":
            self.recording = ""
        return ""

    def trip(self, fault: str) -> None:
        self.fault, self.mode = fault, "fault"
        if self.target:
            self._end(f"antenna fault: {fault}")

    def _end(self, reason: str) -> None:
        self.target, self.reason, self.window = "", reason, None
        self.mode = "holding" if self.mode == "tracking" else self.mode
        if self._goal is not None and reason != LOSS_OF_SIGNAL:
            self.night.fail(self._goal, reason, self.now_s)
        self._goal = None

    def run(self, seconds: float) -> None:
        """Go on for a time, or until the night is over."""
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            begun = self.window is not None and self.now_s >= self.window.aos_t_s
            self.tracked_s += STEP_S * begun
            if begun and self.now_s >= self.window.los_t_s:
                self._end(LOSS_OF_SIGNAL)
            if self.scan and self.now_s >= self.scan_ends_s:
                self.scan = self.scan_ends
            if self.speaks:
                self._publish(begun)
            self.night.take_readiness(self.missing, self.now_s)
            self.night.step(self.now_s)
            if self.night.finished:
                return

    def _publish(self, held: bool) -> None:
        answers, self._answers = self._answers, []
        for number, error in answers:
            self.night.respond(number, not error, error, self.now_s, self.names.get(number, ""))
        place = {} if self.drive else place_values(self.place, TRIED_RAD)["antenna"]
        for device, values in {
            "drive": {"problem": self.drive},
            "antenna": {"mode": self.mode, "fault": self.fault, "high_wind": self.wind, "moving": False, **place},
            "test_place": dict(zip(AXES, TRIED_RAD, strict=True)),
            "tracking": {"mode": "conscan" if self.target else "idle", "target": self.target, "reason": self.reason,
                         "held": held, "seconds_tracked": self.tracked_s, "seconds_lost": 0.0, "mean_loss": 0.1},
            "pointing_controller": {"silent_s": self.silent_s, "failed": ""}, "disk": {"free_gb": self.free_gb},
            "scan": {"state": self.scan},
            "recorder": {"state": "recording" if self.recording else "idle"},
            **{node: {"failed": ""} for node in ("antenna_servo", "ephemeris_publisher")},
            "computer": {"memory_free_mb": 500.0}, "executive": {"problem": ""},
        }.items():  # fmt: skip
            self.night.take(device, values, self.now_s)

    @property
    def states(self) -> dict[str, str]:
        return {record.id: record.state for record in self.night.records}


def two() -> tuple[ScheduledPass, ...]:
    return a_pass("a", 1000.0), a_pass("b", 2000.0, azimuth=(200.0, 120.0))


def test_why_a_pass_is_not_tracked_is_reported_by_its_newest_cause_until_another_is() -> None:
    station = Station(*two())

    def alarms() -> dict[str, str]:
        return {alarm.name: alarm.message for alarm in station.night.book.lasting}

    for cause in ("it is in the Sun", "it is behind a hill"):
        station.refuses = cause
        station.run(1060.0 if cause.endswith("Sun") else 90.0)
        assert set(alarms()) == {"not_ready", "rejected_certificate"}
        assert all(cause in message for message in alarms().values())
    station.night.pause(station.now_s)
    station.run(5.0)
    assert "not_ready" not in alarms(), "an operator holds the passes back"
    station.night.resume(station.now_s)
    station.run(600.0)
    assert set(alarms()) == {"rejected_certificate"}, "the pass is over, and what hindered it is not mended"
    station.refuses = ""
    station.run(1e4)
    assert (station.states, alarms()) == ({"a": "lost", "b": "tracked"}, {})


def test_a_clock_that_is_set_back_and_a_restart_hold_up_no_recovery() -> None:
    station = Station(*two())
    station.run(1100.0)
    station.trip("azimuth drive")
    station.run(4.0)
    # It trips again at once: what counts is the time to the next try.
    station.trip("azimuth drive")
    station.now_s -= 600.0
    station.run(30.0)
    assert (station.fault, station.sent.count("reset_antenna_fault")) == ("", 2)
    kept = json.loads(station.kept[-1])
    station.executive().restore(kept, station.now_s)
    station.run(60.0)
    assert [entry.event for entry in station.night.journal].count("goes on after a restart") == 1


class Precalibrated(Station):
    """A station that is calibrated before each pass."""

    procedure = read_tables(AlarmParams(), procedure="precalibration").procedure
    between = BetweenParams(lead_s=300.0)


def test_seven_blocks_come_before_a_pass_and_none_of_them_before_it_is_joined_again() -> None:
    station = Precalibrated(*two())
    station.run(900.0)
    before = ["select_target", "record", "release", "unwind", "unwind", "track"]
    assert sorted(station.sent) == sorted(before)
    assert station.sent[-3:] == before[-3:]
    assert station.target, "the goal is given before the rise"
    assert len(station.procedure.blocks["track"].after) + 1 == 7
    station.run(150.0)
    station.trip("azimuth drive")
    del station.sent[:]
    station.run(60.0)
    assert station.target
    assert "unwind" not in station.sent
    station.run(1e5)
    assert station.states == {"a": "tracked", "b": "tracked"}


def test_a_procedure_of_maintenance_runs_between_passes_only_and_its_outcome_is_kept() -> None:
    station, test = Station(*two()), TABLES.maintenance["self_test"]
    station.run(1.0)
    station.night.run(test, station.now_s)
    station.run(60.0)
    entry = next(each for each in station.night.journal if each.event == "self_test")
    assert entry.detail.count("completed") == len(test.blocks), entry.detail
    assert station.mode == "parked"
    station.run(400.0)
    with pytest.raises(ValueError, match=r"may take \d+ s, must be <= \d+ s to the next pass"):
        station.night.run(test, station.now_s)
    station.run(1000.0)
    assert station.night.active_id
    with pytest.raises(ValueError, match="self_test must wait: a is in work"):
        station.night.run(test, station.now_s)


@given(fills=st.lists(st.booleans(), min_size=2, max_size=5), lost=st.integers(0, 4))
@settings(max_examples=15, deadline=None)
def test_a_filler_is_counted_by_its_gaps_and_a_number_gets_the_name_of_its_target(fills: list[bool], lost: int) -> None:
    """One pass after the other, the filler's in the gaps; one is refused by the antenna."""
    items = [
        a_pass(f"p{k}", 600.0 + 900.0 * k, target="28" if fills_gap else "25544", filler=fills_gap)
        for k, fills_gap in enumerate(fills)
    ]
    station, said = Station(*items), list[str]()
    for k, item in enumerate(items):
        station.refuses = "it is in the Sun" if k == lost else ""
        station.run(item.aos_t_s + 100.0 - station.now_s)
        said.append(station.night.reason)
        station.run(item.los_t_s + 20.0 - station.now_s)
    station.run(1e5)
    count, tracked = sum(fills), sum(each for k, each in enumerate(fills) if k != lost)
    number = iter(range(1, count + 1))
    assert said == [f"gap {next(number)} of {count}" if each else "" for each in fills]
    assert {record.name for record in station.night.records} == {f"bird {item.target}" for item in items}
    found = fillers_of(station.night.records)
    held_s = [each.tracked_s for each in found.get("bird 28", []) if each.state == "tracked"]
    hours = sum(held_s) / 3600.0
    assert math.isclose(hours, tracked / 6.0, rel_tol=0.02, abs_tol=0.001)
    shown = f"{tracked}" if tracked == count else f"{tracked} of {count}"
    assert {name: filler_text(each) for name, each in found.items()} == (
        {"bird 28": f"tracked in {shown} gap{'s' * (shown != '1')}, {hours:.1f} h"} if count else {}
    )


class AnyNight(RuleBasedStateMachine):
    """Whatever happens to a night of three passes, it ends, and nothing is moved that must not be."""

    @initialize()
    def begin(self) -> None:
        self.station = Station(*two(), a_pass("c", 3300.0, azimuth=(-100.0, -260.0)))
        self.station.run(880.0)

    @property
    def night(self) -> Night:
        return self.station.night

    @rule(seconds=st.sampled_from([1.0, 7.0, 60.0, 300.0, 700.0]))
    def time_goes_on(self, seconds: float) -> None:
        self.station.run(seconds)

    @rule(fault=st.sampled_from(["azimuth drive runs at 0.05 deg/s", "azimuth past the hard limit"]))
    def a_fault_is_latched(self, fault: str) -> None:
        self.station.trip(fault)
        self.station.run(20.0)

    @rule(wind=st.sampled_from(["", "gust 30 m/s"]), silent_s=st.sampled_from([0.0, 30.0]),
          free_gb=st.sampled_from([0.5, 100.0]), refuses=st.sampled_from(["", "", "3.2 deg from the Sun"]))  # fmt: skip
    def the_surroundings_change(self, wind: str, silent_s: float, free_gb: float, refuses: str) -> None:
        station = self.station
        station.wind, station.silent_s, station.free_gb, station.refuses = wind, silent_s, free_gb, refuses
        station.run(5.0)

    @rule(seconds=st.sampled_from([1.0, 8.0, 90.0]))
    def nothing_arrives(self, seconds: float) -> None:
        self.station.speaks = False
        self.station.run(seconds)
        self.station.speaks = True

    @rule(name=st.sampled_from(["pause", "resume", "resume", "change"]))
    def an_operator_requests(self, name: str) -> None:
        with contextlib.suppress(ValueError):
            getattr(self.night, name)(self.station.now_s)

    @rule(name=st.sampled_from(["", "b", "record"]))
    def an_operator_skips(self, name: str) -> None:
        with contextlib.suppress(ValueError):
            self.night.skip(name, self.station.now_s)

    @precondition(lambda self: not self.night.finished)
    @rule()
    def the_executive_is_killed(self) -> None:
        station, sent, records = self.station, len(self.station.sent), len(self.night.records)
        station.executive().restore(json.loads(station.kept[-1]), station.now_s)
        assert len(self.night.records) == records
        station.speaks = False
        station.run(10.0)
        station.speaks = True
        assert len(station.sent) == sent, "nothing is sent before the station has been seen"

    @invariant()
    def one_pass_is_in_work_and_each_that_is_over_has_one_record(self) -> None:
        entries = self.night.schedule.entries
        active = [name for name, each in entries.items() if each.state == PassState.ACTIVE]
        assert active == ([self.night.active_id] if self.night.active_id else [])
        assert len(self.station.states) == len(self.night.records)
        for record in self.night.records:
            entry = entries[record.id]
            assert (record.state, record.reason) == (entry.state, entry.reason)
            assert entry.state not in (*OPEN, PassState.ACTIVE)
            whole = record.tracked_s + record.lost_s
            assert whole == pytest.approx(600.0) if record.attempts else whole == 0.0
            assert record.state != PassState.TRACKED or record.tracked_s >= 480.0
        assert self.station.sent.count("reset_antenna_fault") <= TRIES * (1 + self.station.sent.count("track"))

    def teardown(self) -> None:
        station = self.station
        station.fault, station.wind, station.silent_s, station.refuses = "", "", 0.0, ""
        station.mode = "holding" if station.mode == "fault" else station.mode
        station.run(5.0)
        if self.night.state_name == NightState.PAUSED:
            self.night.resume(station.now_s)
        station.run(max(0.0, 3900.0 - station.now_s) + 700.0)
        assert self.night.finished, self.night.reason
        assert station.mode == "stowed"
        # A pass that was skipped before it began has no record.
        over = {name for name, each in self.night.schedule.entries.items() if each.state not in OPEN}
        skipped = {name for name, each in self.night.schedule.entries.items() if each.state == PassState.SKIPPED}
        assert over - skipped <= set(station.states) <= over


# Not shortened: hours of a night are stepped in each attempt.
AnyNight.TestCase.settings = settings(
    max_examples=20, stateful_step_count=12, deadline=None, suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate),
)  # fmt: skip
TestAnyNight = AnyNight.TestCase


def test_a_quiet_night_tracks_and_records_every_pass_and_stows_the_antenna() -> None:
    station = Station(*two())
    station.run(4000.0)
    assert station.states == {"a": "tracked", "b": "tracked"}
    assert all(
        record.tracked_s == pytest.approx(600.0, abs=2.0) and record.recorded for record in station.night.records
    )
    assert (station.mode, station.sent.count("track"), station.night.book.history) == ("stowed", 2, [])
    assert station.now_s < 2700.0


@pytest.mark.parametrize(
    ("trouble", "until_s", "first", "alarm"),
    [
        ({"wind": "gust 30 m/s"}, 1700.0, "weather", "high_wind"), ({"silent_s": 30.0}, 1300.0, "lost", "lost_node"),
        ({"free_gb": 0.5}, 4000.0, "tracked", "full_disk"), ({"refuses": "3.2 deg from the Sun"}, 1700.0, "lost",
        "rejected_certificate"), ({"fault": "azimuth past the hard limit"}, 1700.0, "missed", "latched_fault"),
    ],
)  # fmt: skip
def test_a_trouble_costs_what_it_must_and_the_next_pass_is_tracked(
    trouble: dict[str, Any], until_s: float, first: str, alarm: str
) -> None:
    station = Station(*two())
    station.run(900.0)
    vars(station).update(trouble)
    station.run(until_s - 900.0)
    vars(station).update({name: type(value)() for name, value in trouble.items() if name != "free_gb"})
    station.run(2000.0)
    assert station.states == {"a": first, "b": "tracked"}
    assert alarm in {row[2].partition(" ")[0] for row in station.night.book.history if row[1] == "raised"}
    assert all(record.recorded is ("free_gb" not in trouble) for record in station.night.records if record.attempts)


def test_while_it_is_paused_nothing_begins_also_after_a_restart() -> None:
    station = Station(*two())
    station.run(900.0)
    station.night.pause(900.0)
    station.executive().restore(json.loads(station.kept[-1]), 901.0)
    station.run(660.0)
    assert "track" not in station.sent
    station.night.resume(station.now_s)
    station.run(3000.0)
    assert station.states == {"a": "missed", "b": "tracked"}


def test_an_executive_that_was_away_until_long_after_the_set_of_its_pass_goes_on() -> None:
    station = Station(*two())
    station.run(1400.0)
    station.now_s = 1700.0
    station.executive().restore(json.loads(station.kept[-1]), station.now_s)
    station.run(3000.0)
    assert station.states == {"a": "lost", "b": "tracked"}


def test_a_latched_fault_is_reset_and_the_pass_tried_again_with_the_cause_in_its_record() -> None:
    station = Station(*two())
    station.run(1200.0)
    station.trip("azimuth drive runs at 0.05 deg/s")
    station.run(3000.0)
    first, second = station.night.records
    assert (first.state, second.state, first.attempts) == ("tracked", "tracked", 2)
    assert any("latched_fault" in cause for cause in first.causes)
    assert first.lost_s < 60.0


def test_a_drive_that_is_away_for_ten_minutes_costs_the_pass_under_it_and_is_two_messages() -> None:
    station = Station(*two())
    station.run(1100.0)
    station.drive = "Connection refused"
    station.trip("no position from the drive for 1.0 s")
    station.run(300.0)
    # Killed in the outage: the tries are not spent afterwards either.
    station.executive().restore(json.loads(station.kept[-1]), station.now_s)
    station.run(299.0)
    station.drive = ""
    station.run(3000.0)
    assert station.states == {"a": "lost", "b": "tracked"}
    assert station.sent.count("reset_antenna_fault") == 1
    assert [row[1:] for row in station.told] == [
        ("raised", "lost_drive"), ("cleared", "lost_drive"), ("raised", "latched_fault"), ("cleared", "latched_fault"),
    ]  # fmt: skip
    (lost,) = [record for record in station.night.records if record.id == "a"]
    assert lost.causes[0] == "lost_drive since 00:18:24: the drive is lost: Connection refused"


def test_a_goal_that_a_passing_fault_of_the_antenna_refuses_is_sent_again_at_once() -> None:
    station = Station(*two())
    station.run(980.0)
    station.refuses = "antenna fault: drive lost: no position for 1.1 s, at most 1.0 s"
    station.run(15.0)
    station.refuses = ""
    station.run(2.0)
    assert station.target
    assert not station.told, "the antenna reports its fault itself"


def test_what_the_next_pass_lacks_is_told_15_and_5_minutes_before_it_and_when_it_rises_and_it_is_joined() -> None:
    """The drive was off when the station was started: nothing was ever heard of the antenna."""
    station = Station(*two())
    station.drive = "Connection refused"
    station.speaks, station.missing = False, ["antenna_servo was never heard"]
    station.run(1100.0)
    assert [row[:2] for row in station.told] == [(121.0, "raised"), (701.0, "changed"), (1001.0, "changed")]
    assert {row[2] for row in station.told} == {"not_ready"}
    (alarm,) = station.night.book.lasting
    assert alarm.message == "the pass of a (has risen) cannot be tracked: antenna_servo was never heard"
    assert "joined" in alarm.ask
    station.drive, station.speaks, station.missing = "", True, []
    station.run(100.0)
    assert station.target
    assert station.told[-1][1:] == ("cleared", "not_ready")


def test_an_urgent_pass_that_is_added_ends_the_present_one_in_time() -> None:
    station = Station(*two())
    station.run(1200.0)
    urgent = a_pass("urgent", 1400.0, priority=9, azimuth=(150.0, 240.0))
    station.passes["urgent"] = urgent
    station.night.schedule.change([urgent])
    station.night.change(1200.0)
    station.run(3000.0)
    records = {record.id: record for record in station.night.records}
    assert (records["a"].state, records["a"].reason) == ("lost", "it yields to a pass of a higher priority")
    assert 300.0 < records["a"].tracked_s < 400.0
    assert records["urgent"].tracked_s == pytest.approx(600.0, abs=3.0)


def test_a_pass_that_the_list_cuts_off_is_ended_there_and_counts_as_tracked() -> None:
    station = Station(a_pass("a", 1000.0, los_s=1300.0))
    station.passes["a"] = a_pass("a", 1000.0, los_s=1900.0)
    station.run(4000.0)
    assert station.states == {"a": "tracked"}
    assert station.now_s < 1400.0


@pytest.mark.parametrize(
    ("ends", "state", "reason", "scans"),
    [("complete", "tracked", "the scan is complete", 1), ("no source was seen", "lost", "no source was seen", 2)],
)
def test_a_scan_is_measured_by_its_client_whatever_is_held_and_is_repeated_while_it_can_be(
    ends: str, state: str, reason: str, scans: int
) -> None:
    station = Station(a_pass("a", 1000.0, los_s=1250.0, target="x", scan="cross"))
    station.scan_ends = ends
    station.run(4000.0)
    (record,) = station.night.records
    assert (record.state, station.sent.count("scan")) == (state, scans)
    assert record.reason.endswith(reason)
    assert "record" not in station.sent


# Single steps

GIVEN = ("id", "target", "sensor", "band", "search_from", "patience_s", "aos", "los", "name", "priority")
NAMES: dict[str, tuple[str, ...]] = {
    "track": GIVEN, "unwind": ("azimuth", "elevation"),
    **dict.fromkeys(("record", "end_record", "park", "stow", "stop_pass", "reset"), ()),
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
"""
START = (math.radians(10.0), 0.1)
"""Where the passes of `a_pass` begin: no slew is needed there, and a pass is begun 60 s before its rise."""
BROKE = "broke"


class Bench:
    """A night, what the station shows, and what was sent in each step; every request is accepted in the next one."""

    def __init__(self, *passes: ScheduledPass, **options: Any) -> None:
        schedule = Schedule(LIMITS, RATES, BetweenParams())
        schedule.change(passes)
        self.night = Night(
            schedule, read_procedure(PASS, NAMES), read_table(TABLE, NAMES, AlarmParams()), self._send,
            save=lambda: self.order.append("kept"), **options,
        )  # fmt: skip
        self.shown: dict[str, Any] = {
            "antenna.mode": "holding", "antenna.azimuth": START[0], "antenna.elevation": START[1], "antenna.fault": "",
            "tracking.mode": "idle", "tracking.target": "", "tracking.reason": "start",
        }  # fmt: skip
        self.sent: list[tuple[int, str, dict[str, Any]]] = []
        self.order: list[str] = []
        self.answers, self._new = True, []
        self.night.start(0.0)

    def _send(self, number: int, name: str, arguments: dict[str, Any]) -> None:
        self.sent.append((number, name, arguments))
        self.order.append(name)
        self._new.append((number, name))

    def at(self, t_s: float, **values: Any) -> list[str]:
        """Show these values from now on, step, and return the names of what was sent."""
        self.shown |= {name.replace("__", "."): value for name, value in values.items()}
        for name, value in self.shown.items():
            device, _, attribute = name.partition(".")
            self.night.take(device, {attribute: value}, t_s)
        new, self._new = self._new, []
        for number, _ in new if self.answers else ():
            self.night.respond(number, True, "", t_s)
        self.night.step(t_s)
        return [name for _, name in self._new]

    def track(self, t_s: float) -> None:
        """Let the pass begin at `t_s` and be tracked a second later."""
        assert self.at(t_s) == []
        assert "track" in self.at(t_s + 0.5)
        self.at(t_s + 1.0, recorder__state="recording", **self.has())

    def has(self) -> dict[str, Any]:
        return {"tracking__target": "a", "tracking__mode": "conscan", "tracking__reason": "", "tracking__held": True}

    def counts(self, tracked_s: float, lost_s: float, loss_db: float) -> dict[str, float]:
        names = "seconds_tracked", "seconds_lost", "mean_loss"
        return dict(zip((f"tracking__{name}" for name in names), (tracked_s, lost_s, loss_db), strict=True))

    def ended(self, reason: str = LOSS_OF_SIGNAL) -> dict[str, Any]:
        return {"tracking__target": "", "tracking__mode": "idle", "tracking__reason": reason, "tracking__held": False}

    def events(self) -> list[str]:
        return [f"{row.event} {row.detail}".strip() for row in self.night.journal if not row.directive]


def a_night(**options: Any) -> Bench:
    return Bench(a_pass("a", 1000.0, name="nm", priority=4), a_pass("z", 90_000.0), **options)


def failing(**options: Any) -> Bench:
    """Return a night whose pass has failed at 1100 s."""
    one = a_night(**options)
    one.track(940.0)
    one.at(1100.0, **one.ended("broke"))
    return one


def test_a_pass_begins_a_minute_before_its_rise_with_all_that_the_schedule_says() -> None:
    one = a_night()
    assert one.at(939.5) == []
    assert (one.night.active_id, one.night.reason) == ("", "hold until nm")
    assert one.at(940.0) == []
    assert one.at(940.5) == ["record", "track"]
    assert one.sent[1] == (2, "track", {
        "id": "a", "target": "a", "sensor": "auto", "band": "", "search_from": 940.0, "patience_s": 720.0, "aos": 1000.0,
        "los": 1600.0, "name": "nm", "priority": 4,
    })  # fmt: skip
    # No search begins before 1970, and a pass may have a sensor and a band of its own.
    for sensor, band in (("", ""), ("array", "S")):
        one = Bench(a_pass("a", 30.0, sensor=sensor, band=band), sensor="program", band="X")
        one.track(1.0)
        given = one.sent[1][2]
        assert (given["sensor"], given["band"], given["search_from"]) == (sensor or "program", band or "X", 0.0)


@pytest.mark.parametrize("missing", ["azimuth", "elevation", "new"])
def test_nothing_begins_before_the_place_of_the_antenna_is_known_and_new(missing: str) -> None:
    one = a_night()
    if missing == "new":
        one.at(935.0)
        one.shown.clear()
    else:
        del one.shown[f"antenna.{missing}"]
    one.at(940.5)
    assert one.night.active_id == "", "5.5 s old" if missing == "new" else "unknown"
    one.at(941.0, antenna__azimuth=START[0], antenna__elevation=START[1])
    assert one.night.active_id == "a"


@pytest.mark.parametrize(
    ("least", "tracked_s", "state", "reason"),
    [
        (0.8, 481.0, "tracked", LOSS_OF_SIGNAL), (0.8, 479.0, "lost", "80 % of the pass was held, must be >= 80 %"),
        (0.3, 190.0, "tracked", LOSS_OF_SIGNAL), (0.3, 120.0, "lost", "20 % of the pass was held, must be >= 30 %"),
    ],
)  # fmt: skip
def test_a_pass_is_tracked_if_enough_of_it_was_held_and_its_recording_ends(
    least: float, tracked_s: float, state: str, reason: str
) -> None:
    one = a_night(least_share=least)
    one.track(940.0)
    one.at(1600.0, **one.counts(tracked_s, 0.0, 0.0))
    assert one.at(1601.0, **one.ended()) == []
    (record,) = one.night.records
    assert (record.state, record.reason, record.attempts, record.recorded) == (state, reason, 1, True)
    assert one.at(1601.5) == ["end_record"]


def test_attempts_are_five_seconds_apart_and_five_more_with_each_up_to_thirty() -> None:
    one, waits, t_s = failing(), [], 1100.0
    for number in range(1, 8):
        failed_s = t_s
        while f"tried again attempt {number + 1}" not in one.events():
            t_s += 0.5
            assert one.at(t_s) == []
        waits.append(t_s - failed_s)
        one.at(t_s + 0.5)
        one.at(t_s + 1.0, **one.has())
        t_s += 2.0
        one.at(t_s, **one.ended("broke"))
    assert waits == [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 30.0]
    for late_s in (60.0, 60.5):
        one.at(t_s + late_s)
    one.at(t_s + 61.0, **one.has())
    one.at(1601.0, **one.ended())
    assert one.night.records[0].reason == f"0 % of the pass was held, must be >= 80 %: {BROKE}"


def test_a_pass_is_joined_within_seconds_of_the_start_of_a_controller_that_was_away_for_a_minute() -> None:
    one = a_night()
    one.answers = False
    one.at(940.0)
    for t_s in (940.5 + 0.5 * number for number in range(119)):
        for number, name, _ in one.sent:
            one.night.respond(number, name != "track", "action track_pass is not offered", t_s)
        one.at(t_s)
    one.answers = True
    assert any("track" in one.at(1000.0 + 0.5 * k) for k in range(20))


@pytest.mark.parametrize("why", ["a.trouble", "paused", "a.broken", "antenna.mode", "tracking.mode"])
def test_no_attempt_begins_while_something_speaks_against_it(why: str) -> None:
    one = failing()
    before = dict(one.shown)
    if why == "paused":
        one.night.pause(1101.0)
    elif why in before:
        del one.shown[why]
    else:
        # The action of a cause that is never answered holds the next attempt up as well.
        one.answers, one.shown[why] = False, "x"
    for t_s in (1102.0, 1107.0, 1110.0):
        assert "track" not in one.at(t_s)
    if why == "paused":
        one.night.resume(1111.0)
    one.answers = True
    one.shown = before | {why: before.get(why, "")}
    sent = [name for t_s in (1112.0, 1130.0, 1131.0, 1132.0) for name in one.at(t_s)]
    assert "track" in sent


def test_a_pass_that_was_tracked_is_joined_again_at_once_however_often_it_breaks() -> None:
    one, t_s = a_night(), 940.0
    one.track(t_s)
    for number in range(2, 9):
        t_s += 60.0
        one.at(t_s, **one.counts(10.5, 0.0, 0.0))
        one.at(t_s + 0.5, **one.ended("broke"))
        one.at(t_s + 1.0)
        assert f"tried again attempt {number}" in one.events()
        one.at(t_s + 1.5)
        one.at(t_s + 2.0, **one.has())


def test_what_is_left_of_an_attempt_is_stopped_before_the_next() -> None:
    one = a_night()
    one.answers = False
    one.at(940.0)
    assert one.at(940.5) == ["record", "track"]
    # The response is lost: after 20 s the attempt has failed, though the controller has the pass.
    one.at(961.0, **one.has())
    assert [one.at(t_s) for t_s in (965.0, 966.0, 966.5)] == [[], [], ["stop_pass"]]
    one.answers = True
    assert [one.at(t_s, **one.ended("stop was requested")) for t_s in (967.0, 967.5)] == [[], ["record", "track"]]


@pytest.mark.parametrize(("left_s", "lost"), [(10.5, False), (9.5, True)])
@pytest.mark.parametrize("los_s", [1050.0, 1600.0])
@pytest.mark.parametrize("cause", ["", "a storm"])
def test_a_pass_of_which_too_little_is_left_is_lost_for_the_cause_or_the_failure(
    los_s: float, left_s: float, lost: bool, cause: str
) -> None:
    one = Bench(a_pass("a", 1000.0, los_s=los_s), a_pass("z", 90_000.0))
    one.track(940.0)
    one.at(los_s - left_s, a__storm=cause, **one.ended("broke"))
    found = [(record.state, record.reason) for record in one.night.records]
    assert found == [("weather", cause) if cause else ("lost", BROKE)] * lost


def test_the_pass_of_the_target_is_the_one_that_shares_most_with_that_of_the_schedule() -> None:
    one = a_night()
    seen = lambda name: one.night.expected_state.value(f"ephemeris.{name}")  # noqa: E731
    windows = [(0.0, 1000.0, "before"), (900.0, 1010.0, "10 s"), (1500.0, 1700.0, "100 s"), (1300.0, 1400.0, "too"),
               (1600.0, 1900.0, "after")]  # fmt: skip
    for t_s, present, found in ((900.0, windows, None), (941.0, windows, "100 s"), (942.0, windows[:1], None)):
        one.at(t_s)
        one.night.take_passes("x", present, t_s)
        assert (seen("target"), seen("pass"), seen("pass_found")) == ("x", found, found is not None)


def test_requests_are_refused_where_they_do_not_fit_and_are_kept_and_noted_where_they_do() -> None:
    one = a_night()
    night, fits = one.night, {
        "pause": {"running": "paused"}, "resume": {"paused": "running"}, "change": {},
        "stop": dict.fromkeys(("running", "paused", "stopping"), "stopping"), "start": {"stopping": "running"},
        "abort": dict.fromkeys(("running", "paused", "stopping"), "stopping"),
    }  # fmt: skip
    names = "start resume pause start pause resume pause change stop pause resume stop start pause abort start"
    for name in names.split(" "):
        before, kept = str(night.state_name), len(one.order)
        after = fits[name].get(before, before if name == "change" else "")
        if after:
            getattr(night, name)(5.0)
        else:
            with pytest.raises(ValueError, match=f"the executive is {before}"):
                getattr(night, name)(5.0)
        assert (night.state_name, len(one.order) - kept) == (after or before, int(bool(after)))
    assert night.begun_s == 0.0, "one that is being stopped may go on"
    noted = {"started 2 passes", "paused", "resumed", "schedule changed 2 passes", "stop was requested"}
    assert set(one.events()) == noted


@pytest.mark.parametrize("request_", ["stop", "abort"])
def test_a_stopped_night_ends_after_its_pass_and_an_aborted_one_at_once(request_: str) -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("b", 3000.0))
    one.track(940.0)
    getattr(one.night, request_)(1100.0)
    assert one.at(1101.0, recorder__state="idle") == (["stop_pass"] if request_ == "abort" else [])
    one.at(1102.0, **one.ended("stop was requested" if request_ == "abort" else LOSS_OF_SIGNAL))
    sent = [name for t_s in (1102.5, 1103.0, 1103.5) for name in one.at(t_s)]
    assert (sent, one.night.finished) == (["stow"], False)
    one.at(1104.0, antenna__mode="stowed")
    one.at(1105.0)
    assert (one.night.finished, one.night.reason) == (True, "stop was requested")
    first, second = one.night.records
    assert (second.id, second.state, second.reason) == ("b", "skipped", "stop was requested")
    assert (first.reason == "the night was aborted") is (request_ == "abort")


def test_passes_and_blocks_are_skipped_by_their_names() -> None:
    one = Bench(*(a_pass(name, 1000.0 + 2000.0 * k) for k, name in enumerate("abc")))
    assert one.night.skip("b", 10.0) == "pass b is skipped"
    refused = {
        "b": "pass b cannot be skipped: its state is skipped",
        "e": "pass 'e' is not in the schedule",
        "": "no pass is in work",
    }
    for name, words in refused.items():
        with pytest.raises(ValueError, match=words):
            one.night.skip(name, 11.0)
    one.at(940.0)
    assert one.night.skip("record", 940.5) == "block record is skipped"
    with pytest.raises(ValueError, match="track must not be skipped"):
        one.night.skip("track", 940.5)
    assert one.night.skip("a", 941.0) == "pass a is skipped"
    one.at(942.0)
    (record,) = one.night.records
    assert (record.id, record.state, record.reason) == ("a", "skipped", "skipped by the operator")


def test_an_action_is_tried_one_at_a_time_as_often_as_the_table_says_and_one_that_fails_is_given_up() -> None:
    one = a_night()
    sent = {0.5 * k: names for k in range(20, 100) if (names := one.at(0.5 * k, a__broken="it broke"))}
    assert sent == {10.5: ["reset"], 20.5: ["reset"]}
    assert "recovery broken: reset" in one.events()
    one, one.answers = a_night(), False
    one.answers = False
    sent = {0.5 * k: names for k in range(20, 100) if (names := one.at(0.5 * k, a__broken="it broke"))}
    # Its time is over after 20 s; the second try begins in the same step.
    assert sent == {10.5: ["reset"], 31.5: ["reset"]}


@pytest.mark.parametrize(
    ("rest", "moved"),
    [
        ("hold", ""), ("park", "holding fault disabled"), ("stow", "holding fault disabled parking parked"),
        ("unwind", "holding fault stowing parking"),
    ],
)  # fmt: skip
def test_between_two_passes_the_antenna_is_brought_to_rest_unless_it_is_there(rest: str, moved: str) -> None:
    aos_s = {"hold": 1000.0, "unwind": 1000.0, "park": 5000.0, "stow": 20_000.0}[rest]
    for mode in ("holding", *["parking", "parked", "stowing", "stowed", "fault", "disabled"]):
        one = Bench(a_pass("a", aos_s, name="nm"))
        one.at(100.0, antenna__mode=mode, antenna__azimuth=math.radians(-175.0) if rest == "unwind" else START[0])
        assert one.night.reason == f"{rest} until nm"
        assert one.at(100.5) == ([rest] if mode in moved.split() else []), mode
        if rest == "unwind" and one.sent:
            assert one.sent[0][2] == {"azimuth": START[0], "elevation": START[1]}


def test_a_rest_that_is_not_reached_is_requested_again_after_a_minute_and_another_one_at_once() -> None:
    one = Bench(a_pass("a", 5000.0))
    sent = {0.5 * k: names for k in range(360) if (names := one.at(0.5 * k))}
    # It may take 50 s, which ends an attempt; the next one is a minute after the one before.
    assert sent == {t_s: ["park"] for t_s in (0.5, 60.5, 120.5)}
    one.night.schedule.change([], ["a"])
    one.night.schedule.change([a_pass("b", 30_000.0)])
    one.night.change(180.0)
    one.at(180.0, antenna__mode="parked")
    assert (one.night.reason, one.at(180.5)) == ("stow until b", ["stow"])


@pytest.mark.parametrize(("mode", "fault", "stows"), [
    ("holding", "", True), ("stowed", "", False), ("stowing", "", False), ("holding", "broken", False),
])  # fmt: skip
def test_the_night_ends_with_the_antenna_stowed_if_it_can_be_and_asks_once(mode: str, fault: str, stows: bool) -> None:
    one = Bench()
    sent = [name for k in range(240) for name in one.at(0.5 * k, antenna__mode=mode, antenna__fault=fault)]
    assert sent == ["stow"] * stows
    assert (one.night.finished, one.night.reason) == (True, "the schedule is done")
    assert one.night.ended_s == pytest.approx(51.5 if stows else 0.0, abs=1.5)


def test_a_cause_that_stops_the_night_ends_it_with_its_text() -> None:
    one = Bench(a_pass("a", 1000.0), a_pass("yields", 1000.0, peak_rad=0.1), a_pass("other", 5000.0, antenna="gs2"))
    one.at(10.0)
    one.at(11.0, antenna__mode="stowed", a__halt="fire")
    assert (one.night.finished, one.night.reason, one.night.ended_s) == (True, "fire", 11.0)
    # What was planned is missed; what was to be left out stays so.
    assert [(each.id, each.state, each.reason) for each in one.night.records] == [("a", "missed", "fire")]
    assert one.night.schedule.entry("yields").state == one.night.schedule.entry("other").state == PassState.YIELDS


def test_responses_that_nobody_waits_for_are_noted_and_a_reported_failure_ends_the_attempt() -> None:
    one = a_night()
    one.night.respond(77, True, "what?", 5.0)
    one.night.fail(77, "what?", 5.0)
    for t_s in (940.0, 940.5, 941.0):
        one.at(t_s)
    one.night.fail(2, "the goal was aborted", 942.0)
    assert {"unexpected response 77: what?", "anomaly the goal was aborted"} <= set(one.events())
    ((name, run),) = one.night.blocks()
    assert block_text(name, run.state, run.reason) == "track: anomaly, the goal was aborted"


@pytest.mark.parametrize("missing", ["antenna.mode", "tracking.mode"])
def test_a_restored_night_waits_for_new_views_of_antenna_and_controller(missing: str) -> None:
    one, other = failing(), a_night()
    other.night.restore(json.loads(json.dumps(one.night.state())), 1101.0)
    value = other.shown.pop(missing)
    other.night.take(missing.partition(".")[0], {"mode": value}, 1104.0)
    # 6 s old is no view of now.
    assert [other.at(t_s) for t_s in (1110.0, 1116.0)] == [[], []]
    other.shown[missing] = value
    assert [other.at(t_s, **other.ended("broke")) for t_s in (1117.0, 1117.5)] == [[], ["record", "track"]]
    for wrong, words in (({"version": 1}, "no state of a night"), ({"version": 7}, "version=7")):
        with pytest.raises(ValueError, match=words):
            other.night.restore(wrong, 0.0)


def test_the_plan_is_made_anew_after_a_minute_and_after_every_change(monkeypatch: pytest.MonkeyPatch) -> None:
    one, plans = a_night(), []
    replan = one.night.schedule.replan
    monkeypatch.setattr(
        one.night.schedule, "replan", lambda t_s, *given: (plans.append((t_s, given[1])), replan(t_s, *given))
    )
    for k in range(250):
        one.at(0.5 * k)
    one.night.taken = {"a"}
    one.night.change(125.0)
    one.at(125.0)
    assert plans == [(0.0, set()), (60.5, set()), (121.0, set()), (125.0, {"a"})]
    assert one.night.schedule.entry("a").reason == "another antenna tracks it"
    # A pass that is over frees the antenna at once.
    one = a_night()
    one.track(940.0)
    monkeypatch.setattr(one.night.schedule, "replan", lambda t_s, *_: plans.append(t_s))
    one.at(970.0, **one.ended())
    assert plans[4:] == [970.0]
