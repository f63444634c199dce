"""ROS 2 nodes of the array sensors, and their simulated graphs."""
