"""Brains of the nodes that act for an operator or another program: stepped by time, without ROS."""
