"""Common part of all nodes and clients: parameters, topics, lifecycle, messages, launching."""

NODE_USAGE = """usage: NAME --ros-args [-r __ns:=/gs1] [--params-file FILE] [-p NAME:=VALUE] ...
A managed node: `ros2 lifecycle set /gs1/NAME configure`, then `activate`, or at its start
-p lifecycle.autostart:=true, as the launch files give it."""
"""Arguments of every node; here, so that its help needs no library."""
