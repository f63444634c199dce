"""Numbers on what is sent, counts of what was lost, and the newest message only of a fast stream."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import PointingError, Target
from sensor_msgs.msg import JointState

from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import OK, WARN
from rf_pointing.nodes.stamps import stamp_from_seconds
from rf_pointing.nodes.streams import InputCounter, Latest, SequencedPublisher


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


def test_a_node_that_speaks_for_two_sensors_numbers_them_apart() -> None:
    sent: list[tuple[str, int]] = []
    publisher = SequencedPublisher(SimpleNamespace(publish=lambda m: sent.append((m.sensor, m.sequence))))
    for sensor in ("conscan", "steptrack", "steptrack", "conscan"):
        publisher.publish(PointingError(sensor=sensor))
    assert sent == [("conscan", 1), ("steptrack", 1), ("steptrack", 2), ("conscan", 2)]


def joints(position: float, t_s: float = 0.0) -> bytes:
    message = JointState(name=["azimuth", "elevation"], position=[position, 0.5], velocity=[0.0, 0.0])
    message.header.stamp = stamp_from_seconds(t_s)
    return bytes(serialize_message(message))


@pytest.mark.usefixtures("ros_domain")
def test_only_the_newest_of_a_fast_stream_is_decoded_and_only_once() -> None:
    latest = Latest(JointState, convert.joints_from_message, print)
    assert latest.take() is None
    for position in (1.0, 2.0, 3.0):
        latest.note(joints(position))
    assert latest.take().position_rad[0] == 3.0
    assert latest.take() is None


@pytest.mark.usefixtures("ros_domain")
def test_what_is_newer_than_asked_for_is_kept_for_later() -> None:
    latest = Latest(JointState, convert.joints_from_message, print)
    for k in range(5):
        latest.note(joints(float(k), 100.0 + 0.02 * k))
    assert latest.take(100.05).position_rad[0] == 2.0
    assert latest.take(100.05) is None
    assert latest.take(100.06).position_rad[0] == 3.0
    assert latest.take().position_rad[0] == 4.0


@pytest.mark.usefixtures("ros_domain")
def test_of_messages_that_cannot_be_used_the_one_before_is_taken_and_the_reason_told() -> None:
    reasons: list[str] = []
    latest = Latest(JointState, convert.joints_from_message, reasons.append)
    latest.note(joints(math.nan))
    assert latest.take() is None
    assert reasons == ["position must be finite and at most 1e+18"]
    for position in (1.0, 2.0, math.nan, math.inf):
        latest.note(joints(position))
    latest.note(joints(4.0)[:40])
    assert latest.take().position_rad[0] == 2.0
    assert len(reasons) == 4
    assert reasons[1] == "40 bytes are no JointState"
    assert latest.take() is None


@pytest.mark.usefixtures("ros_domain")
def test_a_stamp_far_ahead_keeps_no_later_message_from_being_used() -> None:
    latest = Latest(JointState, convert.joints_from_message, print)
    latest.note(joints(9.0, 1e9))
    latest.note(joints(1.0, 100.0))
    assert latest.take(100.0).position_rad[0] == 1.0
    latest.note(joints(2.0, 100.02))
    assert latest.take(100.02).position_rad[0] == 2.0
    assert latest.take(100.04) is None
