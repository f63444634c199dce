"""The launch files start the nodes of the graph with the parameters of their arguments (`launch` itself is a stub)."""

import configparser
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from rf_pointing.ros.graph import ALARMS, ARRAY_NODES, DESCRIPTION, NODES, STATION_NODES
from rf_pointing.station.description import read_station
from rf_pointing.station.description.urdf import urdf

FOLDER = Path(__file__).parents[2] / "launch"
MORE = {
    "executive": "station_executive",
    "page": "operator_page",
    "radio": "radio_control",
    "rotctld": "rotctld_server",
}


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


def actions(name: str) -> list[dict[str, Any]]:
    """Return what every process of a launch file is started with."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.launch.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (start,) = [each for each in module.generate_launch_description().positional[0] if "function" in each.named]
    return [node.named for node in start.named["function"](None, *start.named["args"])]


def launched(name: str) -> dict[str, dict[str, Any]]:
    """Return what every node of a launch file is started with, by its name, also where it shares a process."""
    found = {}
    for action in actions(name):
        if action["executable"] != "station_process":
            found[action["name"]] = action
            continue
        own, *files = action["parameters"]
        sections = yaml.safe_load(Path(own).read_text())
        Path(own).unlink()
        for node in action["arguments"]:
            if node != "--no-restart":
                values = sections[f"/**/{node}"]["ros__parameters"]
                found[node] = {**action, "executable": node, "name": node, "parameters": [values, *files]}
    return found


def parameters(node: dict[str, Any]) -> dict[str, Any]:
    """Return all parameters that a node is started with, but for those of the user's file."""
    return {name: value for each in node["parameters"] if isinstance(each, dict) for name, value in each.items()}


def those_with(nodes: dict[str, dict[str, Any]], name: str) -> set[str]:
    """Return the nodes that get a parameter of this name."""
    return {node for node, given in nodes.items() if name in parameters(given)}


def with_drive(tmp_path: Path) -> str:
    path = tmp_path / "mine.yaml"
    read_station("dss13").write(path, {"drive.type": "hamlib"})
    return str(path)


def test_the_simulated_station_has_every_node_and_its_own_time(given: dict[str, str]) -> None:
    given["speed"] = "0"
    nodes = launched("simulated_station")
    assert set(nodes) == {*NODES, ALARMS, DESCRIPTION}
    for name, node in nodes.items():
        assert (node["package"], node["executable"], node["output"]) == ("rf_pointing", name, "screen")
        assert (node["respawn"], node["respawn_delay"], node["remappings"]) == (True, 0.5, [("/clock", "clock")])
        assert parameters(node)["lifecycle.autostart"] is True
    clock, servo = (parameters(nodes[name]) for name in ("simulation_clock", "antenna_servo"))
    assert clock == {"lifecycle.autostart": True, "start_s": 1151384173.0, "speed": 0.0}
    assert (servo["station"], servo["band"], servo["use_sim_time"]) == ("dss13", "", True)
    given["respawn"] = "false"
    assert not any(node["respawn"] for node in launched("simulated_station").values())
    shared = [each["arguments"][-1] for each in actions("simulated_station") if "arguments" in each]
    assert shared == ["--no-restart"] * len(shared)
    assert shared


@pytest.mark.parametrize(
    ("processes", "simulated", "real"), [("1", 1, 2), ("2", 2, 2), ("8", len(NODES) + 1, len(STATION_NODES) + 2)]
)
def test_nodes_share_as_many_processes_as_are_wanted_but_a_real_control_unit_has_its_own(
    given: dict[str, str], tmp_path: Path, processes: str, simulated: int, real: int
) -> None:
    """So have the clients of the station, and under security every node."""
    given |= {"processes": processes, **dict.fromkeys(MORE, "true")}
    assert len(actions("simulated_station")) == simulated + len(MORE) + 1
    given["station"] = with_drive(tmp_path)
    found = actions("single_antenna")
    assert len(found) == real + len(MORE) + 1
    assert {"antenna_servo", ALARMS, *MORE.values()} <= {action["executable"] for action in found}
    given["processes"] = "3"
    with pytest.raises(ValueError, match="processes=3 must be 1, 2 or 8"):
        actions("single_antenna")


def test_a_station_with_its_own_drivers_keeps_the_other_nodes_and_the_time_of_the_system(given: dict[str, str]) -> None:
    given |= {"namespace": "gs7", "params_file": "my.yaml", "autostart": "false", "station": "dish.yaml", "band": "S"}
    nodes = launched("single_antenna")
    assert set(nodes) == {*STATION_NODES, ALARMS, DESCRIPTION}
    assert those_with(nodes, "state_file") == set()
    for node in nodes.values():
        assert (node["namespace"], node["remappings"]) == ("gs7", [])
        # The user's file comes last: what it says is in force.
        assert node["parameters"][-1] == "my.yaml"
        wanted = {"station": "dish.yaml", "band": "S", "use_sim_time": False, "lifecycle.autostart": False}
        assert parameters(node).items() >= wanted.items()


def test_a_station_with_a_drive_starts_the_control_unit_on_it_with_a_priority(
    given: dict[str, str], tmp_path: Path
) -> None:
    given["station"] = with_drive(tmp_path)
    nodes = launched("single_antenna")
    assert set(nodes) == {"antenna_servo", *STATION_NODES, ALARMS, DESCRIPTION}
    assert those_with(nodes, "lifecycle.realtime_priority") == {"antenna_servo"}
    assert parameters(nodes["antenna_servo"])["lifecycle.realtime_priority"] == 20
    assert those_with(launched("simulated_station"), "lifecycle.realtime_priority") == set()


def test_a_station_with_an_array_starts_its_nodes(given: dict[str, str]) -> None:
    """A real array has receivers of its own; every node refuses a band that does not exist."""
    given["station"] = "rotator_2m"
    assert set(launched("simulated_station")) == {*NODES, *ARRAY_NODES, ALARMS, DESCRIPTION}
    given["band"] = "S"
    assert {"array_tracker"} == set(launched("single_antenna")) & set(ARRAY_NODES)
    given["band"] = "W"
    assert not set(launched("single_antenna")) & set(ARRAY_NODES)


def test_a_station_is_named_for_a_real_antenna_and_an_unknown_one_is_left_to_the_nodes(given: dict[str, str]) -> None:
    """A real antenna must not move by the numbers of another one."""
    with pytest.raises(KeyError, match="station"):
        launched("single_antenna")
    given["station"] = "nowhere"
    assert set(launched("single_antenna")) == {*STATION_NODES, ALARMS, DESCRIPTION}


@pytest.mark.parametrize("installed", [True, False])
def test_robot_state_publisher_turns_the_joints_where_it_is_installed(
    given: dict[str, str], installed: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if installed:
        index = tmp_path / "share/ament_index/resource_index/packages"
        index.mkdir(parents=True)
        (index / "robot_state_publisher").touch()
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:{os.environ['AMENT_PREFIX_PATH']}")
    given |= {"namespace": "/north/gs7", "station": "leo_3m7", "respawn": "false", "use_sim_time": "false"}
    nodes = launched("simulated_station")
    assert ("robot_state_publisher" in nodes) == installed
    assert (parameters(nodes[DESCRIPTION]).get("view.publish_tf") is False) == installed
    if installed:
        publisher = nodes["robot_state_publisher"]
        assert parameters(publisher) == {
            "robot_description": urdf(read_station("leo_3m7")), "frame_prefix": "north/gs7/", "use_sim_time": False,
        }  # fmt: skip
        assert (publisher["package"], publisher["executable"]) == ("robot_state_publisher",) * 2
        assert (publisher["namespace"], publisher["remappings"]) == ("/north/gs7", [("/clock", "clock")])
        assert (publisher["respawn"], publisher["respawn_delay"], publisher["output"]) == (False, 0.5, "screen")
    given |= {"description": "false", "alarms": "false"}
    assert set(launched("simulated_station")) == set(NODES)


def test_what_is_optional_is_started_on_request_alone(given: dict[str, str]) -> None:
    assert not set(MORE.values()) & set(launched("simulated_station"))
    for argument, name in MORE.items():
        given.update({**dict.fromkeys(MORE, "false"), argument: "true"})
        assert set(MORE.values()) & set(launched("simulated_station")) == {name}


@pytest.mark.parametrize(("namespace", "home"), [("gs1", "/var/lib/station"), ("/north/gs2", "")])
def test_each_antenna_keeps_its_state_by_default_in_a_folder_of_its_own(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch, namespace: str, home: str
) -> None:
    """Of the user, the domain and the namespace; its commanders share the key."""
    monkeypatch.setenv("XDG_STATE_HOME", home)
    monkeypatch.setenv("ROS_DOMAIN_ID", "12")
    given |= {"namespace": namespace, **dict.fromkeys(MORE, "true")}
    nodes = launched("simulated_station")
    folder = Path(home or Path.home() / ".local" / "state") / "rf_pointing" / "domain12" / namespace.strip("/")
    kept = {
        name: {key: value for key, value in parameters(node).items() if str(value).startswith(str(folder))}
        for name, node in nodes.items()
    }
    key, nights = {"command_key_file": str(folder / "command.key")}, str(folder / "nights")
    assert {name: values for name, values in kept.items() if values} == {
        "antenna_servo": {
            "state_file": str(folder / "antenna_servo.json"), "wrap_file": str(folder / "azimuth_turn.json"), **key,
        },
        "pointing_controller": key,
        "rotctld_server": key,
        "operator_page": {"page.reports": nights, **key},
        "station_alarms": {"folder": nights},
        "station_executive": {
            "executive.state_file": str(folder / "station_executive.json"), "executive.folder": nights, **key,
        },
    }  # fmt: skip
    given["state_folder"] = ""
    nodes = launched("simulated_station")
    for name in ("state_file", "command_key_file", "executive.folder", "page.reports"):
        assert those_with(nodes, name) == set()


def test_a_node_has_an_enclave_of_its_own_where_security_is_on(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_SECURITY_ENABLE", raising=False)
    assert not any(action.get("ros_arguments") for action in actions("simulated_station"))
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    given["namespace"] = "/gs7"
    assert launched("simulated_station")["antenna_servo"]["ros_arguments"] == ["--enclave", "/gs7/antenna_servo"]


LOCALHOST = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.mark.parametrize(
    ("network", "set_by_user", "wanted"),
    [
        ("loopback", {}, "the profile"),
        ("loopback", {"FASTRTPS_DEFAULT_PROFILES_FILE": "", "RMW_IMPLEMENTATION": ""}, "the profile"),
        ("loopback", {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, "the profile"),
        ("loopback", {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, LOCALHOST),
        ("environment", {}, {}),
        # Who has chosen a profile, a range or a server is not overruled.
        ("loopback", {"FASTRTPS_DEFAULT_PROFILES_FILE": "/etc/station.xml"}, {}),
        ("loopback", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, {}),
        ("loopback", {"ROS_DISCOVERY_SERVER": "10.0.0.1:11811"}, {}),
    ],
)
@pytest.mark.parametrize("name", ["simulated_station", "single_antenna", "doa"])
def test_nodes_are_heard_on_this_computer_alone_unless_the_user_decides(
    given: dict[str, str], monkeypatch: pytest.MonkeyPatch, name: str, network: str, set_by_user: dict[str, str],
    wanted: Any,
) -> None:  # fmt: skip
    for variable in ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DISCOVERY_SERVER",
                     "RMW_IMPLEMENTATION"):  # fmt: skip
        monkeypatch.delenv(variable, raising=False)
    for variable, value in set_by_user.items():
        monkeypatch.setenv(variable, value)
    given |= {"network": network, "station": "dss13"}
    for node in launched(name).values():
        found = dict(node["additional_env"])
        if wanted == "the profile":
            assert "127.0.0.1" in Path(found.pop("FASTRTPS_DEFAULT_PROFILES_FILE")).read_text()
            assert found == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
        else:
            assert found == wanted


@pytest.mark.parametrize("system", ["doa", "interferometer", "tripulse"])
def test_an_array_sensor_has_a_clock_of_its_namespace(given: dict[str, str], system: str) -> None:
    nodes = launched(system)
    assert "simulation_clock" in nodes
    assert {node["remappings"][0] for node in nodes.values()} == {("/clock", f"/{system}/clock")}


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
    assert those_with(nodes, "source.elements") == wanted
    # A file is found from wherever the node runs; an address stays as it is.
    place = str(tmp_path / "cbers.tle") if elements == "cbers.tle" else elements
    for name in wanted:
        values = parameters(nodes[name])
        assert (values["source.elements"], values["source.satellite"]) == (place, satellite)


def test_the_unit_of_systemd_gives_the_launch_file_arguments_that_it_has(given: dict[str, str], tmp_path: Path) -> None:
    """Its command line is run with a launcher that prints what it gets; the settings are those of the shipped file."""
    folder = Path(__file__).parents[2] / "config" / "systemd"
    unit = configparser.ConfigParser(interpolation=None, delimiters="=", comment_prefixes="#", strict=True)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    unit.read(folder / "rf_pointing@.service")
    assert (unit["Service"]["Restart"], unit["Unit"]["StartLimitIntervalSec"]) == ("always", "0")
    assert unit["Install"]["WantedBy"] == "multi-user.target"
    assert "network-online" not in unit["Unit"]["After"]
    settings = dict(shlex.split(line)[0].split("=", 1) for line in (folder / "station.conf").read_text().splitlines()
                    if not line.startswith("#"))  # fmt: skip
    assert settings["LAUNCH"].split()[-1] in {file.name for file in FOLDER.iterdir()}
    launcher = tmp_path / "launcher"
    launcher.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    launcher.chmod(0o755)
    settings |= {"SETUP": "/dev/null", "LAUNCH": f"{launcher} file", "STATION": "/etc/my dish.yaml"}
    line = shlex.split(unit["Service"]["ExecStart"].replace("%i", "gs1").replace("$$", "$"))
    done = subprocess.run(line, env=os.environ | settings, capture_output=True, text=True, check=True, timeout=60)
    first, *pairs = done.stdout.splitlines()
    arguments = dict(each.split(":=", 1) for each in pairs)
    given |= arguments | {"station": "leo_3m7"}
    assert (first, arguments["namespace"], arguments["station"]) == ("file", "gs1", "/etc/my dish.yaml")
    known = {each.positional[0] for each in importlib.import_module("rf_pointing.ros.launching").common_arguments()}
    assert set(arguments) <= known
    assert {"station_executive", "station_alarms", "operator_page"} <= set(launched("single_antenna"))
    if shutil.which("systemd-analyze"):
        done = subprocess.run(["systemd-analyze", "verify", folder / "rf_pointing@.service"], capture_output=True, text=True,
                              timeout=60, check=False)  # fmt: skip
        assert "rf_pointing@.service:" not in done.stderr
