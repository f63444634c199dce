"""Tripulse: the simulated satellite, a receiver in the namespace of each station, and the attitude.

ros2 launch rf_pointing tripulse.launch.py namespace:=tripulse
"""

from launch import LaunchDescription
from rf_pointing.array_sensors.nodes.launching import array_description


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return array_description("tripulse")
