"""The process around a node: its arguments, its executor, and the loop that ends under control.

Every executable of a managed node is `run(NodeType)`.
"""

import gc
import re
import signal
import sys
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

__all__ = ["make_executor", "run", "settle_garbage"]

_USAGE = "usage: NAME --ros-args [-r __ns:=/gs1] [--params-file FILE] [-p NAME:=VALUE] ..."
_IN_THE_SOURCE = re.compile(r"\s*, at \S+\.c(pp)?:\d+")
"""Where in its own source rcl noticed what is wrong."""


def make_executor(context: Any = None) -> Any:
    """Return the executor that costs least: events where this rclpy has it, else single-threaded.

    It is driven by `spin_once` in a loop: `EventsExecutor.spin` burns a core without running a callback in some releases.
    """
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def settle_garbage() -> None:
    """Take what was imported out of the garbage collector's rounds: it would be looked through again and again."""
    gc.collect()
    gc.freeze()


def run(node_type: Callable[[], Any]) -> None:
    """Run one node until SIGINT or SIGTERM; an active node is deactivated first, so that motion ends under control.

    A refused start prints one line and exits with 2; `--help` prints the docstring of the node's module.
    """
    asked: list[int] = []
    try:
        _take_arguments(str(sys.modules[node_type.__module__].__doc__))
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        for sign in (signal.SIGINT, signal.SIGTERM):
            signal.signal(sign, lambda number, _frame: asked.append(number))
        node = node_type()
    except (RuntimeError, ValueError) as error:
        print(f"rf_pointing: not started: {_IN_THE_SOURCE.sub('', str(error))}", file=sys.stderr)
        rclpy.try_shutdown()
        sys.exit(2)
    executor = make_executor()
    executor.add_node(node)
    settle_garbage()
    while not asked:
        node.bring_up()
        executor.spin_once(timeout_sec=node.turn())
    node.end()
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()


def _take_arguments(description: str) -> None:
    """Leave by SystemExit where help is asked for; ValueError for what is no argument of ROS, which nobody would heed."""
    given = remove_ros_args(sys.argv)[1:]
    if {"-h", "--help"} & set(given):
        print(f"{description}\n{_USAGE}")
        sys.exit(0)
    if given:
        raise ValueError(f"argument {given[0]!r} is not known; {_USAGE}")
