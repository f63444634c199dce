"""Numbers on what is sent, counts of what was lost, and the newest message only of a fast stream."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import Alarm, ExecutiveStatus, PassProfile, PassProfileList, PointingError, Target
from sensor_msgs.msg import JointState

from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.streams import (
    KEPT,
    LARGEST,
    FramedPublisher,
    InputCounter,
    Latest,
    SequencedPublisher,
    frame_in,
    require_length,
    require_plausible,
)


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
    for sequence in (100, 101, 101, 1, 2, 3):
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


def test_the_frame_of_an_antenna_is_below_its_namespace() -> None:
    assert (frame_in("/gs1", "base"), frame_in("/", "base")) == ("gs1/base", "base")
    sent: list[Any] = []
    FramedPublisher(SimpleNamespace(publish=sent.append), "gs1/base").publish(Target())
    assert sent[0].header.frame_id == "gs1/base"


def test_a_message_has_at_most_the_bytes_of_its_topic() -> None:
    require_length(bytes(10), 10)
    with pytest.raises(ValueError, match="11 bytes, must be <= 10"):
        require_length(bytes(11), 10)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.1 * LARGEST, -1.1 * LARGEST])
def test_a_number_that_can_be_none_is_refused_with_its_place(value: float) -> None:
    with pytest.raises(ValueError, match="^azimuth must"):
        require_plausible(Target(azimuth=value))
    with pytest.raises(ValueError, match="^covariance must"):
        require_plausible(Target(covariance=[0.0, value]))
    profiles = [PassProfile(), PassProfile(time=[0.0, value])]
    with pytest.raises(ValueError, match=r"^profiles\[1\]\.time must"):
        require_plausible(PassProfileList(profiles=profiles))


def test_what_can_be_a_number_is_taken() -> None:
    require_plausible(Target(azimuth=LARGEST, covariance=[-LARGEST]))
    require_plausible(Target())
    require_plausible(ExecutiveStatus(blocks=["slew"], alarms=[Alarm(name="disk")]))


def test_only_a_carrier_may_be_absent() -> None:
    require_plausible(PointingError(carrier_to_noise=-math.inf))
    for value in (math.inf, math.nan):
        with pytest.raises(ValueError, match="carrier_to_noise must"):
            require_plausible(PointingError(carrier_to_noise=value))


def test_a_stamp_that_can_be_none_is_refused_wherever_it_is() -> None:
    target = Target()
    target.header.stamp.sec = -1
    with pytest.raises(ValueError, match="-1 s"):
        require_plausible(target)
    alarm = Alarm(name="disk")
    alarm.raised.sec = -2
    with pytest.raises(ValueError, match="-2 s"):
        require_plausible(ExecutiveStatus(alarms=[Alarm(), alarm]))


def test_the_health_counts_losses_refusals_and_errors() -> None:
    counter = InputCounter()
    assert (counter.health().level, counter.health().message) == (OK, "complete")
    counter.note_refusal("target", "late")
    counter.note_refusal("target", "later")
    counter.note_refusal("passes", "long")
    counter.note_error("turn", KeyError("x"))
    health = counter.health()
    assert (health.level, health.message) == (WARN, "3 messages refused, 1 errors survived")
    assert (health.values["refused target"], health.values["errors"]) == (2, 1)
    assert health.values["last_refusal"] == "passes: long"
    assert health.values["last_error"] == "turn: KeyError: 'x'"


@pytest.mark.usefixtures("ros_domain")
def test_the_newest_100_messages_wait_and_a_stamp_counts_to_a_microsecond() -> None:
    latest = Latest(JointState, convert.joints_from_message, print)
    for k in range(KEPT + 5):
        latest.note(joints(float(k), 100.0 + k))
    assert latest.take(104.5) is None
    assert latest.take(105.0 - 0.9e-6).position_rad[0] == 5.0
    assert latest.take(106.0 - 1.1e-6) is None
    with pytest.raises(ValueError, match="no stamp"):
        latest.note(b"short")
