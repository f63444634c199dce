"""Close an MCAP file that was cut short by a full disk or a killed recorder.

An MCAP file (specification, version 0) is a sequence of records (opcode, 8-byte length, content)
between two magic words.  Messages are in chunks, each followed by its message indexes; an index of
the chunks is at the end.  Without that end most readers refuse the file.  `complete` drops what is
cut and writes the end for what is left.  `salvage` copies what is left of a file with damage in its
middle, by the indexes.
"""

import re
import struct
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.storage_mcap import decompress, zstd  # type: ignore[attr-defined]  # whichever zstd it uses

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = 2, 3, 4, 5, 6, 7, 8
_STATISTICS, _DATA_END = 11, 15
_HEAD = 9
_MESSAGE_HEAD = 22
_FOOTER_BYTES = 37
HOLE_BYTES = 400
"""So many zeros in a row are a lost block of the disk; the longest covariance has 288."""
CHUNK_ERRORS = (ReaderError, RuntimeError, ValueError, OSError, zstd.ZstdError)
"""Errors that libraries raise for a chunk that does not decompress."""
Record = tuple[int, int, bytes]


@dataclass
class McapTail:
    """The intact part of a file: its end, its message counts and times, and its index."""

    usable_bytes: int = 0
    dropped_bytes: int = 0
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    times: list[tuple[int, int, int]] = field(default_factory=list)
    """Log and publish time and channel of every message."""
    schemas: dict[int, bytes] = field(default_factory=dict)
    channels: dict[int, bytes] = field(default_factory=dict)
    chunk_indexes: list[bytes] = field(default_factory=list)

    @property
    def message_count(self) -> int:
        """Messages in the usable part."""
        return sum(self.counts.values())


def complete(path: Path) -> McapTail:
    """Cut `path` after its last intact chunk and write index and footer, in place.

    ValueError for a file that does not begin as an MCAP file, OSError without room for the index.
    """
    # In place: a disk that is full has no room for a repaired copy.
    with path.open("r+b") as file:
        _require_magic(file, path)
        tail = McapTail(usable_bytes=len(_MAGIC))
        pending = _scan(file, tail)
        tail.dropped_bytes = file.seek(0, 2) - tail.usable_bytes
        file.truncate(tail.usable_bytes)
        file.seek(tail.usable_bytes)
        if pending is not None:
            tail.chunk_indexes.append(_close_chunk(file, pending))
        _write_end(file, tail)
    return tail


def salvage(source: Path, target: Path) -> McapTail:
    """Write what is intact of a damaged file with an index to `target`; return what that holds.

    ValueError or struct.error where begin or index of the file is damaged too.
    """
    with source.open("rb") as damaged, target.open("w+b") as file:
        _require_magic(damaged, source)
        header = next(_records(damaged))
        summary = list(_summary(damaged))
        file.write(_MAGIC)
        for opcode, _, content in (header, *summary):
            if opcode != _CHUNK_INDEX:
                _write(file, opcode, content)
        indexes = (index for opcode, _, index in summary if opcode == _CHUNK_INDEX)
        for kept in (_salvaged_chunk(damaged, index) for index in indexes):
            start = file.tell()
            _write(file, _CHUNK, kept)
            chunk = _open_chunk(start, kept, McapTail())
            if chunk is not None:
                _close_chunk(file, chunk)
    return complete(target)


def _require_magic(file: BinaryIO, path: Path) -> None:
    if file.read(len(_MAGIC)) != _MAGIC:
        raise ValueError(f"{path} does not begin as an MCAP file")


def publish_times(path: Path) -> dict[str, list[tuple[int, int]]]:
    """Return log and publish time in ns of the intact messages of a file by topic, in its order."""
    tail, found = McapTail(), defaultdict[str, list[tuple[int, int]]](list)
    with path.open("rb") as file:
        file.seek(len(_MAGIC))
        _scan(file, tail)
    for log_time, published, channel in tail.times:
        # Numbers of channel and schema and the length of the topic come before it.
        (length,) = struct.unpack_from("<4xI", tail.channels[channel])
        found[tail.channels[channel][8 : 8 + length].decode()].append((log_time, published))
    return found


def _summary(file: BinaryIO) -> Iterator[Record]:
    """Return schemas, channels and chunk indexes of the summary at the end of a file."""
    file.seek(-_FOOTER_BYTES, 2)
    (start,) = struct.unpack_from("<Q", file.read(_FOOTER_BYTES), _HEAD)
    file.seek(start)
    for record in _records(file):
        if record[0] == _FOOTER:
            return
        if record[0] in (_SCHEMA, _CHANNEL, _CHUNK_INDEX):
            yield record
    raise ValueError("the summary of the file is damaged")


def _salvaged_chunk(file: BinaryIO, index: bytes) -> bytes:
    """Return the content of a chunk with the intact messages of the one that `index` names."""
    times, (start, length, offsets) = index[:16], struct.unpack_from("<QQI", index, 16)
    indexed, name = struct.unpack_from("<QI", index, 36 + offsets)
    compression = index[48 + offsets : 48 + offsets + name].decode()
    stored, size = struct.unpack_from("<QQ", index, 48 + offsets + name)
    file.seek(start + length - stored)
    data = file.read(stored)
    try:
        data = decompress(data, compression, size, 0)
    # One wrong byte of a compressed chunk costs all of it.
    except CHUNK_ERRORS:
        data = b""
    # The data end the chunk, and its indexes follow.
    kept = b"".join(_intact(data, BytesIO(file.read(indexed))))
    return times + struct.pack("<QIIQ", len(kept), 0, 0, len(kept)) + kept


def _intact(data: bytes, indexes: BinaryIO) -> Iterator[bytes]:
    """Return the message records of a chunk's data that its indexes name and no zeros cover."""
    holes = [match.span() for match in re.finditer(rb"\0{%d,}" % HOLE_BYTES, data)]
    entries = []
    for opcode, _, content in _records(indexes):
        if opcode == _MESSAGE_INDEX:
            channel, _ = struct.unpack_from("<HI", content)
            entries += [(offset, time, channel) for time, offset in struct.iter_unpack("<QQ", content[6:])]
    for offset, time, channel in sorted(entries):
        if len(data) < offset + _HEAD + _MESSAGE_HEAD:
            continue
        opcode, length = struct.unpack_from("<BQ", data, offset)
        here, _, when = struct.unpack_from("<HIQ", data, offset + _HEAD)
        end = offset + _HEAD + length
        sound = (opcode, here, when) == (_MESSAGE, channel, time) and end <= len(data)
        if sound and not any(first < end and offset < last for first, last in holes):
            yield data[offset:end]


@dataclass
class _OpenChunk:
    start: int
    length: int
    times: bytes
    compression: str
    sizes: tuple[int, int]
    messages: dict[int, list[tuple[int, int]]]
    index_offsets: dict[int, int] = field(default_factory=dict)
    index_bytes: int = 0

    def chunk_index(self) -> bytes:
        offsets = b"".join(struct.pack("<HQ", *item) for item in self.index_offsets.items())
        head = self.times + struct.pack("<QQI", self.start, self.length, len(offsets)) + offsets
        name = self.compression.encode()
        return head + struct.pack("<QI", self.index_bytes, len(name)) + name + struct.pack("<QQ", *self.sizes)


def _scan(file: BinaryIO, tail: McapTail) -> _OpenChunk | None:
    """Fill `tail` from the intact records; return the last chunk if its indexes are incomplete."""
    chunk: _OpenChunk | None = None
    for opcode, start, content in _records(file):
        if opcode in (_FOOTER, _DATA_END):
            break
        end = start + _HEAD + len(content)
        if opcode == _MESSAGE_INDEX and chunk is not None:
            chunk.index_offsets[int.from_bytes(content[:2], "little")] = start
            chunk.index_bytes += end - start
            if set(chunk.index_offsets) != set(chunk.messages):
                continue
            tail.chunk_indexes.append(chunk.chunk_index())
            chunk = None
        # Another record before the indexes are complete: the file was cut or damaged here.
        elif chunk is not None:
            break
        elif opcode == _CHUNK:
            chunk = _open_chunk(start, content, tail)
            if chunk is None:
                break
            if not chunk.messages:
                tail.chunk_indexes.append(chunk.chunk_index())
                chunk = None
        else:
            _note(opcode, content, tail)
        tail.usable_bytes = end
    return chunk


def _records(file: BinaryIO) -> Iterator[Record]:
    start = file.tell()
    size = file.seek(0, 2)
    file.seek(start)
    while len(head := file.read(_HEAD)) == _HEAD:
        opcode, length = struct.unpack("<BQ", head)
        # Opcode 0 is not a record: a file system that crashed leaves blocks of zeros.  A damaged
        # length may be more than the memory holds.
        if opcode == 0 or length > size - file.tell():
            return
        content = file.read(length)
        yield opcode, start, content
        start += _HEAD + length


def _open_chunk(start: int, content: bytes, tail: McapTail) -> _OpenChunk | None:
    # Start and end time, size before compression, checksum; then name and data of the compression.
    _, _, size, crc = struct.unpack_from("<QQQI", content)
    name_end = 32 + int.from_bytes(content[28:32], "little")
    compression = content[32:name_end].decode()
    stored = content[name_end + 8 :]
    messages: dict[int, list[tuple[int, int]]] = defaultdict(list)
    try:
        records = list(_records(BytesIO(decompress(stored, compression, size, crc))))
        for opcode, offset, record in records:
            if opcode == _MESSAGE:
                channel, _, log_time = struct.unpack_from("<HIQ", record)
                messages[channel].append((log_time, offset))
    # A chunk that does not decompress or fails its checksum ends the usable part.
    except (*CHUNK_ERRORS, struct.error):
        return None
    for opcode, _, record in records:
        _note(opcode, record, tail)
    return _OpenChunk(start, _HEAD + len(content), content[:16], compression, (len(stored), size), messages)


def _note(opcode: int, content: bytes, tail: McapTail) -> None:
    if opcode == _MESSAGE:
        channel, _, log_time, published = struct.unpack_from("<HIQQ", content)
        tail.counts[channel] += 1
        tail.times.append((log_time, published, channel))
    elif opcode in (_SCHEMA, _CHANNEL):
        kept = tail.schemas if opcode == _SCHEMA else tail.channels
        kept[int.from_bytes(content[:2], "little")] = content


def _close_chunk(file: BinaryIO, chunk: _OpenChunk) -> bytes:
    """Write the indexes of a chunk that ends where the file does; return its own index."""
    chunk.index_offsets, chunk.index_bytes = {}, 0
    for channel, entries in chunk.messages.items():
        chunk.index_offsets[channel] = file.tell()
        packed = b"".join(struct.pack("<QQ", *entry) for entry in entries)
        chunk.index_bytes += _write(file, _MESSAGE_INDEX, struct.pack("<HI", channel, len(packed)) + packed)
    return chunk.chunk_index()


def _write_end(file: BinaryIO, tail: McapTail) -> None:
    # Checksums of 0 mean "not available".
    _write(file, _DATA_END, bytes(4))
    # Readers need schemas and channels once more here, before the indexes that refer to them.
    summary_start = file.tell()
    head = (_SCHEMA, tail.schemas.values()), (_CHANNEL, tail.channels.values())
    for opcode, records in (*head, (_CHUNK_INDEX, tail.chunk_indexes)):
        for record in records:
            _write(file, opcode, record)
    counts = b"".join(struct.pack("<HQ", *item) for item in sorted(tail.counts.items()))
    sizes = (tail.message_count, len(tail.schemas), len(tail.channels), 0, 0, len(tail.chunk_indexes))
    span = (min(tail.times, default=(0,))[0], max(tail.times, default=(0,))[0])
    _write(file, _STATISTICS, struct.pack("<QHIIIIQQI", *sizes, *span, len(counts)) + counts)
    _write(file, _FOOTER, struct.pack("<QQI", summary_start, 0, 0))
    file.write(_MAGIC)


def _write(file: BinaryIO, opcode: int, content: bytes) -> int:
    return file.write(struct.pack("<BQ", opcode, len(content)) + content)
