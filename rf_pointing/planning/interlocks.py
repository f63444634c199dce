"""Interlocks that hold the antenna until somebody acts: authority, latched faults, unknown turns.

One commander has the authority at a time.  A fault stays until somebody resets it.  The whole turns
of the azimuth, which an absolute encoder of one turn cannot know, are kept over a restart: at the
start the encoder must agree with the last unwrapped azimuth modulo a turn.  If it does not, the
antenna was moved meanwhile, and only somebody who looks at the cables knows the turn.
"""

import json
import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from rf_pointing.core import STANDBY, TURN, parse_json, read_whole, write_whole

# Who commanded last is part of a fault's record.
KEPT_COMMANDS = 5
# When a command came, from whom, and the azimuth and elevation (rad) at its end.
Command = tuple[float, str, float, float]
# A killed process leaves the file behind by a second of motion, and brakes let an axis run out.
TOLERANCE_RAD = math.radians(10.0)
# A file write takes milliseconds: once in half a degree, far inside the tolerance.
WRITE_RAD = math.radians(0.5)


SUCCEEDS_S = 0.35
"""Silence after which one of the two follows the other, before the last command has ended."""


class Authority:
    """One commander at a time: the first one, until it has been silent for `silence_s`.

    The other one of a pair may follow after `SUCCEEDS_S`.
    """

    def __init__(self, silence_s: float) -> None:
        self._silence_s = silence_s
        self.holder = ""
        self._newest_s = -math.inf

    def conflict(self, name: str, t_s: float) -> str:
        """Return "" if `name` may command at `t_s`, else who holds the authority."""
        # A silent commander loses the authority: a controller that died must not lock the antenna.
        paired = name.removesuffix(STANDBY) == self.holder.removesuffix(STANDBY) != ""
        silence_s = min(self._silence_s, SUCCEEDS_S) if paired else self._silence_s
        if name != self.holder and t_s - self._newest_s <= silence_s:
            return f"conflict: {self.holder or 'an unnamed commander'} commands, {name or 'an unnamed one'} is refused"
        return ""

    def claim(self, name: str, t_s: float) -> None:
        """Give the authority to `name`, whose command was accepted at `t_s`."""
        self.holder, self._newest_s = name, t_s

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped: the holder has been silent as long as before."""
        self._newest_s += by_s

    def release(self) -> None:
        """Let whoever commands next have the authority."""
        self.holder, self._newest_s = "", -math.inf


@dataclass(frozen=True, slots=True)
class LatchedFault:
    """A fault, its time, and the last commands before it."""

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
    """The first fault counts; later ones are added to its text."""

    def __init__(self) -> None:
        self._recent: deque[Command] = deque(maxlen=KEPT_COMMANDS)
        self.fault: LatchedFault | None = None

    @property
    def text(self) -> str:
        """The latched fault, or ""."""
        return self.fault.text if self.fault else ""

    def note_command(self, command: Command) -> None:
        """Remember a command, for the record of the next fault."""
        self._recent.append(command)

    def latch(self, text: str, t_s: float) -> None:
        """Latch a fault; while one is latched only a new text is added to it."""
        if self.fault is None:
            self.fault = LatchedFault(text, t_s, tuple(self._recent))
        # The first fault is the cause; what follows from it is noise unless it is something new.
        elif text not in self.fault.text:
            self.fault = LatchedFault(f"{self.fault.text}; {text}", self.fault.t_s, self.fault.commands)

    def reset(self, cause: str) -> str:
        """Clear the fault unless its cause is still there; return why not, "" when cleared."""
        if self.fault is None:
            return "no fault is latched"
        if cause:
            return f"the cause is still there: {cause}"
        self.fault = None
        return ""


# More than the cables of any antenna allow.
FARTHEST_RAD = 50.0


class WrapCount:
    """The file of one antenna, written when the azimuth has moved."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._written_rad: float | None = None

    def recover(self, absolute_rad: float) -> tuple[float, str]:
        """Return the unwrapped azimuth of an encoder of one turn, and "" or why it is uncertain."""
        folded = math.remainder(absolute_rad, TURN)
        # A new antenna begins on the turn nearest to zero.
        if not self._path.exists():
            return folded, ""
        try:
            kept = float(parse_json(read_whole(self._path))["azimuth_rad"])
            if not math.isfinite(kept):
                raise ValueError("azimuth_rad is not finite")
            if abs(kept) > FARTHEST_RAD:
                raise ValueError(f"azimuth_rad={kept} is not an azimuth of an antenna")
        except (ValueError, KeyError, TypeError, OverflowError, OSError) as error:
            return folded, f"wrap file {self._path.name} cannot be read ({error}): look at the cables, then reset"
        # The nearest turn to what was kept; the tolerance below says whether to believe it.
        turns = round((kept - folded) / TURN)
        unwrapped = folded + turns * TURN
        if abs(unwrapped - kept) > TOLERANCE_RAD:
            return unwrapped, (
                f"azimuth encoder reads {math.degrees(folded):.2f} deg, the wrap file says {math.degrees(kept):.2f} deg, "
                f"at most {math.degrees(TOLERANCE_RAD):.0f} deg apart: moved while off; look at the cables, then reset"
            )
        return unwrapped, ""

    def keep(self, azimuth_rad: float) -> None:
        """Write the unwrapped azimuth if it has changed enough to matter."""
        if self._written_rad is not None and abs(azimuth_rad - self._written_rad) < WRITE_RAD:
            return
        write_whole(self._path, json.dumps({"azimuth_rad": azimuth_rad}))
        self._written_rad = azimuth_rad
