"""The managed nodes of one namespace, each as a process of its own: start them, take them through their lifecycle, end them."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from rclpy.node import Node

from rf_pointing.commands.lifecycle_client import LifecycleClient
from rf_pointing.commands.processes import NodeProcesses

__all__ = ["ManagedGraph", "NotStartedError"]

ACTIVATION_S = 5.0
"""How long a refused activation is tried again: the held time reaches the nodes one by one."""
ACTIVATION_PERIOD_S = 0.1
LOOK_S = 0.02


class NotStartedError(Exception):
    """Why the graph could not be brought up, or what ended."""


class ManagedGraph:
    """The nodes of `namespace`, with `parameter_files`; those `on_time` go before the others.

    `spin(timeout_s)` must run the executor of `node` once; `patience_s` is wall time to wait for any answer.
    """

    def __init__(
        self,
        node: Node,
        namespace: str,
        parameter_files: Sequence[Path],
        logs: Path,
        spin: Callable[[float], None],
        *,
        patience_s: float,
        on_time: Sequence[str] = (),
    ) -> None:
        self._spin, self._patience_s = spin, patience_s
        self._processes = NodeProcesses(namespace, parameter_files, logs, on_time)
        self._lifecycle = LifecycleClient(node, namespace, spin, self.check)

    def start(self, names: Sequence[str]) -> None:
        """Start the processes."""
        self._processes.start(names)

    def configure(self, names: Sequence[str]) -> None:
        """Wait until the nodes are there, and configure them.

        Another graph's nodes of the same names offer the same services, and must not be taken for the own ones.
        """
        self.wait_until(lambda: not self._processes.nameless(names), ", ".join(names))
        self._lifecycle.wait_for(names, self._patience_s)
        self.change(names, "configure")

    def activate(self, names: Sequence[str]) -> None:
        """Activate; a refusal is tried again for a moment."""
        deadline_s = time.monotonic() + ACTIVATION_S
        while time.monotonic() < deadline_s:
            names = self._lifecycle.change(names, "activate", self._patience_s)
            if not names:
                return
            self.wait(ACTIVATION_PERIOD_S)
        self.change(names, "activate")

    def change(self, names: Sequence[str], transition: str) -> None:
        """Take all through one transition at once; NotStartedError in the words of those that refuse."""
        refused = self._lifecycle.change(names, transition, self._patience_s)
        if refused:
            reasons = "; ".join(f"{name}: {self.complaint(name)}" for name in refused)
            raise NotStartedError(f"could not {transition} {reasons}")

    def check(self) -> None:
        """NotStartedError if a process has ended."""
        if ended := self._processes.ended():
            raise NotStartedError("; ".join(f"{name} ended: {self.complaint(name)}" for name in ended))

    def complaint(self, name: str) -> str:
        """Return the last line of a node's log, which says why it refused."""
        return self._processes.complaint(name)

    def wait(self, duration_s: float) -> None:
        """Spin for a while of wall time."""
        deadline_s = time.monotonic() + duration_s
        while time.monotonic() < deadline_s:
            self._spin(LOOK_S)

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        """Spin until `condition`; TimeoutError naming `what` when it does not come."""
        deadline_s = time.monotonic() + self._patience_s
        while not condition():
            self.check()
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"{what} not seen within {self._patience_s:.0f} s")
            self._spin(LOOK_S)

    def stop(self) -> None:
        """End every process."""
        self._processes.stop()
