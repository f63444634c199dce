"""Launch files of the array sensors: each node in its namespace, with a clock of the graph's own."""

import pytest

pytest.importorskip("rclpy", reason="launch files need ROS 2")
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK
from rf_pointing.array_sensors.nodes.launching import array_processes
from test.ros.test_launching import launched


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
@pytest.mark.parametrize("autostart", ["true", "false"])
def test_every_node_of_a_system_is_launched_with_its_file_and_its_clock(name: str, autostart: str) -> None:
    nodes = launched(name, namespace="/north/sat", autostart=autostart)
    assert set(nodes) == {CLOCK, *(each.rsplit("/", 1)[-1] for each in ARRAY_SYSTEMS[name].nodes)}
    for each, node in nodes.items():
        assert (node.package, node.executable) == ("rf_pointing", each)
        assert str(node.parameters[0]).endswith(f"/config/array_sensors/{name}.yaml")
        assert node.values(each) == {"use_sim_time": each != CLOCK, "lifecycle.autostart": autostart == "true"}
        assert node.remappings == (("/clock", "/north/sat/clock"),)
        assert node.respawn is (autostart == "true")
    assert nodes[CLOCK].namespace == "/north/sat"


def test_receivers_stand_in_the_namespaces_of_their_stations() -> None:
    values = {"namespace": "tripulse", "params_file": "own.yaml", "autostart": True, "network": "loopback"}
    found = array_processes(("tripulse_source", "usingen/tripulse_receiver"), values)
    assert [(each.namespace, each.name, each.parameters[0]) for each in found] == [
        ("tripulse", "tripulse_source", "own.yaml"),
        ("tripulse/usingen", "tripulse_receiver", "own.yaml"),
    ]
