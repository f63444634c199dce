"""Common part of the launch files of the array sensors; imported by launch files only."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK
from rf_pointing.ros.launching import RESPAWN_DELAY_S, network_argument, network_environment


def array_description(name: str) -> LaunchDescription:
    """Return the simulated graph `name` of ARRAY_SYSTEMS, with simulation time of its own that runs
    at real speed.
    """
    parameters = Path(get_package_share_directory("rf_pointing")) / "config" / f"{name}.yaml"
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "namespace", default_value=name, description="namespace of the graph"
            ),
            DeclareLaunchArgument(
                "params_file", default_value=str(parameters), description="parameters of its nodes"
            ),
            DeclareLaunchArgument(
                "autostart",
                default_value="true",
                description="nodes configure and activate themselves",
            ),
            network_argument(),
            OpaqueFunction(function=lifecycle_nodes, args=[(CLOCK, *ARRAY_SYSTEMS[name].nodes)]),
        ]
    )


def lifecycle_nodes(context: Any, names: Sequence[str]) -> list[Any]:
    namespace, parameters, start, network = (
        LaunchConfiguration(argument).perform(context)
        for argument in ("namespace", "params_file", "autostart", "network")
    )
    actions: list[Any] = []
    for name in names:
        *below, executable = name.split("/")
        node = LifecycleNode(
            package="rf_pointing",
            executable=executable,
            name=executable,
            namespace="/".join([namespace, *below]),
            parameters=[
                parameters,
                {"use_sim_time": executable != CLOCK, "lifecycle.autostart": start == "true"},
            ],
            # Every graph has a clock of its own, so two graphs may run at different times on one
            # machine.
            remappings=[("/clock", f"/{namespace.strip('/')}/clock")],
            additional_env=network_environment(network),
            respawn=start == "true",
            respawn_delay=RESPAWN_DELAY_S,
            output="screen",
        )
        actions.append(node)
    return actions
