"""Executable `station_process`: several nodes of an antenna in one process.

Each is the node of the executable NAME, with its name, parameters, lifecycle and diagnostics.  One
that has failed is started again alone, half a second later; one that receives nothing ends the
process with 3.  A parameter file gives each its own (`/**/NAME:`); what follows `--ros-args` is for
all of them.  They share one participant of DDS: 65 MB less memory each, and messages between them
pass no socket.  /diagnostics (`process`) reports restarts, and when a node has held up the others.

    ros2 run rf_pointing station_process antenna_servo rf_receiver --ros-args -r __ns:=/gs1

`--no-restart` leaves a node that has ended as it is.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from rclpy.utilities import remove_ros_args

from rf_pointing.ros.lifecycle import Lifecycle
from rf_pointing.ros.main_loop import run

ROOMS = ("rf_pointing.nodes", "rf_pointing.array_sensors.nodes")


def node_type(name: str) -> Callable[[], Any]:
    """Return the class of the node of an executable; ValueError for another name."""
    for module in (f"{room}.{name}" for room in ROOMS):
        if name.isidentifier() and find_spec(module) is not None:
            for each in vars(import_module(module)).values():
                if isinstance(each, type) and issubclass(each, Lifecycle) and each.__module__ == module:
                    return each
    raise ValueError(f"{name!r} is not the executable of a node")


def main() -> None:
    """Entry point of `ros2 run rf_pointing station_process`."""
    words = remove_ros_args(sys.argv)[1:]
    try:
        kinds = [node_type(word) for word in words if not word.startswith("-")]
        if not kinds and words not in (["--help"], ["-h"]):
            raise ValueError("no node is named")
    except ValueError as error:
        print(f"rf_pointing: not started: {error}", file=sys.stderr)
        sys.exit(2)
    known = [word for word in words if word == "--no-restart" or not word.startswith("-")]
    run(*kinds, description=str(__doc__), known=known, restart="--no-restart" not in words)
