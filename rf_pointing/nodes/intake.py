"""What became of a node's input: used, used but found invalid, or rejected, with the reason on /diagnostics."""

from collections.abc import Callable

from rf_pointing.nodes.diagnostics import OK, WARN, Health

__all__ = ["Intake"]


class Intake:
    """Counts messages while it is open; the last rejection stays visible, the level is that of the newest message."""

    def __init__(self) -> None:
        self.open = False
        self._counts = {"valid": 0, "invalid": 0, "rejected": 0}
        self._reason = "nothing received yet"
        self._last_rejection = ""

    def take(self, work: Callable[[], str]) -> None:
        """Do the work for one message: it returns why its result is not valid, "" if it is, and raises to reject."""
        if not self.open:
            return
        try:
            self._reason = work()
        except ValueError as refusal:
            self._reason = self._last_rejection = str(refusal)
            self._counts["rejected"] += 1
            return
        self._counts["invalid" if self._reason else "valid"] += 1

    def health(self) -> Health:
        """Return the counts, as a warning while the newest message was of no use."""
        values = {**self._counts, "last_rejection": self._last_rejection}
        return Health(WARN if self._reason else OK, self._reason or "input is used", values)
