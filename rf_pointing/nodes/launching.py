"""What the launch files share: arguments, and nodes that bring themselves up after every start.

Imported by launch files only, so `launch` and `launch_ros` are needed nowhere else.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

RESPAWN_DELAY_S = 0.5


def common_arguments(*, simulated: bool = False) -> list[DeclareLaunchArgument]:
    """Return the arguments that every launch file takes."""
    share = Path(get_package_share_directory("rf_pointing")) / "config"
    return [
        DeclareLaunchArgument("namespace", default_value="gs1", description="namespace of the antenna"),
        DeclareLaunchArgument("params_file", default_value=str(share / "dss13.yaml"), description="station parameters"),
        DeclareLaunchArgument("band_file", default_value=str(share / "band_x.yaml"), description="band parameters"),
        DeclareLaunchArgument("model_file", default_value=str(share / "bias_model_dss13.yaml") if simulated else "",
                              description="pointing model in force"),
        DeclareLaunchArgument("use_sim_time", default_value=str(simulated).lower(), description="time from /clock"),
        DeclareLaunchArgument("autostart", default_value="true", description="nodes configure and activate themselves"),
        DeclareLaunchArgument("state_folder", default_value=str(state_folder()),
                              description="folder of what the antenna remembers over a restart; empty: nothing"),
        DeclareLaunchArgument("respawn", default_value="true", description="start nodes again that have ended"),
    ]  # fmt: skip


def state_folder() -> Path:
    """Return the folder of the user's state for the present ROS domain."""
    base = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return Path(base).expanduser() / "rf_pointing" / f"domain{os.environ.get('ROS_DOMAIN_ID') or 0}"


def managed_nodes(context: Any, names: Sequence[str]) -> list[Any]:
    """Return the actions that start `names`."""
    return [_node(context, name, simulated="simulation_clock" in names) for name in names]


def _node(context: Any, name: str, *, simulated: bool) -> LifecycleNode:
    def given(argument: str) -> str:
        return str(LaunchConfiguration(argument).perform(context))

    parameters: list[Any] = []
    if name == "antenna_servo" and given("state_folder"):
        # A latched fault and the turn of the cables must outlive a crash; two antennas keep two
        # folders.
        kept = Path(given("state_folder")) / given("namespace").strip("/")
        files = {"state_file": str(kept / "antenna_servo.json"), "wrap_file": str(kept / "azimuth_turn.json")}
        parameters.append(files)
    # Later parameters override earlier ones: a station's own files those, the band the station,
    # the arguments all.
    parameters += [given("params_file"), given("band_file")]
    if name == "simulation_clock":
        parameters.append({"start_s": float(given("start_s")), "speed": float(given("speed"))})
    else:
        parameters.append({"use_sim_time": given("use_sim_time") == "true"})
    # An empty argument keeps the model file of the parameter file.
    if name == "bias_calibrator" and given("model_file"):
        parameters.append({"calibrator.model_file": given("model_file")})
    parameters.append({"lifecycle.autostart": given("autostart") == "true"})
    # Each antenna has its own simulation time; without the clock node, /clock is the user's.
    clock = [("/clock", "clock")] if simulated else []
    return LifecycleNode(
        package="rf_pointing",
        executable=name,
        name=name,
        namespace=given("namespace"),
        parameters=parameters,
        remappings=clock,
        respawn=given("respawn") == "true",
        respawn_delay=RESPAWN_DELAY_S,
        output="screen",
    )
