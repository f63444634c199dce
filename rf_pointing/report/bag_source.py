"""Open a rosbag2 recording, intact or cut short: MCAP or sqlite3, with or without `metadata.yaml`.

A recorder that was killed leaves an MCAP file without its end.  Such a file is copied, closed by
`mcap_tail.complete` and read from the copy; the recording itself is never changed.
"""

import shutil
import struct
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

from rf_pointing.report.mcap_tail import CHUNK_ERRORS, complete, salvage

READ_ERRORS = (
    *CHUNK_ERRORS, TypeError, KeyError, IndexError, AttributeError, AssertionError, struct.error, MemoryError,
    OverflowError,
)  # fmt: skip
"""Errors of reading damaged files: rosbags checks little before it indexes into the data."""


@dataclass
class BagSource:
    """Open readers of one recording, its notes, and what is wrong with it in words for the user."""

    readers: list[Reader] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)

    @property
    def connections(self) -> list[Connection]:
        """Topics of all files; one topic appears once per file."""
        return [connection for reader in self.readers for connection in reader.connections]


def open_bag(path: Path, stack: ExitStack, *, damaged: bool = False) -> BagSource:
    """Open the bag directory or file at `path`; `stack` closes it.

    Of `damaged` MCAP files copies of what is intact are opened.

    Raises
    ------
    ValueError
        There is no recording at `path`, or none of it can be read.
    """
    if not path.exists():
        raise ValueError(f"path={path} does not exist")
    source = BagSource()
    if path.is_dir() and not _data_files(path) and not (path / "metadata.yaml").is_file():
        # A pass that was joined again after a restart has several bags in its folder.
        bags = (each for each in path.iterdir() if each.is_dir() and _data_files(each))
        for folder in sorted(bags):
            part = open_bag(folder, stack, damaged=damaged)
            source.readers += part.readers
            source.problems += part.problems
            source.notes |= part.notes
    # A damaged or missing metadata.yaml costs nothing: the data files have all of it but the notes.
    if damaged:
        for file in _data_files(path) if path.is_dir() else [path]:
            _open_salvaged(file, source, stack)
    elif path.is_dir() and not source.readers and not _open_directory(path, source, stack):
        for file in _data_files(path):
            _open_file(file, source, stack)
    elif path.is_file():
        _open_file(path, source, stack)
    if not source.readers:
        raise ValueError(f"path={path} cannot be read: {'; '.join(source.problems) or 'it holds no recording'}")
    return source


def _data_files(path: Path) -> list[Path]:
    return sorted(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))


def _open_directory(path: Path, source: BagSource, stack: ExitStack) -> bool:
    if not (path / "metadata.yaml").is_file():
        if _data_files(path):
            source.problems.append("metadata.yaml is missing: the recorder did not finish")
        return False
    try:
        reader = stack.enter_context(Reader(path))
    except READ_ERRORS as error:
        source.problems.append(f"the bag is damaged: {error}")
        return False
    source.readers.append(reader)
    metadata = reader.storage.metadata
    source.notes.update(metadata.custom or {})
    return True


def _open_file(file: Path, source: BagSource, stack: ExitStack) -> None:
    try:
        source.readers.append(stack.enter_context(Reader(file)))
    except READ_ERRORS as error:
        if file.suffix != ".mcap" or not _open_completed(file, source, stack):
            source.problems.append(f"{file.name} is not readable: {error}")


def _open_completed(file: Path, source: BagSource, stack: ExitStack) -> bool:
    folder = stack.enter_context(TemporaryDirectory(prefix="rf_pointing_report_"))
    # The recording of the user is never changed, not even to repair it.
    copy = Path(shutil.copy(file, folder))
    try:
        tail = complete(copy)
        reader = stack.enter_context(Reader(copy))
    except READ_ERRORS:
        return False
    source.readers.append(reader)
    source.problems.append(
        f"{file.name} was cut short: {tail.message_count} messages are whole, "
        f"the last {tail.dropped_bytes} bytes could not be used"
    )
    return True


def _open_salvaged(file: Path, source: BagSource, stack: ExitStack) -> None:
    copy = Path(stack.enter_context(TemporaryDirectory(prefix="rf_pointing_report_"))) / file.name
    try:
        salvage(file, copy)
        source.readers.append(stack.enter_context(Reader(copy)))
    except READ_ERRORS:
        # Begin or index are lost too: what comes before the damage is all there is.
        _open_file(file, source, stack)
