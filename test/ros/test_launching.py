"""The processes of the launch files follow from their arguments, and `launch` gets each as it is."""

import configparser
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from rf_pointing.commands.launch import launch_file
from rf_pointing.ros.graph import ALARMS, ARRAY_NODES, DESCRIPTION, NODES, STATION_NODES
from rf_pointing.ros.launching import Process, adopt_state, full_namespace, launch_files, station_arguments
from rf_pointing.station.description import read_station
from rf_pointing.station.description.urdf import urdf

FOLDER = Path(__file__).parents[2] / "launch"
MORE = {
    "executive": "station_executive", "page": "operator_page", "radio": "radio_control",
    "rotctld": "rotctld_server",
}  # fmt: skip
STATION = {"station": "dss13"}
WITH_RADIO = tempfile.NamedTemporaryFile("w", suffix=".yaml")  # noqa: SIM115
RADIO = {"radio.transponders.any.downlink_mhz": 437.5}
read_station("dss13").write(Path(WITH_RADIO.name), RADIO)
EVERY = dict.fromkeys(MORE, "true") | {"station": WITH_RADIO.name}


def launched(name: str, **given: str) -> dict[str, Process]:
    """Return the process of every node of a launch file, by the node's name."""
    file = launch_file(name)
    named = STATION if name == "simulated_station" else {}
    return {node: process for process in file.processes(file.values(named | given)) for node in process.nodes}


def values(nodes: dict[str, Process], name: str) -> dict[str, Any]:
    """Return the parameters of a node that its file does not hold."""
    return nodes[name].values(name)


def those_with(nodes: dict[str, Process], name: str) -> set[str]:
    """Return the nodes that get a parameter of this name."""
    return {node for node in nodes if name in values(nodes, node)}


def with_drive(tmp_path: Path) -> str:
    path = tmp_path / "mine.yaml"
    read_station("dss13").write(path, RADIO | {"drive.type": "hamlib"})
    return str(path)


def test_the_simulated_station_has_every_node_and_its_own_time() -> None:
    nodes = launched("simulated_station", speed="0")
    assert set(nodes) == {*NODES, ALARMS, DESCRIPTION}
    for name, node in nodes.items():
        assert (node.package, node.respawn, node.remappings) == ("rf_pointing", True, (("/clock", "clock"),))
        assert values(nodes, name)["lifecycle.autostart"] is True
    clock, servo = (values(nodes, name) for name in ("simulation_clock", "antenna_servo"))
    assert clock == {"lifecycle.autostart": True, "start_s": 0.0, "speed": 0.0}
    assert (servo["station"], servo["band"], servo["use_sim_time"]) == ("dss13", "", True)
    ended = launched("simulated_station", respawn="false").values()
    assert not any(node.respawn for node in ended)
    assert {node.arguments[-1] for node in ended if node.arguments} == {"--no-restart"}


@pytest.mark.parametrize(
    ("processes", "simulated", "real"), [("1", 1, 2), ("2", 2, 2), ("8", len(NODES) + 1, len(STATION_NODES) + 2)]
)
def test_nodes_share_as_many_processes_as_are_wanted_but_a_real_control_unit_has_its_own(
    tmp_path: Path, processes: str, simulated: int, real: int
) -> None:
    """So have the clients of the station, and under security every node."""
    given = {"processes": processes, **EVERY}
    nodes = launched("simulated_station", **given)
    assert len({id(each) for each in nodes.values()}) == simulated + len(MORE) + 1
    nodes = launched("single_antenna", **given | {"station": with_drive(tmp_path)})
    assert len({id(each) for each in nodes.values()}) == real + len(MORE) + 1
    alone = {"antenna_servo", ALARMS, *MORE.values()}
    assert alone <= {node.executable for node in nodes.values()}


def test_a_station_with_its_own_drivers_keeps_the_other_nodes_and_the_time_of_the_system(tmp_path: Path) -> None:
    own = tmp_path / "my.yaml"
    own.touch()
    nodes = launched(
        "single_antenna", namespace="gs7", params_file=str(own), autostart="false", station="dss13", band="X"
    )
    assert set(nodes) == {*STATION_NODES, ALARMS, DESCRIPTION}
    assert those_with(nodes, "state_file") == set()
    for name, node in nodes.items():
        assert (node.namespace, node.remappings) == ("gs7", ())
        # The user's file comes last: what it says is in force.
        assert node.parameters[-1] == str(own)
        wanted = {"station": "dss13", "band": "X", "use_sim_time": False, "lifecycle.autostart": False}
        assert values(nodes, name).items() >= wanted.items()


def test_a_station_with_a_drive_starts_the_control_unit_on_it_with_a_priority(tmp_path: Path) -> None:
    nodes = launched("single_antenna", station=with_drive(tmp_path))
    assert set(nodes) == {"antenna_servo", *STATION_NODES, ALARMS, DESCRIPTION}
    assert those_with(nodes, "lifecycle.realtime_priority") == {"antenna_servo"}
    assert values(nodes, "antenna_servo")["lifecycle.realtime_priority"] == 20
    assert those_with(launched("simulated_station"), "lifecycle.realtime_priority") == set()


@pytest.mark.parametrize(("word", "roles"), [("none", [None]), ("here", ["first", "second"]), ("elsewhere", ["first"])])
def test_of_two_controllers_each_knows_which_it_is(tmp_path: Path, word: str, roles: list[str | None]) -> None:
    for processes in ("2", "8"):
        file = launch_file("single_antenna")
        given = {"station": with_drive(tmp_path), "processes": processes, "standby": word, "network": "environment"}
        found = file.processes(file.values(given))
        controllers = [each for each in found if "pointing_controller" in each.nodes]
        assert [each.values("pointing_controller").get("lifecycle.standby") for each in controllers] == roles
        assert len({each.name for each in found}) == len(found)
        # The other computer starts what this one would, with the key that is copied there.
        alone = file.processes(file.values(given | {"standby": "only"}))
        assert [each.values("pointing_controller")["lifecycle.standby"] for each in alone] == ["second"]
        assert alone[0] in file.processes(file.values(given | {"standby": "here"}))


@pytest.mark.parametrize(
    ("sensors", "receiver", "trackers"),
    [
        (["", "", ""], "simulated", set()), (["", "", ""], "topic", {"conscan_tracker"}),
        (["steptrack", "", ""], "simulated", {"conscan_tracker"}), (["monopulse", "", ""], "topic", {"monopulse_tracker"}),
        (["monopulse", "conscan", ""], "simulated", {"conscan_tracker", "monopulse_tracker"}),
    ],
)  # fmt: skip
def test_a_real_antenna_starts_the_trackers_of_its_bands_or_one_for_the_level_of_its_receiver(
    tmp_path: Path, sensors: list[str], receiver: str, trackers: set[str]
) -> None:
    path = tmp_path / "mine.yaml"
    by_band = {f"bands.{name}.sensors": own.split() for name, own in zip(("S", "X", "Ka"), sensors, strict=True)}
    read_station(WITH_RADIO.name).write(path, {"drive.type": "hamlib", "receiver.type": receiver, **by_band})
    nodes = set(launched("single_antenna", station=str(path), band="Ka"))
    assert nodes & {"conscan_tracker", "monopulse_tracker"} == trackers
    assert {"antenna_servo", "pointing_controller", "ephemeris_publisher", "bias_calibrator"} <= nodes


def test_time_does_not_wait_for_what_a_real_receiver_measures(tmp_path: Path) -> None:
    read_station("leo_3m7").write(path := tmp_path / "mine.yaml", {"receiver.type": "rtl_tcp"})
    assert values(launched("simulated_station", station=str(path)), "simulation_clock")["errors_in_time"] is False
    assert "errors_in_time" not in values(launched("simulated_station"), "simulation_clock")


def test_a_station_with_an_array_starts_its_nodes() -> None:
    """A real array has receivers of its own."""
    rotator = {"station": "rotator_2m"}
    assert set(launched("simulated_station", **rotator)) == {*NODES, *ARRAY_NODES, ALARMS, DESCRIPTION}
    assert {"array_tracker"} == set(launched("single_antenna", **rotator, band="S")) & set(ARRAY_NODES)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "station:= must be given to single_antenna: station description"),
        (STATION | {"staton": "x"}, "staton:= is not an argument of single_antenna; did you mean station"),
        (STATION | {"page": "yes"}, "page:=yes must be true or false"),
        (STATION | {"processes": "3"}, "processes:=3 must be 1 or 2 or 8"),
        (STATION | {"network": "open"}, "network:=open must be loopback or environment"),
        (STATION | {"band": "W"}, "W"),
        (STATION | {"params_file": "nowhere.yaml"}, "params_file:=nowhere.yaml does not exist"),
        ({"station": "nowhere"}, "nowhere: no such file, and no shipped station"),
        (STATION | {"radio": "true"}, "radio:=true needs the section radio, which .* has not"),
    ],
)
def test_what_cannot_be_launched_is_refused_by_name_value_and_bound(given: dict[str, str], words: str) -> None:
    """A real antenna must not move by the numbers of another one: it has no default."""
    with pytest.raises(ValueError, match=words):
        launched("single_antenna", **given)
    with pytest.raises(ValueError, match="speed:=fast must be a number"):
        launched("simulated_station", speed="fast")
    with pytest.raises(ValueError, match="station:= must be given to simulated_station: station description"):
        launch_file("simulated_station").values({})


@pytest.mark.parametrize("text", ["True", "1", "true"])
def test_a_boolean_may_be_written_as_in_yaml(text: str) -> None:
    nodes = launched("single_antenna", **STATION, page=text, use_sim_time=text, alarms="False")
    assert "operator_page" in nodes
    assert ALARMS not in nodes
    assert values(nodes, "pointing_controller")["use_sim_time"] is True


@pytest.mark.parametrize("installed", [True, False])
def test_robot_state_publisher_turns_the_joints_where_it_is_installed(
    installed: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if installed:
        index = tmp_path / "share/ament_index/resource_index/packages"
        index.mkdir(parents=True)
        (index / "robot_state_publisher").touch()
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:{os.environ['AMENT_PREFIX_PATH']}")
    given = {"namespace": "/north/gs7", "station": "leo_3m7", "respawn": "false", "use_sim_time": "false"}
    nodes = launched("simulated_station", **given)
    assert ("robot_state_publisher" in nodes) == installed
    assert (values(nodes, DESCRIPTION).get("view.publish_tf") is False) == installed
    if installed:
        publisher = nodes["robot_state_publisher"]
        assert values(nodes, "robot_state_publisher") == {
            "robot_description": urdf(read_station("leo_3m7")), "frame_prefix": "north/gs7/", "use_sim_time": False,
        }  # fmt: skip
        assert (publisher.package, publisher.executable) == ("robot_state_publisher",) * 2
        assert (publisher.namespace, publisher.remappings) == ("/north/gs7", (("/clock", "clock"),))
        assert not publisher.respawn
    assert set(launched("simulated_station", **given, description="false", alarms="false")) == set(NODES)


def test_what_is_optional_is_started_on_request_alone() -> None:
    assert not set(MORE.values()) & set(launched("simulated_station"))
    for argument, name in MORE.items():
        assert set(MORE.values()) & set(
            launched("simulated_station", station=WITH_RADIO.name, **{argument: "true"})
        ) == {name}


@pytest.mark.parametrize(("namespace", "home"), [("gs1", "/var/lib/station"), ("/north/gs2", "")])
def test_each_antenna_keeps_its_state_by_default_in_a_folder_of_its_own(
    monkeypatch: pytest.MonkeyPatch, namespace: str, home: str
) -> None:
    """Of the user, the domain and the namespace; its commanders share the key."""
    monkeypatch.setenv("XDG_STATE_HOME", home)
    monkeypatch.setenv("ROS_DOMAIN_ID", "12")
    folder = Path(home or Path.home() / ".local" / "state") / "rf_pointing" / "domain12" / namespace.strip("/")
    default = {argument.name: argument.default for argument in station_arguments(simulated=True)}["state_folder"]
    nodes = launched("simulated_station", namespace=namespace, state_folder=str(default), **EVERY)
    kept = {
        name: {key: value for key, value in values(nodes, name).items() if str(value).startswith(str(folder))}
        for name in nodes
    }
    key, nights = {"command_key_file": str(folder / "command.key")}, str(folder / "nights")
    assert {name: found for name, found in kept.items() if found} == {
        "antenna_servo": {
            "state_file": str(folder / "antenna_servo.json"), "wrap_file": str(folder / "azimuth_turn.json"), **key,
        },
        "pointing_controller": key, "rotctld_server": key,
        "operator_page": {"page.reports": nights, **key}, "station_alarms": {"folder": nights},
        "ephemeris_publisher": {"publisher.learned_file": str(folder / "learned_times.json")},
        "station_executive": {
            "executive.state_file": str(folder / "station_executive.json"), "executive.folder": nights, **key,
        },
    }  # fmt: skip
    nodes = launched("simulated_station", state_folder="none", **EVERY)
    for name in ("state_file", "command_key_file", "executive.folder", "page.reports"):
        assert those_with(nodes, name) == set()


@pytest.mark.parametrize(
    ("pushed", "namespace", "full"),
    [
        ("", "gs1", "/gs1"), ("", "/north/gs1/", "/north/gs1"), ("/site_a", "gs1", "/site_a/gs1"),
        ("/site_a", "/gs1", "/gs1"), ("/site_a", "", "/site_a"), ("", "", ""),
    ],
)  # fmt: skip
def test_a_launch_file_included_below_a_namespace_knows_the_whole_of_it(pushed: str, namespace: str, full: str) -> None:
    assert full_namespace(pushed, namespace) == full


def test_two_stations_of_one_name_at_two_sites_share_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rf_pointing.ros.launching.get_package_prefix", lambda _package: "/opt")
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    kept: list[set[str]] = []
    for site in ("/site_a", "/site_b"):
        space = full_namespace(site, "gs1")
        nodes = launched("simulated_station", namespace=space, state_folder=str(tmp_path), **EVERY)
        assert values(nodes, "robot_state_publisher")["frame_prefix"] == f"{space[1:]}/"
        texts = {str(text) for name in nodes for text in values(nodes, name).values()}
        # The key of partners is shared by all antennas of a folder: they share passes with it.
        partners = str(tmp_path / "partners.key")
        kept.append({text for text in texts if text.startswith(str(tmp_path)) and text != partners})
        kept[-1] |= {node.ros_arguments[1] for node in nodes.values() if node.ros_arguments}
        assert all(space in text for text in kept[-1])
    assert len(kept[0]) == len(kept[1]) > 15
    assert kept[0] & kept[1] == set()


def test_what_two_sites_shared_goes_once_to_the_first_that_asks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, files = tmp_path / "gs1", ("antenna_servo.json", "azimuth_turn.json", "command.key")
    old.mkdir()
    for name in files:
        (old / name).write_text(name)
    given = {"state_folder": str(tmp_path), "namespace": "/site_a/gs1"}
    monkeypatch.setattr(
        "rf_pointing.ros.launching.present_holder", lambda name: 7 if name == "/gs1/antenna_servo" else None
    )
    assert adopt_state(given, "gs1") == "", "the antenna of that namespace runs"
    monkeypatch.setattr("rf_pointing.ros.launching.present_holder", lambda _name: None)
    for other in ({"namespace": "/gs1"}, {"state_folder": ""}):
        assert adopt_state(given | other, "gs1") == ""
    said = adopt_state(given, "gs1")
    assert said.startswith("state of /site_a/gs1: antenna_servo.json, azimuth_turn.json, command.key moved from ")
    assert [(tmp_path / "site_a" / "gs1" / name).read_text() for name in files] == list(files)
    assert list(old.iterdir()) == []
    (old / "command.key").write_text("new")
    assert adopt_state(given, "gs1") == "", "never over its own"
    assert adopt_state(given | {"namespace": "/site_b/gs1"}, "gs1").endswith("site_b/gs1")


def test_a_node_has_an_enclave_of_its_own_where_security_is_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_SECURITY_ENABLE", raising=False)
    assert not any(node.ros_arguments for node in launched("simulated_station").values())
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    servo = launched("simulated_station", namespace="/gs7")["antenna_servo"]
    assert servo.ros_arguments == ("--enclave", "/gs7/antenna_servo")


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
    monkeypatch: pytest.MonkeyPatch, name: str, network: str, set_by_user: dict[str, str], wanted: Any
) -> None:  # fmt: skip
    for variable in ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DISCOVERY_SERVER",
                     "RMW_IMPLEMENTATION"):  # fmt: skip
        monkeypatch.delenv(variable, raising=False)
    for variable, value in set_by_user.items():
        monkeypatch.setenv(variable, value)
    for node in launched(name, network=network, **(STATION if name != "doa" else {})).values():
        found = dict(node.environment)
        if wanted == "the profile":
            assert "127.0.0.1" in Path(found.pop("FASTRTPS_DEFAULT_PROFILES_FILE")).read_text()
            assert found == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
        else:
            assert found == wanted


@pytest.mark.parametrize(
    ("elements", "satellite"), [("", ""), ("cbers.tle", ""), ("", "25544"), ("https://x.org/a.tle", "25544")]
)
def test_the_target_reaches_the_publisher_and_the_simulated_receiver(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elements: str, satellite: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cbers.tle").write_text("")
    nodes = launched("simulated_station", elements=elements, satellite=satellite)
    wanted = {"ephemeris_publisher", "rf_receiver"} if elements or satellite else set()
    assert those_with(nodes, "source.elements") == wanted
    # A file is found from wherever the node runs; an address stays as it is.
    place = str(tmp_path / "cbers.tle") if elements == "cbers.tle" else elements
    for name in wanted:
        found = values(nodes, name)
        assert (found["source.elements"], found["source.satellite"]) == (place, satellite)


def test_the_unit_of_systemd_gives_the_launch_file_arguments_that_it_has(tmp_path: Path) -> None:
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
    program, name = settings["LAUNCH"].split()
    assert program.endswith("/scripts/launch")
    assert name in launch_files()
    launcher = tmp_path / "launcher"
    launcher.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    launcher.chmod(0o755)
    settings |= {"SETUP": "/dev/null", "LAUNCH": f"{launcher} file", "STATION": "/etc/my dish.yaml"}
    line = shlex.split(unit["Service"]["ExecStart"].replace("%i", "gs1").replace("$$", "$"))
    done = subprocess.run(line, env=os.environ | settings, capture_output=True, text=True, check=True, timeout=60)
    first, *pairs = done.stdout.splitlines()
    arguments = dict(each.split(":=", 1) for each in pairs)
    assert (first, arguments["namespace"], arguments["station"]) == ("file", "gs1", "/etc/my dish.yaml")
    nodes = launched("single_antenna", **arguments | {"station": "leo_3m7"})
    assert {"station_executive", "station_alarms", "operator_page"} <= set(nodes)
    if shutil.which("systemd-analyze"):
        done = subprocess.run(["systemd-analyze", "verify", folder / "rf_pointing@.service"], capture_output=True, text=True,
                              timeout=60, check=False)  # fmt: skip
        assert "rf_pointing@.service:" not in done.stderr


class Action:
    """Any action of `launch`: remembers what it was made with."""

    def __init__(self, *positional: Any, **named: Any) -> None:
        self.positional, self.named = positional, named


@pytest.mark.parametrize("name", launch_files())
def test_launch_gets_every_argument_and_every_process_as_it_is(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`launch` is a stub here; its own parser refuses what is not among the choices."""
    given = STATION if name in ("single_antenna", "simulated_station") else {}

    class Configuration(Action):
        def perform(self, _context: Any) -> str:
            return given.get(self.positional[0]) or declared[self.positional[0]]["default_value"]

    contents: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": Action},
        "launch.actions": {"DeclareLaunchArgument": Action, "LogInfo": Action, "OpaqueFunction": Action},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"LifecycleNode": Action, "Node": Action},
    }
    for module_name, members in contents.items():
        stub = ModuleType(module_name)
        stub.__dict__.update(members)
        monkeypatch.setitem(sys.modules, module_name, stub)
    monkeypatch.delitem(sys.modules, "rf_pointing.ros.launch_actions", raising=False)
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.launch.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    *arguments, start = module.generate_launch_description().positional[0]
    declared = {each.positional[0]: each.named for each in arguments}
    file = launch_file(name)
    assert set(declared) == {argument.name for argument in file.arguments}
    for argument in file.arguments:
        assert declared[argument.name].get("default_value") == argument.default
        assert tuple(declared[argument.name].get("choices", ())) == argument.words
    values = file.values(given)
    processes = file.processes(values | {"namespace": f"/site/{values['namespace']}"})
    context = SimpleNamespace(launch_configurations={"ros_namespace": "/site"})
    actions = [action.named for action in start.named["function"](context, *start.named["args"])]
    monkeypatch.delitem(sys.modules, "rf_pointing.ros.launch_actions")
    assert len(actions) == len(processes)
    for action, process in zip(actions, processes, strict=True):
        assert (action["package"], action["executable"]) == (process.package, process.executable)
        assert (action["namespace"], action["output"]) == (process.namespace, "screen")
        assert (action["respawn"], action["respawn_delay"]) == (process.respawn, 0.5)
        assert (action["remappings"], action["arguments"]) == ([*process.remappings], [*process.arguments])
        assert (action["additional_env"], action["ros_arguments"]) == (process.environment, [*process.ros_arguments])
        own = next(each for each in action["parameters"] if not str(each).endswith(f"config/array_sensors/{name}.yaml"))
        if len(process.nodes) == 1:
            assert (action["name"], own) == (process.name, process.values(process.name))
            continue
        sections = yaml.safe_load(Path(own).read_text())
        Path(own).unlink()
        assert sections == {f"/**/{node}": {"ros__parameters": process.values(node)} for node in process.nodes}
