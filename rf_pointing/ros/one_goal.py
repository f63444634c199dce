"""One goal of an action at a time, which lasts until the node says that its work is over."""

from collections.abc import Callable
from typing import Any

from rf_pointing.ros.managed import ManagedNode


class OneGoal:
    """An action that an active node serves.

    `begin(request)` starts the work, and its ValueError or OSError refuses it.  `result(reason)`
    is that of the work, or of a goal that was refused for a reason; `cancel()` ends the work early.
    """

    def __init__(
        self, node: ManagedNode, kind: Any, name: str, begin: Callable[[Any], None], result: Callable[[str], Any],
        cancel: Callable[[], None],
    ) -> None:  # fmt: skip
        self._node, self._begin = node, begin
        self._goal: Any = None
        self._reason = ""
        node.serve_goals(
            kind, name, accepts=self._accepts, begin=self._take, cancel=cancel, result=lambda: result(self._reason)
        )

    @property
    def lasts(self) -> bool:
        """Whether a client waits for the end of the work."""
        return self._goal is not None

    def report(self, feedback: Any) -> None:
        """Send feedback to the client, if there is one."""
        if self._goal is not None:
            self._goal.publish_feedback(feedback)

    def finish(self) -> None:
        """End the goal: the client gets the result."""
        goal, self._goal = self._goal, None
        if goal is not None:
            goal.execute()

    def _accepts(self, _request: Any) -> bool:
        if self._node.active and self._goal is None:
            return True
        why = "another one is under way" if self._node.active else "not active"
        self._node.log_once("goal refused", why, error=True)
        return False

    def _take(self, goal: Any) -> None:
        self._reason = ""
        try:
            self._begin(goal.request)
        except (ValueError, OSError) as error:
            # Executed at once, so that the client receives the reason as a result: a rejection has
            # no text.
            self._reason = str(error)
            self._node.log_once("goal refused", str(error), error=True)
            goal.execute()
            return
        self._goal = goal
