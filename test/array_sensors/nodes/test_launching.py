"""Launch files of the array sensors: each node in its namespace, with a clock of the graph's own."""

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="launch files need ROS 2")
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK
from test.ros.test_launching import given, launched

__all__ = ["given"]


@pytest.mark.parametrize("name", ARRAY_SYSTEMS)
@pytest.mark.parametrize("autostart", ["true", "false"])
def test_every_node_of_a_system_is_launched_with_its_file_and_its_clock(
    given: dict[str, str], name: str, autostart: str
) -> None:
    given |= {"namespace": "/north/sat", "autostart": autostart}
    nodes = launched(name)
    assert set(nodes) == {CLOCK, *(each.rsplit("/", 1)[-1] for each in ARRAY_SYSTEMS[name].nodes)}
    for each, node in nodes.items():
        assert (node["package"], node["executable"], node["output"]) == ("rf_pointing", each, "screen")
        file, values = node["parameters"]
        assert file.endswith(f"/config/{name}.yaml")
        assert values == {"use_sim_time": each != CLOCK, "lifecycle.autostart": autostart == "true"}
        assert node["remappings"] == [("/clock", "/north/sat/clock")]
        assert node["respawn"] is (autostart == "true")
        assert node["respawn_delay"] == 0.5
    assert nodes[CLOCK]["namespace"] == "/north/sat"


def test_receivers_stand_in_the_namespaces_of_their_stations(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[dict[str, Any]] = []
    launched("tripulse")
    from rf_pointing.array_sensors.nodes import launching

    monkeypatch.setattr(launching, "LifecycleNode", lambda **named: started.append(named))
    assert len(launching.lifecycle_nodes(None, ("tripulse_source", "usingen/tripulse_receiver"))) == 2
    assert [(each["namespace"], each["name"]) for each in started] == [
        ("tripulse", "tripulse_source"),
        ("tripulse/usingen", "tripulse_receiver"),
    ]
    given["params_file"] = "own.yaml"
    launching.lifecycle_nodes(None, ("tripulse_source",))
    assert started[-1]["parameters"][0] == "own.yaml"
