"""Launch files as `launch` wants them, made from the processes of `ros/launching.py`.

Imported by launch files only, so `launch` and `launch_ros` are needed nowhere else.
"""

import tempfile
from pathlib import Path
from typing import Any

import yaml
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node

from launch import LaunchDescription
from rf_pointing.ros.launching import PACKAGE, Argument, LaunchFile, Process, adopt_state, full_namespace
from rf_pointing.ros.main_loop import RESTART_S


def described(file: LaunchFile) -> LaunchDescription:
    """Return the description of a launch file."""
    declared = [_declared(argument) for argument in file.arguments]
    return LaunchDescription([*declared, OpaqueFunction(function=_actions, args=[file])])


def _declared(argument: Argument) -> DeclareLaunchArgument:
    more = {"choices": list(argument.words)} if argument.words else {}
    if argument.default is not None:
        more["default_value"] = argument.default
    return DeclareLaunchArgument(argument.name, description=argument.description, **more)


def _actions(context: Any, file: LaunchFile) -> list[Any]:
    names = [argument.name for argument in file.arguments]
    values = file.values({name: str(LaunchConfiguration(name).perform(context)) for name in names})
    # What an antenna keeps, its frames and its enclave belong to the namespace of its nodes.
    former, pushed = values["namespace"], context.launch_configurations.get("ros_namespace", "")
    values["namespace"] = full_namespace(pushed, former)
    said = [LogInfo(msg=words) for words in [adopt_state(values, former)] if words]
    return [*said, *(_action(process) for process in file.processes(values))]


def _action(process: Process) -> Node:
    """Return the action that starts one process."""
    kind = LifecycleNode if process.package == PACKAGE else Node
    named = {"name": process.nodes[0]}
    # Names and parameters of several nodes are in a file.
    if len(process.nodes) > 1:
        kind, named = Node, {}
    return kind(
        package=process.package, executable=process.executable, namespace=process.namespace,
        parameters=[each if isinstance(each, str) else _values(process, each) for each in process.parameters],
        remappings=list(process.remappings), arguments=list(process.arguments),
        ros_arguments=list(process.ros_arguments), additional_env=dict(process.environment),
        respawn=process.respawn, respawn_delay=RESTART_S, output="screen", **named,
    )  # fmt: skip


def _values(process: Process, given: Any) -> Any:
    if len(process.nodes) == 1:
        return dict(given[process.nodes[0]])
    sections = {f"/**/{name}": {"ros__parameters": own} for name, own in given.items()}
    with tempfile.NamedTemporaryFile("w", prefix="rf_pointing-", suffix=".yaml", delete=False) as file:
        yaml.safe_dump(sections, file)
    return str(Path(file.name))
