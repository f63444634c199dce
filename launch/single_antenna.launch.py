"""The nodes of a real station: with antenna_servo where its description names a drive.

    ros2 launch rf_pointing single_antenna.launch.py station:=my_dish.yaml namespace:=gs1

Every node configures and activates itself; a station that manages lifecycles itself passes
autostart:=false.
"""

from launch.actions import OpaqueFunction

from launch import LaunchDescription
from rf_pointing.ros.graph import STATION_NODES
from rf_pointing.ros.launching import common_arguments, station_nodes


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return LaunchDescription([*common_arguments(), OpaqueFunction(function=station_nodes, args=[STATION_NODES])])
