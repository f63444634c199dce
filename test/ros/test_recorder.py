"""The recorder writes every topic of an antenna as it came over the wire, latched ones from before its start included."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rf_pointing_msgs.msg import PassList, Target
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock

from rf_pointing.ros.graph import EXECUTIVE, TOPICS
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.recorder import Recorder

DEADLINE_S = 20.0
COUNT = 300


def spin_until(executor: Any, condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s
        executor.spin_once(timeout_sec=0.05)


@pytest.fixture
def executor(ros_context: Any) -> Any:
    """Yield an executor of the private context."""
    made = SingleThreadedExecutor(context=ros_context)
    yield made
    made.shutdown()


def test_a_bag_holds_every_message_of_the_namespace_in_order(
    make_node: Callable[..., Any], executor: Any, tmp_path: Path
) -> None:
    talker, listener = make_node("talker"), make_node("listener")
    passes = talker.create_publisher(PassList, "/gs9/passes", LATCHED)
    passes.publish(PassList(target="bird", sequence=1))
    recorder = Recorder(listener, "/gs9", tmp_path / "bag", notes={"band": "X"})
    heard: Counter[str] = Counter()
    listener.create_subscription(Target, "/gs9/target", lambda _: heard.update(["target"]), QoSProfile(depth=COUNT))
    listener.create_subscription(PassList, "/gs9/passes", lambda _: heard.update(["passes"]), LATCHED)
    targets = talker.create_publisher(Target, "/gs9/target", STREAM)
    others = talker.create_publisher(Target, "/gs8/target", STREAM)
    health = talker.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
    executor.add_node(talker)
    executor.add_node(listener)
    spin_until(executor, lambda: targets.get_subscription_count() > 1 and health.get_subscription_count() > 0)
    others.publish(Target(target="other", sequence=1))
    health.publish(DiagnosticArray())
    for sequence in range(1, COUNT + 1):
        targets.publish(Target(target="bird", sequence=sequence))
        executor.spin_once(timeout_sec=0.0)
    spin_until(executor, lambda: heard == {"target": COUNT, "passes": 1})
    # What else has arrived by now is the recorder's.
    for _ in range(50):
        executor.spin_once(timeout_sec=0.0)
    result = recorder.close()
    assert result.problem == ""
    assert result.counts["/gs9/target"] == COUNT
    assert result.counts["/diagnostics"] == 1
    assert "/gs8/target" not in result.counts
    with Reader(tmp_path / "bag") as reader:
        names = {connection.topic for connection in reader.connections}
        log_times = [t for connection, t, _ in reader.messages() if connection.topic == "/gs9/target"]
    assert names == {topic.name if topic.name.startswith("/") else f"/gs9/{topic.name}" for topic in TOPICS}
    assert log_times == sorted(log_times)


def test_simulated_time_is_the_log_time_from_the_first_message_on(
    make_node: Callable[..., Any], executor: Any, tmp_path: Path
) -> None:
    talker, listener = make_node("talker"), make_node("listener")
    recorder = Recorder(listener, "/gs9", tmp_path / "bag", simulated=True)
    clock = talker.create_publisher(Clock, "/gs9/clock", STREAM)
    targets = talker.create_publisher(Target, "/gs9/target", STREAM)
    heard: Counter[str] = Counter()
    listener.create_subscription(Target, "/gs9/target", lambda _: heard.update(["target"]), STREAM)
    listener.create_subscription(Clock, "/gs9/clock", lambda _: heard.update(["clock"]), STREAM)
    executor.add_node(listener)
    spin_until(executor, lambda: min(clock.get_subscription_count(), targets.get_subscription_count()) > 1)
    before_ns = time.time_ns()
    for number, (publisher, message) in enumerate(
        [(targets, Target()), (clock, Clock(clock=Time(sec=1000))), (targets, Target()),
         (clock, Clock(clock=Time(sec=1000, nanosec=20_000_000))), (targets, Target())], 1
    ):  # fmt: skip
        publisher.publish(message)
        spin_until(executor, lambda so_far=number: heard.total() == so_far)
        # One more event: the recorder's own.
        executor.spin_once(timeout_sec=0.2)
    recorder.close()
    with (tmp_path / "bag" / "bag.mcap").open("rb") as stream:
        read = [(channel.topic, message) for _, channel, message in make_reader(stream).iter_messages()]
    assert [message.log_time / 1e9 for topic, message in read if topic == "/gs9/target"] == [1000.0, 1000.0, 1000.02]
    assert all(before_ns <= message.publish_time <= time.time_ns() for _, message in read)


def test_every_topic_of_the_table_waits_for_its_publisher(make_node: Callable[..., Any], tmp_path: Path) -> None:
    recorder = Recorder(make_node("listener"), "/gs8", tmp_path / "bag")
    # A station without an executive is whole; /diagnostics may have a publisher of a test before.
    every = {f"/gs8/{topic.name}" for topic in TOPICS if topic.publisher != EXECUTIVE and topic.name[0] != "/"}
    assert {name for name in recorder.unmatched() if name.startswith("/gs8/")} == every
    recorder.close()


def test_an_existing_directory_is_refused(make_node: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(ValueError, match="exists already"):
        Recorder(make_node("listener"), "/gs9", tmp_path / "bag")
