"""Common part of all nodes and clients: parameters, topics, lifecycle, messages, launching."""

NODE_USAGE = "usage: NAME --ros-args [-r __ns:=/gs1] [--params-file FILE] [-p NAME:=VALUE] ..."
"""Arguments of every node; here, so that its help needs no library."""
