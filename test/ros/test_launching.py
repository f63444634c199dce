"""The launch files start the nodes of the graph with the parameters of their arguments (`launch` itself is a stub)."""

import importlib.util
import os
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import rf_pointing
from rf_pointing.ros.graph import ARRAY_NODES, DESCRIPTION, NODES, STATION_NODES
from rf_pointing.station.description import read_station
from rf_pointing.station.description.urdf import urdf

FOLDER = Path(__file__).parents[2] / "launch"


class Action:
    """Any action of `launch`: remembers what it was made with."""

    def __init__(self, *positional: Any, **named: Any) -> None:
        self.positional, self.named = positional, named


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Return the values of the launch arguments, by default their defaults; `launch` and `launch_ros` are stubs."""
    values: dict[str, str] = {}

    class Argument(Action):
        def __init__(self, name: str, description: str, default_value: str | None = None) -> None:
            super().__init__(name)
            assert description
            if default_value is not None:
                values.setdefault(name, default_value)

    class Configuration(Action):
        def perform(self, _context: Any) -> str:
            return values[self.positional[0]]

    contents: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": Action},
        "launch.actions": {"DeclareLaunchArgument": Argument, "OpaqueFunction": Action},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"LifecycleNode": Action, "Node": Action},
    }
    for name, members in contents.items():
        stub = ModuleType(name)
        stub.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, stub)
    for name in ("rf_pointing.ros.launching", "rf_pointing.array_sensors.nodes.launching"):
        # Made from the stubs by this test, and removed with them.
        monkeypatch.setitem(sys.modules, name, SimpleNamespace())
        del sys.modules[name]
    return values


def launched(name: str) -> dict[str, dict[str, Any]]:
    """Return what every node of a launch file is started with, by its name."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.launch.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (start,) = [each for each in module.generate_launch_description().positional[0] if "function" in each.named]
    return {node.named["name"]: node.named for node in start.named["function"](None, *start.named["args"])}


def test_the_simulated_station_has_every_node_and_its_own_time(given: dict[str, str]) -> None:
    given["speed"] = "0"
    nodes = launched("simulated_station")
    assert tuple(nodes) == (*NODES, DESCRIPTION)
    assert all(node["remappings"] == [("/clock", "clock")] for node in nodes.values())
    assert {"start_s": 1151384173.0, "speed": 0.0} in nodes["simulation_clock"]["parameters"]
    assert {"use_sim_time": True} in nodes["antenna_servo"]["parameters"]
    assert {"station": "dss13", "band": ""} in nodes["antenna_servo"]["parameters"]
    assert not [each for each in nodes["simulation_clock"]["parameters"] if "station" in each]


def test_a_station_with_its_own_drivers_keeps_the_other_nodes_and_the_time_of_the_system(given: dict[str, str]) -> None:
    given |= {"namespace": "gs7", "params_file": "my.yaml", "autostart": "false", "station": "dish.yaml", "band": "S"}
    nodes = launched("single_antenna")
    assert tuple(nodes) == (*STATION_NODES, DESCRIPTION)
    for node in nodes.values():
        assert node["namespace"] == "gs7"
        assert not any("state_file" in each for each in node["parameters"] if isinstance(each, dict))
        # The user's file comes last: what it says is in force.
        assert node["parameters"][-1] == "my.yaml"
        assert {"station": "dish.yaml", "band": "S"} in node["parameters"]
        assert {"use_sim_time": False} in node["parameters"]
        assert {"lifecycle.autostart": False} in node["parameters"]
        assert node["remappings"] == []


def test_a_station_with_a_drive_starts_the_control_unit_on_it(given: dict[str, str], tmp_path: Path) -> None:
    shipped = Path(rf_pointing.__file__).parent / "station" / "description" / "stations"
    station = shutil.copytree(shipped, tmp_path / "stations") / "dss13.yaml"
    station.write_text(station.read_text() + "\ndrive: {type: hamlib}\n")
    given["station"] = str(station)
    assert tuple(launched("single_antenna")) == ("antenna_servo", *STATION_NODES, DESCRIPTION)


def test_a_station_with_an_array_starts_its_nodes(given: dict[str, str]) -> None:
    """A real array has receivers of its own; a band that is none is refused by every node."""
    given["station"] = "rotator_2m"
    assert tuple(launched("simulated_station")) == (*NODES, *ARRAY_NODES, DESCRIPTION)
    given["band"] = "S"
    assert {"array_tracker"} == set(launched("single_antenna")) & set(ARRAY_NODES)
    given["band"] = "W"
    assert not set(launched("single_antenna")) & set(ARRAY_NODES)


@pytest.mark.parametrize("installed", [True, False])
def test_robot_state_publisher_turns_the_joints_where_it_is_installed(
    given: dict[str, str], installed: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if installed:
        index = tmp_path / "share/ament_index/resource_index/packages"
        index.mkdir(parents=True)
        (index / "robot_state_publisher").touch()
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:{os.environ['AMENT_PREFIX_PATH']}")
    given |= {"namespace": "/north/gs7", "station": "leo_3m7"}
    nodes = launched("simulated_station")
    assert ("robot_state_publisher" in nodes) == installed
    assert ({"view.publish_tf": False} in nodes[DESCRIPTION]["parameters"]) == installed
    if installed:
        first, second = nodes["robot_state_publisher"]["parameters"]
        assert first == {"robot_description": urdf(read_station("leo_3m7")), "frame_prefix": "north/gs7/"}
        assert second == {"use_sim_time": True}
        assert nodes["robot_state_publisher"]["remappings"] == [("/clock", "clock")]
        publisher = nodes["robot_state_publisher"]
        assert (publisher["namespace"], publisher["output"]) == ("/north/gs7", "screen")
        assert (publisher["package"], publisher["executable"]) == ("robot_state_publisher",) * 2
        assert (publisher["respawn"], publisher["respawn_delay"]) == (True, 0.5)
        given |= {"respawn": "false", "use_sim_time": "false"}
        publisher = launched("simulated_station")["robot_state_publisher"]
        assert (publisher["respawn"], publisher["parameters"][1]) == (False, {"use_sim_time": False})
    given["description"] = "false"
    assert tuple(launched("simulated_station")) == NODES


def test_the_page_and_the_executive_share_the_folder_of_reports(given: dict[str, str]) -> None:
    given |= {"station": "leo_3m7", "page": "true", "executive": "true", "state_folder": "/var/lib/station"}
    nodes = launched("single_antenna")
    assert {"station_executive", "operator_page"} <= set(nodes)
    assert {"page.reports": "/var/lib/station/gs1/nights"} in nodes["operator_page"]["parameters"]
    # It takes limits and horizon from the running nodes, so it needs no station.
    assert not [each for each in nodes["operator_page"]["parameters"] if "station" in each]


def test_a_real_antenna_is_not_started_with_the_numbers_of_another(given: dict[str, str]) -> None:
    with pytest.raises(KeyError, match="station"):
        launched("single_antenna")


@pytest.mark.parametrize(("namespace", "home"), [("gs1", "/var/lib/station"), ("/north/gs2", "")])
def test_the_antenna_remembers_its_fault_and_its_turn_by_default(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch, namespace: str, home: str
) -> None:
    """In the user's state folder, of its own for each domain and namespace; the station's file has the last word."""
    monkeypatch.setenv("XDG_STATE_HOME", home)
    monkeypatch.setenv("ROS_DOMAIN_ID", "12")
    given |= {"namespace": namespace, "params_file": "my.yaml"}
    _, first, *later = launched("simulated_station")["antenna_servo"]["parameters"]
    folder = Path(home or Path.home() / ".local" / "state") / "rf_pointing" / "domain12" / namespace.strip("/")
    assert first == {
        "state_file": str(folder / "antenna_servo.json"),
        "wrap_file": str(folder / "azimuth_turn.json"),
        "command_key_file": str(folder / "command.key"),
    }
    assert later[-1] == given["params_file"]


def test_a_node_has_an_enclave_of_its_own_where_security_is_on(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_SECURITY_ENABLE", raising=False)
    assert launched("simulated_station")["antenna_servo"]["ros_arguments"] == []
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    given["namespace"] = "/gs7"
    assert launched("simulated_station")["antenna_servo"]["ros_arguments"] == ["--enclave", "/gs7/antenna_servo"]


@pytest.mark.parametrize(
    ("network", "set_by_user", "own"),
    [
        ("loopback", {}, True),
        ("environment", {}, False),
        # Who has chosen a profile or a range is not overruled.
        ("loopback", {"FASTRTPS_DEFAULT_PROFILES_FILE": "/etc/station.xml"}, False),
        ("loopback", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, False),
        ("loopback", {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, True),
        ("loopback", {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, False),
    ],
)
@pytest.mark.parametrize("name", ["simulated_station", "single_antenna", "doa"])
def test_nodes_are_heard_on_this_computer_alone_unless_the_user_decides(
    given: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    network: str,
    set_by_user: dict[str, str],
    own: bool,
) -> None:
    for variable in ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "RMW_IMPLEMENTATION"):
        monkeypatch.delenv(variable, raising=False)
    for variable, value in set_by_user.items():
        monkeypatch.setenv(variable, value)
    given |= {"network": network, "station": "dss13"}
    for node in launched(name).values():
        profile = node["additional_env"].get("FASTRTPS_DEFAULT_PROFILES_FILE")
        assert (profile is not None) == own
        assert profile is None or "127.0.0.1" in Path(profile).read_text()


def test_a_network_that_is_none_is_refused(given: dict[str, str]) -> None:
    given["network"] = "everyone"
    with pytest.raises(ValueError, match="network:=everyone must be loopback or environment"):
        launched("simulated_station")


def test_a_launch_may_remember_nothing(given: dict[str, str]) -> None:
    given["state_folder"] = ""
    for node in launched("simulated_station").values():
        assert not any("state_file" in each for each in node["parameters"] if isinstance(each, dict))


@pytest.mark.parametrize("system", ["doa", "interferometer", "tripulse"])
def test_an_array_sensor_has_a_clock_of_its_namespace(given: dict[str, str], system: str) -> None:
    nodes = launched(system)
    assert "simulation_clock" in nodes
    assert {node["remappings"][0] for node in nodes.values()} == {("/clock", f"/{system}/clock")}


def parameters(node: dict[str, Any]) -> dict[str, Any]:
    """Return all parameters that a node is started with, but for those of the user's file."""
    return {name: value for each in node["parameters"] if isinstance(each, dict) for name, value in each.items()}


def test_every_node_is_managed_started_again_and_shown(given: dict[str, str]) -> None:
    nodes = launched("simulated_station")
    for name, node in nodes.items():
        assert (node["package"], node["executable"], node["output"]) == ("rf_pointing", name, "screen")
        assert (node["respawn"], node["respawn_delay"]) == (True, 0.5)
        assert parameters(node)["lifecycle.autostart"] is True
    given["respawn"] = "false"
    assert not any(node["respawn"] for node in launched("simulated_station").values())


def test_a_real_drive_loop_alone_has_a_priority(given: dict[str, str], tmp_path: Path) -> None:
    assert not any("lifecycle.realtime_priority" in parameters(node) for node in launched("simulated_station").values())
    shipped = Path(rf_pointing.__file__).parent / "station" / "description" / "stations"
    station = shutil.copytree(shipped, tmp_path / "stations") / "dss13.yaml"
    station.write_text(station.read_text() + "\ndrive: {type: hamlib}\n")
    given["station"] = str(station)
    nodes = launched("single_antenna")
    assert parameters(nodes["antenna_servo"])["lifecycle.realtime_priority"] == 20
    assert [name for name, node in nodes.items() if "lifecycle.realtime_priority" in parameters(node)] == [
        "antenna_servo"
    ]


MORE = ("station_executive", "operator_page", "rotctld_server")


def test_what_is_optional_is_started_on_request_alone(given: dict[str, str]) -> None:
    assert not set(MORE) & set(launched("simulated_station"))
    for argument, name in (("executive", MORE[0]), ("page", MORE[1]), ("rotctld", MORE[2])):
        given.update({"executive": "false", "page": "false", "rotctld": "false", argument: "true"})
        assert set(MORE) & set(launched("simulated_station")) == {name}


def test_commanders_share_the_key_of_the_antenna_and_what_is_kept_has_its_files(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    given |= {
        "executive": "true",
        "page": "true",
        "rotctld": "true",
        "state_folder": "/var/lib/st",
        "namespace": "/n/gs2",
    }
    nodes = launched("simulated_station")
    key = parameters(nodes["antenna_servo"])["command_key_file"]
    assert key.startswith("/var/lib/st")
    with_key = {name for name, node in nodes.items() if parameters(node).get("command_key_file") == key}
    assert with_key == {"antenna_servo", "pointing_controller", *MORE}
    executive = parameters(nodes["station_executive"])
    assert executive["executive.state_file"] == "/var/lib/st/n/gs2/station_executive.json"
    assert (
        executive["executive.folder"]
        == parameters(nodes["operator_page"])["page.reports"]
        == "/var/lib/st/n/gs2/nights"
    )
    given["state_folder"] = ""
    nodes = launched("simulated_station")
    assert not any("command_key_file" in parameters(node) for node in nodes.values())
    assert not any("executive.folder" in parameters(node) for node in nodes.values())
    assert "page.reports" not in parameters(nodes["operator_page"])


@pytest.mark.parametrize(
    ("elements", "satellite"), [("", ""), ("cbers.tle", ""), ("", "25544"), ("https://x.org/a.tle", "25544")]
)
def test_the_target_reaches_the_publisher_and_the_simulated_receiver(
    given: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elements: str, satellite: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cbers.tle").write_text("")
    given |= {"elements": elements, "satellite": satellite}
    nodes = launched("simulated_station")
    wanted = {"ephemeris_publisher", "rf_receiver"} if elements or satellite else set()
    assert {name for name, node in nodes.items() if "source.elements" in parameters(node)} == wanted
    for name in wanted:
        # A file is found from wherever the node runs; an address stays as it is.
        assert parameters(nodes[name])["source.elements"] == (
            str(tmp_path / "cbers.tle") if elements == "cbers.tle" else elements
        )
        assert parameters(nodes[name])["source.satellite"] == satellite


def test_only_a_station_s_own_nodes_get_its_description(given: dict[str, str]) -> None:
    given |= {"page": "true"}
    nodes = launched("simulated_station")
    without = {name for name, node in nodes.items() if "station" not in parameters(node)}
    assert without == {"simulation_clock", "operator_page"}
    assert {name for name, node in nodes.items() if "use_sim_time" not in parameters(node)} == without
    assert {name for name, node in nodes.items() if "start_s" in parameters(node)} == {"simulation_clock"}


def test_an_unknown_station_starts_the_nodes_which_say_why(given: dict[str, str]) -> None:
    given["station"] = "nowhere"
    assert tuple(launched("single_antenna")) == (*STATION_NODES, DESCRIPTION)


@pytest.mark.parametrize(
    ("variable", "value", "environment"),
    [
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
        ("ROS_DISCOVERY_SERVER", "10.0.0.1:11811", {}),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "", None),
        ("RMW_IMPLEMENTATION", "", None),
    ],
)
def test_another_middleware_stays_on_this_computer_too(
    given: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    variable: str,
    value: str,
    environment: dict[str, str] | None,
) -> None:
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DISCOVERY_SERVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("RMW_IMPLEMENTATION", raising=False)
    monkeypatch.setenv(variable, value)
    given["station"] = "dss13"
    for node in launched("simulated_station").values():
        found = node["additional_env"]
        if environment is None:
            assert found["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
            assert found["FASTRTPS_DEFAULT_PROFILES_FILE"].endswith("config/fastdds_loopback.xml")
        else:
            assert found == environment
