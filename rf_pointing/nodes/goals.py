"""How an action's goal ends."""

from typing import Any

__all__ = ["RESULT_TIMEOUT_S", "conclude"]

RESULT_TIMEOUT_S = 1e8
"""How long an action server keeps the result of a goal, in node time: as good as for ever, at a kilobyte each.

When results expire (after 900 s unless told otherwise) the events executor can lose the event of a timer on simulated time;
time that waits for that timer's work then stands still for its patience, and the antenna runs out of commands.
"""


def conclude(goal: Any, result: Any) -> Any:
    """Set the end of `goal` that its `result` says: canceled when that was asked for, else by `success`; return it."""
    if goal.is_cancel_requested:
        goal.canceled()
    elif result.success:
        goal.succeed()
    else:
        goal.abort()
    return result
