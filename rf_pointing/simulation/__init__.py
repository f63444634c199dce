"""The whole station in one process, without ROS."""

from rf_pointing.simulation.kinematic_station import KinematicParams, KinematicStation
from rf_pointing.simulation.pass_simulation import PassLog, StationSetup, simulate_pass

__all__ = ["KinematicParams", "KinematicStation", "PassLog", "StationSetup", "simulate_pass"]
