"""The night with a small station: passes, faults, restarts at any instant, an operator, lost messages."""

import json
import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.night import Night, NightState
from rf_pointing.operations.schedule import PassState, Schedule, ScheduledPass
from test.operations.test_schedule import LIMITS, PARK, RATES, a_pass

MOTIONS = {"track", "park", "stow", "unwind", "release"}
STEP_S = 0.5


class Station:
    """An antenna and a controller that do what is commanded within seconds, and publish it."""

    def __init__(self, passes: list[ScheduledPass], *, lost: float = 0.0, seed: int = 1) -> None:
        self.passes = {item.target: item for item in passes}
        self.mode, self.fault, self.wind, self.place = "parked", "", "", PARK
        self.target, self.reason, self.tracked_s, self.window = "", "start", 0.0, None
        self.silent: dict[str, float] = {}
        self.free_gb, self.refuses, self.recording = 100.0, "", ""
        self.sent: list[tuple[float, str]] = []
        self.night: Night | None = None
        self._random, self._lost, self._answers = np.random.default_rng(seed), lost, []
        self._moving_until_s, self._goal = -math.inf, None

    def send(self, number: int, name: str, arguments: dict[str, Any]) -> None:
        self.sent.append((self.now_s, name))
        error = self._do(name, arguments)
        if name == "track" and not error:
            self._goal = number
        self._answers.append((number, not error, error))

    def _do(self, name: str, arguments: dict[str, Any]) -> str:
        if name == "select_target":
            item = self.passes[arguments["target"]]
            self.night.take_passes(item.name, [(item.aos_t_s + 0.7, item.los_t_s + 0.7, item)], self.now_s)
        elif name == "track":
            if self.fault or self.refuses:
                self.night.take("track", {"refused": self.refuses or self.fault}, self.now_s)
                return self.refuses or self.fault
            assert not self.target, "another pass is tracked"
            assert self.mode in ("holding", "tracking")
            self.window, self.target, self.tracked_s, self.mode = arguments["target_pass"], "x", 0.0, "tracking"
        elif name == "stop_pass":
            self._end("stop was requested")
        elif name == "reset_antenna_fault":
            if self.mode != "fault":
                return "no fault is latched"
            self.fault, self.mode = "", "holding"
        elif name in ("park", "stow"):
            if self.fault:
                return f"fault latched ({self.fault})"
            self.mode = {"park": "parked", "stow": "stowed"}[name]
        elif name == "release":
            if self.wind:
                return self.wind
            self.mode = "holding"
        elif name == "unwind":
            self.place, self._moving_until_s = (arguments["azimuth"], arguments["elevation"]), self.now_s + 20.0
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
        if self.mode == "tracking":
            self.mode = "holding"
        if self._goal is not None and reason != "loss of signal":
            self.night.fail(self._goal, reason, self.now_s)
        self._goal = None

    def step(self, now_s: float) -> None:
        self.now_s = now_s
        if self.window is not None and self.window.aos_t_s <= now_s:
            self.tracked_s += STEP_S
            if now_s >= self.window.los_t_s:
                self._end("loss of signal")
        answers, self._answers = self._answers, []
        for number, accepted, text in answers:
            self.night.respond(number, accepted, text, now_s)
        begun = self.window is not None and now_s >= self.window.aos_t_s
        self._publish("antenna", {
            "mode": self.mode, "fault": self.fault, "high_wind": self.wind, "azimuth": self.place[0],
            "elevation": self.place[1], "moving": now_s < self._moving_until_s,
        })  # fmt: skip
        self._publish("tracking", {
            "mode": "conscan" if self.target else "idle", "target": self.target, "reason": self.reason, "held": begun,
            "seconds_tracked": self.tracked_s, "seconds_lost": 0.0, "mean_loss": 0.1,
        })  # fmt: skip
        for name in ("pointing_controller", "antenna_servo"):
            self._publish(name, {"silent_s": self.silent.get(name, 0.0)})
        self._publish("disk", {"free_gb": self.free_gb})
        self._publish("recorder", {"state": "recording" if self.recording else "idle"})

    def _publish(self, device: str, values: dict[str, Any]) -> None:
        kept = {name: value for name, value in values.items() if self._random.random() >= self._lost}
        self.night.take(device, kept, self.now_s)


def made(passes: list[ScheduledPass], station: Station, **options: Any) -> Night:
    tables = read_tables(AlarmParams())
    schedule = Schedule(LIMITS, RATES, BetweenParams())
    night = Night(schedule, tables.procedure, tables.recovery, station.send, **options)
    station.night = night
    return night


def two() -> list[ScheduledPass]:
    return [a_pass("a", 1000.0), a_pass("b", 2000.0, azimuth=(200.0, 120.0))]


def run(night: Night, station: Station, from_s: float, until_s: float, *, to_end: bool = True) -> float:
    """Step both; return when the night ended, or `until_s`."""
    for k in range(round((until_s - from_s) / STEP_S) + 1):
        now_s = from_s + k * STEP_S
        station.step(now_s)
        night.step(now_s)
        if to_end and night.finished:
            return now_s
    return until_s


def begin(passes: list[ScheduledPass], **options: Any) -> tuple[Night, Station]:
    station = Station(passes, **{k: options.pop(k) for k in ("lost", "seed") if k in options})
    night = made(passes, station, **options)
    night.schedule.add(passes)
    night.start(0.0)
    return night, station


def names(station: Station) -> list[str]:
    return [name for _, name in station.sent]


def test_every_pass_is_tracked_and_the_antenna_is_stowed_at_the_end() -> None:
    night, station = begin(two())
    assert run(night, station, 0.0, 4000.0) < 2700.0
    assert [record.state for record in night.records] == ["tracked", "tracked"]
    assert all(record.tracked_s == pytest.approx(600.0, abs=2.0) and record.recorded for record in night.records)
    assert station.mode == "stowed"
    assert names(station).count("track") == 2
    assert not night.book.history


@pytest.mark.parametrize("seed", range(5))
def test_a_fifth_of_the_messages_lost_changes_no_outcome(seed: int) -> None:
    night, station = begin(two(), lost=0.2, seed=seed)
    run(night, station, 0.0, 4000.0)
    assert [record.state for record in night.records] == ["tracked", "tracked"]
    assert names(station).count("track") == 2


def keep(kept: list[str], station: Station) -> None:
    kept.append(json.dumps(station.night.state()))


def test_killed_at_any_instant_it_goes_on_and_starts_nothing_before_it_has_seen_the_station() -> None:
    rng = np.random.default_rng(7)
    # Dense where directives go out, at random elsewhere.
    instants = sorted(
        {*np.arange(935.0, 1010.0, 7.5), *np.arange(1592.0, 1620.0, 7.5), *rng.uniform(1.0, 2600.0, 8).round()}
    )
    for killed_s in instants:
        kept: list[str] = []
        station = Station(two())
        night = made(two(), station, save=partial(keep, kept, station))
        night.schedule.add(two())
        night.start(0.0)
        run(night, station, 0.0, killed_s, to_end=False)
        if night.finished:
            continue
        before, mode = len(station.sent), station.target
        again = made(two(), station)
        again.restore(json.loads(kept[-1]), killed_s)
        # Without a message of the station nothing may leave, however long it takes.
        for k in range(1, 20):
            again.step(killed_s + 0.5 * k)
        assert len(station.sent) == before
        assert station.target == mode
        station._answers.clear()
        end_s = run(again, station, killed_s + 10.0, 4000.0)
        assert end_s < 2700.0, killed_s
        assert [record.state for record in again.records] == ["tracked", "tracked"], (killed_s, again.records)
        assert names(station).count("track") == 2, killed_s


def test_stopped_and_paused_nights_stay_so_after_a_restart() -> None:
    night, station = begin(two())
    run(night, station, 0.0, 100.0)
    night.pause(100.0)
    again = made(two(), station)
    again.restore(json.loads(json.dumps(night.state())), 101.0)
    run(again, station, 101.0, 1560.0)
    assert again.state_name == NightState.PAUSED
    assert "track" not in names(station)
    again.resume(1560.0)
    run(again, station, 1560.0, 4000.0)
    # The first pass was over, the second was not.
    assert [(record.id, record.state) for record in again.records] == [("a", "missed"), ("b", "tracked")]


def test_latched_fault_is_reset_and_the_pass_tried_again_with_the_cause_in_its_record() -> None:
    night, station = begin(two())
    run(night, station, 0.0, 1200.0)
    station.trip("azimuth drive runs at 0.05 deg/s")
    run(night, station, 1200.0, 4000.0)
    first, second = night.records
    assert (first.state, second.state, first.attempts) == ("tracked", "tracked", 2)
    assert any("latched_fault" in cause for cause in first.causes)
    assert first.lost_s < 60.0
    assert "reset_antenna_fault" in names(station)


def test_a_fault_that_needs_an_operator_is_not_reset_and_the_night_waits() -> None:
    night, station = begin(two())
    run(night, station, 0.0, 1200.0)
    station.trip("azimuth past the hard limit")
    run(night, station, 1200.0, 4000.0)
    assert "reset_antenna_fault" not in names(station)
    assert [record.state for record in night.records] == ["lost", "missed"]
    assert "hard limit" in night.records[1].reason
    (alarm,) = [each for each in night.book.lasting if each.name == "latched_fault"]
    assert alarm.ask == "look at the antenna, then reset the fault"


def test_fault_that_comes_back_is_tried_as_often_as_the_table_says() -> None:
    notified: list[tuple[str, str]] = []
    night, station = begin(two(), notify=lambda event, alarm: notified.append((event, alarm.ask)))
    run(night, station, 0.0, 1200.0)
    for k in range(300):
        if not station.fault:
            station.trip("azimuth encoder stands still")
        run(night, station, 1200.0 + k * 2.0, 1201.5 + k * 2.0)
    (cause,) = [each for each in night.table.causes if each.name == "latched_fault"]
    assert names(station).count("reset_antenna_fault") == cause.tries
    assert night.recovery.effect()[0] == cause.last
    # The quiet time must not hide that an operator is needed now.
    assert notified[-1][1] == "look at the antenna, then reset the fault", notified


def test_no_pass_begins_while_a_node_is_lost_and_it_goes_on_afterwards() -> None:
    night, station = begin(two())
    station.silent["pointing_controller"] = 30.0
    run(night, station, 0.0, 1300.0)
    assert "track" not in names(station)
    assert [each.name for each in night.book.lasting] == ["lost_node pointing_controller"]
    station.silent.clear()
    run(night, station, 1300.0, 4000.0)
    assert [record.state for record in night.records][1] == "tracked"
    # Joined late: less than the least share was left.
    assert night.records[0].state == "lost"
    assert "was held, must be >=" in night.records[0].reason
    assert not night.book.lasting


def test_a_pass_in_high_wind_is_lost_to_the_weather() -> None:
    night, station = begin(two())
    station.wind, station.mode = "gust 30 m/s, limit 25 m/s", "stowed"
    run(night, station, 0.0, 1700.0)
    station.wind = ""
    run(night, station, 1700.0, 4000.0)
    assert [record.state for record in night.records] == ["weather", "tracked"]


def test_full_disk_costs_the_recording_and_not_the_pass() -> None:
    night, station = begin(two())
    station.free_gb = 0.5
    run(night, station, 0.0, 4000.0)
    assert [(record.state, record.recorded) for record in night.records] == [("tracked", False)] * 2
    assert [row[2] for row in night.book.history if row[1] == "raised"] == ["full_disk"]


def test_rejected_certificate_is_an_alarm_and_the_next_pass_is_tracked() -> None:
    night, station = begin(two())
    station.refuses = "no branch works: 3.2 deg from the Sun"
    run(night, station, 0.0, 1700.0)
    station.refuses = ""
    run(night, station, 1700.0, 4000.0)
    assert [record.state for record in night.records] == ["lost", "tracked"]
    assert "no branch works" in night.records[0].reason
    assert any(row[1] == "raised" and row[2] == "rejected_certificate" for row in night.book.history)


def test_urgent_pass_that_is_added_ends_the_present_one_in_time() -> None:
    night, station = begin(two())
    run(night, station, 0.0, 1200.0)
    urgent = a_pass("urgent", 1400.0, priority=9, azimuth=(150.0, 240.0))
    station.passes["urgent"] = urgent
    night.schedule.add([urgent])
    night.change(1200.0)
    run(night, station, 1200.0, 5000.0)
    states = {record.id: record for record in night.records}
    assert states["a"].reason == "it yields to a pass of a higher priority"
    assert 300.0 < states["a"].tracked_s < 400.0
    assert states["urgent"].state == "tracked"
    assert states["urgent"].tracked_s == pytest.approx(600.0, abs=3.0)


def test_operator_skips_pauses_stops_and_aborts() -> None:
    night, station = begin(two())
    with pytest.raises(ValueError, match="no pass is in work"):
        night.skip("", 10.0)
    run(night, station, 0.0, 1200.0)
    night.skip("", 1200.0)
    run(night, station, 1200.0, 1250.0)
    assert night.schedule.entry("a").state == PassState.SKIPPED
    assert not station.target
    with pytest.raises(ValueError, match="must be paused"):
        night.resume(1250.0)
    run(night, station, 1250.0, 2300.0)
    assert station.target
    night.stop(2300.0)
    assert run(night, station, 2300.0, 4000.0) > 2600.0
    assert [record.state for record in night.records] == ["skipped", "tracked"]
    night, station = begin(two())
    run(night, station, 0.0, 1200.0)
    night.abort(1200.0)
    assert run(night, station, 1200.0, 4000.0) < 1260.0
    assert night.records[0].reason == "the night was aborted"
    assert station.mode == "stowed"


def test_unwind_between_passes_leaves_nothing_to_unwind_for_the_next() -> None:
    passes = [a_pass("a", 1000.0, azimuth=(100.0, 260.0)), a_pass("b", 2000.0, azimuth=(-100.0, -260.0))]
    night, station = begin(passes)
    run(night, station, 0.0, 1600.0)
    station.place = (math.radians(260.0), 0.1)
    run(night, station, 1600.0, 1900.0)
    assert "unwind" in names(station)
    start = night.schedule.entry("b").turn[0]
    assert station.place == start
    assert RATES.slew_s(station.place, start) < 1e-9


def test_state_of_another_night_is_refused() -> None:
    night, _ = begin(two())
    with pytest.raises(ValueError, match="no state of a night"):
        night.restore({"version": 1}, 0.0)
    with pytest.raises(ValueError, match="version=7"):
        night.restore({"version": 7}, 0.0)


def test_a_pass_that_the_list_cuts_off_is_ended_there_and_counts_as_tracked() -> None:
    cut = a_pass("a", 1000.0, los_s=1300.0)
    night, station = begin([cut])
    station.passes["a"] = a_pass("a", 1000.0, los_s=1900.0)
    assert run(night, station, 0.0, 4000.0) < 1400.0
    (record,) = night.records
    assert (record.state, record.attempts) == ("tracked", 1)
    assert "stop_pass" in names(station)
