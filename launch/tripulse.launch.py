"""Tripulse: the simulated satellite, a receiver in the namespace of each station, and the attitude.

scripts/launch tripulse namespace:=tripulse
ros2 launch rf_pointing tripulse.launch.py namespace:=tripulse
"""

from launch import LaunchDescription
from rf_pointing.array_sensors.nodes.launching import TRIPULSE
from rf_pointing.ros.launch_actions import described


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return described(TRIPULSE)
