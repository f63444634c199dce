"""Array sensors on live nodes: estimates agree with the truth, and bad input is refused with its reason."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rclpy.qos import QoSProfile

from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    multiply,
    quaternion_from_matrix,
    quaternion_to_rotation_vector,
)
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, ArrayGraph
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.qos import STREAM

pytestmark = pytest.mark.graph

EPOCHS = 20
SIGMAS = 4.0
SPEEDS = {"tripulse": 20.0, "doa": 10.0, "interferometer": 20.0}
QUICK_START = "/**/doa_attitude: {ros__parameters: {start: {settle_s: 10.0}}}"
DEEP = QoSProfile(depth=1000, reliability=STREAM.reliability)


class Bench:
    """One live system: every message of its topics, and publishers for what no sound node would send."""

    def __init__(self, name: str, folder: Path, domain: int) -> None:
        self.system = ARRAY_SYSTEMS[name]
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node(f"{name}_bench", context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self.node)
        extra = folder / "extra.yaml"
        extra.write_text(QUICK_START)
        files = [extra] if name == "doa" else []
        logs = folder / "logs"
        self.graph = ArrayGraph(self.system, self.node, self._spin, logs, speed=SPEEDS[name], parameter_files=files)
        self.messages: dict[str, list[Any]] = {topic.name: [] for topic in self.system.topics}
        self.types = {topic.name: topic.message_type for topic in self.system.topics}
        for topic in self.system.topics:
            self.node.create_subscription(topic.message_type, self._full(topic.name), self._taker(topic.name), DEEP)
        self._publishers: dict[str, Any] = {}

    def close(self) -> None:
        with self.graph:
            pass
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        self.graph.wait_until(condition, what)

    def send(self, topic: str, message: Any) -> None:
        """Publish beside the node that owns the topic."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(self.types[topic], self._full(topic), STREAM)
            # This bench listens too, so the node under test is the second subscriber.
            self.wait(lambda: self._publishers[topic].get_subscription_count() >= 2, f"a subscriber of {topic}")
        self._publishers[topic].publish(message)

    def refused(self, node: str) -> str:
        """Return what the newest diagnostics of a node give as its last rejections."""
        for array in reversed(self.messages["/diagnostics"]):
            mine = [s for s in array.status if s.name.startswith(f"{self.system.name}/{node}: ")]
            if mine:
                return "; ".join(
                    pair.value for s in mine for pair in s.values if pair.key in ("last_rejection", "last_refusal")
                )
        return ""

    def pairs(self, estimate: str, truth: str) -> list[tuple[Any, Any]]:
        """Return the estimates that are valid with the truth of the same stamp."""
        known = {stamp(message): message for message in self.messages[truth]}
        found = [m for m in self.messages[estimate] if getattr(m, "valid", True)]
        return [(m, known[stamp(m)]) for m in found if stamp(m) in known]

    def _full(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{self.graph.namespace}/{topic}"

    def _taker(self, topic: str) -> Callable[[Any], None]:
        return lambda message: self.messages[topic].append(message)

    def _spin(self, timeout_s: float) -> None:
        self._executor.spin_once(timeout_sec=timeout_s)


def stamp(message: Any) -> tuple[int, int]:
    return message.header.stamp.sec, message.header.stamp.nanosec


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Callable[[str], Bench]]:
    """Return the running system of a name; each is started once."""
    running: dict[str, Bench] = {}

    def get(name: str) -> Bench:
        if name not in running:
            running[name] = Bench(name, tmp_path_factory.mktemp(name), ros_domain)
            running[name].graph.bring_up()
            running[name].graph.run_time()
        return running[name]

    yield get
    for each in running.values():
        each.close()


def assert_covariance(matrix: np.ndarray) -> None:
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-9, atol=0.0)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


def assert_within(error: np.ndarray, covariance: np.ndarray) -> None:
    assert_covariance(covariance)
    assert np.all(np.abs(error) < SIGMAS * np.sqrt(np.diag(covariance)))


@pytest.mark.parametrize("name", ["tripulse", "doa"])
def test_attitudes_arrive_and_agree_with_the_truth(bench: Callable[[str], Bench], name: str) -> None:
    running = bench(name)
    running.wait(lambda: len(running.pairs("attitude", "sim/attitude")) >= EPOCHS, "valid attitudes")
    for estimate, truth in running.pairs("attitude", "sim/attitude"):
        report = convert.attitude_from_message(estimate)
        _, quaternion = convert.orientation_from_message(truth)
        error = quaternion_to_rotation_vector(multiply(report.quaternion, conjugate(quaternion)))
        assert_within(error, report.covariance_rad2)


def test_doa_rates_arrive_and_agree_with_the_truth(bench: Callable[[str], Bench]) -> None:
    running = bench("doa")
    running.wait(lambda: len(running.pairs("attitude_rate", "sim/attitude_rate")) >= EPOCHS, "attitude rates")
    for estimate, truth in running.pairs("attitude_rate", "sim/attitude_rate"):
        report = convert.rate_from_message(estimate)
        assert_within(report.rate_rad_s - convert.vector_from_message(truth)[1], report.covariance_rad2_s2)


def test_relative_poses_arrive_and_agree_with_the_truth(bench: Callable[[str], Bench]) -> None:
    running = bench("interferometer")

    def complete() -> list[tuple[Any, ...]]:
        poses = running.pairs("relative_pose", "sim/relative_pose")
        twists = {stamp(e): (e, t) for e, t in running.pairs("relative_twist", "sim/relative_twist")}
        return [(e, t, *twists[stamp(e)]) for e, t in poses if stamp(e) in twists]

    running.wait(lambda: len(complete()) >= EPOCHS, "relative poses")
    for pose, true_pose, twist, true_twist in complete():
        (_, found), (_, truth) = (
            convert.pose_from_messages(pose, twist),
            convert.pose_from_messages(true_pose, true_twist),
        )
        turn = quaternion_to_rotation_vector(quaternion_from_matrix(found.orientation @ truth.orientation.T))
        assert_within(np.concatenate([found.position_m - truth.position_m, turn]), found.pose_covariance)
        slips = [found.velocity_m_s - truth.velocity_m_s, found.angular_velocity_rad_s - truth.angular_velocity_rad_s]
        assert_within(np.concatenate(slips), found.twist_covariance)
    assert {message.status for message in running.messages["relative_pose_status"]} == {"tracking"}


NAN = float("nan")
BAD: list[tuple[str, str, str, str, str]] = [
    ("tripulse", "tripulse_attitude", "usingen/tripulse_measurement", "covariance", "covariance"),
    ("doa", "doa_attitude", "known_torque", "control_torque", "control_torque"),
    ("interferometer", "interferometer_tracker", "interferometer_measurement", "coupling", "coupling must be finite"),
]
"""One of each system; what else is refused is the table of `test/array_sensors/nodes/test_convert.py`."""
ESTIMATES = {"tripulse": "attitude", "doa": "attitude", "interferometer": "relative_pose"}


@pytest.mark.parametrize(("name", "node", "topic", "field", "words"), BAD, ids=[name for name, *_ in BAD])
def test_bad_input_is_refused_with_its_reason_and_estimates_go_on(
    bench: Callable[[str], Bench], name: str, node: str, topic: str, field: str, words: str
) -> None:
    running = bench(name)
    running.wait(lambda: bool(running.messages[topic]), topic)
    bad = running.messages[topic][-1]
    setattr(bad, field, [NAN, *list(getattr(bad, field))[1:]])
    running.send(topic, bad)
    running.wait(lambda: words in running.refused(node), f"the refusal of {field} by {node}")
    seen = len(running.messages[ESTIMATES[name]])
    running.wait(lambda: len(running.messages[ESTIMATES[name]]) >= seen + 3, "estimates after the refusal")
    assert all(getattr(message, "valid", True) for message in running.messages[ESTIMATES[name]][-3:])
