"""Files that are read and replaced as one: a killed process leaves the old text or the new one.

`read_whole`, `parse_json` and `parse_yaml` read what others wrote, within bounds of
length and depth that keep the time short.  `write_whole` writes any text.  `KeptState` keeps a few
values of one node that outlive it as JSON.
Unreadable text is an error, not an empty start.  A file that cannot be written is an error at the
start; later, when a disk fills up, it ends nothing: `problem` says so and every call tries again.
"""

import json
import os
import stat
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

SETTINGS_BYTES = 1024 * 1024
"""Longest file of settings, models or state; YAML of that length takes 1 s to read."""
DATA_BYTES = 32 * 1024 * 1024
"""Longest file of elements or ephemerides; TLE of that length take 15 s to read."""
JOURNAL_BYTES = 512 * 1024 * 1024
"""Longest table of observations, which grows over years."""
DEEPEST = 50
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def open_private(path: Path, flags: int) -> int:
    """Open or make a file of this user; RuntimeError for a link, or a file of another user."""
    try:
        opened = os.open(
            path, flags | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK, 0o600
        )
    except OSError as error:
        raise RuntimeError(f"{path} cannot be used: {error.strerror}") from error
    found = os.fstat(opened)
    if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid() or found.st_nlink != 1:
        os.close(opened)
        raise RuntimeError(f"{path} must be a file of user {os.getuid()} without another name")
    return opened


def read_bytes(path: Path, most_bytes: int = SETTINGS_BYTES) -> bytes:
    """Return the content of a regular file; ValueError for anything else, and for a longer one."""
    with open(path, "rb", opener=_regular) as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise ValueError(f"{path} is longer than {most_bytes / 2**20:g} MiB")
    return data


def _regular(path: str, flags: int) -> int:
    # Without O_NONBLOCK the opening of a pipe waits for its other end, for ever.
    opened = os.open(path, flags | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(opened).st_mode):
        os.close(opened)
        raise ValueError(f"{path} must be a regular file")
    return opened


def read_whole(path: Path, most_bytes: int = SETTINGS_BYTES, encoding: str = "utf-8") -> str:
    """Return the text of a file as `read_bytes`; ValueError for one in another encoding."""
    data = read_bytes(path, most_bytes)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        name = "ASCII" if encoding == "ascii" else "UTF-8"
        raise ValueError(f"{path}: byte {error.start} is not {name}") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_json(text: str, **options: Any) -> Any:
    """Return what a JSON text holds; ValueError where it is malformed, too deep or no text."""
    try:
        value = json.loads(text, **options)
    except RecursionError:
        raise ValueError(f"nested more than {DEEPEST} deep") from None
    _require_plain(value)
    return value


class YamlError(ValueError):
    """A YAML text that cannot be used: `line` and `why`."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"line {line}: {why}")
        self.line, self.why = line, why


def parse_yaml(text: str) -> Any:
    """Return what a YAML text holds; YamlError for a malformed or deep one, aliases and tags."""
    value = _from_yaml(yaml.load, text)
    _require_plain(value)
    return value


def compose_yaml(text: str) -> Any:
    """Return the nodes of a YAML text, which know their lines; errors as of `parse_yaml`."""
    return _from_yaml(yaml.compose, text)


def _from_yaml(make: Callable[..., Any], text: str) -> Any:
    depth = 0
    try:
        # Before anything is built: a few aliases of aliases stand for billions of values.
        for event in yaml.parse(text, Loader=_LOADER):
            if isinstance(event, yaml.AliasEvent):
                raise YamlError(
                    event.start_mark.line + 1, f"alias *{event.anchor} must be written out"
                )
            if getattr(event, "tag", None):
                # What PyYAML makes of `!!int x` or `!!timestamp x` are errors of any kind.
                raise YamlError(event.start_mark.line + 1, f"tag {event.tag} must be left out")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(
                event, yaml.CollectionEndEvent
            )
            if depth > DEEPEST:
                raise YamlError(event.start_mark.line + 1, f"nested more than {DEEPEST} deep")
        return make(text, Loader=_LOADER)
    except (yaml.YAMLError, RecursionError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None)
        why = getattr(error, "problem", None) or error
        raise YamlError(mark.line + 1 if mark else 1, f"not YAML: {why}") from None


def _require_plain(value: Any) -> None:
    """Raise ValueError for values nested too deep, and for text that no file can hold."""
    level = [value]
    for _ in range(DEEPEST + 1):
        below: list[Any] = []
        for each in level:
            if isinstance(each, Mapping):
                below += [*each.keys(), *each.values()]
            elif isinstance(each, (list, tuple)):
                below += each
            elif isinstance(each, str) and not each.isascii():
                try:
                    each.encode()
                except UnicodeEncodeError:
                    # It would raise wherever it is printed or written.
                    raise ValueError(f"{each!a} holds half a character") from None
        if not below:
            return
        level = below
    raise ValueError(f"nested more than {DEEPEST} deep")


def write_whole(path: Path, content: str | bytes) -> None:
    """Replace the content of a file; its folders are made where they are missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.new")
    with new.open("wb") as file:
        file.write(content.encode() if isinstance(content, str) else content)
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
            values = parse_json(read_whole(self._path))
        except OSError as error:
            raise ValueError(f"state file {self._path} cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise ValueError(f"state file {self._path} cannot be read: {error}") from error
        if not isinstance(values, dict):
            raise ValueError(
                f"state file {self._path} holds {type(values).__name__}, must hold an object"
            )
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
