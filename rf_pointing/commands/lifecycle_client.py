"""Bring managed nodes through their lifecycle, all of them at once, and say which one refused."""

import time
from collections.abc import Callable, Sequence
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node

__all__ = ["LifecycleClient"]

TRANSITIONS = {
    "configure": Transition.TRANSITION_CONFIGURE,
    "activate": Transition.TRANSITION_ACTIVATE,
    "deactivate": Transition.TRANSITION_DEACTIVATE,
}


class LifecycleClient:
    """Calls change_state of the nodes of one namespace.

    `spin(timeout_s)` must run the executor of `node` once; `alive` raises when waiting has become pointless.
    """

    def __init__(self, node: Node, namespace: str, spin: Callable[[float], None], alive: Callable[[], None]) -> None:
        self._node, self._namespace, self._spin, self._alive = node, namespace, spin, alive
        self._clients: dict[str, Any] = {}

    def wait_for(self, names: Sequence[str], timeout_s: float) -> None:
        """Wait until every node offers its lifecycle."""
        self._clients |= {
            name: self._node.create_client(ChangeState, f"{self._namespace}/{name}/change_state") for name in names
        }
        deadline_s = time.monotonic() + timeout_s
        while missing := [name for name in names if not self._clients[name].service_is_ready()]:
            self._alive()
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"{', '.join(missing)} did not appear within {timeout_s:.0f} s")
            self._spin(0.02)

    def change(self, names: Sequence[str], transition: str, timeout_s: float) -> list[str]:
        """Take every node through `transition` at once; return those that refused."""
        request = ChangeState.Request(transition=Transition(id=TRANSITIONS[transition]))
        waiting = {name: self._clients[name].call_async(request) for name in names}
        deadline_s = time.monotonic() + timeout_s
        while not all(future.done() for future in waiting.values()):
            self._alive()
            if time.monotonic() > deadline_s:
                late = [name for name, future in waiting.items() if not future.done()]
                raise TimeoutError(f"{', '.join(late)} did not {transition} within {timeout_s:.0f} s")
            self._spin(0.02)
        return [name for name, future in waiting.items() if not future.result().success]
