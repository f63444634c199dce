"""Nodes of other packages, a vendor's driver for example, are turned and watched here."""

from contextlib import suppress
from typing import Any

from rclpy.executors import ExternalShutdownException

from rf_pointing.ros.main_loop import DEAF, LONGEST_WAIT_S, HangWatch, leave, make_executor
from rf_pointing.station.log_lines import say


def spin_watched(node: Any) -> None:
    """Turn a node of another class than ManagedNode, a driver for example, until its context ends.

    The process ends with `DEAF` where a thread of DDS hangs: its launch file starts it again.
    """
    watch, executor = HangWatch(), make_executor(node.context)
    executor.add_node(node)
    watch.begin(spin_watched.__code__)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        while node.context.ok():
            # A message that was damaged cannot be read.
            with suppress(ValueError):
                executor.spin_once(timeout_sec=LONGEST_WAIT_S)
            if hung := watch.come_round():
                say(node.get_name(), f"the node ends, and must be started again: {hung}", "FATAL")
                leave(DEAF)
