"""Every registered check becomes one status; a check that fails is an error of its subject."""

from collections.abc import Callable
from typing import Any

from rclpy.clock import ClockType

from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Diagnostics, EventLog, Health


def published(node: Any, **checks: Callable[[], Health]) -> Any:
    """Return the array that is published of some checks."""
    diagnostics, found = Diagnostics(node), list[Any]()
    for name, check in checks.items():
        diagnostics.add(name, check)
    (publisher,) = (each for each in node.publishers if each.topic_name == "/diagnostics")
    publisher.publish = found.append
    diagnostics.publish()
    return found[0]


def test_a_check_gives_a_status_with_name_level_message_and_values(make_node: Callable[..., Any]) -> None:
    node = make_node()
    array = published(node, drive=lambda: Health(WARN, "at its limit", {"axis": "azimuth", "count": 3}))
    (status,) = array.status
    assert (status.name, status.hardware_id) == ("test/subject: drive", "/test/subject")
    assert (status.level, status.message) == (WARN, "at its limit")
    assert [(value.key, value.value) for value in status.values] == [("axis", "azimuth"), ("count", "3")]
    assert abs(array.header.stamp.sec - node.get_clock().now().nanoseconds // 10**9) <= 1
    (timer,) = node.timers
    assert (timer.timer_period_ns, timer.clock.clock_type) == (1_000_000_000, ClockType.STEADY_TIME)


def test_a_check_that_cannot_be_made_is_an_error_and_hides_no_other(make_node: Callable[..., Any]) -> None:
    def broken() -> Health:
        raise ValueError("t_s=3 is outside the elements")

    first, second = published(make_node(), broken=broken, fine=Health).status
    assert (first.level, first.message) == (ERROR, "t_s=3 is outside the elements")
    assert (second.level, second.message) == (OK, "ok")


def test_an_event_is_news_once_whatever_its_numbers_until_a_minute_of_silence() -> None:
    events = EventLog()
    assert events.is_news("input", "3 bytes are none", 0.0)
    assert not events.is_news("input", "17 bytes are none", 0.5)
    assert not events.is_news("input", "1.5e-3 bytes are none", 60.0)
    assert not events.is_news("input", "4 bytes are none", 119.9), "each time counts from the last"
    assert events.is_news("input", "4 bytes are none", 179.9)


def test_a_subject_is_news_once_a_second_and_what_lasts_is_not_lost() -> None:
    events = EventLog()
    assert events.is_news("input", "a", 10.0)
    assert not events.is_news("input", "b", 10.9)
    assert events.is_news("disk", "b", 10.9), "another subject"
    assert events.is_news("input", "b", 11.0)
    assert not events.is_news("input", "a", 11.5)
    assert not events.is_news("input", "c", 11.9), "a repetition is no line, and moves nothing"
    assert events.is_news("input", "c", 12.0)
