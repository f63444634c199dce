"""The nodes of a real station: with antenna_servo where its description names a drive.

    scripts/launch single_antenna station:=my_dish.yaml namespace:=gs1
    ros2 launch rf_pointing single_antenna.launch.py station:=my_dish.yaml namespace:=gs1

Every node configures and activates itself; a station that manages lifecycles itself passes
autostart:=false.  Arguments and processes: rf_pointing/ros/launching.py.
"""

from launch import LaunchDescription
from rf_pointing.ros.launch_actions import described
from rf_pointing.ros.launching import SINGLE_ANTENNA


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return described(SINGLE_ANTENNA)
