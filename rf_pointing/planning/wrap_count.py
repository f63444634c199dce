"""The azimuth's whole turns, which an absolute encoder of one turn cannot know, kept over a restart.

The file holds the last unwrapped azimuth.  At the start the encoder must agree with it modulo a turn; then the turn is
known.  If it does not, the antenna was moved meanwhile, and only somebody who looks at the cables knows the turn.
"""

import json
import math
import os
from pathlib import Path

__all__ = ["WrapCount"]

TURN = 2.0 * math.pi
TOLERANCE_RAD = math.radians(10.0)
"""A killed process leaves the file behind by a second of motion, and brakes let an axis run out."""
WRITE_RAD = math.radians(0.5)


class WrapCount:
    """The file of one antenna; written whole or not at all, when the azimuth has moved."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._written_rad: float | None = None

    def recover(self, absolute_rad: float) -> tuple[float, str]:
        """Return the unwrapped azimuth of an encoder that knows one turn, and "" or why the turn is uncertain."""
        folded = math.remainder(absolute_rad, TURN)
        if not self._path.exists():
            return folded, ""
        try:
            kept = float(json.loads(self._path.read_text())["azimuth_rad"])
            if not math.isfinite(kept):
                raise ValueError("azimuth_rad is not finite")
        except (ValueError, KeyError, TypeError) as error:
            return folded, f"wrap file {self._path.name} cannot be read ({error}): look at the cables, then reset"
        turns = round((kept - folded) / TURN)
        unwrapped = folded + turns * TURN
        if abs(unwrapped - kept) > TOLERANCE_RAD:
            return unwrapped, (
                f"azimuth encoder reads {math.degrees(folded):.2f} deg, the wrap file says {math.degrees(kept):.2f} deg: "
                "moved while off; look at the cables, then reset"
            )
        return unwrapped, ""

    def keep(self, azimuth_rad: float) -> None:
        """Write the unwrapped azimuth if it has changed enough to matter."""
        if self._written_rad is not None and abs(azimuth_rad - self._written_rad) < WRITE_RAD:
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f"{self._path.name}.new")
        with beside.open("w") as file:
            json.dump({"azimuth_rad": azimuth_rad}, file)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(self._path)
        self._written_rad = azimuth_rad
