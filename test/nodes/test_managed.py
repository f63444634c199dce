"""What every node shares: counted inputs, numbered outputs, refusals that do not end the process.

Periodic work: every instant of the grid once, in order, however the timer fires.
"""

import math
import re
import sys
from typing import Any, ClassVar

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import PointingError, Target
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import WARN
from rf_pointing.nodes.main_loop import _work, run
from rf_pointing.nodes.managed import ManagedNode, Schedule
from rf_pointing.nodes.qos import STREAM

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
