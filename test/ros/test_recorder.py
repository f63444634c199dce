"""The recorder writes every topic of an antenna as it came over the wire, latched ones from before its start included."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rf_pointing_msgs.msg import PassList, Target
from rosbags.rosbag2 import Reader

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


def test_every_topic_of_the_table_waits_for_its_publisher(make_node: Callable[..., Any], tmp_path: Path) -> None:
    recorder = Recorder(make_node("listener"), "/gs9", tmp_path / "bag")
    # A station without an executive is whole.
    assert len(recorder.unmatched()) == len([topic for topic in TOPICS if topic.publisher != EXECUTIVE])
    assert "/gs9/joint_states" in recorder.unmatched()
    assert "/diagnostics" in recorder.unmatched()
    recorder.close()


def test_an_existing_directory_is_refused(make_node: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(ValueError, match="exists already"):
        Recorder(make_node("listener"), "/gs9", tmp_path / "bag")
