"""What a node takes and offers: nothing that arrives ends it, and every refusal is counted with its reason."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import PointingError, Target
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rf_pointing.ros import convert, managed
from rf_pointing.ros.managed import ManagedNode, conclude
from rf_pointing.ros.qos import STREAM

WARN = b"\x01"


class Subject(ManagedNode):
    """A node with one input, without parameters of its own."""

    def __init__(self) -> None:
        super().__init__("managed_subject")
        self.taken: list[Any] = []
        self.reasons: list[str] = []

    def configure(self) -> None:
        self.listen(PointingError, "error", self._take, STREAM, most_bytes=lambda: 1000, refused=self.reasons.append)

    def _take(self, message: PointingError) -> None:
        self.taken.append(convert.error_from_message(message))


@pytest.fixture
def bench(make_bench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Yield a configured node."""
    monkeypatch.setattr(managed, "STEADY", ("error",))
    made = make_bench(Subject)
    assert made.step("configure")
    return made


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"12345678", "8 bytes are no PointingError"),
        (b"", "0 bytes are no PointingError"),
        (bytes(1001), "a message of 1001 bytes, must be <= 1000"),
        (PointingError(cross_elevation=1e300), "cross_elevation must be finite and at most 1e+18"),
        (PointingError(cross_elevation=math.nan), "cross_elevation must be finite and at most 1e+18"),
        (PointingError(header=Header(stamp=Time(sec=-1))), "stamp of -1 s and 0 ns is not a time"),
        (PointingError(header=Header(stamp=Time(nanosec=1_000_000_000))), "stamp of 0 s and 1000000000 ns is not a time"),
    ],
)  # fmt: skip
def test_an_impossible_message_is_refused_at_the_door_and_counted(bench: Any, payload: Any, reason: str) -> None:
    bench.give("error", payload, PointingError(sensor="monopulse", cross_elevation=0.001))
    health = bench.health("inputs")
    assert (health.level, health.message) == (WARN, "1 messages refused")
    assert (health.values["refused error"], health.values["last_refusal"]) == ("1", f"error: {reason}")
    assert (bench.node.reasons, len(bench.node.taken)) == ([reason], 1)


@given(payload=st.binary(max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_no_bytes_end_a_node(bench: Any, payload: bytes) -> None:
    bench.give("error", payload)
    assert bench.health("inputs").values["errors"] == "0"


def test_another_exception_of_a_callback_is_counted_and_logged_once(bench: Any) -> None:
    bench.node.listen(PointingError, "broken", lambda message: message.nothing, STREAM)
    for _ in range(3):
        bench.give("broken", PointingError(sensor="monopulse"))
    health = bench.health("inputs")
    assert (health.message, health.values["last_error"].startswith("broken: AttributeError: ")) == (
        "3 errors survived", True,
    )  # fmt: skip
    assert [level for level, words in bench.log if words.startswith("broken: AttributeError")] == ["error"]


def test_only_the_newest_of_a_fast_stream_is_decoded_and_its_refusal_counted(bench: Any) -> None:
    latest = bench.node.listen_latest(PointingError, "fast", convert.error_from_message, STREAM)
    for length in range(12):
        bench.give("fast", bytes(length))
    assert bench.health("inputs").values["refused fast"] == "12", "without a stamp"
    bench.give("fast", PointingError(sensor="monopulse"), bytes([0, 1, 0, 0, *[0] * 12]))
    assert latest.take().sensor == "monopulse"
    assert bench.health("inputs").values["last_refusal"] == "fast: 16 bytes are no PointingError"


def test_lost_messages_of_a_numbered_stream_are_counted_and_those_of_bytes_are_not(bench: Any) -> None:
    raw: list[bytes] = []
    bench.node.listen(PointingError, "raw", raw.append, STREAM, raw=True)
    for topic in ("error", "raw"):
        bench.give(topic, *(PointingError(sensor="monopulse", sequence=number) for number in (1, 5)))
    health = bench.health("inputs")
    assert (health.message, health.values["lost error"], "lost raw" in health.values) == ("3 messages lost", "3", False)
    assert raw[0] == serialize_message(PointingError(sensor="monopulse", sequence=1))


def test_a_steady_input_that_falls_silent_makes_the_node_deaf_whatever_its_messages(bench: Any) -> None:
    bench.publishers = {"/diagnostics": ["/other"], "error": ["/other"]}
    status = DiagnosticStatus(name="other: state", message="active", hardware_id="/other")
    active = serialize_message(DiagnosticArray(status=[status]))

    def wait(seconds: int, sent: bytes | None) -> str:
        for _ in range(seconds):
            bench.wait(1.0)
            bench.give("/diagnostics", active)
            if sent is not None:
                bench.give("error", sent)
            bench.health("hearing")
        return str(bench.node.input_watchdog.deaf)

    assert wait(15, b"") == "", "bytes that cannot be used are a sign of life"
    assert "error has been silent for" in wait(15, None)


# Services and actions


@pytest.mark.parametrize(
    ("act", "success", "message"),
    [
        (lambda _request: "done", True, "done"),
        (lambda _request: Path("/nowhere/file").read_text(), False, "No such file or directory: '/nowhere/file'"),
        (lambda _request: int("x"), False, "invalid literal for int() with base 10: 'x'"),
        (lambda _request: 1 / 0, False, "ZeroDivisionError: division by zero"),
    ],
)
def test_a_service_answers_with_its_message_or_its_error(bench: Any, act: Any, success: bool, message: str) -> None:
    bench.node.serve_action(Trigger, "~/act", act)
    answer = bench.call("~/act")
    assert (answer.success, answer.message.endswith(message)) == (success, True)
    bench.step("cleanup")
    assert "/managed_subject/act" not in [each.service_name for each in bench.node.offered]


def test_a_goal_is_accepted_begun_cancelled_and_concluded(bench: Any) -> None:
    seen: list[Any] = []
    bench.node.serve_goals(
        Identify, "identify", accepts=lambda request: request.axis != "roll", begin=seen.append,
        cancel=lambda: seen.append("cancel"), result=lambda: Identify.Result(success=True, message="done"),
    )  # fmt: skip
    assert bench.goal("identify", Identify.Goal(axis="roll")) is None
    goal = bench.goal("identify", Identify.Goal(axis="azimuth"))
    assert seen == [goal]
    assert goal.cancel()
    goal.execute()
    assert (seen[1:], goal.end, goal.result.message) == (["cancel"], "canceled", "done")


@pytest.mark.parametrize(("success", "end"), [(True, "succeeded"), (False, "aborted")])
def test_a_goal_ends_by_the_success_of_its_result(bench: Any, success: bool, end: str) -> None:
    bench.node.serve_goals(
        Identify, "identify", accepts=bool, begin=lambda goal: goal.execute(), cancel=list,
        result=lambda: Identify.Result(success=success),
    )  # fmt: skip
    assert bench.goal("identify", Identify.Goal()).end == end
    ends: list[str] = []
    goal = SimpleNamespace(is_cancel_requested=True, canceled=lambda: ends.append("canceled"))
    conclude(goal, Identify.Result(success=True))
    assert ends == ["canceled"]


def test_what_is_published_has_the_frame_of_its_topic_and_its_number(bench: Any) -> None:
    framed, plain = bench.node.stream(Target, "target", STREAM), bench.node.publisher(Target, "elsewhere", STREAM)
    for _ in range(2):
        framed.publish(Target())
        plain.publish(Target())
    shown = [(each.header.frame_id, each.sequence) for each in bench.sent["target"] + bench.sent["elsewhere"]]
    assert shown == [("base_link", 1), ("base_link", 2), ("", 0), ("", 0)]


def test_a_name_that_is_no_text_leaves_what_was_seen_of_the_graph(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def look(topic: str) -> list[Any]:
        # The bench answers for the graph; this is what a node does with the real one.
        return ManagedNode.get_publishers_info_by_topic(bench.node, topic)

    def damaged(*_where: Any) -> Any:
        raise UnicodeDecodeError("utf-8", b"\xa1", 0, 1, "invalid start byte")

    before = look("/diagnostics")
    with monkeypatch.context() as patch:
        patch.setattr(Node, "get_publishers_info_by_topic", damaged)
        assert before == look("/diagnostics") != look("/unseen") == []
        assert bench.node.damaged_topics == {"/diagnostics", "/unseen"}
    assert look("/diagnostics")
    assert bench.node.damaged_topics == {"/unseen"}
