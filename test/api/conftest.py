"""Without ROS only the modules that need none are collected."""

import importlib.util

collect_ignore_glob = [] if importlib.util.find_spec("rclpy") else ["test_live.py", "test_live_requests.py"]
