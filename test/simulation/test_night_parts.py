"""The parts of a simulated night one at a time: its ticks, what the executive is shown, its requests and its faults."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.alarms import Alarm
from rf_pointing.simulation import StationSetup
from rf_pointing.simulation.night import COMMON, NO_ANSWER, TICK_S, NightFault, NightSimulation, kinds_of
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.modes import AntennaMode
from test.simulation.night_plan import EPOCH_S, small_night

T0 = 1_151_520_000.0
Make = Callable[..., NightSimulation]


class Calls:
    """Stands for any part: notes what is called, and answers as it was told; what is set is an attribute."""

    def __init__(
        self, log: list[tuple[Any, ...]], name: str, /, answers: dict[str, Any] | None = None, **attributes: Any
    ):
        self.__dict__ |= {"_log": log, "_name": name, "_answers": answers or {}, **attributes}

    def __getattr__(self, key: str) -> Callable[..., Any]:
        def call(*given: Any) -> Any:
            self._log.append((f"{self._name}.{key}", *given))
            answer = self._answers.get(key)
            return answer(*given) if callable(answer) else answer

        return call


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> tuple[StationSetup, StationSetup, Path, list[Any]]:
    """The small night of a dish with a plant and of one with a rotator."""
    station, elements, passes = small_night(tmp_path_factory.mktemp("night"))
    return StationSetup(station), StationSetup("rotator_2m"), elements, passes


@pytest.fixture
def make(plan: tuple[StationSetup, StationSetup, Path, list[Any]]) -> Make:
    def made(*faults: NightFault, rotator: bool = False, **options: Any) -> NightSimulation:
        plant, other, elements, passes = plan
        return NightSimulation(other if rotator else plant, elements, passes, T0, faults=faults, **options)

    return made


def shown(night: NightSimulation) -> dict[str, Any]:
    """What the executive was shown."""
    return {name: seen.value for name, seen in night.night.expected_state.attributes().items()}


def with_executive(night: NightSimulation, **attributes: Any) -> list[tuple[Any, ...]]:
    """Put a stand-in in the executive's place; return what is called of it."""
    log: list[tuple[Any, ...]] = []
    night.night = Calls(log, "night", {"blocks": []}, **{"active_id": "", "finished": False, **attributes})
    return log


# What the executive is shown


def test_a_night_at_rest_shows_antenna_drive_nodes_disk_and_recorder(make: Make) -> None:
    night = make()
    night.antenna.enable()
    night._look()
    assert shown(night) == {
        "antenna.mode": "holding", "antenna.fault": "", "antenna.warning": "", "antenna.high_wind": "",
        "antenna.moving": False, "antenna.azimuth": 0.0, "antenna.elevation": pytest.approx(math.radians(45.0)),
        "drive.problem": "", "pointing_controller.silent_s": 0.0, "ephemeris_publisher.silent_s": 0.0,
        "conscan_tracker.silent_s": 0.0, "rf_receiver.silent_s": 0.0, "antenna_servo.silent_s": 0.0,
        "disk.free_gb": 500.0, "recorder.state": "idle",
    }  # fmt: skip
    assert {seen.t_s for seen in night.night.expected_state.attributes().values()} == {T0}


def test_what_is_not_read_is_not_shown(make: Make) -> None:
    night = make(reads=lambda name: name not in ("antenna.mode", "disk.free_gb"))
    night.antenna.enable()
    night._look()
    assert {"antenna.mode", "disk.free_gb"}.isdisjoint(shown(night))
    assert {"antenna.fault", "recorder.state"} <= set(shown(night))


@pytest.mark.parametrize(
    ("moving", "rates", "expected"),
    [
        (False, (0.0, 0.9e-4), False),
        (False, (0.0, -1.2e-4), True),
        (False, (1.2e-4, 0.0), True),
        (True, (0.0, 0.0), True),
    ],
)
def test_an_antenna_moves_if_its_axes_do_or_a_rate_is_commanded(
    make: Make, moving: bool, rates: tuple[float, float], expected: bool
) -> None:
    night = make()
    status = SimpleNamespace(mode="tracking", fault="f", warning="w", high_wind="h", rate_command_rad_s=np.array(rates))
    reading = SimpleNamespace(position_rad=np.array([1.0, 0.5]))
    log: list[tuple[Any, ...]] = []
    night.antenna = Calls(
        log, "antenna", {"status": status, "reading": reading}, axes=SimpleNamespace(moving=moving),
        hardware=SimpleNamespace(fault="broken"),
    )  # fmt: skip
    night._look()
    seen = shown(night)
    assert seen["antenna.moving"] is expected
    assert [seen[f"antenna.{key}"] for key in ("mode", "fault", "warning", "high_wind", "azimuth", "elevation")] == [
        "tracking", "f", "w", "h", 1.0, 0.5
    ]  # fmt: skip
    assert seen["drive.problem"] == "broken"
    assert ("antenna.status", T0) in log


def test_the_place_of_a_rotator_is_shown_while_its_drive_answers(make: Make) -> None:
    night = make(rotator=True)
    night.antenna.enable()
    night.antenna.step(T0)
    night._look()
    assert {"antenna.azimuth", "antenna.elevation"} <= set(shown(night))
    assert shown(night)["drive.problem"] == ""
    lost = make(rotator=True)
    lost._begin(NightFault(T0, "drive_lost", 3.0))
    lost.antenna.step(T0)
    lost._look()
    assert {"antenna.azimuth", "antenna.elevation"}.isdisjoint(shown(lost))
    assert shown(lost)["drive.problem"] == NO_ANSWER


def test_what_is_killed_is_silent_since_it_was_seen_last_and_shows_nothing(make: Make) -> None:
    night = make()
    night.antenna.enable()
    night._look()
    for t_s, killed, expected in (
        (2.0, ("receiver_killed", "servo_killed"), (0.0, 0.0, 0.0, 2.0, 2.0)),
        (7.0, ("receiver_killed",), (0.0, 0.0, 0.0, 7.0, 0.0)),
        (8.0, ("controller_killed", "ephemeris_killed", "tracker_killed"), (1.0, 1.0, 1.0, 0.0, 0.0)),
    ):
        night.t_s = T0 + t_s
        night._on = [(math.inf, NightFault(T0, kind, 1.0)) for kind in killed]
        night._look()
        nodes = ("pointing_controller", "ephemeris_publisher", "conscan_tracker", "rf_receiver", "antenna_servo")
        assert tuple(shown(night)[f"{node}.silent_s"] for node in nodes) == expected
        assert (night.night.expected_state.actual("antenna.mode").t_s == T0 + t_s) is ("servo_killed" not in killed)
        assert (night.night.expected_state.actual("drive.problem").t_s == T0 + t_s) is ("servo_killed" not in killed)


def test_the_controller_shows_its_status_once_it_has_one(make: Make) -> None:
    night = make()
    night.antenna.enable()
    status = SimpleNamespace(
        mode="conscan", target="sat", reason="r", held=1, seconds_tracked_s=3.0, seconds_lost_s=4.0, mean_loss_db=5.0
    )
    night._status = status
    controller, night.controller = night.controller, None
    night._look()
    assert "tracking.mode" not in shown(night)
    night.controller = controller
    night._look()
    assert {key: value for key, value in shown(night).items() if key.startswith("tracking")} == {
        "tracking.mode": "conscan", "tracking.target": "sat", "tracking.reason": "r", "tracking.held": True,
        "tracking.seconds_tracked": 3.0, "tracking.seconds_lost": 4.0, "tracking.mean_loss": 5.0,
    }  # fmt: skip


def test_the_age_of_the_elements_is_that_of_the_target_in_hours(make: Make) -> None:
    night = make()
    night.antenna.enable()
    night._look()
    assert "elements.age_h" not in shown(night)
    night._target = SimpleNamespace(name="sat", target=SimpleNamespace(elements=SimpleNamespace(epoch_t_s=T0 - 7200.0)))
    night._look()
    assert (shown(night)["elements.age_h"], shown(night)["elements.target"]) == (2.0, "sat")
    night._begin(NightFault(T0, "stale_elements", 1.0))
    assert night._element_age_h() == 202.0
    night._end(NightFault(T0, "stale_elements", 1.0))
    assert night._element_age_h() == 2.0


def test_answers_reach_the_executive_a_tenth_of_a_second_after_the_request(make: Make) -> None:
    night = make()
    night.antenna.enable()
    log = with_executive(night)
    night._send(7, "park", {})
    night._send(8, "stop_pass", {})
    assert night.log.sent == [(T0, "park"), (T0, "stop_pass")]
    responses = lambda: [row[1:] for row in log if row[0] == "night.respond"]  # noqa: E731
    for wait_s, count in ((0.0, 0), (0.09, 0), (0.11, 2), (0.12, 2)):
        night.t_s = T0 + wait_s
        night._look()
        assert len(responses()) == count
    assert responses() == [(7, True, "accepted", T0 + 0.11), (8, True, "stopping", T0 + 0.11)]


# Requests


def test_requests_reach_the_antenna_and_its_refusal_is_one(make: Make) -> None:
    night = make()
    log: list[tuple[Any, ...]] = []
    night.antenna = Calls(log, "antenna")
    for name, call in (
        ("park", ("antenna.park",)), ("stow", ("antenna.stow",)), ("release", ("antenna.resume",)),
        ("reset_antenna_fault", ("antenna.reset_fault",)),
    ):  # fmt: skip
        log.clear()
        assert night._act(1, name, {}) == "accepted"
        assert log == [call]
    log.clear()
    assert night._act(1, "unwind", {"azimuth": 1.5, "elevation": 0.25}) == "accepted"
    assert night._act(1, "unwind", {}) == "accepted"
    assert log == [("antenna.go_to", (1.5, 0.25)), ("antenna.go_to", (0.0, 0.0))]
    night.antenna = Calls(log, "antenna", {"park": "it is stowed", "go_to": "too far"})
    night._send(5, "park", {})
    night._send(6, "unwind", {})
    assert [row[1:] for row in night._answers] == [(5, False, "it is stowed"), (6, False, "too far")]


def test_what_is_killed_answers_no_request(make: Make) -> None:
    night = make()
    night.controller = None
    night._on = [(math.inf, NightFault(T0, kind, 1.0)) for kind in ("servo_killed", "ephemeris_killed")]
    for name in ("park", "unwind", "select_target", "track", "stop_pass"):
        night._send(1, name, {"target": "90001", "start": T0})
    assert night._answers == []
    assert len(night.log.sent) == 5


def test_a_recording_needs_space_and_ends_when_it_is_ended(make: Make) -> None:
    night = make()
    night.antenna.enable()
    assert night._act(1, "record", {"name": "a"}) == "accepted"
    night._look()
    assert shown(night)["recorder.state"] == "recording"
    night._act(1, "end_record", {})
    night._look()
    assert shown(night)["recorder.state"] == "idle"
    night._begin(NightFault(T0, "full_disk", 1.0))
    night._send(2, "record", {"name": "b"})
    assert night._answers[-1][1:] == (2, False, "No space left on device")
    night._look()
    assert (shown(night)["recorder.state"], shown(night)["disk.free_gb"]) == ("idle", 0.0)
    assert night._act(1, "something else", {}) == "accepted"
    night._end(NightFault(T0, "full_disk", 1.0))
    night._look()
    assert shown(night)["disk.free_gb"] == 500.0


def test_a_target_is_selected_with_its_passes_profiles_and_the_receiver(
    make: Make, plan: tuple[Any, Any, Any, list[Any]]
) -> None:
    night, passes = make(), plan[3]
    log: list[tuple[Any, ...]] = []
    night.receiver, night.controller = Calls(log, "receiver"), Calls(log, "controller", plan=Calls(log, "plan"))
    executive = with_executive(night)
    begin_s = passes[0].aos_t_s - 60.0
    assert night._act(1, "select_target", {"target": "90001", "start": begin_s}) == "1 passes"
    (window,) = night._windows
    assert window.aos_t_s == pytest.approx(passes[0].aos_t_s, abs=0.1)
    assert night._target.name == "sat 1"
    assert [row[0] for row in log] == ["receiver.tune", "plan.take_profiles"]
    assert log[0][1].name == "sat 1"
    assert len(log[1][1]) == 1
    assert executive == [("night.take_passes", "sat 1", [(window.aos_t_s, window.los_t_s, window)], T0)]
    assert night._element_age_h() == pytest.approx((T0 - EPOCH_S) / 3600.0)
    # The search ends after two hours.
    with pytest.raises(ValueError, match="sat 1 has no pass"):
        night._select({"target": "90001", "start": passes[0].aos_t_s - 7300.0})
    night._windows = [window]
    night.controller = None
    night._profiles()
    night.controller, night._target = Calls(log, "controller", plan=Calls(log, "plan")), None
    night._profiles()
    assert len(log) == 2


def test_a_goal_is_taken_or_refused_with_its_reason(make: Make) -> None:
    night = make()
    log: list[tuple[Any, ...]] = []
    night.controller = Calls(log, "controller")
    executive = with_executive(night)
    assert night._act(9, "track", {"target_pass": "w", "sensor": "conscan"}) == "accepted"
    assert log == [("controller.start", T0, "w", "conscan")]
    assert executive == [("night.take", "track", {"refused": ""}, T0)]
    assert night._goal == (9, "w")
    assert night._act(10, "stop_pass", {}) == "stopping"
    assert log[-1] == ("controller.stop", "stop was requested")

    def refuse(*_: Any) -> None:
        raise ValueError("the Sun")

    night.controller, night._goal = Calls(log, "controller", {"start": refuse}), None
    night._send(11, "track", {"target_pass": "w", "sensor": "conscan"})
    assert executive[-1] == ("night.take", "track", {"refused": "the Sun"}, T0)
    assert night._answers == [(T0 + 0.1, 11, False, "the Sun")]
    assert night._goal is None


@pytest.mark.parametrize(
    ("reason", "fault", "share", "success", "fails"),
    [
        ("loss of signal", "", 0.9, True, False), ("loss of signal", "", 0.1, False, False),
        ("stop was requested", "", 0.9, False, True), ("loss of signal", "broke", 0.9, False, True),
    ],
)  # fmt: skip
def test_the_end_of_a_goal_is_told_once_and_one_that_was_cut_off_has_failed(
    make: Make, reason: str, fault: str, share: float, success: bool, fails: bool
) -> None:
    night = make()
    executive = with_executive(night)
    outcome = PassOutcome(100.0 * share, 100.0 - 100.0 * share, 100.0)
    statistics = SimpleNamespace(outcome=outcome, reason=reason, fault=fault)
    controller = SimpleNamespace(
        statistics=statistics, params=SimpleNamespace(machine=SimpleNamespace(least_share=0.5))
    )
    night._goal = (4, "w")
    night._end_of_goal(controller)
    (first, *others) = executive
    assert first[:2] == ("night.take", "track")
    assert first[2]["success"] is success
    assert bool(first[2]["message"]) is not success
    assert [row[:2] for row in others] == ([("night.fail", 4)] if fails else [])
    night._end_of_goal(controller)
    assert len(executive) == 1 + fails


def test_messages_to_the_operator_are_kept(make: Make) -> None:
    night = make()
    night._notify("raised", Alarm("x", 1, "text", T0))
    assert night.log.messages == [("raised", "x", "text")]


# Faults


def test_faults_begin_and_end_at_their_times_in_order(make: Make) -> None:
    night = make(
        NightFault(T0 + 20.0, "full_disk", 5.0), NightFault(T0 + 10.0, "tracker_killed", 3.0),
        NightFault(T0 + 10.0, "receiver_killed", 20.0),
    )  # fmt: skip
    for t_s, on in (
        (9.9, set()), (10.0, {"tracker_killed", "receiver_killed"}), (12.9, {"tracker_killed", "receiver_killed"}),
        (13.0, {"receiver_killed"}), (20.5, {"receiver_killed", "full_disk"}), (25.4, {"receiver_killed", "full_disk"}),
        (25.5, {"receiver_killed"}), (30.0, set()),
    ):  # fmt: skip
        night.t_s = T0 + t_s
        night._begin_and_end_faults()
        assert {fault.kind for _, fault in night._on} == on, t_s
        for kind in ("tracker_killed", "receiver_killed", "full_disk", "link_drop"):
            assert night._alive(kind) is (kind not in on)
        assert night._free_gb == (0.0 if "full_disk" in on else 500.0)
    # Noted as they began.
    assert night.log.faults == [
        NightFault(T0 + 10.0, "tracker_killed", 3.0), NightFault(T0 + 10.0, "receiver_killed", 20.0),
        NightFault(T0 + 20.5, "full_disk", 5.0),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", ["link_drop", "encoder_frozen", "axes_stuck"])
def test_a_fault_that_needs_a_pass_or_a_motion_waits_for_it_and_holds_up_the_next(make: Make, kind: str) -> None:
    night = make(NightFault(T0 + 1.0, kind, 5.0), NightFault(T0 + 2.0, "stale_elements", 5.0))
    night._begin = lambda _fault: None
    night.antenna = SimpleNamespace(axes=SimpleNamespace(moving=False))
    for status in (None, SimpleNamespace(held=False)):
        night.t_s, night._status = T0 + 3.0, status
        night._begin_and_end_faults()
        assert night.log.faults == []
    night.t_s = T0 + 4.0
    night._status = SimpleNamespace(held=kind == "link_drop")
    night.antenna.axes.moving = kind != "link_drop"
    night._begin_and_end_faults()
    assert night.log.faults == [NightFault(T0 + 4.0, kind, 5.0), NightFault(T0 + 4.0, "stale_elements", 5.0)]
    assert [end_s for end_s, _ in night._on] == [T0 + 9.0, T0 + 9.0]


def over(night: NightSimulation, kind: str) -> tuple[Callable[[], None], Callable[[], None]]:
    fault = NightFault(T0, kind, 1.0)
    return lambda: night._begin(fault), lambda: night._end(fault)


def test_a_controller_that_is_killed_comes_back_without_status_and_goal_but_with_the_profiles(make: Make) -> None:
    night = make()
    before, night._status, night._goal = night.controller, "status", (1, "w")
    profiles: list[Any] = []
    night._profiles = lambda: profiles.append(night.controller)
    begin, end = over(night, "controller_killed")
    begin()
    assert (night.controller, night._goal, night._status) == (None, None, "status")
    end()
    assert night.controller not in (None, before)
    assert (night._status, profiles) == (None, [night.controller])


def test_a_servo_that_is_killed_is_inactive_and_comes_back_enabled(make: Make) -> None:
    night = make()
    night.antenna.enable()
    begin, end = over(night, "servo_killed")
    begin()
    assert night.antenna.mode == AntennaMode.INACTIVE
    end()
    assert night.antenna.mode == AntennaMode.HOLDING


def test_a_lost_drive_trips_a_plant_and_silences_a_rotator(make: Make) -> None:
    night = make()
    night.antenna.enable()
    begin, end = over(night, "drive_lost")
    begin()
    assert night.antenna.hardware.fault == NO_ANSWER
    assert NO_ANSWER in night.antenna.safety.latch.text
    end()
    assert night.antenna.hardware.fault == ""
    night = make(rotator=True)
    begin, end = over(night, "drive_lost")
    begin()
    assert night.antenna.hardware.drive.problem == NO_ANSWER
    end()
    assert night.antenna.hardware.drive.problem == ""


@pytest.mark.parametrize(("kind", "value"), [("runaway", None), ("encoder_frozen", 0.0), ("gust", 30.0)])
def test_faults_of_a_plant_are_injected_and_taken_out(make: Make, kind: str, value: float | None) -> None:
    night = make()
    injected: list[tuple[str, float]] = []
    night.antenna.injected.inject = lambda name, given: injected.append((name, given))
    begin, end = over(night, kind)
    begin()
    end()
    # A runaway: at half of the largest rate of the azimuth.
    expected = 0.5 * night.antenna.axes.limits.rate_limit_rad_s[0] if value is None else value
    assert injected == [(kind, expected), ("none", 0.0)]
    with pytest.raises(ValueError, match="are faults of a simulated plant"):
        over(make(rotator=True), kind)[0]()


def test_stuck_axes_are_those_of_a_rotator(make: Make) -> None:
    night = make(rotator=True)
    begin, end = over(night, "axes_stuck")
    model = night.antenna.hardware.drive.model
    begin()
    assert not model.powered
    end()
    assert model.powered
    with pytest.raises(ValueError, match="axes_stuck is a fault of a simulated rotator"):
        over(make(), "axes_stuck")[0]()


def test_what_can_go_wrong_is_that_of_every_station_and_that_of_its_kind(
    plan: tuple[StationSetup, StationSetup, Path, list[Any]],
) -> None:
    assert kinds_of(plan[0]) == (*COMMON, "runaway", "encoder_frozen", "gust")
    assert kinds_of(plan[1]) == (*COMMON, "axes_stuck")


def test_the_morning_report_shows_the_disk_and_the_relays_of_a_rotator(make: Make) -> None:
    assert make().health() == {"disk": {"free_gb": 500.0}}
    night = make(rotator=True)
    night.antenna.hardware.drive.model.starts = [3, 5]
    assert night.health() == {"disk": {"free_gb": 500.0}, "relays": {"starts of azimuth and elevation": "3, 5"}}


# Ticks


class Ticked:
    """A night with stand-ins for antenna, controller, receiver and trackers, tick by tick."""

    def __init__(self, night: NightSimulation, *, busy: bool = True) -> None:
        self.night, self.log = night, []
        self.status = SimpleNamespace(scan_centre_rad="c", offset_rad="o", mode="m", sensor="s")
        self.trajectory: Any = None
        self.reception: Any = None
        axes = SimpleNamespace(moving=False)
        night.antenna = Calls(
            self.log, "antenna", {"step": lambda _t_s: (f"reading {self.tick}", "beam")}, mode="mode", axes=axes,
            safety=SimpleNamespace(latch=SimpleNamespace(text="latched")),
        )  # fmt: skip
        night.controller = Calls(
            self.log, "controller", {"step": lambda _t_s: (self.trajectory, self.status)}, busy=busy
        )
        night.receiver = Calls(self.log, "receiver", {"take": lambda _: self.reception})
        night._monopulse = Calls(self.log, "monopulse", {"measure": "monopulse error"})
        night._carrier = Calls(self.log, "carrier", {"take_power": ["first", "second"]})
        self.tick = -1

    def step(self) -> list[tuple[Any, ...]]:
        """Do one tick; return the calls."""
        self.tick += 1
        self.log.clear()
        self.night._ticks, self.night.t_s = self.tick, round(T0 + TICK_S * self.tick, 6)
        self.night._tick()
        return list(self.log)

    def heard(self, call: str) -> list[tuple[Any, ...]]:
        return [row[1:] for row in self.log if row[0] == call]


def test_the_controller_acts_every_fifth_tick_on_what_was_known_a_period_before(make: Make) -> None:
    one = Ticked(make())
    one.trajectory = "trajectory"
    for tick in range(11):
        calls = one.step()
        t_s = round(T0 + 0.02 * tick, 6)
        assert calls[0] == ("antenna.step", t_s)
        names = [row[0] for row in calls]
        if tick % 5:
            assert names == ["antenna.step", "carrier.take_joints", "receiver.take"]
            continue
        known = [("controller.take_joints", f"reading {tick - 5}")] if tick else []
        assert calls[1:] == [
            ("controller.take_antenna", "mode", "latched"), *known, ("controller.step", t_s),
            ("antenna.accept", "trajectory", t_s), ("carrier.take_status", t_s, "c", "o", "m", "s"),
            ("carrier.take_joints", f"reading {tick}"), ("receiver.take", "beam"),
        ]  # fmt: skip
    assert one.night._status is one.status
    guarded_s: list[float] = []
    one.night._guard = guarded_s.append
    one.step()
    assert guarded_s == [one.night.t_s]


def test_targets_are_taken_two_seconds_ahead_near_a_pass_while_the_ephemeris_lives(make: Make) -> None:
    one = Ticked(make())
    one.night._target = SimpleNamespace(target_at=lambda t_s: f"at {t_s - T0:.3f}")
    one.night._windows = [SimpleNamespace(aos_t_s=T0 + 1000.0, los_t_s=T0 + 2000.0)]
    one.step()
    assert one.heard("controller.take_target") == []
    one.night._windows = [
        SimpleNamespace(aos_t_s=T0 + 1000.0, los_t_s=T0 + 2000.0), SimpleNamespace(aos_t_s=T0 + 6.5, los_t_s=T0 + 50.0)
    ]  # fmt: skip
    one.tick = 4
    one.step()
    assert one.heard("controller.take_target") == [("at 2.100",)]
    assert one.heard("antenna.accept") == [], "no trajectory"
    one.night._on = [(math.inf, NightFault(T0, "ephemeris_killed", 1.0))]
    one.tick = 9
    one.step()
    assert one.heard("controller.take_target") == []


@pytest.mark.parametrize(
    ("t_s", "near"),
    [(994.5, False), (995.5, True), (2004.5, True), (2005.5, False), (2994.5, False), (2995.5, True), (3105.5, False)],
)
def test_near_a_pass_is_from_five_seconds_before_its_rise_to_five_after_its_set(
    make: Make, t_s: float, near: bool
) -> None:
    night = make()
    night._windows = [
        SimpleNamespace(aos_t_s=1000.0, los_t_s=2000.0), SimpleNamespace(aos_t_s=3000.0, los_t_s=3100.0)
    ]  # fmt: skip
    assert night._near(t_s) is near


@pytest.mark.parametrize(
    ("killed", "received", "errors"),
    [
        ((), True, ["monopulse error", "first", "second"]), (("link_drop",), True, []), (("receiver_killed",), False, []),
        (("tracker_killed",), True, []),
    ],
)  # fmt: skip
def test_errors_are_taken_while_receiver_link_and_tracker_live(
    make: Make, killed: tuple[str, ...], received: bool, errors: list[str]
) -> None:
    one = Ticked(make())
    one.reception = SimpleNamespace(power="power", cluster="cluster")
    one.night._on = [(math.inf, NightFault(T0, kind, 1.0)) for kind in killed]
    one.tick = 0
    one.step()
    assert bool(one.heard("receiver.take")) is received
    assert [error for (error,) in one.heard("controller.take_error")] == errors
    assert one.heard("monopulse.measure") == ([("cluster",)] if errors else [])
    assert one.heard("carrier.take_power") == ([("power",)] if errors else [])


def test_without_a_pass_or_a_controller_nothing_is_received(make: Make) -> None:
    one = Ticked(make(), busy=False)
    one.reception = SimpleNamespace(power="power", cluster="cluster")
    assert [row[0] for row in one.step()] == [
        "antenna.step", "controller.take_antenna", "controller.step", "carrier.take_status"
    ]  # fmt: skip
    assert [row[0] for row in one.step()] == ["antenna.step"]
    one.night.controller = None
    one.tick = 9
    assert [row[0] for row in one.step()] == ["antenna.step"]
    assert one.night._known == "reading 10", "read also while nobody takes it"


def test_a_drive_that_reads_nothing_gives_the_tracker_no_joints(make: Make) -> None:
    one = Ticked(make())
    one.night.antenna._answers["step"] = lambda _t_s: (None, "beam")
    one.step()
    assert one.heard("carrier.take_joints") == []
    assert one.night._known is None
    one.night.antenna._answers["step"] = lambda _t_s: (None, None)
    with pytest.raises(ValueError, match="must say where its beam is"):
        one.step()


@pytest.mark.parametrize(("before", "after", "ends"), [(True, False, 1), (True, True, 0), (False, False, 0)])
def test_the_goal_ends_in_the_period_in_which_the_controller_lets_go(
    make: Make, before: bool, after: bool, ends: int
) -> None:
    one, ended = Ticked(make(), busy=before), []
    controller = one.night.controller
    controller._answers["step"] = lambda _t_s: (setattr(controller, "busy", after), one.status)
    one.night._end_of_goal = ended.append
    one.step()
    assert ended == [controller] * ends


def guarded(night: NightSimulation, *, moving: bool = True, past: str = "", azimuth: float = 0.0) -> None:
    hardware = SimpleNamespace(switch_rad=np.array([azimuth, 0.5]), velocity_rad_s=np.array([0.1, 0.2]))
    axes = SimpleNamespace(moving=moving, hardware=hardware)
    gate = night.antenna.safety.gate
    night.antenna = SimpleNamespace(
        axes=axes, safety=SimpleNamespace(beyond=lambda switch, rate: past and f"{past} {switch} {rate}", gate=gate)
    )


def test_time_in_motion_is_counted_and_motion_past_the_gate_is_noted_once_a_period(make: Make) -> None:
    night = make()
    guarded(night, moving=False, past="hard")
    night._guard(T0)
    assert (night.log.moved_s, night.log.outside) == (0.0, [])
    guarded(night, past="hard")
    for tick in range(11):
        night._ticks = tick
        night._guard(T0 + 0.5 + tick)
    assert night.log.moved_s == pytest.approx(0.22)
    where = "hard (0.0, 0.5) (0.1, 0.2)"
    assert night.log.outside == [f"{T0 + 0.5 + tick:.1f}: {where}" for tick in (0, 5, 10)]
    night._ticks = 0
    for _ in range(200):
        night._guard(T0)
    assert len(night.log.outside) == 100


@pytest.mark.parametrize(("past_deg", "noted"), [(0.45, False), (0.55, True)])
def test_half_a_degree_past_the_travel_is_outside(make: Make, past_deg: float, noted: bool) -> None:
    night = make()
    high = night.antenna.safety.gate.limits.azimuth_max_rad
    guarded(night, azimuth=high + math.radians(past_deg))
    night._guard(T0)
    assert bool(night.log.outside) is noted


# Time


REST = {"mode": AntennaMode.HOLDING, "moving": False, "rate": 0.0, "busy": False, "answers": [], "active": "", "on": [],
        "blocks": []}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "idle"),
    [
        ({}, True), ({"mode": AntennaMode.PARKED}, True), ({"mode": AntennaMode.STOWED}, True),
        ({"mode": AntennaMode.TRACKING}, False), ({"moving": True}, False), ({"rate": 0.9e-6}, True),
        ({"rate": 1.2e-6}, False), ({"rate": -1.2e-6}, False), ({"busy": True}, False), ({"busy": None}, True),
        ({"answers": [1]}, False), ({"active": "a"}, False), ({"on": [1]}, False), ({"blocks": ["b"]}, False),
    ],
)  # fmt: skip
def test_a_night_is_idle_while_nothing_moves_and_nothing_is_waited_for(
    make: Make, changes: dict[str, Any], idle: bool
) -> None:
    night, now = make(), REST | changes
    axes = SimpleNamespace(moving=now["moving"], rate_command_rad_s=np.array([0.0, now["rate"]]))
    night.antenna = SimpleNamespace(mode=now["mode"], axes=axes)
    night.controller = None if now["busy"] is None else SimpleNamespace(busy=now["busy"])
    night._answers, night._on = now["answers"], now["on"]
    night.night = SimpleNamespace(active_id=now["active"], blocks=lambda: now["blocks"])
    assert night._idle is idle


class Clocked(NightSimulation):
    """A night whose ticks only note the time and their number; it is idle from one time to another."""

    idle_s = (10.0, 9000.0)

    def _tick(self) -> None:
        self.rows.append((round(self.t_s - T0, 6), self._ticks))

    @property
    def _idle(self) -> bool:
        return self.idle_s[0] <= self.t_s - T0 < self.idle_s[1]

    def _begin_and_end_faults(self) -> None:
        self.faulted = getattr(self, "faulted", 0) + 1

    def _look(self) -> None:
        self.looks.append(round(self.t_s - T0, 6))


def test_time_goes_on_in_ticks_or_in_seconds_and_the_executive_is_stepped_twice_a_second(
    plan: tuple[StationSetup, StationSetup, Path, list[Any]],
) -> None:
    night = Clocked(plan[0], plan[2], plan[3], T0)
    night.rows, night.looks, hours = [], [], []
    log = with_executive(night)
    night.run(T0 + 9001.0, lambda t_s: hours.append(t_s - T0))
    assert log[0] == ("night.start", T0)
    assert night.antenna.mode == AntennaMode.HOLDING
    times = [t_s for t_s, _ in night.rows]
    assert times[:3] == [0.0, 0.02, 0.04]
    assert night.faulted == len(times)
    assert np.diff(times[:501]) == pytest.approx(0.02, abs=1e-6)
    assert np.diff(times[500:9490]) == pytest.approx(1.0, abs=1e-6)
    assert np.diff(times[9491:]) == pytest.approx(0.02, abs=1e-6)
    assert times[-1] == pytest.approx(9000.98, abs=0.011)
    # The number of the tick counts on while something moves, and is 0 in idle seconds.
    assert [number for _, number in night.rows[:4]] == [0, 1, 2, 3]
    assert {number for _, number in night.rows[501:9490]} == {0}
    assert [number for t_s, number in night.rows if t_s > 9000.01][:3] == [1, 2, 3]
    steps = [row[1] - T0 for row in log if row[0] == "night.step"]
    assert steps[:21] == pytest.approx([0.5 * k for k in range(21)])
    assert steps[21:30] == pytest.approx([11.0 + k for k in range(9)])
    assert night.looks[0] == 0.0
    assert night.looks[1:] == pytest.approx(steps)
    assert hours == pytest.approx([0.02, 3600.0, 7200.0])


def test_a_night_ends_with_its_executive(plan: tuple[StationSetup, StationSetup, Path, list[Any]]) -> None:
    night = Clocked(plan[0], plan[2], plan[3], T0)
    night.rows, night.looks = [], []
    log = with_executive(night)
    night._tick = lambda: setattr(night.night, "finished", night.t_s >= T0 + 0.1)
    night.run(T0 + 100.0)
    assert night.t_s == pytest.approx(T0 + 0.12)
    assert [row[0] for row in log] == ["night.start", "night.step"]


def test_the_executive_gets_thresholds_rest_sensor_and_share_of_the_station(make: Make) -> None:
    night = make(between=BetweenParams(lead_s=7.0), thresholds=AlarmParams(quiet_s=33.0, node_silent_s=44.0))
    assert night.night.schedule.params.lead_s == 7.0
    assert night.night.book.quiet_s == 33.0
    (cause,) = [each for each in night.night.table.causes if each.name == "lost_node"]
    assert cause.when[0].wanted == 44.0
    assert (night.night.sensor, night.night.least_share) == (night.setup.sensor, 0.6)
    assert list(night.night.schedule.entries) == ["90001", "90002"]
    night.night.book.notify("raised", Alarm("x", 1, "text", T0))
    assert night.log.messages == [("raised", "x", "text")]
    assert make().night.book.quiet_s == AlarmParams().quiet_s


@pytest.mark.parametrize(
    ("rotator", "anemometer", "wind"), [(False, True, True), (False, False, False), (True, True, False)]
)
def test_gusts_are_faults_of_a_plant_with_an_anemometer(rotator: bool, anemometer: bool, wind: bool) -> None:
    antenna = object.__new__(DriveAntenna) if rotator else object()
    content = SimpleNamespace(wind=SimpleNamespace(anemometer=anemometer))
    setup = SimpleNamespace(antenna=lambda: antenna, station=SimpleNamespace(content=content))
    assert ("gust" in kinds_of(setup)) is wind


def test_a_runaway_goes_at_half_the_largest_rate_of_the_azimuth(make: Make) -> None:
    night, log = make(), []
    axes = SimpleNamespace(limits=SimpleNamespace(rate_limit_rad_s=(0.3, 0.7)))
    night.antenna = SimpleNamespace(axes=axes, injected=Calls(log, "injected"))
    night._begin(NightFault(T0, "runaway", 1.0))
    assert log == [("injected.inject", "runaway", pytest.approx(0.15))]
