"""Brains of the nodes that are clients of a station, without ROS and stepped by time."""
