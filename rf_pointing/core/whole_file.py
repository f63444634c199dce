"""Files that are replaced as one: a killed process leaves either the old text or the new one.

`write_whole` writes any text.  `KeptState` keeps a few values of one node that outlive it as JSON.
Unreadable text is an error, not an empty start.  A file that cannot be written is an error at the
start; later, when a disk fills up, it ends nothing: `problem` says so and every call tries again.
"""

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_whole(path: Path, text: str) -> None:
    """Replace the text of a file; its folders are made where they are missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.new")
    with new.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        # Without it a crash can leave an empty file: the rename may reach the disk before the text.
        os.fsync(file.fileno())
    new.replace(path)


class KeptState:
    """The file of one node; an empty name keeps nothing."""

    def __init__(self, name: str) -> None:
        self._path = Path(name) if name else None
        self._kept: dict[str, Any] | None = None
        self.problem = ""
        """Why the latest values are not in the file, empty when they are."""
        if self._path is not None:
            self._require_writable(self._path)

    def recover(self) -> dict[str, Any]:
        """Return what was kept, empty when nothing was; ValueError when the file cannot be read."""
        if self._path is None or not self._path.exists():
            return {}
        try:
            values = json.loads(self._path.read_text())
        except ValueError as error:
            raise ValueError(f"state file {self._path} cannot be read: {error}") from error
        if not isinstance(values, dict):
            raise ValueError(f"state file {self._path} holds {type(values).__name__}, must hold an object")
        return values

    def keep(self, values: Mapping[str, Any]) -> None:
        """Write `values` if they differ from those written last; see `problem`."""
        # Equal values spare a write a second for the whole life of a node.
        if self._path is None or values == self._kept:
            return
        try:
            write_whole(self._path, json.dumps(values))
        except OSError as error:
            self.problem = f"state file {self._path} cannot be written: {error.strerror}"
            return
        self._kept, self.problem = dict(values), ""

    @staticmethod
    def _require_writable(path: Path) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Permission bits do not tell of a full disk or a read-only mount; a file does.
            with tempfile.TemporaryFile(dir=path.parent):
                pass
        except OSError as error:
            raise ValueError(f"state file {path} cannot be written: {error.strerror}") from error
