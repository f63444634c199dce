"""What every node shares: counted inputs, numbered outputs, refusals that do not end the process.

Periodic work: every instant of the grid once, in order, however the timer fires.
"""

import math
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.clock import ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.time import Time as ClockTime
from rf_pointing_msgs.msg import PointingError, Target
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rf_pointing.ros import convert, managed
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.main_loop import _work, run
from rf_pointing.ros.managed import ManagedNode, Schedule
from rf_pointing.ros.qos import LATCHED, STREAM

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


class Subject(ManagedNode):
    """A node that refuses what it is told to refuse."""

    def __init__(self) -> None:
        super().__init__("managed_subject")
        self.refusal: Exception | None = None
        self.made = 0
        self.ticks: list[float] = []

    def configure(self) -> None:
        self.stream(Target, "managed_subject/target", STREAM)
        self.listen(PointingError, "managed_subject/error", self._take, STREAM)
        if self.refusal:
            raise self.refusal
        self.made += 1

    def activate(self) -> None:
        self.every(0.1, self.ticks.append)
        if self.refusal:
            raise self.refusal

    def _take(self, given: PointingError) -> None:
        convert.error_from_message(given)


@pytest.fixture
def subject(default_context: None) -> Any:
    """Yield a managed node."""
    node = Subject()
    yield node
    node.lock.release()
    node.destroy_node()


def entities(node: Subject) -> list[list[Any]]:
    """Return what the node has in the graph, and its timers."""
    return [list(kind) for kind in (node.publishers, node.subscriptions, node.services, node.timers)]


@pytest.mark.parametrize(
    "refusal", [ValueError("gain=9 must be <= 5"), FileNotFoundError(2, "No such file", "model.yaml")]
)
def test_a_refused_configuration_leaves_nothing_behind_and_says_why(subject: Subject, refusal: Exception) -> None:
    before = entities(subject)
    subject.refusal = refusal
    assert subject.on_configure(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert subject._state_health().message == str(refusal)
    assert entities(subject) == before
    subject.refusal = None
    assert subject.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert subject._state_health().message == "inactive"
    subject.on_cleanup(ANY_STATE)


def test_a_refused_activation_leaves_no_timer_running(subject: Subject) -> None:
    subject.on_configure(ANY_STATE)
    subject.refusal = ValueError("no pass")
    before = entities(subject)
    assert subject.on_activate(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert entities(subject) == before
    assert subject._state_health().message == "no pass"
    subject.on_cleanup(ANY_STATE)


def test_a_message_that_is_refused_is_counted_and_the_node_lives_on(subject: Subject) -> None:
    reasons: list[str] = []
    door = subject._door(PointingError, "pointing_error", subject._take, False, lambda: 1000, reasons.append)
    door(serialize_message(PointingError(sensor="monopulse", cross_elevation=math.nan)))
    door(serialize_message(PointingError(sensor="monopulse", cross_elevation=0.001)))
    health = subject.inputs.health()
    assert (health.level, health.message) == (WARN, "1 messages refused")
    assert health.values["refused pointing_error"] == 1
    assert health.values["last_refusal"] == "pointing_error: cross_elevation must be finite and at most 1e+18"
    assert reasons == ["cross_elevation must be finite and at most 1e+18"]


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"12345678", "8 bytes are no PointingError"),
        (b"", "0 bytes are no PointingError"),
        (bytes(1001), "a message of 1001 bytes, must be <= 1000"),
        (PointingError(cross_elevation=1e300), "cross_elevation must be finite and at most 1e+18"),
        (
            PointingError(header=Header(stamp=Time(sec=-1))),
            "stamp of -1 s and 0 ns is none",
        ),
        (
            PointingError(header=Header(stamp=Time(sec=1, nanosec=1_000_000_000))),
            "stamp of 1 s and 1000000000 ns is none",
        ),
    ],
)
def test_what_can_be_no_message_is_refused_at_the_door(
    subject: Subject, payload: bytes | PointingError, reason: str
) -> None:
    if isinstance(payload, PointingError):
        payload = serialize_message(payload)
    subject._door(PointingError, "pointing_error", subject._take, False, lambda: 1000, str)(payload)
    assert subject.inputs.last_refusal == f"pointing_error: {reason}"
    assert subject.inputs.errors == 0


def test_a_message_without_a_stamp_is_refused_before_it_is_kept(subject: Subject) -> None:
    latest = subject.listen_latest(PointingError, "managed_subject/fast", convert.error_from_message, STREAM)
    (door,) = [each.callback for each in subject.subscriptions if each.topic_name.endswith("fast")]
    for length in range(12):
        door(bytes(length))
    assert subject.inputs.refused == {"managed_subject/fast": 12}
    # Enough for a stamp, too little for a message: refused when it would be used.
    door(bytes([0, 1, 0, 0, *[0] * 12]))
    assert latest.take() is None
    assert subject.inputs.refused == {"managed_subject/fast": 13}
    assert subject.inputs.last_refusal == "managed_subject/fast: 16 bytes are no PointingError"


def test_another_exception_is_counted_and_the_node_lives_on(subject: Subject) -> None:
    door = subject._door(PointingError, "pointing_error", lambda m: m.nothing, False, lambda: 1000, str)
    door(serialize_message(PointingError(sensor="monopulse")))
    health = subject.inputs.health()
    assert (health.level, health.message) == (WARN, "1 errors survived")
    assert str(health.values["last_error"]).startswith("pointing_error: AttributeError: ")


def test_a_service_that_raises_answers_that_it_has_failed(subject: Subject) -> None:
    subject.serve(Trigger, "managed_subject/fails", lambda _request, _response: 1 / 0)
    (service,) = [each for each in subject.services if each.srv_name.endswith("fails")]
    answer = service.callback(Trigger.Request(), Trigger.Response())
    assert not answer.success
    assert answer.message == "ZeroDivisionError: division by zero"
    assert subject.inputs.errors == 1


def test_a_second_node_of_the_name_is_refused(subject: Subject) -> None:
    assert subject.lock is not None
    with pytest.raises(RuntimeError, match="/managed_subject already runs in ROS domain"):
        Subject()


@pytest.mark.parametrize("asked", [{"id": 4}, {"id": 99}, {"label": "activate"}, {"label": "fly"}])
def test_a_transition_that_the_state_does_not_have_is_refused_and_the_node_lives_on(
    subject: Subject, asked: dict[str, Any]
) -> None:
    request = ChangeState.Request(transition=Transition(**asked))
    answer = subject._service_change_state.callback(request, ChangeState.Response())
    assert not answer.success
    configure = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    assert subject._service_change_state.callback(configure, ChangeState.Response()).success
    again = subject._service_change_state.callback(configure, ChangeState.Response())
    assert not again.success
    assert subject._state_health().message == "inactive"


def test_shutdown_deactivates_an_active_node_first(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    stops: list[int] = []
    monkeypatch.setattr(subject, "deactivate", lambda: stops.append(1))
    subject.trigger_configure()
    subject.trigger_activate()
    subject.trigger_shutdown()
    assert stops == [1]
    assert subject._state_health().message == "finalized"


def test_the_end_deactivates_an_active_node_once(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    stops: list[int] = []
    monkeypatch.setattr(subject, "deactivate", lambda: stops.append(1))
    before = entities(subject)
    subject.on_configure(ANY_STATE)
    subject.on_activate(ANY_STATE)
    subject.end()
    subject.end()
    assert stops == [1]
    assert entities(subject) == before


def test_a_node_brings_itself_up_once_and_only_when_asked(subject: Subject) -> None:
    subject.bring_up()
    assert subject._state_health().message == "unconfigured"
    subject.brings_itself_up = True
    subject.bring_up()
    assert subject._state_health().message == "active"
    subject.trigger_deactivate()
    subject.bring_up()
    assert subject._state_health().message == "inactive", "what somebody has deactivated stays so"


def test_a_node_that_brings_itself_up_waits_for_simulated_time(
    subject: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject.brings_itself_up = True
    monkeypatch.setattr(subject, "knows_time", lambda: False)
    subject.bring_up()
    subject.bring_up()
    assert subject._state_health().message == "inactive"
    monkeypatch.setattr(subject, "knows_time", lambda: True)
    subject.bring_up()
    assert subject._state_health().message == "active"


def test_a_refused_configuration_is_not_tried_again(subject: Subject) -> None:
    subject.brings_itself_up = True
    subject.refusal = ValueError("gain=9 must be <= 5")
    subject.bring_up()
    subject.refusal = None
    subject.bring_up()
    assert subject._state_health().message == "gain=9 must be <= 5"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--nonsense"], r"argument '--nonsense' is not known; usage: NAME --ros-args"),
        (["--ros-args", "--nonsense"], r"\['--nonsense'\]"),
        (["--ros-args", "-p"], r".* trailing -p flag\. .*"),
        (
            ["--ros-args", "--params-file", "nowhere.yaml"],
            r".*'--params-file nowhere.yaml'. Error: Error opening YAML file",
        ),
        (["--ros-args", "-r", "__ns:=gs1"], r".*'-r __ns:=gs1'.*"),
    ],
)
def test_wrong_arguments_of_a_node_are_named_in_one_line_and_it_is_not_started(
    arguments: list[str],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["managed_subject", *arguments])
    with pytest.raises(SystemExit) as left:
        run(Subject)
    assert left.value.code == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("rf_pointing: ")]
    assert len(lines) == 1
    assert re.match(rf"rf_pointing: not started: {words}", lines[0]), lines
    assert ".c:" not in lines[0]


def test_help_of_a_node_says_what_it_does_and_starts_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["managed_subject", "--help"])
    with pytest.raises(SystemExit) as left:
        run(Subject)
    assert left.value.code == 0
    said = capsys.readouterr().out
    assert said.startswith(__doc__)
    assert "--params-file FILE" in said


class Failing(Subject):
    """A node whose periodic work fails at its third instant, and which notes how it ends."""

    order: ClassVar[list[str]] = []

    def activate(self) -> None:
        self.every(0.02, self._work)

    def _work(self, t_s: float) -> None:
        self.ticks.append(t_s)
        if len(self.ticks) == 3:
            raise KeyError("gone")

    def fail(self, reason: str) -> None:
        self.order.append(f"fail {reason}")

    def deactivate(self) -> None:
        self.order.append("deactivate")


def test_a_node_whose_periodic_work_raises_stops_what_moves_and_ends(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["failing", "--ros-args", "-p", "lifecycle.autostart:=true"])
    with pytest.raises(SystemExit) as left:
        run(Failing)
    assert left.value.code == 1
    assert Failing.order == ["fail KeyError: 'gone'", "deactivate"]
    assert "the node ends after a controlled stop, please report it: KeyError: 'gone'" in capfd.readouterr().err


def test_an_error_between_two_callbacks_is_survived(subject: Subject) -> None:
    """rclpy itself raises for a time before 1970 on /clock, and for bytes that are no request of a service."""
    signals: list[int] = []

    class Executor:
        calls = 0

        def spin_once(self, **_options: float) -> None:
            self.calls += 1
            if self.calls == 5:
                signals.append(15)
            raise ValueError("Nanoseconds value must not be negative")

    executor = Executor()
    assert _work(subject, executor, signals) == ""
    assert executor.calls == 5
    assert subject.inputs.errors == 5
    assert subject.inputs.last_error == "a callback: ValueError: Nanoseconds value must not be negative"


START_S = 1_151_384_000.0


def test_every_instant_comes_once_and_in_order_however_late_the_timer_fires(random: np.random.Generator) -> None:
    schedule, now_s, done = Schedule(START_S, 0.02), START_S, []
    for delay_s in random.uniform(0.0, 0.4, 400):
        now_s += delay_s
        done += schedule.due(now_s)
        assert schedule.jumped_s == 0.0
    assert done == [round(START_S + 0.02 * k, 6) for k in range(1, len(done) + 1)]
    assert now_s - 0.02 - 1e-6 < done[-1] <= now_s + 1e-3


def test_the_grid_does_not_drift() -> None:
    schedule = Schedule(START_S, 0.1)
    times = [t for k in range(1, 100_001) for t in schedule.due(START_S + 0.1 * k)]
    assert len(times) == 100_000
    assert times[-1] == START_S + 10_000.0


def test_a_timer_that_fires_twice_at_one_time_does_nothing_the_second_time() -> None:
    schedule = Schedule(START_S, 0.1)
    assert schedule.due(START_S + 0.1) == [START_S + 0.1]
    assert schedule.due(START_S + 0.1) == []


def test_nothing_is_due_before_the_first_period_is_over() -> None:
    assert Schedule(START_S, 0.1).due(START_S + 0.09) == []


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0, 0.9, -0.9])
def test_a_clock_that_jumps_starts_a_new_grid_and_says_so(jump_s: float) -> None:
    schedule = Schedule(START_S, 0.02)
    schedule.due(START_S + 0.02)
    assert schedule.due(START_S + 0.04 + jump_s) == [round(START_S + 0.04 + jump_s, 6)]
    assert schedule.jumped_s == pytest.approx(jump_s, abs=1e-6)
    assert schedule.due(START_S + 0.06 + jump_s) == [round(START_S + 0.06 + jump_s, 6)]
    assert schedule.jumped_s == 0.0


def test_a_process_that_stood_still_is_no_jump_of_the_clock() -> None:
    schedule = Schedule(START_S, 0.02)
    schedule.due(START_S + 0.02, 100.0)
    assert schedule.due(START_S + 1.33, 101.31) == [round(START_S + 1.32, 6)], "what is past is not made up for"
    assert (schedule.jumped_s, schedule.stalled_s) == (0.0, pytest.approx(1.31))
    assert schedule.due(START_S + 1.36, 101.33) != []
    assert schedule.stalled_s == 0.0
    # A clock that is set while the process stands still has jumped by the rest.
    schedule.due(START_S + 9.36, 104.33)
    assert schedule.jumped_s == pytest.approx(5.0, abs=0.03)


def test_a_long_period_is_not_taken_for_a_jump() -> None:
    schedule = Schedule(START_S, 5.0)
    assert schedule.due(START_S + 9.9) == [START_S + 5.0]
    assert schedule.jumped_s == 0.0


@pytest.mark.parametrize(
    ("period_s", "late_s", "jumps"), [(0.02, 0.5, False), (0.02, 0.52, True), (5.0, 10.0, False), (5.0, 10.1, True)]
)
def test_a_gap_of_half_a_second_or_two_periods_is_made_up_and_a_longer_one_is_a_jump(
    period_s: float, late_s: float, jumps: bool
) -> None:
    schedule = Schedule(0.0, period_s)
    due = schedule.due(period_s + late_s)
    assert (schedule.jumped_s != 0.0) == jumps
    assert len(due) == (1 if jumps else round(late_s / period_s) + 1)
    assert schedule.stalled_s == 0.0


@pytest.mark.parametrize(
    ("start_s", "first_s"), [(0.0, 0.02), (0.019997, 0.02), (0.0199976, 0.02), (0.0199985, 0.04), (0.02, 0.04)]
)
def test_a_start_a_ten_thousandth_of_a_period_before_an_instant_is_that_instant(start_s: float, first_s: float) -> None:
    assert Schedule(start_s, 0.02).due(0.05)[0] == first_s


@pytest.mark.parametrize(("early_s", "due"), [(0.00009, True), (0.00012, False)])
def test_an_instant_is_due_a_thousandth_of_a_period_early(early_s: float, due: bool) -> None:
    assert Schedule(0.0, 0.1).due(0.1 - early_s) == ([0.1] if due else [])


def test_instants_are_whole_microseconds() -> None:
    assert Schedule(0.0, 1.0 / 3.0).due(0.7) == [0.333333, 0.666667]


@pytest.mark.parametrize(("clock_s", "steady_s", "jumped_s"), [(2.0, 1.5, 0.0), (2.0, 2.4, 0.0), (2.0, 1.45, 0.53)])
def test_a_stall_differs_from_a_jump_within_half_a_second(clock_s: float, steady_s: float, jumped_s: float) -> None:
    schedule = Schedule(0.0, 0.02)
    schedule.due(0.0, 0.0)
    schedule.due(clock_s, steady_s)
    assert schedule.jumped_s == pytest.approx(jumped_s, abs=1e-9)
    assert schedule.stalled_s == (0.0 if jumped_s else steady_s)


def test_periodic_work_goes_on_a_grid_of_node_time_and_its_stall_shows(
    subject: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [1000.0, 50.0]
    monkeypatch.setattr(subject, "now_s", lambda: now[0])
    monkeypatch.setattr(managed.time, "monotonic", lambda: now[1])
    subject.on_configure(ANY_STATE)
    timers = len(list(subject.timers))
    done: list[float] = []
    schedule = subject.every(0.1, done.append)
    timer = list(subject.timers)[-1]
    assert len(list(subject.timers)) == timers + 1
    assert timer.timer_period_ns == 100_000_000
    for step_s, steady_s in ((0.1, 0.1), (0.2, 0.2), (2.0, 2.0)):
        now[0], now[1] = now[0] + step_s, now[1] + steady_s
        timer.callback()
    assert done == [1000.1, 1000.2, 1000.3, 1002.3]
    assert (schedule.jumped_s, schedule.stalled_s) == (0.0, pytest.approx(2.0))
    now[0] += 2.0
    timer.callback()
    assert schedule.jumped_s == pytest.approx(1.9, abs=1e-6), "the steady clock did not go on"
    subject._clear()
    assert len(list(subject.timers)) == timers
    subject.on_cleanup(ANY_STATE)


def test_work_that_raises_is_the_failure_of_the_node(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [1000.0]
    monkeypatch.setattr(subject, "now_s", lambda: now[0])
    subject.every(0.1, lambda _t_s: 1 / 0)
    now[0] = 1000.1
    with pytest.raises(ZeroDivisionError):
        list(subject.timers)[-1].callback()
    assert isinstance(subject.failure, ZeroDivisionError)
    subject._clear()


def simulated(subject: Subject) -> None:
    (done,) = subject.set_parameters([Parameter("use_sim_time", value=True)])
    assert done.successful


def test_a_clock_of_the_wall_is_known_and_a_simulated_one_after_its_first_message(subject: Subject) -> None:
    assert subject.knows_time()
    assert subject.ready()
    simulated(subject)
    assert not subject.knows_time()
    assert not subject.ready()
    subject.get_clock().set_ros_time_override(ClockTime(seconds=5, clock_type=ClockType.ROS_TIME))
    assert subject.knows_time()
    assert subject.now_s() == 5.0


def test_activation_waits_for_simulated_time_and_says_so(subject: Subject) -> None:
    simulated(subject)
    subject.on_configure(ANY_STATE)
    assert subject.on_activate(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert subject._state_health().message.startswith("use_sim_time is set, but no time has been received")
    assert subject._state_health().level == ERROR
    subject.on_cleanup(ANY_STATE)


def test_simulated_time_has_no_stall(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    simulated(subject)
    now = [1000.0, 50.0]
    monkeypatch.setattr(subject, "now_s", lambda: now[0])
    monkeypatch.setattr(managed.time, "monotonic", lambda: now[1])
    schedule = subject.every(0.1, lambda _t_s: None)
    timer = list(subject.timers)[-1]
    timer.callback()
    now[0], now[1] = 1003.0, 53.0
    timer.callback()
    assert (schedule.stalled_s, schedule.jumped_s) == (0.0, pytest.approx(2.9))
    subject._clear()


def test_states_and_what_is_allowed_in_them_follow_the_transitions(subject: Subject) -> None:
    seen = []
    for step in (subject.on_configure, subject.on_activate, subject.on_deactivate, subject.on_cleanup):
        assert step(ANY_STATE) == TransitionCallbackReturn.SUCCESS
        health = subject._state_health()
        assert (health.level, health.message) == (OK, health.values["state"])
        seen.append((health.message, subject.active, subject.parameters.configured))
    assert seen == [
        ("inactive", False, True),
        ("active", True, True),
        ("inactive", False, True),
        ("unconfigured", False, False),
    ]
    assert subject.made == 1


def test_a_deactivated_node_has_no_timer_and_is_stopped_before(
    subject: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject.on_configure(ANY_STATE)
    idle = len(list(subject.timers))
    subject.on_activate(ANY_STATE)
    assert len(list(subject.timers)) == idle + 1
    running: list[int] = []
    monkeypatch.setattr(subject, "deactivate", lambda: running.append(len(list(subject.timers))))
    subject.on_deactivate(ANY_STATE)
    assert running == [idle + 1]
    assert len(list(subject.timers)) == idle
    subject.on_cleanup(ANY_STATE)


def test_a_reason_is_forgotten_with_the_next_success(subject: Subject) -> None:
    subject.refusal = ValueError("no pass")
    subject.on_configure(ANY_STATE)
    assert (subject._state_health().level, subject._state_health().values) == (ERROR, {"state": "unconfigured"})
    subject.refusal = None
    subject.on_configure(ANY_STATE)
    subject.refusal = ValueError("no target")
    subject.on_activate(ANY_STATE)
    assert subject._state_health().message == "no target"
    subject.refusal = None
    subject.on_activate(ANY_STATE)
    assert (subject._state_health().level, subject._state_health().message) == (OK, "active")
    subject.end()


def test_an_unknown_parameter_is_refused_with_the_nearest_name(subject: Subject) -> None:
    known, unknown = Parameter("lifecycle.autostart", value=False), Parameter("lifecycle.autostrat", value=True)
    done = subject.set_parameters_atomically([known, unknown])
    assert not done.successful
    assert "lifecycle.autostrat" in done.reason
    assert "lifecycle.autostart" in done.reason
    assert subject.set_parameters_atomically([known]).successful


def test_a_topic_that_is_watched_is_counted_before_its_door(subject: Subject) -> None:
    got: list[Any] = []
    subject.listen(PointingError, "managed_subject/steady", got.append, STREAM, steady=True)
    subject.listen(PointingError, "managed_subject/free", got.append, STREAM)
    assert set(subject.hearing._inputs) == {"managed_subject/steady"}
    doors = {each.topic_name: each.callback for each in subject.subscriptions}
    doors["/managed_subject/steady"](serialize_message(PointingError(sensor="x")))
    doors["/managed_subject/steady"](b"nothing")
    doors["/managed_subject/free"](serialize_message(PointingError(sensor="y")))
    assert subject.hearing._inputs["managed_subject/steady"].count == 2
    assert [each.sensor for each in got] == ["x", "y"]
    subject._clear()


def test_lost_messages_of_a_numbered_stream_are_counted_but_for_raw_ones(subject: Subject) -> None:
    got: list[Any] = []
    subject.listen(PointingError, "managed_subject/numbered", got.append, STREAM)
    subject.listen(PointingError, "managed_subject/raw", got.append, STREAM, raw=True)
    doors = {each.topic_name.rpartition("/")[2]: each.callback for each in subject.subscriptions}
    payloads = [serialize_message(PointingError(sensor="x", sequence=number)) for number in (1, 5)]
    for payload in payloads:
        doors["numbered"](payload)
        doors["raw"](payload)
    assert subject.inputs.lost == {"managed_subject/numbered": 3}
    assert got[1] == payloads[0], "undecoded"
    subject._clear()


@pytest.mark.parametrize(("qos", "most"), [(STREAM, 262_144), (LATCHED, 16_777_216)])
def test_the_longest_message_is_that_of_a_stream_or_of_a_latched_list(subject: Subject, qos: Any, most: int) -> None:
    got: list[int] = []
    subject.listen(PointingError, "managed_subject/long", lambda raw: got.append(len(raw)), qos, raw=True)
    (door,) = [each.callback for each in subject.subscriptions if each.topic_name.endswith("long")]
    door(bytes(most))
    door(bytes(most + 1))
    assert got == [most]
    assert subject.inputs.last_refusal.endswith(f"a message of {most + 1} bytes, must be <= {most}")
    subject._clear()


@pytest.mark.parametrize(
    ("act", "success", "message"),
    [
        (lambda _request: "done", True, "done"),
        (lambda _request: Path("/nowhere/file").read_text(), False, "No such file or directory: '/nowhere/file'"),
        (lambda _request: int("x"), False, "invalid literal for int() with base 10: 'x'"),
        (lambda _request: 1 / 0, False, "ZeroDivisionError: division by zero"),
    ],
)
def test_an_action_answers_with_its_message_or_its_error(
    subject: Subject, act: Any, success: bool, message: str
) -> None:
    subject.serve_action(Trigger, "~/act", act)
    (service,) = [each for each in subject.services if each.service_name.endswith("/act")]
    answer = service.callback(Trigger.Request(), Trigger.Response())
    assert answer.success is success
    assert answer.message.endswith(message)
    subject._clear()
    assert not [each for each in subject.services if each.service_name.endswith("/act")]


def test_a_service_without_success_survives_too(subject: Subject) -> None:
    subject.serve(GetState, "~/state", lambda _request, _response: 1 / 0)
    (service,) = [each for each in subject.services if each.service_name == "/managed_subject/state"]
    response = GetState.Response()
    assert service.callback(GetState.Request(), response) is response
    assert subject.inputs.errors == 1
    subject._clear()


def test_what_repeats_is_logged_once_with_its_severity(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[tuple[str, str]] = []
    logger = SimpleNamespace(
        error=lambda words: lines.append(("error", words)), warning=lambda words: lines.append(("warning", words))
    )
    monkeypatch.setattr(subject, "get_logger", lambda: logger)
    for number in range(3):
        subject.log_once("input", f"{number} bytes are none")
        subject.log_once("disk", "is full", error=True)
    assert lines == [("warning", "input: 0 bytes are none"), ("error", "disk: is full")]
    subject.survived("a callback", KeyError("x"))
    assert lines[2:] == [("error", "a callback: KeyError: 'x'; please report it")]
    assert (subject.inputs.errors, subject.inputs.last_error) == (1, "a callback: KeyError: 'x'")


def test_a_priority_that_is_not_permitted_is_a_warning_and_the_node_starts(
    default_context: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, warned = [], []
    monkeypatch.setattr(managed, "take_priority", lambda number: asked.append(number) or "not permitted")
    monkeypatch.setattr(Subject, "get_logger", lambda _node: SimpleNamespace(warning=warned.append))
    node = Subject()
    assert (asked, warned) == ([0], ["not permitted"])
    assert node.brings_itself_up is False
    assert node.turn() == 0.2
    node.lock.release()
    node.destroy_node()


@pytest.mark.parametrize(
    ("cancel", "success", "end"), [(True, True, "canceled"), (False, True, "succeed"), (False, False, "abort")]
)
def test_a_goal_ends_as_canceled_or_by_the_success_of_its_result(cancel: bool, success: bool, end: str) -> None:
    ends: list[str] = []
    goal = SimpleNamespace(
        is_cancel_requested=cancel,
        **{word: (lambda word=word: ends.append(word)) for word in ("canceled", "succeed", "abort")},
    )
    result = SimpleNamespace(success=success)
    assert managed.conclude(goal, result) is result
    assert ends == [end]


def test_a_failed_transition_of_rclpy_is_answered(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    failures: list[str] = []
    monkeypatch.setattr(subject, "get_logger", lambda: SimpleNamespace(error=failures.append))
    request = ChangeState.Request(transition=Transition(id=4))
    assert not subject._service_change_state.callback(request, ChangeState.Response()).success
    assert failures == ["transition 4 refused: the node is unconfigured"]


def test_what_is_published_has_the_frame_of_its_topic_until_cleanup(subject: Subject) -> None:
    before = entities(subject)
    framed, plain = subject.publisher(Target, "target", STREAM), subject.publisher(Target, "elsewhere", STREAM)
    message = Target()
    plain.publish(message)
    assert message.header.frame_id == ""
    framed.publish(message)
    assert message.header.frame_id == "base_link"
    subject._clear()
    assert entities(subject) == before
