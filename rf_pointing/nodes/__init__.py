"""The ROS 2 graph: one module per executable, and the few things they share.  The only code that imports rclpy."""
