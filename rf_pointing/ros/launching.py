"""Common part of the launch files: arguments, and nodes that bring themselves up after every start.

Imported by launch files only, so `launch` and `launch_ros` are needed nowhere else.
"""

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node

from rf_pointing.core import Sensor
from rf_pointing.ros.graph import (
    ALARMS,
    ARRAY_NODES,
    DESCRIPTION,
    EXECUTIVE,
    OPERATOR_PAGE,
    ROTCTLD,
    partition,
    with_receiver,
)
from rf_pointing.ros.main_loop import DRIVE_PRIORITY
from rf_pointing.station.antenna.memory import state_files, state_folder
from rf_pointing.station.description import StationDescription, read_station
from rf_pointing.station.description.urdf import urdf

RESPAWN_DELAY_S = 0.5
# The publisher predicts the target, and the simulated receiver receives it.
SEES_TARGET = ("ephemeris_publisher", "rf_receiver", "signal_source")
# What decides who can reach the nodes; an integrator who sets one of them has decided.
DISCOVERY = ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DISCOVERY_SERVER")


def common_arguments(*, simulated: bool = False) -> list[DeclareLaunchArgument]:
    """Return the arguments that every launch file takes."""
    station = "station description: a YAML file, or a shipped name"
    # A real antenna must not move by the numbers of another one: launch requires a station.
    named = {"default_value": "dss13"} if simulated else {}
    return [
        DeclareLaunchArgument("namespace", default_value="gs1", description="namespace of the antenna"),
        DeclareLaunchArgument("station", description=station, **named),
        DeclareLaunchArgument("band", default_value="", description="band in use; empty: the station's default"),
        DeclareLaunchArgument(
            "elements", default_value="", description="TLE, OMM or OEM: a file, a folder of files, or an address"
        ),
        DeclareLaunchArgument(
            "satellite", default_value="", description="first target, by name or number; empty: the first of elements"
        ),
        DeclareLaunchArgument("params_file", default_value="", description="ROS parameters over all others"),
        DeclareLaunchArgument("use_sim_time", default_value=str(simulated).lower(), description="time from /clock"),
        DeclareLaunchArgument("autostart", default_value="true", description="nodes configure and activate themselves"),
        DeclareLaunchArgument(
            "state_folder",
            default_value=str(state_folder()),
            description="folder of what the antenna remembers over a restart; empty: nothing",
        ),
        network_argument(),
        DeclareLaunchArgument("executive", default_value="false", description="whether station_executive is started"),
        DeclareLaunchArgument("alarms", default_value="true", description="whether station_alarms starts"),
        DeclareLaunchArgument(
            "description", default_value="true", description="whether viewers get URDF, tf and markers of the station"
        ),
        DeclareLaunchArgument("rotctld", default_value="false", description="whether rotctld_server is started"),
        DeclareLaunchArgument("page", default_value="false", description="whether operator_page is started"),
        DeclareLaunchArgument("respawn", default_value="true", description="start nodes again that have ended"),
        DeclareLaunchArgument(
            "processes",
            # Nodes of a real station do not share each other's faults unless the user says so.
            default_value="2" if simulated else "8",
            description="1, 2 (what moves, and the other nodes), 8: one for each; a real drive always has its own",
        ),
    ]


def network_argument() -> DeclareLaunchArgument:
    """Return the argument that says which computers may reach the nodes."""
    return DeclareLaunchArgument(
        "network",
        default_value="loopback",
        description="loopback: this computer alone; environment: as the DDS settings of the environment say",
    )


def network_environment(network: str) -> dict[str, str]:
    """Return the environment of the nodes: nothing leaves this computer unless the user has chosen.

    Raises
    ------
    ValueError
        When the argument is neither `loopback` nor `environment`.
    """
    if network not in ("loopback", "environment"):
        raise ValueError(f"network:={network} must be loopback or environment")
    if network == "environment" or any(os.environ.get(name) for name in DISCOVERY):
        return {}
    if os.environ.get("RMW_IMPLEMENTATION") not in (None, "", "rmw_fastrtps_cpp"):
        # The profile is one of Fast DDS.
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    profile = Path(get_package_share_directory("rf_pointing")) / "config" / "fastdds_loopback.xml"
    return {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}


def managed_nodes(context: Any, names: Sequence[str]) -> list[Any]:
    """Return the actions that start `names`, and an array's where the band names that sensor."""
    simulated = "simulation_clock" in names
    station = _station(context)
    names = (*with_receiver(names, station.receiver if station else "simulated"),
             *_array_nodes(context, simulated=simulated))  # fmt: skip
    wanted = {"alarms": ALARMS, "executive": EXECUTIVE, "page": OPERATOR_PAGE, "rotctld": ROTCTLD}
    more = [name for argument, name in wanted.items() if LaunchConfiguration(argument).perform(context) == "true"]
    shown: list[Any] = []
    if LaunchConfiguration("description").perform(context) == "true":
        names, shown = (*names, DESCRIPTION), _state_publisher(context, simulated=simulated)
    processes = int(LaunchConfiguration("processes").perform(context))
    given = {name: _parameters(context, name, simulated=simulated) for name in (*names, *more)}
    if shown:
        given[DESCRIPTION]["view.publish_tf"] = False
    rooms = partition((*names, *more), processes)
    return [_process(context, {name: given[name] for name in room}, simulated=simulated) for room in rooms] + shown


def station_nodes(context: Any, names: Sequence[str]) -> list[Any]:
    """Return the actions that start `names`, and the antenna's own where the station has a drive.

    A station whose drive is simulated has a driver of its own on joint_trajectory.
    """
    station = _station(context)
    simulated = station is None or station.drive["type"] == "simulated"
    return managed_nodes(context, names if simulated else ("antenna_servo", *names))


def _array_nodes(context: Any, *, simulated: bool) -> tuple[str, ...]:
    """Return the nodes of the array on the dish; a real array has receivers of its own."""
    station, band = _station(context), str(LaunchConfiguration("band").perform(context))
    try:
        has_array = station is not None and Sensor.ARRAY in station.sensors(band or None)
    except ValueError:
        return ()  # every node refuses the band and says why
    return (ARRAY_NODES if simulated else ARRAY_NODES[1:]) if has_array else ()


def _station(context: Any) -> StationDescription | None:
    """Return the station, None for one that every node refuses and says why."""
    try:
        return read_station(str(LaunchConfiguration("station").perform(context)))
    except (ValueError, OSError):
        return None


def _state_publisher(context: Any, *, simulated: bool) -> list[Any]:
    """Return robot_state_publisher for the station, where it is installed."""
    station = _station(context)
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        station = None
    if station is None:
        return []
    namespace = str(LaunchConfiguration("namespace").perform(context))
    return [Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        name="robot_state_publisher",
        namespace=namespace,
        parameters=[
            {"robot_description": urdf(station), "frame_prefix": f"{namespace.strip('/')}/"},
            {"use_sim_time": LaunchConfiguration("use_sim_time").perform(context) == "true"},
        ],
        remappings=[("/clock", "clock")] if simulated else [],
        additional_env=network_environment(LaunchConfiguration("network").perform(context)),
        respawn=LaunchConfiguration("respawn").perform(context) == "true",
        respawn_delay=RESPAWN_DELAY_S,
        output="screen",
    )]  # fmt: skip


def _parameters(context: Any, name: str, *, simulated: bool) -> dict[str, Any]:
    """Return the parameters of a node, as the launch arguments give them."""

    def given(argument: str) -> str:
        return str(LaunchConfiguration(argument).perform(context))

    own: dict[str, Any] = {"lifecycle.autostart": given("autostart") == "true"}
    if name == "antenna_servo" and not simulated:
        # A real drive loop comes before everything else on its computer.
        own["lifecycle.realtime_priority"] = DRIVE_PRIORITY
    if given("state_folder"):
        own |= _kept(name, Path(given("state_folder")), given("namespace"))
    if name == "simulation_clock":
        own |= {"start_s": float(given("start_s")), "speed": float(given("speed"))}
    elif name != OPERATOR_PAGE:
        # The page shows the station's own time and limits.
        own["use_sim_time"] = given("use_sim_time") == "true"
        # Relative to where launch was started, which the node does not know.
        own |= {"station": _absolute(given("station")), "band": given("band")}
    if name in SEES_TARGET and (given("elements") or given("satellite")):
        own |= {"source.elements": _absolute(given("elements")), "source.satellite": given("satellite")}
    return own


def _process(context: Any, nodes: Mapping[str, dict[str, Any]], *, simulated: bool) -> Node:
    """Return the action that starts nodes, each with its parameters, in one process."""

    def given(argument: str) -> str:
        return str(LaunchConfiguration(argument).perform(context))

    respawn = given("respawn") == "true"
    common: dict[str, Any] = {
        "package": "rf_pointing",
        "namespace": given("namespace"),
        # Each antenna has its own simulation time; without the clock node, /clock is the user's.
        "remappings": [("/clock", "clock")] if simulated else [],
        "additional_env": network_environment(given("network")),
        "respawn": respawn,
        "respawn_delay": RESPAWN_DELAY_S,
        "output": "screen",
    }
    # Last: what a user writes is in force.
    files = [given("params_file")] if given("params_file") else []
    if len(nodes) == 1:
        ((name, own),) = nodes.items()
        return LifecycleNode(
            executable=name, name=name, parameters=[own, *files],
            ros_arguments=enclave(given("namespace"), name), **common,
        )  # fmt: skip
    sections = {f"/**/{name}": {"ros__parameters": own} for name, own in nodes.items()}
    with tempfile.NamedTemporaryFile("w", prefix="rf_pointing-", suffix=".yaml", delete=False) as file:
        yaml.safe_dump(sections, file)
    return Node(
        executable="station_process", arguments=[*nodes, *([] if respawn else ["--no-restart"])],
        parameters=[file.name, *files], **common,
    )  # fmt: skip


def _kept(name: str, folder: Path, namespace: str) -> dict[str, str]:
    """Return the parameters of a node that name what is kept of this antenna in a folder."""
    files, own = state_files(folder, namespace), folder / namespace.strip("/")
    key, nights = {"command_key_file": files["command_key_file"]}, str(own / "nights")
    return {
        "antenna_servo": files,
        "pointing_controller": key,
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


def enclave(namespace: str, name: str) -> list[str]:
    """Return the arguments of a node that runs under SROS2: its own enclave, as in the policy."""
    secured = os.environ.get("ROS_SECURITY_ENABLE") == "true"
    return ["--enclave", f"/{namespace.strip('/')}/{name}"] if secured else []


def _absolute(path: str) -> str:
    return str(Path(path).resolve()) if path and Path(path).exists() else path
