"""The nodes that a station with drivers of its own for antenna and receiver keeps.

    ros2 launch rf_pointing single_antenna.launch.py station:=my_dish.yaml namespace:=gs1

Every node configures and activates itself; a station that manages lifecycles itself passes
autostart:=false.
"""

from launch.actions import OpaqueFunction

from launch import LaunchDescription
from rf_pointing.nodes.graph import STATION_NODES
from rf_pointing.nodes.launching import common_arguments, managed_nodes


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return LaunchDescription([*common_arguments(), OpaqueFunction(function=managed_nodes, args=[STATION_NODES])])
