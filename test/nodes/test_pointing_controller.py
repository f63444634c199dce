"""The node around the controller: when a period is stepped, which goal is taken, how it ends, and what is published.

The arithmetic is a stand-in whose state a test sets; clocks are the test's own.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.action import CancelResponse, GoalResponse
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import Pass
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger

from rf_pointing.core import JointReading, JointTrajectory
from rf_pointing.core.pass_outcome import LOSS_OF_SIGNAL, PassOutcome
from rf_pointing.nodes import pointing_controller
from rf_pointing.nodes.pointing_controller import PointingControllerNode, nearest_pass
from rf_pointing.ros import convert_planning
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.pointing.outcome import PassStatistics
from test.nodes.goal_handle import GoalHandle

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
PERIOD_S = 0.1
NOW_S = 1.8e9


class Core:
    """What the node needs of a controller, with every call noted."""

    def __init__(self, real: Any) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.params, self.state, self.carrier, self.corrections = (
            real.params,
            real.state,
            real.carrier,
            real.corrections,
        )
        self.idle = real.step(NOW_S)[1]
        self.level, self.alarm, self.trajectory = 0, "", None
        self.busy, self.missing, self.stopping, self.awaited = False, "", False, False
        self.after_step: Callable[[], None] = lambda: None
        self.plan = SimpleNamespace(certificate=None, take_profiles=lambda rows: self.calls.append(("profiles", rows)))
        self.statistics, self.model_doubt = PassStatistics(), ""
        self.antenna = SimpleNamespace(fault="")
        self.refusal = ""

    def step(self, t_s: float) -> Any:
        self.calls.append(("step", t_s))
        self.after_step()
        status = dataclasses.replace(self.idle, t_s=t_s, level=self.level, alarm=self.alarm)
        return self.trajectory, status

    def awaits_error(self, _t_s: float) -> bool:
        return self.awaited

    def calibrate(self) -> str:
        return self.refusal

    def start(self, *given: Any) -> None:
        self.calls.append(("start", *given))
        if self.refusal:
            raise ValueError(self.refusal)

    def __getattr__(self, name: str) -> Callable[..., None]:
        if not name.startswith(("take_", "certify", "stop", "refuse_", "retune")):
            raise AttributeError(name)
        return lambda *given: self.calls.append((name, *given))

    def called(self, name: str) -> list[Any]:
        """Return the arguments of the calls of one name."""
        return [call[1:] for call in self.calls if call[0] == name]


class Goal(GoalHandle):
    """A goal of track_pass, and what became of it."""

    def __init__(self, **request: Any) -> None:
        super().__init__(TrackPass.Goal(**request))


def window(begin_s: float = -60.0, length_s: float = 300.0, target: str = "BIRD") -> Pass:
    """Return a pass that begins so long after now."""
    times = {"aos": begin_s, "tca": begin_s + 0.5 * length_s, "los": begin_s + length_s}
    return Pass(
        target=target, peak_elevation=0.5, **{name: stamp_from_seconds(NOW_S + t_s) for name, t_s in times.items()}
    )


def certificate(chosen: bool = True) -> Any:
    return SimpleNamespace(chosen=SimpleNamespace(mean_loss_db=0.4) if chosen else None)


class Bench:
    """An active controller whose streams are lists."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall_s, self.t_s = 1000.0, NOW_S
        self.statuses: list[Any] = []
        self.commands: list[Any] = []
        self.certificates: list[Any] = []
        self.stored: list[Any] = []
        self.reports = 0
        self.difference = ""
        monkeypatch.setattr(pointing_controller, "time", SimpleNamespace(perf_counter=lambda: self.wall_s))
        monkeypatch.setattr(convert_planning, "certificate_to_message", lambda each: each)
        monkeypatch.setattr(pointing_controller, "store_certificate", lambda _params, each: self.stored.append(each))
        self.node: Any = PointingControllerNode()
        self.node.now_s = lambda: self.t_s
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.core = self.node._controller = Core(self.node._controller)
        self.reads_s: list[float] = []
        self.reading: JointReading | None = None
        self.node._joints = SimpleNamespace(take=self._take)
        self.node._status = SimpleNamespace(publish=self.statuses.append)
        self.node._commands = SimpleNamespace(publish=self.commands.append)
        self.node._certificates = SimpleNamespace(publish=self.certificates.append)
        self.node._census = SimpleNamespace(difference=lambda _node: self.difference)
        self.node.diagnostics.publish = self._report

    def _take(self, until_s: float) -> JointReading | None:
        self.reads_s.append(until_s)
        return self.reading

    def _report(self) -> None:
        self.reports += 1

    def start(self, goal: Goal | None = None) -> Goal:
        """Start a goal with its pass."""
        goal = goal or Goal(target_pass=window(), sensor="none")
        self.node._on_accepted(goal)
        self.core.busy = not goal.ends
        return goal

    def close(self) -> None:
        self.node._goal = self.node._wanted = None
        self.node.end()
        self.node._action.destroy()
        self.node.lock.release()
        self.node.destroy_node()


@pytest.fixture
def bench(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """Yield an active controller."""
    made = Bench(monkeypatch)
    made.node.on_activate(ANY_STATE)
    yield made
    made.close()


# Periods


def test_a_period_is_stepped_at_once_with_the_axes_of_the_one_before(bench: Bench) -> None:
    bench.reading = JointReading(t_s=NOW_S, position_rad=np.zeros(2), velocity_rad_s=np.zeros(2))
    bench.node._due(NOW_S)
    assert bench.core.called("step") == [(NOW_S,)]
    assert [NOW_S - until_s for until_s in bench.reads_s] == pytest.approx([PERIOD_S], abs=1e-6)
    assert bench.core.called("take_joints") == [(bench.reading,)]
    assert (len(bench.statuses), bench.commands, bench.statuses[0].commands_sent) == (1, [], 0)
    assert bench.node.turn() == 0.2


def test_a_command_is_published_signed_by_name_and_counted(bench: Bench) -> None:
    times = NOW_S + 0.1 * np.arange(1, 4)
    bench.core.trajectory = JointTrajectory(
        t_s=times, position_rad=np.ones((3, 2)), velocity_rad_s=np.zeros((3, 2)), acceleration_rad_s2=np.zeros((3, 2))
    )
    bench.node._due(NOW_S)
    bench.node._due(NOW_S)
    assert [status.commands_sent for status in bench.statuses] == [1, 2]
    assert bench.commands[0].header.frame_id == "/pointing_controller"
    assert seconds_from_stamp(bench.commands[0].header.stamp) == NOW_S


def test_a_period_waits_50_ms_for_the_error_of_the_one_before(bench: Bench) -> None:
    bench.core.awaited = True
    bench.node._due(NOW_S)
    assert bench.core.called("step") == []
    assert bench.node.turn() == pytest.approx(0.05)
    bench.wall_s += 0.04
    assert bench.node.turn() == pytest.approx(0.01)
    bench.wall_s += 0.02
    assert bench.node.turn() == 0.0
    assert bench.core.called("step") == [(NOW_S,)]
    assert bench.node.turn() == 0.2


def test_a_period_ends_with_the_error_or_with_the_next_period(bench: Bench) -> None:
    bench.core.awaited = True
    bench.node._due(NOW_S)
    bench.core.awaited = False
    assert bench.node.turn() == 0.0
    assert bench.core.called("step") == [(NOW_S,)]
    bench.core.awaited = True
    bench.node._due(NOW_S + 0.1)
    bench.node._due(NOW_S + 0.2)
    assert bench.core.called("step") == [(NOW_S,), (NOW_S + 0.1,)]


def test_the_time_of_a_period_is_held_while_its_certificate_waits(bench: Bench) -> None:
    bench.core.missing = "the profile"
    bench.node._due(NOW_S)
    assert bench.node.turn() == 0.2
    bench.wall_s += 100.0
    assert bench.node.turn() == 0.2
    assert bench.core.called("step") == []
    bench.core.missing = ""
    assert bench.node.turn() == 0.0
    assert bench.core.called("step") == [(NOW_S,)]


def test_a_waiting_goal_is_certified_with_the_present_axes(bench: Bench) -> None:
    bench.core.missing = "the profile"
    bench.node._certify()
    assert bench.core.called("certify") == []
    bench.start()
    bench.reads_s.clear()
    bench.node._certify()
    assert (bench.core.called("certify"), bench.reads_s) == ([(NOW_S,)], [NOW_S])
    bench.wall_s += 30.0
    bench.node._certify()
    assert bench.core.called("refuse_incomplete") == []
    bench.wall_s += 0.5
    bench.node._certify()
    assert bench.core.called("refuse_incomplete") == [(30.5,)]
    bench.core.missing = ""
    bench.node._certify()
    assert len(bench.core.called("certify")) == 3


def test_a_refused_pass_ends_although_time_is_held(bench: Bench) -> None:
    bench.core.missing = "the profile"
    bench.start()
    bench.node._due(NOW_S)
    assert bench.core.called("step") == []
    bench.core.stopping = True
    bench.node.turn()
    assert bench.core.called("step") == [(NOW_S,)]
    assert bench.node._period is None


def test_nodes_of_another_station_stop_a_pass_before_its_certificate(bench: Bench) -> None:
    bench.core.missing = "the position of the axes"
    bench.start()
    bench.difference = "rf_receiver on Other"
    bench.node._certify()
    assert bench.core.called("stop") == []

    def take_joints(*_: Any) -> None:
        bench.core.missing = ""

    bench.core.take_joints = take_joints
    bench.reading = JointReading(t_s=NOW_S, position_rad=np.zeros(2), velocity_rad_s=np.zeros(2))
    bench.node._certify()
    assert [("rf_receiver on Other" in reason) for (reason,) in bench.core.called("stop")] == [True]


# The end of a goal


@pytest.mark.parametrize(
    ("issued", "refused"), [(certificate(), ""), (certificate(False), "too fast"), (None, "too fast")]
)
def test_a_goal_ends_with_its_pass(bench: Bench, issued: Any, refused: str) -> None:
    goal = bench.start()
    bench.core.plan.certificate = issued
    bench.core.statistics.reason = "too fast"
    bench.node._due(NOW_S)
    assert goal.ends == []

    def end() -> None:
        bench.core.busy = False

    bench.core.after_step = end
    bench.node._due(NOW_S + 0.1)
    assert (goal.ends, bench.node._refusal, bench.node._goal) == (["execute"], refused, None)
    bench.node._due(NOW_S + 0.2)
    assert goal.ends == ["execute"]


def test_every_tenth_period_feeds_back_the_share_of_the_pass(bench: Bench) -> None:
    goal = bench.start()
    for period in range(1, 31):
        bench.node._due(NOW_S + (0.1 * period if period < 20 else 90.0))
        assert len(goal.feedback) == period // 10
    assert [each.progress for each in goal.feedback] == pytest.approx([61.0 / 300.0, 0.5, 0.5])
    assert goal.feedback[0].target_pass.target == "BIRD"
    message, status = bench.statuses[-1], bench.core.idle
    for t_s, share in ((NOW_S - 61.0, 0.0), (NOW_S + 241.0, 1.0)):
        bench.node._feed_back(message, dataclasses.replace(status, t_s=t_s))
        assert goal.feedback[-1].progress == share
    bench.node._window = window(0.0, 0.5)
    bench.node._feed_back(message, dataclasses.replace(status, t_s=NOW_S + 0.25))
    assert goal.feedback[-1].progress == pytest.approx(0.25)


def test_the_result_is_the_outcome_of_the_pass(bench: Bench) -> None:
    goal = bench.start()
    bench.core.plan.certificate = certificate()
    bench.core.statistics = PassStatistics(
        outcome=PassOutcome(270.0, 30.0, 250.0), samples=4, square_rad2=np.array([4e-6, 1e-6]), reason=LOSS_OF_SIGNAL
    )
    result = bench.node._conclude(goal)
    assert (result.success, result.message, goal.ends) == (True, LOSS_OF_SIGNAL, ["succeed"])
    assert (result.seconds_tracked, result.seconds_lost, result.predicted_loss) == (270.0, 30.0, 0.4)
    assert result.rms_cross_elevation_error == pytest.approx(1e-3)
    assert result.rms_elevation_error == pytest.approx(0.5e-3)
    assert result.mean_loss == pytest.approx(-10.0 * math.log10(250.0 / 300.0))
    assert result.target_pass.target == "BIRD"
    bench.core.plan.certificate = None
    bench.core.statistics.fault = "encoder frozen"
    result = bench.node._conclude(goal)
    assert (result.success, result.fault, result.predicted_loss, goal.ends[-1]) == (
        False,
        "encoder frozen",
        -1.0,
        "abort",
    )


def test_the_result_of_a_refused_goal_is_its_reason(bench: Bench) -> None:
    bench.core.antenna.fault, bench.core.refusal = "encoder frozen", "the antenna has a fault"
    goal = bench.start()
    assert goal.ends == ["execute"]
    result = bench.node._conclude(goal)
    assert (result.success, result.message, result.predicted_loss) == (False, "the antenna has a fault", -1.0)
    assert (result.fault, goal.ends[-1]) == ("encoder frozen", "abort")
    goal.is_cancel_requested = True
    bench.node._conclude(goal)
    assert goal.ends[-1] == "canceled"


# Goals


def test_goals_are_taken_one_at_a_time_while_the_node_is_active(
    default_context: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(monkeypatch)
    assert bench.node._on_goal(TrackPass.Goal()) == GoalResponse.REJECT
    bench.node.on_activate(ANY_STATE)
    assert bench.node._on_goal(TrackPass.Goal()) == GoalResponse.ACCEPT
    bench.start()
    assert bench.node._on_goal(TrackPass.Goal()) == GoalResponse.REJECT
    bench.close()


def test_a_goal_starts_its_pass_with_the_present_axes_and_a_sensor(bench: Bench) -> None:
    bench.start()
    ((t_s, taken, sensor),) = bench.core.called("start")
    assert (t_s, taken.name, sensor) == (NOW_S, "BIRD", "none")
    assert taken.aos_t_s == NOW_S - 60.0
    assert bench.reads_s == [NOW_S]


def test_a_goal_without_a_sensor_takes_the_first_of_the_station(bench: Bench) -> None:
    bench.start(Goal(target_pass=window()))
    ((_, _, sensor),) = bench.core.called("start")
    station = bench.node.station
    assert sensor == station.chosen_sensor(next(iter(station.sensors(bench.node.band))), bench.node.band)


@pytest.mark.parametrize("why", ["station", "temperature"])
@pytest.mark.parametrize("by_name", [False, True])
def test_no_goal_starts_on_another_station_or_a_model_without_its_input(bench: Bench, why: str, by_name: bool) -> None:
    if why == "station":
        bench.difference = "rf_receiver on Other"
    else:
        bench.node._unfed = "the model needs a temperature"
    goal = bench.start(Goal(satellite="BIRD") if by_name else None)
    assert goal.ends == ["execute"]
    assert bench.core.called("start") == []
    assert ("rf_receiver on Other" if why == "station" else "temperature") in bench.node._refusal
    assert bench.node._health().level == (ERROR if why == "station" else WARN)


def test_a_satellite_and_a_pass_are_not_given_at_once(bench: Bench) -> None:
    goal = bench.start(Goal(satellite="BIRD", target_pass=window(target="OTHER")))
    assert goal.ends == ["execute"]
    assert "'BIRD'" in bench.node._refusal
    assert "'OTHER'" in bench.node._refusal


@pytest.mark.parametrize(
    ("near_s", "start_s"),
    [(None, None), (-7200.0, -10800.0), (0.0, -3600.0), (1800.0, 0.0), (7200.0, 3600.0)],
)
def test_a_pass_is_looked_for_within_an_hour_and_not_in_the_past(
    bench: Bench, near_s: float | None, start_s: float | None
) -> None:
    request = TrackPass.Goal(satellite="BIRD", minimum_peak_elevation=0.3)
    if near_s is not None:
        request.near = stamp_from_seconds(NOW_S + near_s)
    wanted = bench.node._selection_of(request)
    assert (wanted.target, wanted.minimum_peak_elevation) == ("BIRD", 0.3)
    assert seconds_from_stamp(wanted.start) == (0.0 if start_s is None else NOW_S + start_s)


class Ephemeris:
    """The service that finds passes."""

    def __init__(self) -> None:
        self.answers: list[Any] = []
        self.requests: list[Any] = []

    def service_is_ready(self) -> bool:
        return True

    def call_async(self, request: Any) -> Any:
        self.requests.append(request)
        return SimpleNamespace(done=lambda: bool(self.answers), result=lambda: self.answers[0])


def test_a_goal_by_name_starts_the_nearest_pass_that_is_found(bench: Bench) -> None:
    ephemeris = bench.node._ephemeris = Ephemeris()
    goal = bench.start(Goal(satellite="BIRD", near=stamp_from_seconds(NOW_S + 6000.0), sensor="none"))
    assert len(ephemeris.requests) == 1
    bench.node._due(NOW_S)
    bench.node.turn()
    assert bench.core.called("step") == []
    answer = SelectTarget.Response(success=True, passes=[window(100.0, target="A"), window(6100.0, target="B")])
    ephemeris.answers.append(answer)
    bench.node.turn()
    ((_, taken, _),) = bench.core.called("start")
    assert (taken.name, goal.ends) == ("B", [])
    assert (bench.node._wanted, bench.node._selection) == (None, None)
    # The period that was held goes on.
    assert bench.core.called("step") == [(NOW_S,)]


def test_a_goal_waits_30_s_for_the_ephemeris(bench: Bench) -> None:
    bench.node._ephemeris = Ephemeris()
    goal = bench.start(Goal(satellite="BIRD"))
    bench.core.busy = False
    bench.wall_s += 30.0
    bench.node.turn()
    assert goal.ends == []
    bench.wall_s += 1.0
    bench.node.turn()
    assert goal.ends == ["execute"]
    assert "waited 31 s" in bench.node._refusal


def test_a_goal_that_waits_for_its_pass_feeds_nothing_back(bench: Bench) -> None:
    bench.node._ephemeris = Ephemeris()
    goal = bench.start(Goal(satellite="BIRD"))
    for period in range(21):
        bench.node._due(NOW_S + 0.1 * period)
    assert len(bench.core.called("step")) == 20
    assert goal.feedback == []


@pytest.mark.parametrize("how", ["service", "cancel", "deactivation"])
def test_a_pass_is_stopped_under_control(bench: Bench, how: str) -> None:
    goal = bench.start()
    if how == "service":
        response = bench.node._on_stop(Trigger.Request(), Trigger.Response())
        assert (response.success, response.message) == (True, "stopping")
    elif how == "cancel":
        assert bench.node._on_cancel(goal) == CancelResponse.ACCEPT
    else:
        bench.core.awaited = True
        bench.node._due(NOW_S)
        bench.node.on_deactivate(ANY_STATE)
        assert bench.core.called("step") == [(NOW_S,), (NOW_S,)]
    assert len(bench.core.called("stop")) == 1
    assert goal.ends == []


def test_a_search_is_stopped_with_its_goal(bench: Bench) -> None:
    bench.node._ephemeris = Ephemeris()
    goal = bench.start(Goal(satellite="BIRD"))
    response = bench.node._on_stop(Trigger.Request(), Trigger.Response())
    assert (response.success, goal.ends) == (True, ["execute"])
    bench.core.busy = False
    response = bench.node._on_stop(Trigger.Request(), Trigger.Response())
    assert (response.success, response.message) == (False, "nothing is being tracked")


def test_a_calibration_is_answered_with_its_refusal(bench: Bench) -> None:
    response = bench.node._on_calibrate(Trigger.Request(), Trigger.Response())
    assert (response.success, response.message) == (True, "calibrating")
    bench.core.refusal = "no pass"
    response = bench.node._on_calibrate(Trigger.Request(), Trigger.Response())
    assert (response.success, response.message) == (False, "no pass")


# What is shown


def test_diagnostics_are_published_at_once_when_the_level_changes(bench: Bench) -> None:
    bench.core.level, bench.core.alarm = 1, "lag"
    bench.node._due(NOW_S)
    assert bench.reports == 1
    bench.core.alarm = "lag 2"
    bench.node._due(NOW_S + 0.1)
    assert bench.reports == 1
    health = bench.node._health()
    assert (health.level, health.message) == (WARN, "lag 2")
    bench.core.level, bench.core.alarm = 0, ""
    bench.node._due(NOW_S + 0.2)
    assert (bench.reports, bench.node._health().level) == (2, OK)


def test_the_health_shows_the_worst_that_is_known(bench: Bench) -> None:
    health = bench.node._health()
    assert (health.level, health.message) == (OK, bench.core.state.mode)
    bench.core.model_doubt = "3 deg off the axes"
    assert (bench.node._health().level, bench.node._health().message) == (WARN, "3 deg off the axes")
    bench.node._refusal = "too fast"
    assert (bench.node._health().level, bench.node._health().message) == (ERROR, "too fast")
    bench.node._unfed = "no temperature"
    assert (bench.node._health().level, bench.node._health().message) == (WARN, "no temperature")
    bench.node._alarm = 2, "fault"
    assert (bench.node._health().level, bench.node._health().message) == (ERROR, "fault")


def test_the_health_rounds_what_was_learned_of_the_orbit(bench: Bench) -> None:
    state = SimpleNamespace(mean=np.array([0.1234567, -45.6789]), used=7, refused=2)
    bench.core.corrections = SimpleNamespace(filter=SimpleNamespace(state=state))
    values = bench.node._health().values
    assert (values["along_track_s"], values["cross_track_m"]) == (0.12346, -45.68)
    assert (values["trim_used"], values["trim_refused"]) == (7, 2)


def test_a_certificate_is_published_and_stored_once(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    first = bench.core.plan.certificate = certificate()
    bench.node._due(NOW_S)
    bench.node._due(NOW_S + 0.1)
    assert (bench.certificates, bench.stored) == ([first], [first])

    def full(*_: Any) -> None:
        raise OSError(28, "No space left")

    monkeypatch.setattr(pointing_controller, "store_certificate", full)
    bench.core.plan.certificate = certificate()
    bench.node._due(NOW_S + 0.2)
    assert len(bench.certificates) == 2
    # One of a pass that is refused at its start is shown, too.
    bench.core.plan.certificate, bench.core.refusal = certificate(False), "too fast"
    bench.start()
    assert len(bench.certificates) == 3


def test_the_model_follows_the_temperature_in_steps_of_100_mk(bench: Bench) -> None:
    temperatures: list[float | None] = []

    def at_temperature(now_k: float | None) -> str:
        temperatures.append(now_k)
        if now_k is None:
            raise ValueError("azimuth_temperature needs a temperature")
        return "model"

    bench.node._on_temperature(Temperature(temperature=20.0))
    bench.node._model = SimpleNamespace(at_temperature=at_temperature)
    bench.node._temperature_k = None
    bench.node._use_model()
    assert "weather/temperature" in bench.node._unfed
    for celsius in (20.0, 20.09, 19.91, 20.11, 20.02, 20.005):
        bench.node._on_temperature(Temperature(temperature=celsius))
    assert temperatures[1:] == pytest.approx([293.15, 293.26, 293.155])
    assert bench.node._unfed == ""
    assert bench.core.called("take_model") == [("model",)] * 3


def test_profiles_are_passed_on_decoded(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convert_planning, "profile_from_message", lambda row: f"profile {row}")
    bench.node._on_profiles(SimpleNamespace(profiles=["a", "b"]))
    assert bench.core.called("profiles") == [(["profile a", "profile b"],)]


def test_live_parameters_reach_the_controller(bench: Bench) -> None:
    bench.node._retune()
    ((params,),) = bench.core.called("retune")
    assert params == bench.core.params
    bench.node._controller = None
    bench.node._retune()
    bench.node._controller = bench.core


def test_the_controller_is_connected_while_it_is_configured(default_context: None) -> None:
    node = PointingControllerNode()
    kinds = ("subscriptions", "publishers", "services")
    before = [len(list(getattr(node, kind))) for kind in kinds]
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    topics = {
        "target", "joint_states", "antenna_status", "pointing_error", "pointing_model", "pass_profiles",
        "weather/temperature", "station_in_use", "executive_status", "diagnostics",
    }  # fmt: skip
    assert topics <= {each.topic_name.lstrip("/") for each in node.subscriptions}
    assert {"stop", "calibrate"} <= {each.srv_name.rpartition("/")[2] for each in node.services}
    assert {"tracking", "executive", "clocks"} <= set(node.diagnostics._checks)
    node.on_cleanup(ANY_STATE)
    assert [len(list(getattr(node, kind))) for kind in kinds] == before
    node.end()
    node._action.destroy()
    node.lock.release()
    node.destroy_node()


def test_work_is_timed_while_the_node_is_active(bench: Bench) -> None:
    timers = len(list(bench.node.timers))
    bench.node.on_deactivate(ANY_STATE)
    assert len(list(bench.node.timers)) == timers - 1


# The nearest pass


@pytest.mark.parametrize(
    ("near_s", "target"),
    [(None, "A"), (-3660.0, "A"), (240.0, "A"), (3000.0, "A"), (3200.0, "B"), (6200.0, "B"), (9900.0, "B")],
)
def test_the_pass_nearest_to_a_time_is_taken(near_s: float | None, target: str) -> None:
    """A from -60 to 240 s, B from 6000 to 6300 s; the middle between them is 3120 s."""
    passes = [window(target="A"), window(6000.0, target="B")]
    assert nearest_pass(passes, 0.0 if near_s is None else NOW_S + near_s).target == target


@pytest.mark.parametrize("near_s", [-3661.0, 9901.0])
def test_a_pass_farther_than_an_hour_is_none(near_s: float) -> None:
    with pytest.raises(ValueError, match="no pass within 60 min"):
        nearest_pass([window(target="A"), window(6000.0, target="B")], NOW_S + near_s)


@pytest.mark.parametrize("near_s", [0.0, NOW_S])
def test_an_answer_without_passes_refuses_the_goal(near_s: float) -> None:
    """A publisher of another make may answer so; the goal would wait for ever."""
    with pytest.raises(ValueError, match="has found no pass"):
        nearest_pass([], near_s)
