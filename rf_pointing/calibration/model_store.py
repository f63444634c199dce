"""The versions of the model of one station and band, which of them is active, and the way back.

A folder holds one file per version and `history.json`, the names in the order they were accepted;
the last one is active.  Nothing but the history says what is active, and it is replaced in one
step: a crash leaves the old or the new.
"""

import json
from pathlib import Path

from rf_pointing.calibration.model_file import ModelVersion, read_model, write_model
from rf_pointing.core import parse_json, read_whole, require_choice, write_whole


class ModelStore:
    """Versions of the model of `station` in `band` below `folder`; the state is on disk."""

    def __init__(self, folder: str | Path, station: str, band: str) -> None:
        self.folder, self.station, self.band = Path(folder), station, band
        self.folder.mkdir(parents=True, exist_ok=True)
        self._history_file = self.folder / "history.json"

    def add(self, version: ModelVersion) -> None:
        """Keep a new version, not yet active.

        Raises ValueError for another station or band, a name that is taken, one that is not a file
        name.
        """
        version.check_for(self.station, self.band, version.valid_from_t_s)
        # Usable on any system: a folder of models is copied to whatever the operator works on.
        if (
            not version.name
            or any(sign in version.name for sign in '/\\:*?"<>|')
            or version.name.startswith(".")
        ):
            raise ValueError(f"name={version.name!r} must be usable as a file name")
        if self._path(version.name).exists():
            raise ValueError(f"name={version.name!r} is taken; versions are never overwritten")
        write_model(self._path(version.name), version)

    def names(self) -> tuple[str, ...]:
        """Return the names of all versions."""
        return tuple(sorted(path.stem for path in self.folder.glob("*.yaml")))

    def read(self, name: str) -> ModelVersion:
        """Return one version."""
        require_choice("name", name, self.names())
        return read_model(self._path(name))

    def active(self) -> ModelVersion | None:
        """Return the active version, None before the first one is accepted."""
        history = self._history()
        return self.read(history[-1]) if history else None

    def active_at(self, t_s: float) -> ModelVersion | None:
        """Return the newest accepted version that is valid at `t_s`, or None."""
        accepted = (self.read(name) for name in reversed(self._history()))
        return next((version for version in accepted if version.is_valid_at(t_s)), None)

    def accept(self, name: str, t_s: float) -> ModelVersion:
        """Make a version active and return it; it must be valid at `t_s`."""
        version = self.read(name)
        version.check_for(self.station, self.band, t_s)
        history = self._history()
        # Accepting twice must not need two steps back.
        if not history or history[-1] != name:
            write_whole(self._history_file, json.dumps([*history, name]))
        return version

    def roll_back(self) -> ModelVersion:
        """Make the version before the active one active again and return it."""
        history = self._history()
        if len(history) < 2:
            raise ValueError(f"accepted models={len(history)} must be >= 2 to roll back")
        write_whole(self._history_file, json.dumps(history[:-1]))
        return self.read(history[-2])

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.yaml"

    def _history(self) -> list[str]:
        if not self._history_file.exists():
            return []
        text = read_whole(self._history_file)
        try:
            names = parse_json(text)
        except ValueError as error:
            raise ValueError(f"{self._history_file}: {error}") from error
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ValueError(f"{self._history_file} must hold a list of names")
        return names
