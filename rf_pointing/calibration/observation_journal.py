"""Calibration points on disk as they are taken: one line per point, on the disk before the next one is taken.

A killed process loses at most the line it was writing: a last line without its end is cut off when the journal is opened
again.  Any other damage is refused with the line's number, and nothing is overwritten.  The file is the one that
`read_observations` reads.
"""

import errno
import os
from io import FileIO
from pathlib import Path

from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.tracking_csv import edge_columns, read_observations

__all__ = ["ObservationJournal"]

MOST_OF_A_NAME = 1000


class ObservationJournal:
    """The points of one station and band in `path`; `points` are those that were in it when it was opened."""

    def __init__(self, path: str | Path, station: str, band: str) -> None:
        self.path, self.station, self.band = Path(path), station, band
        self.points = self._recovered()

    def append(self, points: Observations) -> None:
        """Add points; they are on the disk when this returns.

        Raises
        ------
        ValueError
            For points of another station or band.
        OSError
            When the disk does not take them; the file is then as it was.
        """
        self._check_owner(points)
        columns = edge_columns(points)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        lines = "".join(",".join(map(repr, row)) + "\n" for row in rows)
        with self.path.open("ab", buffering=0) as stream:
            end = stream.tell()
            if end == 0:
                lines = f"# station: {self.station}\n# band: {self.band}\n{','.join(columns)}\n" + lines
            try:
                _write_all(stream, lines.encode())
                os.fsync(stream.fileno())
            except OSError:
                stream.truncate(end)
                raise

    def set_aside(self, name: str) -> Path | None:
        """Rename the file, so that the next point begins a new one; return the old points' file, None without any.

        Nothing is overwritten: where `name` is taken a number follows it.
        """
        if not self.path.exists():
            return None
        stems = (f"{self.path.stem}-{name}{tail}" for tail in ("", *(f"-{k}" for k in range(2, MOST_OF_A_NAME))))
        free = (place for stem in stems if not (place := self.path.with_name(stem + self.path.suffix)).exists())
        old = next(free, None)
        if old is None:
            raise ValueError(f"{self.path.stem}-{name}-* are all taken; observations are never overwritten")
        os.rename(self.path, old)
        self.points = None
        return old

    def _recovered(self) -> Observations | None:
        if not self.path.exists():
            return None
        content = self.path.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if len(whole) < len(content):
            with self.path.open("rb+") as stream:
                stream.truncate(len(whole))
                os.fsync(stream.fileno())
        if len([line for line in whole.splitlines() if not line.startswith(b"#")]) < 2:
            self.path.unlink()
            return None
        points = read_observations(self.path)
        self._check_owner(points)
        return points

    def _check_owner(self, points: Observations) -> None:
        for name in ("station", "band"):
            if getattr(points, name) != getattr(self, name):
                raise ValueError(
                    f"{self.path}: points of {name} {getattr(points, name)!r}, must be of {getattr(self, name)!r}"
                )


def _write_all(stream: FileIO, content: bytes) -> None:
    """Write without a buffer, which would try again when the file is closed."""
    if stream.write(content) != len(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), stream.name)
