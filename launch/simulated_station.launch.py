"""The whole simulated station in one namespace, with its own simulation time.

    ros2 launch rf_pointing simulated_station.launch.py station:=my_dish.yaml namespace:=gs1 start_s:=1151384173.0

Time runs when simulation_clock is active, which is last.  Then send the track_pass goal.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction

from launch import LaunchDescription
from rf_pointing.ros.graph import NODES
from rf_pointing.ros.launching import common_arguments, managed_nodes


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return LaunchDescription(
        [
            *common_arguments(simulated=True),
            DeclareLaunchArgument(
                "start_s", default_value="1151384173.0", description="UTC seconds at which time starts"
            ),
            DeclareLaunchArgument("speed", default_value="1.0", description="factor of real time, 0 for max"),
            OpaqueFunction(function=managed_nodes, args=[NODES]),
        ]
    )
