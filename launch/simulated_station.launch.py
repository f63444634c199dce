"""The whole simulated station in one namespace, with its own simulation time.

    scripts/launch simulated_station station:=my_dish.yaml namespace:=gs1 start_s:=1151384173.0
    ros2 launch rf_pointing simulated_station.launch.py station:=my_dish.yaml namespace:=gs1 start_s:=1151384173.0

Time runs when simulation_clock is active, which is last.  Then send the track_pass goal.
"""

from launch import LaunchDescription
from rf_pointing.ros.launch_actions import described
from rf_pointing.ros.launching import SIMULATED_STATION


def generate_launch_description() -> LaunchDescription:
    """Return the description."""
    return described(SIMULATED_STATION)
