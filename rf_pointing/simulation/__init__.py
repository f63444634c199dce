"""The whole station in one process, without ROS."""

from rf_pointing.simulation.pass_simulation import PassLog, StationSetup, simulate_pass

__all__ = ["PassLog", "StationSetup", "simulate_pass"]
