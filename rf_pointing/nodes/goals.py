"""How an action's goal ends."""

from typing import Any

__all__ = ["conclude"]


def conclude(goal: Any, result: Any) -> Any:
    """Set the end of `goal` that its `result` says: canceled when that was asked for, else by `success`; return it."""
    if goal.is_cancel_requested:
        goal.canceled()
    elif result.success:
        goal.succeed()
    else:
        goal.abort()
    return result
