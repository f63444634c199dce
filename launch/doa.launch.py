"""DOA: a simulated satellite whose array receives ground stations, and its attitude.

scripts/launch doa namespace:=doa
ros2 launch rf_pointing doa.launch.py namespace:=doa
"""

from launch import LaunchDescription
from rf_pointing.array_sensors.nodes.launching import DOA
from rf_pointing.ros.launch_actions import described


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return described(DOA)
