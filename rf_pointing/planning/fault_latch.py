"""Faults that stay until somebody resets them, with the commands that came before; reset works when the cause is gone."""

import math
from collections import deque
from dataclasses import dataclass

__all__ = ["FaultLatch", "LatchedFault"]

KEPT_COMMANDS = 5
Command = tuple[float, str, float, float]
"""When a command came, from whom, and the azimuth and elevation (rad) at its end."""


@dataclass(frozen=True, slots=True)
class LatchedFault:
    """What happened, when, and the last commands before it."""

    text: str
    t_s: float
    commands: tuple[Command, ...]

    def lines(self) -> list[str]:
        """Return the last commands in words."""
        return [
            f"{self.t_s - t_s:.2f} s before, {name or 'unnamed'}: "
            f"to {math.degrees(azimuth):.3f}, {math.degrees(elevation):.3f} deg"
            for t_s, name, azimuth, elevation in self.commands
        ]


class FaultLatch:
    """The first fault counts; later ones are named beside it."""

    def __init__(self) -> None:
        self._recent: deque[Command] = deque(maxlen=KEPT_COMMANDS)
        self.fault: LatchedFault | None = None

    @property
    def text(self) -> str:
        """The latched fault, "" when there is none."""
        return self.fault.text if self.fault else ""

    def note_command(self, command: Command) -> None:
        """Remember a command, for the record of the next fault."""
        self._recent.append(command)

    def latch(self, text: str, t_s: float) -> None:
        """Latch a fault; while one is latched only a new text is added to it."""
        if self.fault is None:
            self.fault = LatchedFault(text, t_s, tuple(self._recent))
        elif text not in self.fault.text:
            self.fault = LatchedFault(f"{self.fault.text}; {text}", self.fault.t_s, self.fault.commands)

    def reset(self, cause: str) -> str:
        """Clear the fault unless its cause is still there; return why not, "" when it is cleared."""
        if self.fault is None:
            return "no fault is latched"
        if cause:
            return f"the cause is still there: {cause}"
        self.fault = None
        return ""
