"""The graphs of the array sensors: every node is an executable with parameters in the system's file, and is launched."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="topics need ROS 2")
from rf_pointing.array_sensors.nodes import array_graph
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK, ArrayGraph
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_every_node_has_an_executable_and_a_section_of_the_parameter_file(name: str) -> None:
    executables = {node.rsplit("/", 1)[-1] for node in ARRAY_SYSTEMS[name].nodes}
    assert all(f'"{executable}",' in (ROOT / "setup.py").read_text() for executable in executables)
    sections = read_parameter_files([ROOT / "config" / "array_sensors" / f"{name}.yaml"])
    assert sections.keys() == {*executables, CLOCK}


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_truth_travels_under_sim_only_and_comes_from_the_source(name: str) -> None:
    system = ARRAY_SYSTEMS[name]
    assert any(topic.name.startswith("sim/") for topic in system.topics)
    for topic in system.topics:
        if topic.name.startswith("sim/"):
            assert topic.publisher.endswith("_source")
    names = [topic.name for topic in system.topics]
    assert len(names) == len(set(names))


def test_stations_of_the_tripulse_graph_are_those_of_its_parameter_file() -> None:
    sections = read_parameter_files([ROOT / "config" / "array_sensors" / "tripulse.yaml"])
    receivers = [node for node in ARRAY_SYSTEMS["tripulse"].nodes if "/" in node]
    stations = tuple(receiver.split("/")[0] for receiver in receivers)
    for node in ("tripulse_source", "tripulse_attitude"):
        assert sections[node]["stations.names"] == stations


class Bench:
    """The wall clock of a graph without processes, and the times that it has published."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock: list[float] = []
        self.waits: list[float] = []
        self.heard: dict[str, Any] = {}
        self.wall_s = 100.0
        monkeypatch.setattr(array_graph, "get_package_share_directory", lambda _: str(ROOT))
        monkeypatch.setattr(array_graph, "ManagedGraph", lambda *_, **__: None)
        monkeypatch.setattr(array_graph.time, "perf_counter", lambda: self.wall_s)

    def graph(self, name: str, speed: float) -> ArrayGraph:
        clock = SimpleNamespace(publish=lambda message: self.clock.append(seconds_from_stamp(message.clock)))
        node = SimpleNamespace(
            create_publisher=lambda _type, _topic, _qos: clock,
            create_subscription=lambda _type, topic, callback, _qos: self.heard.setdefault(topic, callback),
        )
        return ArrayGraph(
            ARRAY_SYSTEMS[name], node, self.waits.append, Path("logs"), speed=speed, parameter_files=[Path("own.yaml")]
        )

    def estimate(self, topic: str, t_s: float) -> None:
        self.heard[topic](SimpleNamespace(header=SimpleNamespace(stamp=stamp_from_seconds(t_s))))


START_S = 1_767_225_600.0


def test_time_stands_still_at_the_start_and_is_said_ten_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    graph = bench.graph("doa", 1.0)
    for _ in range(21):
        graph.spin(0.03)
        bench.wall_s += 0.0501
    assert graph.now_s == START_S
    assert bench.clock == [START_S] * 11
    assert bench.waits == [0.03] * 21


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_time_waits_for_the_estimates_that_lag_by_more_than_theirs_may(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As fast as the graph: ticks go on to the lag beyond the newest estimate, and after five seconds without it."""
    bench, system = Bench(monkeypatch), ARRAY_SYSTEMS[name]
    graph, topic = bench.graph(name, 0.0), f"/{name}/{system.paced}"
    graph.run_time()

    def runs_to() -> float:
        for _ in range(60):
            graph.spin(0.01)
        return graph.now_s - START_S

    assert runs_to() == pytest.approx(system.lag_s)
    bench.wall_s += 1.0
    bench.estimate(topic, START_S + 2.0)
    assert runs_to() == pytest.approx(2.0 + system.lag_s)
    bench.wall_s += 4.9
    assert runs_to() == pytest.approx(2.0 + system.lag_s)
    # A stream whose messages come within two lags is waited for again.
    bench.estimate(topic, START_S + 2.0 + 2.0 * system.lag_s)
    assert runs_to() == pytest.approx(2.0 + 3.0 * system.lag_s)
    bench.wall_s += 5.1
    assert runs_to() > 2.0 + 3.0 * system.lag_s + 5.0


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_time_may_lead_by_two_periods_of_the_source_and_two_ticks(name: str) -> None:
    sections = read_parameter_files([ROOT / "config" / "array_sensors" / f"{name}.yaml"])
    period_s = sections[f"{name}_source"]["source.period_s"]
    assert ARRAY_SYSTEMS[name].lag_s == 2.0 * period_s + 2.0 * array_graph.TICK_S
