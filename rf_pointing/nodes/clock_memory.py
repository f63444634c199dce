"""The newest simulation time, kept so that a clock that is killed goes on where time stood.

A few bytes beside the instance lock, written in place before every tick is told: the kernel keeps them when the process
dies.  They count for as long as a graph can be waiting for its clock; a clock that ends in order leaves none.
"""

import os
import struct
from pathlib import Path

__all__ = ["ClockMemory"]

RESUME_S = 20.0
_RECORD = struct.Struct("<3d")


class ClockMemory:
    """The file of one clock; `start_s` is where its time begins, `wall_s` a steady clock of the machine."""

    def __init__(self, path: Path, start_s: float) -> None:
        self._path, self._start_s = path, start_s
        self._file: int | None = None

    def recover(self, wall_s: float) -> float | None:
        """Return the time at which a clock with the same start was killed less than 20 s ago, None if there was none."""
        try:
            start_s, kept_wall_s, t_s = _RECORD.unpack(self._path.read_bytes())
        except (OSError, struct.error):
            return None
        return t_s if start_s == self._start_s and 0.0 <= wall_s - kept_wall_s <= RESUME_S else None

    def keep(self, t_s: float, wall_s: float) -> None:
        """Write the time of a tick."""
        if self._file is None:
            self._file = os.open(self._path, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600)
        os.pwrite(self._file, _RECORD.pack(self._start_s, wall_s, t_s), 0)

    def forget(self) -> None:
        """Leave nothing to go on from."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        self._path.unlink(missing_ok=True)
