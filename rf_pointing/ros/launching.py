"""Processes of every launch file, as data: arguments, nodes, parameters, remappings, restarts.

`ros/launch_actions.py` makes actions of `launch` of them, and the command `launch` runs them where
ROS has no such tool.  Both refuse the same arguments with the same words.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory

from rf_pointing.core import STANDBY, STANDBY_ROLE, Sensor
from rf_pointing.ros.graph import (
    ALARMS,
    ARRAY_NODES,
    DESCRIPTION,
    EXECUTIVE,
    NODES,
    OPERATOR_PAGE,
    PROCESSES,
    RADIO,
    ROTCTLD,
    STATION_NODES,
)
from rf_pointing.ros.main_loop import DRIVE_PRIORITY, present_holder
from rf_pointing.ros.managed_graph import partition, with_receiver, with_trackers
from rf_pointing.station.antenna.memory import move_state, state_files, state_folder
from rf_pointing.station.description import StationDescription, read_station
from rf_pointing.station.description.reading import nearest
from rf_pointing.station.description.urdf import urdf
from rf_pointing.station.pointing.succession import FIRST, SECOND

PACKAGE = "rf_pointing"
CONTROLLER = "pointing_controller"
NOTHING = "none"
"""Word for an empty value, which `ros2 launch` does not take."""
SEVERAL = "station_process"
"""Executable of a process with several nodes."""
BOOLEANS = {"true": True, "True": True, "1": True, "false": False, "False": False, "0": False}
# The publisher predicts the target, and the simulated receiver receives it.
SEES_TARGET = ("ephemeris_publisher", "rf_receiver", "signal_source")
# What decides who can reach the nodes; an integrator who sets one of them has decided.
DISCOVERY = ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DISCOVERY_SERVER")


@dataclass(frozen=True)
class Argument:
    """One argument `name:=TEXT` of a launch file; without a `default` it must be given."""

    name: str
    description: str
    default: str | None = None
    kind: type[Any] = str
    """`bool`, `int`, `float` or `str`."""
    choices: tuple[str, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """Every text that is taken; () where it is not a closed set."""
        return tuple(BOOLEANS) if self.kind is bool else self.choices

    def value(self, text: str) -> Any:
        """Return the value of a text; ValueError with name, text and what it must be."""
        if self.words and text not in self.words:
            shown = ("true", "false") if self.kind is bool else self.choices
            raise ValueError(f"{self.name}:={text} must be {' or '.join(shown)}")
        if self.kind is bool:
            return BOOLEANS[text]
        try:
            value = self.kind(text)
        except ValueError:
            value = math.nan
        if self.kind is float and not math.isfinite(value):
            raise ValueError(f"{self.name}:={text} must be a number")
        return "" if value == NOTHING else value


@dataclass(frozen=True)
class Process:
    """One process: its executable, its nodes, and what they are given."""

    executable: str
    namespace: str
    nodes: tuple[str, ...]
    parameters: tuple[Mapping[str, Mapping[str, Any]] | str, ...] = ()
    """Files, and values of each node; the last is in force."""
    remappings: tuple[tuple[str, str], ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)
    respawn: bool = True
    arguments: tuple[str, ...] = ()
    ros_arguments: tuple[str, ...] = ()
    package: str = PACKAGE

    @property
    def name(self) -> str:
        """Name of the process: that of its first node, below its namespace, of two its own."""
        return self.nodes[0] + (STANDBY if self.values(self.nodes[0]).get(STANDBY_ROLE) == SECOND else "")

    def values(self, node: str) -> dict[str, Any]:
        """Return the parameters of a node, but for those of files."""
        found: dict[str, Any] = {}
        for each in self.parameters:
            found |= {} if isinstance(each, str) else each.get(node, {})
        return found

    def command(self, folder: Path) -> list[str]:
        """Return the command line; the values become files of parameters in `folder`."""
        program = Path(get_package_prefix(self.package)) / "lib" / self.package / self.executable
        space = f"/{self.namespace.strip('/')}"
        words = [str(program), *self.arguments, "--ros-args", "-r", f"__ns:={space}"]
        words += [] if self.executable == SEVERAL else ["-r", f"__node:={self.nodes[0]}"]
        for number, each in enumerate(self.parameters):
            path = each
            if not isinstance(each, str):
                path = str(folder / f"{space[1:]}.{self.name}.{number}.yaml".replace("/", "."))
                sections = {f"/**/{node}": {"ros__parameters": dict(own)} for node, own in each.items()}
                Path(path).write_text(yaml.safe_dump(sections))
            words += ["--params-file", str(path)]
        for source, target in self.remappings:
            words += ["-r", f"{source}:={target}"]
        return [*words, *self.ros_arguments]


@dataclass(frozen=True)
class LaunchFile:
    """Arguments of one launch file, and the processes that follow from their values."""

    name: str
    about: str
    arguments: tuple[Argument, ...]
    processes: Callable[[Mapping[str, Any]], list[Process]]

    def values(self, given: Mapping[str, str]) -> dict[str, Any]:
        """Return the values of all arguments.

        Raises
        ------
        ValueError
            For a name that is not known, with the nearest one; a missing one; a wrong value.
        """
        known = {argument.name: argument for argument in self.arguments}
        for name in given:
            if name not in known:
                raise ValueError(f"{name}:= is not an argument of {self.name}{nearest(name, known)}")
        texts = {name: given.get(name, argument.default) for name, argument in known.items()}
        for name, text in texts.items():
            if text is None:
                raise ValueError(f"{name}:= must be given to {self.name}: {known[name].description}")
        return {name: known[name].value(text) for name, text in texts.items() if text is not None}


NETWORK = Argument(
    "network", "loopback: this computer alone; environment: as the DDS settings of the environment say",
    "loopback", choices=("loopback", "environment"),
)  # fmt: skip
AUTOSTART = Argument("autostart", "nodes configure and activate themselves", "true", bool)


def station_arguments(*, simulated: bool) -> tuple[Argument, ...]:
    """Return the arguments of the launch file of a station."""
    # Nodes of a real station do not share each other's faults unless the user says so.
    shared = "2" if simulated else "8"
    time = (
        Argument("start_s", "UTC seconds at which time starts; 0: now", "0.0", float),
        Argument("speed", "factor of real time, 0 for max", "1.0", float),
    )
    return (
        Argument("namespace", "namespace of the antenna", "gs1"),
        # An antenna must not move by the numbers of another one.
        Argument("station", "station description: a YAML file, or a shipped name"),
        Argument("band", "band in use; empty: the station's default", ""),
        Argument("elements", "TLE, OMM or OEM: a file, a folder of files, or an address", ""),
        Argument(
            "satellite", "first target: a name or number in elements (empty: their first), or Sun, Moon, ...", ""
        ),
        Argument("params_file", "ROS parameters over all others", ""),
        Argument("use_sim_time", "time from /clock", str(simulated).lower(), bool),
        AUTOSTART,
        Argument(
            "state_folder", "folder of what the antenna remembers over a restart; none: nothing", str(state_folder())
        ),
        NETWORK,
        Argument("executive", "whether station_executive is started", "false", bool),
        Argument("alarms", "whether station_alarms starts", "true", bool),
        Argument("description", "whether viewers get URDF, tf and markers of the station", "true", bool),
        Argument("rotctld", "whether rotctld_server is started", "false", bool),
        Argument(
            "standby", "a second pointing_controller that takes over: here, elsewhere (on another computer), only "
            "(this is that computer)", NOTHING, choices=(NOTHING, "here", "elsewhere", "only"),
        ),
        Argument("radio", "whether radio_control is started", "false", bool),
        Argument("page", "whether operator_page is started", "false", bool),
        Argument("respawn", "start nodes again that have ended", "true", bool),
        Argument(
            "processes", "1, 2 (what moves, and the other nodes), 8: one for each; a real drive always has its own",
            shared, int, tuple(map(str, PROCESSES)),
        ),
        *(time if simulated else ()),
    )  # fmt: skip


def network_environment(network: str) -> dict[str, str]:
    """Return the environment of the nodes: none leaves this computer unless the user has chosen."""
    if network == "environment" or any(os.environ.get(name) for name in DISCOVERY):
        return {}
    if os.environ.get("RMW_IMPLEMENTATION") not in (None, "", "rmw_fastrtps_cpp"):
        # The profile is one of Fast DDS.
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    profile = Path(get_package_share_directory(PACKAGE)) / "config" / "fastdds_loopback.xml"
    return {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}


def simulated_station(values: Mapping[str, Any]) -> list[Process]:
    """Return the processes of a simulated station with time of its own."""
    return _station_processes(values, read_station(values["station"]), NODES)


def single_antenna(values: Mapping[str, Any]) -> list[Process]:
    """Return the processes of a real station: with the antenna's own where it has a drive.

    A station whose drive is simulated has a driver of its own on joint_trajectory.
    """
    station = read_station(values["station"])
    own = () if station.drive["type"] == "simulated" else ("antenna_servo",)
    names = with_trackers((*own, *STATION_NODES), station.every_sensor, station.receiver)
    return _station_processes(values, station, names)


def _station_processes(
    values: Mapping[str, Any], station: StationDescription, names: Sequence[str]
) -> list[Process]:  # fmt: skip
    simulated = "simulation_clock" in names
    if values["params_file"] and not Path(values["params_file"]).is_file():
        raise ValueError(f"params_file:={values['params_file']} does not exist")
    # Refuses an unknown band; the array may be that of another one.
    _ = station.sensors(values["band"] or None)
    if Sensor.ARRAY in station.every_sensor:
        # A real array has receivers of its own.
        names = (*names, *(ARRAY_NODES if simulated else ARRAY_NODES[1:]))
    if values["description"]:
        names = (*names, DESCRIPTION)
    if values["radio"] and station.content.radio is None:
        raise ValueError(f"radio:=true needs the section radio, which {values['station']} has not")
    wanted = {"alarms": ALARMS, "executive": EXECUTIVE, "page": OPERATOR_PAGE, "radio": RADIO, "rotctld": ROTCTLD}
    names = (*with_receiver(names, station.receiver), *(name for argument, name in wanted.items() if values[argument]))
    given = {name: _parameters(values, name, simulated=simulated) for name in names}
    if simulated and station.receiver != "simulated":
        given["simulation_clock"]["errors_in_time"] = False
    space, respawn = values["namespace"], values["respawn"]
    # Each antenna has its own simulation time; without the clock node, /clock is the user's.
    remappings = (("/clock", "clock"),) if simulated else ()
    environment = network_environment(values["network"])
    shown: list[Process] = []
    if values["description"] and _has("robot_state_publisher"):
        given[DESCRIPTION]["view.publish_tf"] = False
        own = {
            "robot_description": urdf(station), "frame_prefix": f"{space.strip('/')}/",
            "use_sim_time": values["use_sim_time"],
        }  # fmt: skip
        name = "robot_state_publisher"
        shown = [Process(name, space, (name,), ({name: own},), remappings, environment, respawn, package=name)]
    # Last: what a user writes is in force.
    files = (values["params_file"],) if values["params_file"] else ()

    def process(room: tuple[str, ...], **more: str) -> Process:
        alone = len(room) == 1
        return Process(
            executable=room[0] if alone else SEVERAL, namespace=space, nodes=room,
            parameters=({name: given[name] | more for name in room}, *files), remappings=remappings,
            environment=environment, respawn=respawn,
            arguments=() if alone else room if respawn else (*room, "--no-restart"),
            ros_arguments=enclave(space, room[0]) if alone else (),
        )  # fmt: skip

    second = [process((CONTROLLER,), **{STANDBY_ROLE: SECOND})] if values["standby"] in ("here", "only") else []
    if values["standby"] == "only":
        return second
    if values["standby"]:
        given[CONTROLLER][STANDBY_ROLE] = FIRST
    return [*map(process, partition(names, values["processes"])), *second, *shown]


def full_namespace(pushed: str, namespace: str) -> str:
    """Return the namespace that `launch` gives nodes: below the one `pushed`, unless absolute."""
    joined = namespace if namespace.startswith("/") else f"{pushed}/{namespace}"
    return "".join(f"/{part}" for part in joined.split("/") if part)


def adopt_state(values: Mapping[str, Any], former: str) -> str:
    """Move what an antenna kept below its `namespace:=` alone; return what was moved.

    Two sites that include the file with the same `former` one shared it: the first takes it,
    unless an antenna of that namespace runs.
    """
    folder, space = values.get("state_folder"), values["namespace"]
    servo = f"/{former.strip('/')}/antenna_servo"
    if not folder or space.strip("/") == former.strip("/") or present_holder(servo) is not None:
        return ""
    return move_state(Path(folder), former, space)


def _has(package: str) -> bool:
    try:
        return bool(get_package_prefix(package))
    except PackageNotFoundError:
        return False


def _parameters(values: Mapping[str, Any], name: str, *, simulated: bool) -> dict[str, Any]:
    """Return the parameters of a node, as the launch arguments give them."""
    own: dict[str, Any] = {"lifecycle.autostart": values["autostart"]}
    if name == "antenna_servo" and not simulated:
        # A real drive loop comes before everything else on its computer.
        own["lifecycle.realtime_priority"] = DRIVE_PRIORITY
    if values["state_folder"]:
        own |= _kept(name, Path(values["state_folder"]), values["namespace"])
    if name == "simulation_clock":
        own |= {"start_s": values["start_s"], "speed": values["speed"]}
    elif name != OPERATOR_PAGE:
        # The page shows the station's own time and limits.
        own["use_sim_time"] = values["use_sim_time"]
        # Relative to where launch was started, which the node does not know.
        own |= {"station": _absolute(values["station"]), "band": values["band"]}
    if name in SEES_TARGET and (values["elements"] or values["satellite"]):
        own |= {"source.elements": _absolute(values["elements"]), "source.satellite": values["satellite"]}
    return own


def _kept(name: str, folder: Path, namespace: str) -> dict[str, str]:
    """Return the parameters of a node that name what is kept of this antenna in a folder."""
    files, own = state_files(folder, namespace), folder / namespace.strip("/")
    key, nights = {"command_key_file": files["command_key_file"]}, str(own / "nights")
    return {
        "antenna_servo": files,
        "pointing_controller": key,
        "ephemeris_publisher": {"publisher.learned_file": str(own / "learned_times.json")},
        ROTCTLD: key,
        ALARMS: {"folder": nights},
        EXECUTIVE: {
            **key,
            "executive.state_file": str(own / f"{EXECUTIVE}.json"),
            "executive.folder": nights,
            # The antennas of a folder may share their passes.
            "executive.partners_key_file": str(folder / "partners.key"),
        },
        OPERATOR_PAGE: {**key, "page.reports": nights},
    }.get(name, {})


def enclave(namespace: str, name: str) -> tuple[str, ...]:
    """Return the arguments of a node that runs under SROS2: its own enclave, as in the policy."""
    secured = os.environ.get("ROS_SECURITY_ENABLE") == "true"
    return ("--enclave", f"/{namespace.strip('/')}/{name}") if secured else ()


def _absolute(path: str) -> str:
    return str(Path(path).resolve()) if path and Path(path).exists() else path


SIMULATED_STATION = LaunchFile(
    "simulated_station", "the whole simulated station, with its own simulation time",
    station_arguments(simulated=True), simulated_station,
)  # fmt: skip
SINGLE_ANTENNA = LaunchFile(
    "single_antenna", "the nodes of a real station: with antenna_servo where its description names a drive",
    station_arguments(simulated=False), single_antenna,
)  # fmt: skip
GROUP = "rf_pointing.launch_files"
"""Entry point group of further launch files, by their names."""


def launch_files() -> dict[str, Callable[[], LaunchFile]]:
    """Return every launch file by its name; those of other rooms are read when they are called."""
    more = {point.name: point.load for point in entry_points(group=GROUP)}
    own = {each.name: lambda each=each: each for each in (SINGLE_ANTENNA, SIMULATED_STATION)}
    return {**own, **more}
