"""The ROS 2 graph: one module per executable, and what they share."""
