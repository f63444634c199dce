"""What the launch files share: arguments, and managed nodes that are configured and activated as they come up.

Imported by launch files only, so `launch` and `launch_ros` are needed nowhere else.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler, TimerAction
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

__all__ = ["SIMULATION_NODES", "STATION_NODES", "autostart", "common_arguments", "managed_nodes"]

STATION_NODES = (
    "monopulse_tracker",
    "conscan_tracker",
    "bias_calibrator",
    "ephemeris_publisher",
    "pointing_controller",
)
ACTIVATION_DELAY_S = 2.0
CLOCK_DELAY_S = 6.0
"""Held time reaches every node before it is activated, and every node is active before time runs."""
SIMULATION_NODES = ("simulation_clock", "antenna_servo", "rf_receiver")


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
        DeclareLaunchArgument("autostart", default_value="true", description="configure and activate the nodes"),
    ]  # fmt: skip


def managed_nodes(context: Any, names: Sequence[str]) -> list[Any]:
    """Return the actions that start `names`, configure each, and activate it once it is inactive."""

    def given(name: str) -> str:
        value: str = LaunchConfiguration(name).perform(context)
        return value

    actions: list[Any] = []
    for name in names:
        node = _node(name, given, simulated="simulation_clock" in names)
        actions.append(node)
        if given("autostart") == "true":
            actions += autostart(node)
    return actions


def _node(name: str, given: Any, *, simulated: bool) -> LifecycleNode:
    parameters: list[Any] = [given("params_file"), given("band_file")]
    if name == "simulation_clock":
        parameters.append({"start_s": float(given("start_s")), "speed": float(given("speed"))})
    else:
        parameters.append({"use_sim_time": given("use_sim_time") == "true"})
    if name == "bias_calibrator" and given("model_file"):
        parameters.append({"calibrator.model_file": given("model_file")})
    clock = [("/clock", "clock")] if simulated else []
    return LifecycleNode(
        package="rf_pointing",
        executable=name,
        name=name,
        namespace=given("namespace"),
        parameters=parameters,
        remappings=clock,
        output="screen",
    )


def autostart(node: LifecycleNode) -> list[Any]:
    """Return the actions that configure `node` at once and activate it a moment after."""

    def change(transition: int) -> EmitEvent:
        return EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition))

    delay_s = CLOCK_DELAY_S if node.node_executable == "simulation_clock" else ACTIVATION_DELAY_S
    activate = TimerAction(period=delay_s, actions=[change(Transition.TRANSITION_ACTIVATE)])
    configured = OnStateTransition(
        target_lifecycle_node=node, start_state="configuring", goal_state="inactive", entities=[activate]
    )
    return [RegisterEventHandler(configured), change(Transition.TRANSITION_CONFIGURE)]
