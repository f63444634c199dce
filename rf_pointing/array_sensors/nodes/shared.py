"""All nodes share this: the declaration of parameters, and counts of received messages."""

from collections.abc import Callable

from rf_pointing.core import Params
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.managed import ManagedNode


def declare(node: ManagedNode, **groups: Params) -> None:
    """Declare sets of parameters by their prefix."""
    for prefix, defaults in groups.items():
        node.parameters.declare(prefix, defaults)


class InputOutcomes:
    """Counts messages while it is open; the level follows the newest message."""

    def __init__(self) -> None:
        self.open = False
        self._counts = {"valid": 0, "invalid": 0, "rejected": 0}
        self._reason = "nothing received yet"
        self._last_rejection = ""

    def take(self, work: Callable[[], str]) -> None:
        """Do `work` for one message: it returns why its result is invalid, or raises to reject."""
        # While the node is inactive, messages are not input.
        if not self.open:
            return
        try:
            self._reason = work()
        except ValueError as error:
            self._reason = self._last_rejection = str(error)
            self._counts["rejected"] += 1
            return
        self._counts["invalid" if self._reason else "valid"] += 1

    def health(self) -> Health:
        """Return the counts, as a warning while the newest message could not be used."""
        values = {**self._counts, "last_rejection": self._last_rejection}
        return Health(WARN if self._reason else OK, self._reason or "input is used", values)
