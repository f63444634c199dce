"""The handle of an action's goal, which notes what a node does with it."""

from typing import Any


class GoalHandle:
    """A goal that was accepted; `ends` are the calls of the node, in order."""

    def __init__(self, request: Any, cancel: bool = False) -> None:
        self.request, self.is_cancel_requested = request, cancel
        self.ends: list[str] = []
        self.feedback: list[Any] = []
        self.publish_feedback = self.feedback.append

    def execute(self) -> None:
        self.ends.append("execute")

    def succeed(self) -> None:
        self.ends.append("succeed")

    def abort(self) -> None:
        self.ends.append("abort")

    def canceled(self) -> None:
        self.ends.append("canceled")
