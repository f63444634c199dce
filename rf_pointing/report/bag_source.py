"""Open a rosbag2 recording, intact or cut short: MCAP or sqlite3, with or without `metadata.yaml`.

A recorder that was killed leaves an MCAP file without its end, a sqlite3 file with a write-ahead
file, and finished splits that are compressed.  Such files are copied, mended and read from the
copies; the recording itself is never changed.  Every file of the recording that is not used is
named.
"""

import shutil
import sqlite3
import struct
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import zstd  # type: ignore[attr-defined]  # whichever zstd it uses

from rf_pointing.report.mcap_tail import CHUNK_ERRORS, complete, salvage

READ_ERRORS = (
    *CHUNK_ERRORS, TypeError, KeyError, IndexError, AttributeError, AssertionError, struct.error, MemoryError,
    OverflowError, sqlite3.Error,
)  # fmt: skip
"""Errors of reading damaged files: rosbags checks little before it indexes into the data."""
COMPRESSED = (".zstd", ".zst")
MOST_UNPACKED_BYTES = 32 * 2**30
"""Longest split that is unpacked."""
_BLOCK_BYTES = 2**20


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

    Of `damaged` MCAP files copies of what is intact are opened.  ValueError where there is no
    recording at `path`, or none of it can be read.
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
    elif path.is_dir():
        listed = _open_directory(path, source, stack)
        for file in _data_files(path):
            if _stored(file).name not in listed:
                _open_file(file, source, stack)
        _note_others(path, source)
    elif path.is_file():
        _open_file(path, source, stack)
    if not source.readers:
        raise ValueError(f"path={path} cannot be read: {'; '.join(source.problems) or 'it holds no recording'}")
    return source


def _data_files(path: Path) -> list[Path]:
    """Return the splits of a folder, compressed or not."""
    return sorted(file for file in path.iterdir() if _stored(file).suffix in (".mcap", ".db3"))


def _stored(file: Path) -> Path:
    return file.with_suffix("") if file.suffix in COMPRESSED else file


def _note_others(path: Path, source: BagSource) -> None:
    """Name what looks like a part of the recording and is of no known kind."""
    for file in sorted(path.iterdir()):
        kinds = {".mcap", ".db3", ".bag", *COMPRESSED} & set(file.suffixes)
        if kinds and _stored(file).suffix not in (".mcap", ".db3"):
            source.problems.append(f"{file.name} is not used: it is of no kind that is read")


def _open_directory(path: Path, source: BagSource, stack: ExitStack) -> set[str]:
    """Open the bag by its metadata; return the names of its files, none without usable ones."""
    if not (path / "metadata.yaml").is_file():
        if _data_files(path):
            source.problems.append("metadata.yaml is missing: the recorder did not finish")
        return set()
    try:
        reader = stack.enter_context(Reader(path))
    except READ_ERRORS as error:
        source.problems.append(f"the bag is damaged: {error}")
        return set()
    source.readers.append(reader)
    metadata = reader.storage.metadata
    source.notes.update(metadata.custom or {})
    text = (path / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
    listed = {_stored(file).name for file in _data_files(path) if _stored(file).name in text}
    if more := [file.name for file in _data_files(path) if _stored(file).name not in listed]:
        source.problems.append(f"metadata.yaml does not list {', '.join(more)}: read all the same")
    return listed


def _open_file(file: Path, source: BagSource, stack: ExitStack) -> None:
    if file.suffix in COMPRESSED and _stored(file).is_file():
        source.problems.append(f"{file.name} is not used: {_stored(file).name} is there too")
        return
    whole = file
    try:
        whole = _as_stored(file, source, stack)
        source.readers.append(stack.enter_context(Reader(whole)))
    except READ_ERRORS as error:
        if _stored(file).suffix != ".mcap" or not _open_completed(whole, source, stack):
            source.problems.append(f"{file.name} is not readable: {error}")


def _as_stored(file: Path, source: BagSource, stack: ExitStack) -> Path:
    """Return the file, or a copy of it that is unpacked, or has its write-ahead file in it."""
    ahead = file.with_name(f"{file.name}-wal")
    if file.suffix not in COMPRESSED and not (ahead.is_file() and ahead.stat().st_size):
        return file
    folder = Path(stack.enter_context(TemporaryDirectory(prefix="rf_pointing_report_")))
    if file.suffix in COMPRESSED:
        return _unpacked(file, folder / _stored(file).name, source)
    copy = Path(shutil.copy(file, folder))
    shutil.copy(ahead, folder)
    # rosbags reads a database as it stands: without what the recorder had not moved into it yet.
    with closing(sqlite3.connect(copy)) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        database.execute("PRAGMA journal_mode=DELETE").fetchall()
    return copy


def _unpacked(file: Path, target: Path, source: BagSource) -> Path:
    """Write what can be unpacked of a split; the rest of a truncated one is reported."""
    with zstd.open(file, "rb") as packed, target.open("wb") as plain:
        try:
            while block := packed.read(_BLOCK_BYTES):
                if plain.tell() > MOST_UNPACKED_BYTES:
                    raise ValueError(f"it is longer than {MOST_UNPACKED_BYTES / 2**30:g} GiB when unpacked")
                plain.write(block)
        except (EOFError, zstd.ZstdError) as error:
            source.problems.append(f"{file.name} was unpacked up to {plain.tell()} bytes: {error}")
    return target


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
    left = f"{tail.message_count} messages are whole, the last {tail.dropped_bytes} bytes"
    source.problems.append(f"{file.name} was cut short: {left} could not be used")
    return True


def _open_salvaged(file: Path, source: BagSource, stack: ExitStack) -> None:
    copy = Path(stack.enter_context(TemporaryDirectory(prefix="rf_pointing_report_"))) / file.name
    try:
        salvage(file, copy)
        source.readers.append(stack.enter_context(Reader(copy)))
    except READ_ERRORS:
        # Begin or index are lost too: what comes before the damage is all there is.
        _open_file(file, source, stack)
