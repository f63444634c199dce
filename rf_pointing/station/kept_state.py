"""A few values of one node that outlive it: one JSON file, replaced whole or not at all.

A killed process leaves either the old file or the new one.  Unreadable text is refused, not taken for an empty start.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["KeptState"]


class KeptState:
    """The file of one node; an empty name keeps nothing."""

    def __init__(self, name: str) -> None:
        self._path = Path(name) if name else None
        self._kept: dict[str, Any] | None = None

    def recover(self) -> dict[str, Any]:
        """Return what was kept, empty when nothing was; ValueError names a file that cannot be read."""
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
        """Write `values` if they are others than those written last."""
        if self._path is None or values == self._kept:
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f"{self._path.name}.new")
        with beside.open("w") as file:
            json.dump(values, file)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(self._path)
        self._kept = dict(values)
