"""Numbers on what is sent, counts of what was lost, the newest message only of a fast stream, impossible numbers."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import Alarm, ExecutiveStatus, PassProfile, PassProfileList, PointingError, Target
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.streams import (
    KEPT,
    LARGEST,
    UNSERVED_S,
    InputCounter,
    LatchedPublisher,
    Latest,
    SequencedPublisher,
    require_plausible,
)

IMPOSSIBLE = [math.nan, math.inf, -math.inf, 1.1 * LARGEST, -1.1 * LARGEST]


@given(sent=st.lists(st.tuples(st.sampled_from("ab"), st.booleans()), max_size=60))
def test_what_does_not_arrive_between_two_messages_of_a_sensor_is_lost(sent: list[tuple[str, bool]]) -> None:
    counter, published = InputCounter(), list[Any]()
    take = counter.watching("pointing_error", str)
    publisher = SequencedPublisher(SimpleNamespace(publish=published.append))
    lost = 0
    for sensor in "ab":
        arrivals = [arrives for each, arrives in sent if each == sensor]
        first, last = (arrivals.index(True), len(arrivals) - arrivals[::-1].index(True)) if any(arrivals) else (0, 0)
        lost += arrivals[first:last].count(False)
    for sensor, arrives in sent:
        publisher.publish(PointingError(sensor=sensor))
        if arrives:
            take(published[-1])
    assert counter.lost == {"pointing_error": lost}
    # A publisher that starts again is no loss, and the count goes on behind it.
    for sequence in (1000, 1, 2, 4):
        take(PointingError(sensor="c", sequence=sequence))
    assert counter.lost == {"pointing_error": lost + 1}


@given(
    served=st.lists(st.tuples(st.integers(1, 60), st.booleans()), min_size=1, max_size=30), readers=st.integers(0, 2)
)
def test_a_writer_is_renewed_after_its_patience_and_the_last_message_goes_on(
    served: list[tuple[int, bool]], readers: int
) -> None:
    """The reader takes nothing, or is not even matched, for the given times."""
    state, sent, open_ = SimpleNamespace(served=True), list[tuple[int, str]](), set[int]()

    def make() -> Any:
        number = state.made = getattr(state, "made", 0) + 1
        open_.add(number)
        return SimpleNamespace(
            number=number, publish=lambda message: sent.append((number, message)),
            get_subscription_count=lambda: readers if state.served or readers < 2 else readers - 1,
            wait_for_all_acked=lambda _without_waiting: state.served or readers == 2,
        )  # fmt: skip

    publisher = LatchedPublisher(make, lambda each: open_.remove(each.number), lambda: readers)
    publisher.publish("old")
    publisher.publish("new")
    now_s, renewals, patience_s, since_s = 100.0, 0, UNSERVED_S, 100.0
    publisher.look(now_s)
    for seconds, state.served in served:
        for _ in range(seconds):
            now_s += 1.0
            publisher.look(now_s)
            if state.served:
                patience_s, since_s = UNSERVED_S, now_s
            elif now_s - since_s > patience_s:
                renewals, patience_s, since_s = renewals + 1, 2.0 * patience_s, now_s
    assert publisher.renewed == renewals
    assert sent == [(1, "old"), *((number, "new") for number in range(1, renewals + 2))]
    assert open_ == {renewals + 1}


def test_the_health_counts_losses_refusals_and_errors() -> None:
    counter = InputCounter()
    take = counter.watching("target", str)
    assert (counter.health().level, counter.health().message) == (OK, "complete")
    for sequence in (7, 8, 10, 14, 3):
        take(Target(sequence=sequence))
    for topic, reason in (("target", "late"), ("target", "later"), ("passes", "long")):
        counter.note_refusal(topic, reason)
    counter.note_error("turn", KeyError("x"))
    health = counter.health()
    assert (health.level, health.message) == (WARN, "4 messages lost, 3 messages refused, 1 errors survived")
    assert health.values == {
        "lost target": 4, "refused target": 2, "refused passes": 1, "last_refusal": "passes: long", "errors": 1,
        "last_error": "turn: KeyError: 'x'",
    }  # fmt: skip


def joints(position: float, t_s: float) -> bytes:
    message = JointState(name=["azimuth", "elevation"], position=[position, 0.5], velocity=[0.0, 0.0])
    message.header.stamp = stamp_from_seconds(t_s)
    return bytes(serialize_message(message))


@pytest.mark.usefixtures("ros_domain")
@given(
    steps=st.lists(
        st.one_of(st.tuples(st.integers(0, 50), st.booleans()), st.floats(0.0, 1.2)), max_size=40,
    )
)  # fmt: skip
@settings(deadline=None)
def test_the_newest_message_up_to_a_time_is_taken_once_and_later_ones_wait(steps: list[Any]) -> None:
    """Messages of any stamps, some of which cannot be used, and looks at any time, beside a list of them."""
    reasons: list[str] = []
    latest, waiting = Latest(JointState, convert.joints_from_message, reasons.append), list[tuple[float, float]]()
    for number, step in enumerate(steps):
        if isinstance(step, tuple):
            t_s, position = 100.0 + 0.02 * step[0], float(number) if step[1] else math.nan
            latest.note(joints(position, t_s))
            waiting.append((t_s, position))
            continue
        until_s = 100.0 + step
        usable = [position for t_s, position in waiting if t_s <= until_s + 1e-6 and math.isfinite(position)]
        found = latest.take(until_s)
        assert (found.position_rad[0] if found else None) == (usable[-1] if usable else None)
        waiting = [each for each in waiting if each[0] > until_s + 1e-6]
    assert set(reasons) <= {"position must be finite and at most 1e+18"}


@pytest.mark.usefixtures("ros_domain")
def test_the_newest_100_messages_wait_and_bytes_without_a_stamp_do_not() -> None:
    latest = Latest(JointState, convert.joints_from_message, str)
    for k in range(KEPT + 5):
        latest.note(joints(float(k), 100.0 + k))
    assert latest.take(104.5) is None
    assert latest.take(105.0).position_rad[0] == 5.0
    with pytest.raises(ValueError, match="no stamp"):
        latest.note(b"short")
    reasons: list[str] = []
    broken = Latest(JointState, convert.joints_from_message, reasons.append)
    broken.note(joints(4.0, 100.0)[:40])
    assert (broken.take(), reasons) == (None, ["40 bytes are no JointState"])


def numbers(message: Any, place: str = "") -> dict[str, tuple[Any, str, int | None]]:
    """Return every number of floating point of a message by its place in words."""
    found: dict[str, tuple[Any, str, int | None]] = {}
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        if hasattr(value, "get_fields_and_field_types"):
            found |= numbers(value, f"{place}{field}.")
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for index, each in enumerate(value):
                found |= numbers(each, f"{place}{field}[{index}].")
        elif isinstance(value, float):
            found[f"{place}{field}"] = message, field, None
        elif kind.startswith(("double", "float", "sequence<double", "sequence<float")):
            found |= {f"{place}{field}": (message, field, index) for index in range(len(value))}
    return found


@given(count=st.integers(1, 36), data=st.data())
@settings(deadline=None)
def test_an_impossible_number_is_refused_wherever_it_is_and_others_are_taken(count: int, data: Any) -> None:
    values = np.linspace(-LARGEST, LARGEST, count).tolist()
    point = JointTrajectoryPoint(positions=values, velocities=values, effort=values)
    message = data.draw(st.sampled_from([
        Target(azimuth=LARGEST), PointingError(), PassProfileList(profiles=[PassProfile(), PassProfile(time=values)]),
        JointTrajectory(points=[point] * 2), JointState(position=values), ExecutiveStatus(alarms=[Alarm(name="disk")]),
    ]))  # fmt: skip
    require_plausible(message)
    places = numbers(message)
    if not places:
        return
    place = data.draw(st.sampled_from(sorted(places)))
    holder, field, index = places[place]
    value = data.draw(st.sampled_from(IMPOSSIBLE))
    if index is None:
        setattr(holder, field, value)
    else:
        getattr(holder, field)[data.draw(st.integers(0, len(getattr(holder, field)) - 1))] = value
    if field == "carrier_to_noise" and value == -math.inf:
        require_plausible(message)
        return
    with pytest.raises(ValueError, match="must be finite and at most 1e") as refused:
        require_plausible(message)
    # Two points of a trajectory may be one object: the first is named.
    assert str(refused.value).split(" must")[0].replace("[0]", "[1]") == place.replace("[0]", "[1]")


def test_a_stamp_before_1970_is_refused_wherever_it_is() -> None:
    alarm, target = Alarm(name="disk"), Target()
    alarm.raised.sec, target.header.stamp.sec = -2, -1
    with pytest.raises(ValueError, match="-1 s"):
        require_plausible(target)
    with pytest.raises(ValueError, match="-2 s"):
        require_plausible(ExecutiveStatus(alarms=[Alarm(), alarm]))
