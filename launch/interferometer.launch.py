"""Polarized interferometer: a simulated approach of two spacecraft, and their relative pose.

scripts/launch interferometer namespace:=interferometer
ros2 launch rf_pointing interferometer.launch.py namespace:=interferometer
"""

from launch import LaunchDescription
from rf_pointing.array_sensors.nodes.launching import INTERFEROMETER
from rf_pointing.ros.launch_actions import described


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return described(INTERFEROMETER)
