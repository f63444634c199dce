"""What clients of the station may do and see, without ROS and stepped by time."""
