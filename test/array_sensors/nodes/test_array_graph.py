"""The graphs of the array sensors: every node is an executable with parameters in the system's file, and is launched."""

import ast
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="topics need ROS 2", exc_type=ImportError)
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK
from rf_pointing.core.parameters import read_parameter_files

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_every_node_has_an_executable_and_a_section_of_the_parameter_file(name: str) -> None:
    executables = {node.rsplit("/", 1)[-1] for node in ARRAY_SYSTEMS[name].nodes}
    assert all(f'"{executable}",' in (ROOT / "setup.py").read_text() for executable in executables)
    sections = read_parameter_files([ROOT / "config" / f"{name}.yaml"])
    assert sections.keys() == {*executables, CLOCK}


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
def test_launch_file_describes_the_system_of_its_name(name: str) -> None:
    tree = ast.parse((ROOT / "launch" / f"{name}.launch.py").read_text())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    assert [(call.func.id, call.args[0].value) for call in calls] == [("array_description", name)]


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
    sections = read_parameter_files([ROOT / "config" / "tripulse.yaml"])
    receivers = [node for node in ARRAY_SYSTEMS["tripulse"].nodes if "/" in node]
    stations = [receiver.split("/")[0] for receiver in receivers]
    for node in ("tripulse_source", "tripulse_attitude"):
        assert sections[node].values["stations.names"] == stations
