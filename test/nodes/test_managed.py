"""What every node shares: counted inputs, numbered outputs, refusals that do not end the process."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import PointingError, Target
from sensor_msgs.msg import JointState

from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import OK, WARN
from rf_pointing.nodes.managed import InputCounter, Latest, ManagedNode, SequencedPublisher
from rf_pointing.nodes.qos import STREAM

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


def message(sequence: int, sensor: str = "") -> Any:
    return SimpleNamespace(sequence=sequence, sensor=sensor)


def test_gaps_in_the_numbers_are_counted_as_losses() -> None:
    counter, taken = InputCounter(), []
    take = counter.watching("target", taken.append)
    for sequence in (7, 8, 10, 14, 15):
        take(message(sequence))
    assert counter.lost == {"target": 4}
    assert len(taken) == 5
    health = counter.health()
    assert (health.level, health.message, health.values["lost target"]) == (WARN, "4 messages lost", 4)


def test_a_publisher_that_starts_again_is_no_loss() -> None:
    counter = InputCounter()
    take = counter.watching("target", lambda _: None)
    for sequence in (100, 101, 1, 2, 3):
        take(message(sequence))
    assert counter.lost == {"target": 0}
    assert counter.health().level == OK


def test_two_sensors_on_one_topic_are_counted_apart() -> None:
    counter = InputCounter()
    take = counter.watching("pointing_error", lambda _: None)
    for k in range(1, 20):
        take(message(k, "monopulse"))
        if k % 4 == 0:
            take(message(k // 4, "conscan"))
    assert counter.lost == {"pointing_error": 0}


def test_messages_are_numbered_from_one() -> None:
    sent: list[int] = []
    publisher = SequencedPublisher(SimpleNamespace(publish=lambda m: sent.append(m.sequence)))
    for _ in range(3):
        publisher.publish(Target())
    assert sent == [1, 2, 3]


def joints(position: float) -> bytes:
    return bytes(
        serialize_message(JointState(name=["azimuth", "elevation"], position=[position, 0.5], velocity=[0.0, 0.0]))
    )


@pytest.mark.usefixtures("ros_domain")
def test_only_the_newest_of_a_fast_stream_is_decoded_and_only_once() -> None:
    latest = Latest(JointState, convert.joints_from_message)
    assert latest.take() is None
    for position in (1.0, 2.0, 3.0):
        latest.note(joints(position))
    assert latest.take().position_rad[0] == 3.0
    assert latest.take() is None


@pytest.mark.usefixtures("ros_domain")
def test_a_newest_message_that_cannot_be_used_is_dropped() -> None:
    latest = Latest(JointState, convert.joints_from_message)
    latest.note(joints(math.nan))
    with pytest.raises(ValueError, match="must be finite"):
        latest.take()
    assert latest.take() is None


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


@pytest.mark.parametrize(
    "refusal", [ValueError("gain=9 must be <= 5"), FileNotFoundError(2, "No such file", "model.yaml")]
)
def test_a_refused_configuration_leaves_nothing_behind_and_says_why(subject: Subject, refusal: Exception) -> None:
    before = subject.count_publishers("managed_subject/target")
    subject.refusal = refusal
    assert subject.on_configure(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert subject._state_health().message == str(refusal)
    assert (subject._inputs, subject._outputs) == ([], [])
    assert subject.count_publishers("managed_subject/target") == before
    subject.refusal = None
    assert subject.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert subject._state_health().message == "inactive"
    subject.on_cleanup(ANY_STATE)


def test_a_refused_activation_leaves_no_timer_running(subject: Subject) -> None:
    subject.on_configure(ANY_STATE)
    subject.refusal = ValueError("no pass")
    assert subject.on_activate(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert subject._active_timers == []
    assert subject._state_health().message == "no pass"
    subject.on_cleanup(ANY_STATE)


def test_a_message_that_is_refused_is_counted_and_the_node_lives_on(subject: Subject) -> None:
    take = subject._guarded("pointing_error", subject._take)
    take(PointingError(sensor="monopulse", cross_elevation=math.nan))
    take(PointingError(sensor="monopulse", cross_elevation=0.001))
    health = subject.inputs.health()
    assert (health.level, health.message) == (WARN, "1 messages refused")
    assert health.values["refused pointing_error"] == 1
    assert health.values["last_refusal"] == "pointing_error: cross_elevation_rad=nan must be finite"


def test_another_exception_is_not_hidden(subject: Subject) -> None:
    with pytest.raises(AttributeError):
        subject._guarded("pointing_error", lambda m: m.nothing)(PointingError())


def test_a_second_node_of_the_name_is_refused(subject: Subject) -> None:
    assert subject.lock is not None
    with pytest.raises(RuntimeError, match="/managed_subject already runs in ROS domain"):
        Subject()


def test_the_end_deactivates_an_active_node_once(subject: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    stops: list[int] = []
    monkeypatch.setattr(subject, "deactivate", lambda: stops.append(1))
    subject.on_configure(ANY_STATE)
    subject.on_activate(ANY_STATE)
    subject.end()
    subject.end()
    assert stops == [1]
    assert subject._active_timers == []
