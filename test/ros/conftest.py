"""Without ROS there is nothing to collect here."""

import importlib.util

collect_ignore_glob = [] if importlib.util.find_spec("rclpy") else ["test_*.py"]
