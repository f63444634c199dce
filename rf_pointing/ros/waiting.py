"""How a client waits, in wall time, for what others do: nodes, answers, goals.

Everything that waits handles the events of its node meanwhile, notices at once what makes waiting
vain, and gives up after a time with what is missing.
"""

import time
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.node import Node

LOOK_S = 0.02
"""Longest wait for one event where something is awaited."""
# Time in which the executor takes up a client that was just made; an answer that arrives in that
# moment is not noticed (1 of 1700 calls).
TAKEN_UP_S = 0.02


class Answer(Protocol):
    """A future, or a `RepeatedCall`."""

    def done(self) -> bool:
        """Return whether the answer is there."""

    def result(self) -> Any:
        """Return the answer."""


class Waiting:
    """Waits at most `patience_s`; `spin(timeout_s)` must run the executor once.

    `check` raises when waiting is in vain, as when a process has ended.
    """

    def __init__(
        self, spin: Callable[[float], None], patience_s: float, check: Callable[[], None] = lambda: None
    ) -> None:
        self.spin, self.patience_s, self._check = spin, patience_s, check

    def until(
        self, condition: Callable[[], bool], missing: str | Callable[[], str], patience_s: float | None = None
    ) -> None:
        """Wait for `condition`; TimeoutError names what is `missing` when it takes too long."""
        patience_s = self.patience_s if patience_s is None else patience_s
        deadline_s = time.monotonic() + patience_s
        while not condition():
            self._check()
            if time.monotonic() > deadline_s:
                text = missing if isinstance(missing, str) else missing()
                raise TimeoutError(f"{text} within {patience_s:.0f} s")
            self.spin(LOOK_S)

    def pause(self, duration_s: float) -> None:
        """Handle events for a while."""
        deadline_s = time.monotonic() + duration_s
        while time.monotonic() < deadline_s:
            self.spin(LOOK_S)

    def answer(self, future: Answer, owner: str) -> Any:
        """Return what `owner` answers."""
        self.until(future.done, f"an answer of {owner} not seen")
        return future.result()

    def call(self, node: Node, kind: Any, name: str, request: Any) -> Any:
        """Call a service, and return its answer."""
        client = node.create_client(kind, name)
        self.pause(TAKEN_UP_S)
        self.until(client.service_is_ready, f"{name} not seen")
        return self.answer(client.call_async(request), name)
