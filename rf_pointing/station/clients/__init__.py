"""Brains of the nodes that are clients of the station, without ROS and stepped by time."""
