"""Ground-station antenna pointing: a ROS-free numeric core, and in `nodes` the ROS 2 graph around
it.
"""

__version__ = "0.1.0"
