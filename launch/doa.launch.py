"""DOA: a simulated satellite whose array receives ground stations, and its attitude.

ros2 launch rf_pointing doa.launch.py namespace:=doa
"""

from launch import LaunchDescription
from rf_pointing.array_sensors.nodes.launching import array_description


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return array_description("doa")
