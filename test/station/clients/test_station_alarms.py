"""Alarms of a station without an executive: what the nodes publish in, what an operator receives out."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core.kinematics import LEVEL
from rf_pointing.operations import AlarmParams, ExpectedState
from rf_pointing.operations.alarms import AlarmBook
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.recovery import Recovery
from rf_pointing.station.clients import station_alarms
from rf_pointing.station.clients.alarm_hooks import HookParams
from rf_pointing.station.clients.station_alarms import StationAlarms, place_to_try
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.parameters import controller_params

T_S = 1.8e9
CONTROLLER = controller_params(read_station("leo_3m7"), "X")
OK, WARN, ERROR = 0, 1, 2


class Bench:
    """Alarms whose station shows the same until a test changes it, a second a step."""

    def __init__(self, folder: Path, hooks: HookParams | None = None) -> None:
        thresholds, self.now_s = AlarmParams(nodes="my_receiver, my_drive"), 0.0
        table = read_tables(thresholds).recovery
        recovery = Recovery(table, ExpectedState(), AlarmBook(lambda *_: None, thresholds.quiet_s), acts=False)
        self.messages: list[dict[str, str]] = []
        self.alarms = StationAlarms(
            recovery, thresholds, hooks or HookParams(), "Dish", CONTROLLER, folder, self.messages.append
        )
        self.checks: dict[tuple[str, str], tuple[int, str, dict[str, str]]] = {}
        self.shown: dict[str, dict[str, Any]] = {}

    def run(self, seconds: int) -> list[tuple[float, str, str]]:
        """Go on for a time; return when which messages went out."""
        sent = []
        for _ in range(seconds):
            self.now_s += 1.0
            for (node, check), (level, message, values) in self.checks.items():
                self.alarms.take_check(node, check, level, message, values, self.now_s)
            for device, attributes in self.shown.items():
                self.alarms.take(device, attributes, T_S + self.now_s)
            self.alarms.step(T_S + self.now_s, self.now_s)
            sent += [(self.now_s, each["event"], each["alarm"]) for each in self.messages]
            self.last, self.messages[:] = self.messages[-1:] or getattr(self, "last", []), []
        return sent


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Any:
    one = SimpleNamespace(free=5e9)
    monkeypatch.setattr(station_alarms, "shutil", SimpleNamespace(disk_usage=lambda _: one))
    return one


@pytest.fixture
def bench(tmp_path: Path, disk: Any) -> Bench:
    one = Bench(tmp_path)
    one.checks = {(node, "state"): (OK, "active", {"state": "active"}) for node in station_alarms.NEEDED}
    one.shown = {
        "antenna": {"mode": "tracking", "fault": "", "high_wind": "", "azimuth": 0.5, "elevation": 0.7},
        "tracking": {"mode": "conscan", "target": "bird", "held": True, "seconds_lost": 0.0, "reason": "", "level": 0},
    }
    return one


@pytest.mark.parametrize(
    ("check", "shown", "cause", "within_s", "words"),
    [
        (("antenna_servo", "device", ERROR, "no answer", {}), {}, "lost_drive", 5, "the drive is lost: no answer"),
        (("my_drive", "bus", ERROR, "no frame for 3 s", {}), {}, "failed_check my_drive", 8, "my_drive: bus: no frame for 3 s"),
        (("antenna_servo", "state", ERROR, "drive: refused", {"state": "unconfigured"}), {}, "failed_check antenna_servo", 8,
         "antenna_servo: state: drive: refused"),
        (("pointing_controller", "clocks", ERROR, "the clock of x is 900 ms ahead", {"offset_ms x": "900.0"}), {}, "clock", 12,
         "the clock of x is 900 ms ahead"),
        (("ephemeris_publisher", "target", OK, "bird", {"element_age_h": "99.0", "target": "bird"}), {}, "stale_elements", 8,
         "the elements of bird are 99 h old"),
        (("antenna_servo", "executive", ERROR, "station_executive has been silent", {}), {}, "lost_executive", 2,
         "station_executive has been silent"),
        (None, {"antenna": {"fault": "hard limit"}}, "latched_fault", 4, "the antenna has a latched fault: hard limit"),
        (None, {"tracking": {"held": False, "seconds_lost": 4.0}}, "lost_signal", 32,
         "bird is not held, 4 s of its pass are lost: conscan, "),
    ],
)  # fmt: skip
def test_each_cause_is_one_message_that_says_what_to_do_and_is_repeated_until_somebody_knows(
    bench: Bench, check: Any, shown: dict[str, dict[str, Any]], cause: str, within_s: int, words: str
) -> None:
    assert bench.run(60) == []
    if check:
        bench.checks[check[:2]] = check[2:]
    for device, values in shown.items():
        bench.shown[device] |= values
    ((first_s, *event),) = bench.run(120)
    assert (event, first_s - 60.0 <= within_s) == (["raised", cause], True)
    (message,) = bench.last
    assert (message["message"], message["station"]) == (words, "Dish")
    assert message["to_do"]
    assert "{" not in message["to_do"]
    assert [row[1:] for row in bench.run(1200)] == [("reminder", cause)] * 2
    bench.alarms.book.acknowledge("", T_S)
    assert bench.run(1200) == []


@pytest.mark.parametrize("received", [True, False])
def test_who_never_comes_up_is_missed_after_a_minute_where_no_executive_runs(bench: Bench, received: bool) -> None:
    up = bench.checks.pop(("antenna_servo", "state"))
    if received:
        bench.checks["antenna_servo", "state"] = (WARN, "waits for rotctld", {"state": "unconfigured"})
    assert bench.run(60) == []
    ((_, *event),) = bench.run(60)
    assert event == ["raised", "failed_check antenna_servo"]
    words = "is unconfigured: waits for rotctld" if received else "has not been received"
    assert bench.last[0]["message"] == f"antenna_servo: {words}"
    bench.checks["antenna_servo", "state"] = up
    assert [row[1:] for row in bench.run(60)] == [("cleared", "failed_check antenna_servo")]


def test_a_full_disk_and_little_memory_are_on_diagnostics_at_once(
    bench: Bench, disk: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    memory = tmp_path / "meminfo"
    memory.write_text("MemTotal: 4000000 kB\nMemAvailable: 2048000 kB\n")
    monkeypatch.setattr(station_alarms, "MEMORY", memory)
    bench.run(1)
    assert bench.alarms.computer() == (OK, "ok", {"disk_free_mb": 5000, "memory_free_mb": 2000})
    disk.free = 0.5e9
    memory.write_text("MemAvailable: 51200 kB\n")
    assert [row[2] for row in bench.run(11)] == ["full_disk", "low_memory"]
    level, words, _ = bench.alarms.computer()
    assert level == 1
    assert "0.5 GB are free on the disk of the recordings" in words
    assert "50 MB of memory are free" in words
    memory.unlink()
    assert [row[1:] for row in bench.run(1)] == [("cleared", "low_memory")]


def test_an_antenna_that_looks_into_the_sun_is_told_and_one_beside_it_is_not(bench: Bench) -> None:
    sun = station_alarms.SolarDirection(CONTROLLER.sun).at(T_S)
    assert sun is not None
    radius_rad = CONTROLLER.machine.sun_radius_rad
    for off, told in ((1.5 * radius_rad, []), (0.5 * radius_rad, ["sun"])):
        bench.shown["antenna"] |= {"azimuth": sun[0], "elevation": sun[1] - off}
        assert [row[2] for row in bench.run(25)] == told


def test_a_permission_is_no_alarm_and_who_is_left_tells_when_the_control_unit_is_silent(bench: Bench) -> None:
    sun = station_alarms.SolarDirection(CONTROLLER.sun).at(T_S + 300.0)
    assert sun is not None
    bench.shown["antenna"] |= {"azimuth": sun[0], "elevation": sun[1], "sun": ""}
    bench.shown["antenna"]["sun_permit_until_t_s"] = T_S + 1000.0
    assert [row[2] for row in bench.run(350)] == []
    bench.shown["antenna"]["sun_permit_until_t_s"] = 0.0
    assert [row[2] for row in bench.run(25)] == ["sun"]
    other = station_alarms.SolarDirection(CONTROLLER.sun).at(T_S + 900.0)
    bench.shown["antenna"] |= {"azimuth": other[0], "elevation": other[1]}
    bench.run(1)
    del bench.shown["antenna"]
    told = [row for row in bench.run(270) if row[2] == "sun_ahead"]
    assert len(told) == 1, "once, in words that stay the same"
    assert "antenna_servo is silent" in bench.alarms.known.value("antenna.sun")


def test_while_an_executive_with_a_way_out_is_heard_that_one_tells_and_a_silent_one_is_replaced(bench: Bench) -> None:
    for values, told in (({"alarms_sent": "0", "alarms_not_sent": "0"}, True),
                         ({"alarms_sent": "0", "alarms_not_sent": "0", "command": "no message yet"}, False)):  # fmt: skip
        bench.checks["station_executive", "hooks"] = (OK, "", values)
        bench.shown["antenna"]["fault"] = "hard limit"
        assert bool(bench.run(10)) is told
        bench.shown["antenna"]["fault"] = ""
        bench.run(10)
    bench.shown["antenna"]["fault"] = "hard limit"
    bench.run(10)
    del bench.checks["station_executive", "hooks"]
    assert ("raised", "latched_fault") in [row[1:] for row in bench.run(130)]


def test_what_a_pass_needs_is_named_if_it_was_never_heard_or_is_not_active_and_has_no_alarm(bench: Bench) -> None:
    servo, controller, publisher, tracker = needed = (*station_alarms.NEEDED, "monopulse_tracker")
    del bench.checks[servo, "state"]
    bench.checks[controller, "state"] = OK, "waits for the drive", {"state": "unconfigured"}
    bench.checks[tracker, "state"] = OK, "active", {"state": "active"}
    bench.checks[publisher, "state"] = ERROR, "no elements", {"state": "unconfigured"}
    bench.checks["ghost\n", "state"] = ERROR, "of nobody", {}
    bench.run(10)
    assert bench.alarms.reasons_not_ready(needed, bench.now_s) == [
        f"{servo} has not been received", f"{controller} is unconfigured: waits for the drive",
    ]  # fmt: skip
    assert [each.name for each in bench.alarms.book.lasting] == [f"failed_check {publisher}"]
    # A control unit that is active may have a drive that does not answer; one cause is one message.
    for node in (servo, controller, publisher):
        bench.checks[node, "state"] = OK, "active", {"state": "active"}
    bench.shown["antenna"].pop("azimuth")
    bench.run(7)
    assert bench.alarms.reasons_not_ready(needed, bench.now_s) == ["the drive reads no position"]
    bench.checks[servo, "state"] = ERROR, "drive: refused", {"state": "unconfigured"}
    bench.run(7)
    assert bench.alarms.reasons_not_ready(needed, bench.now_s) == []


def test_a_way_that_fails_is_told_by_those_that_are_left(tmp_path: Path, disk: Any) -> None:
    out = tmp_path / "out"
    hook = tmp_path / "hook"
    hook.write_text(f"#!/bin/sh\ncat >> {out}\n")
    hook.chmod(0o755)
    bench = Bench(tmp_path, HookParams(command=str(hook), webhook="http://127.0.0.1:9/", retry_s=0.1))
    command, webhook = bench.alarms.hooks.ways
    bench.alarms.test(T_S)
    webhook.close(20.0)
    assert (webhook.failed, "Connection refused" in webhook.problem) == (1, True)
    assert ("raised", "alarm_not_sent webhook") in [row[1:] for row in bench.run(2)]
    command.close(20.0)
    assert "alarm_not_sent webhook" in out.read_text()


def test_a_process_that_stood_still_itself_blames_nobody_for_the_silence(bench: Bench) -> None:
    """Its own stall of a minute is not heard as one of every node; a node that is silent afterwards is lost as ever."""
    for node in ("antenna_servo", "pointing_controller", "bias_calibrator"):
        bench.checks[node, "state"] = OK, "active", {"state": "active"}
    bench.run(20)
    bench.now_s += 60.0
    # The first step comes before what has arrived meanwhile is read.
    bench.alarms.step(T_S + bench.now_s, bench.now_s)
    assert bench.run(20) == []
    del bench.checks["antenna_servo", "state"]
    assert [row[1:] for row in bench.run(10)] == [("raised", "lost_node antenna_servo")]


def test_an_executive_that_comes_back_does_not_tell_of_its_own_end(bench: Bench) -> None:
    """The controller still says that it is silent: station_alarms has told that, and only that node does."""
    bench.alarms.take_check("pointing_controller", "executive", ERROR, "station_executive has been silent", {}, 1.0)
    bench.alarms.observe(T_S + 1.0, 1.0)
    bench.alarms.recovery.step(T_S + 1.0)
    assert bench.messages == []
    assert [row[1:] for row in bench.run(1)] == [("raised", "lost_executive")]


@pytest.mark.parametrize("name", ["xy_7m3", "polar_3m"])
def test_the_sun_is_as_near_to_the_beam_of_any_axes(name: str, tmp_path: Path, disk: Any) -> None:
    """The beam of other axes is as far from the Sun as that of azimuth and elevation at its place."""
    station = read_station(name)
    other = controller_params(station, station.default_band)
    level, margins = other.replace(kinematics=LEVEL), []
    for controller, axes_rad in ((other, (0.3, 0.4)), (level, other.kinematics.sky_at(0.3, 0.4))):
        recovery = Recovery(
            read_tables(AlarmParams()).recovery, ExpectedState(), AlarmBook(lambda *_: None, 1.0), acts=False
        )
        alarms = StationAlarms(recovery, AlarmParams(), HookParams(), name, controller, tmp_path, lambda _: None)
        alarms.take("antenna", dict(zip(("azimuth", "elevation"), axes_rad, strict=True)), T_S)
        alarms.observe(T_S, 1.0)
        margins.append(alarms.known.value("antenna.sun_margin_rad"))
    assert margins[0] == pytest.approx(margins[1], abs=1e-12)
    assert np.isfinite(margins[0])


@pytest.mark.parametrize("station", shipped_stations())
def test_each_axis_is_tried_within_its_travel_and_above_the_horizon(station: str) -> None:
    description = read_station(station)
    own = controller_params(description, description.default_band)
    place = place_to_try(own.limits, own.kinematics)
    assert own.limits.reason(*place) == ""
    assert own.kinematics.sky_at(*place)[1] > np.radians(20.0)
