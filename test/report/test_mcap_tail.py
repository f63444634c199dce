"""Closing MCAP files that were cut short, and copying what is intact of damaged ones."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from rf_pointing.report.mcap_tail import complete, salvage

COUNT = 2_000


def written(path: Path, compression: CompressionType, contents: list[bytes]) -> Path:
    """A file of another writer, in many small chunks: these messages by turns on two topics."""
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=4_096, compression=compression)
        writer.start(profile="ros2", library="independent")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
        for number, data in enumerate(contents):
            writer.add_message(channels[number % 2], number, data, number, number)
        writer.finish()
    return path


@pytest.fixture(scope="module", params=[CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def compression(request: pytest.FixtureRequest) -> CompressionType:
    return request.param


@pytest.fixture(scope="module")
def whole(compression: CompressionType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    contents = [b"\0\1\0\0" + number.to_bytes(60, "little") for number in range(COUNT)]
    return written(tmp_path_factory.mktemp("mcap") / "whole.mcap", compression, contents)


@pytest.fixture(scope="module")
def marked(compression: CompressionType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file whose messages begin and end with bytes that are not zero; the last one is empty."""
    contents = [b"\1" * 60 + (number + 1).to_bytes(3, "little") + b"\1" for number in range(199)]
    return written(tmp_path_factory.mktemp("mcap") / "marked.mcap", compression, [*contents, b""])


def summary_of(path: Path) -> Any:
    with path.open("rb") as stream:
        return make_reader(stream).get_summary()


def times(path: Path) -> list[int]:
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        found = [message.log_time for _, _, message in reader.iter_messages()]
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(found)
    assert sum(summary.statistics.channel_message_counts.values()) == len(found)
    if found:
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (found[0], found[-1])
    return found


@pytest.mark.parametrize("kept", [0.1, 0.37, 0.5, 0.73, 0.9, 0.999, 1.0])
def test_cut_file_gives_its_first_messages_without_gap(whole: Path, tmp_path: Path, kept: float) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: round(kept * whole.stat().st_size)])
    tail = complete(cut)
    found = times(cut)
    assert found == list(range(len(found)))
    assert len(found) == tail.message_count == len(tail.times)
    assert kept < 1.0 or len(found) == COUNT


def test_every_cut_inside_one_chunk_and_its_index_is_closed_alike(whole: Path, tmp_path: Path) -> None:
    data, summary = whole.read_bytes(), summary_of(whole)
    third, fourth = summary.chunk_indexes[2:4]
    before = summary.chunk_indexes[1].message_end_time + 1
    for end in range(third.chunk_start_offset, fourth.chunk_start_offset + 1, 41):
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:end])
        complete(cut)
        whole_chunk = end >= third.chunk_start_offset + third.chunk_length
        assert len(times(cut)) == (third.message_end_time + 1 if whole_chunk else before)


def test_index_that_was_cut_off_is_written_as_it_was(whole: Path, tmp_path: Path) -> None:
    original = summary_of(whole)
    third = original.chunk_indexes[2]
    cut = tmp_path / "cut.mcap"
    end = third.chunk_start_offset + third.chunk_length
    cut.write_bytes(whole.read_bytes()[: end + third.message_index_length // 2])
    complete(cut)
    closed = summary_of(cut)
    assert closed.chunk_indexes == original.chunk_indexes[:3]
    assert closed.schemas == original.schemas
    assert closed.channels == original.channels
    written = cut.read_bytes()[end : end + third.message_index_length]
    assert written == whole.read_bytes()[end : end + third.message_index_length]


def test_damaged_chunk_ends_what_can_be_used(whole: Path, tmp_path: Path) -> None:
    data, summary = bytearray(whole.read_bytes()), summary_of(whole)
    damaged = summary.chunk_indexes[3]
    middle = damaged.chunk_start_offset + damaged.chunk_length // 2
    data[middle : middle + 40] = bytes(255 - value for value in data[middle : middle + 40])
    copy = tmp_path / "damaged.mcap"
    copy.write_bytes(data)
    tail = complete(copy)
    assert times(copy) == list(range(summary.chunk_indexes[2].message_end_time + 1))
    assert tail.dropped_bytes == len(data) - damaged.chunk_start_offset


def test_other_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("this is no recording")
    with pytest.raises(ValueError, match="does not begin as an MCAP file"):
        complete(tmp_path / "text.mcap")


def test_file_without_chunks_is_closed_too(tmp_path: Path) -> None:
    path = tmp_path / "flat.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream, use_chunking=False)
        writer.start(profile="ros2", library="independent")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/B", "ros2msg", b"string c\n"))
        for number in range(100):
            writer.add_message(channel, number, bytes(64), number, number)
    path.write_bytes(path.read_bytes()[:-200])
    complete(path)
    assert times(path) == list(range(97))


def records(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Give opcode, place and content of every record between the magic words."""
    place = 8
    while place < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, place)
        yield opcode, place, data[place + 9 : place + 9 + length]
        place += 9 + length


DATA_END, FOOTER = 15, 2


def test_the_end_of_a_closed_file_is_that_of_another_writer(whole: Path, tmp_path: Path) -> None:
    """But for checksums, which are 0, and the offsets by kind, which it leaves out."""
    data = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[:-100])
    complete(cut)
    given, made = summary_of(whole).statistics, summary_of(cut).statistics
    assert made == given
    end = [record for record in records(cut.read_bytes()) if record[0] in (DATA_END, FOOTER)]
    assert [opcode for opcode, _, _ in end] == [DATA_END, FOOTER]
    assert end[0][2] == bytes(4)
    assert struct.unpack("<QQI", end[1][2]) == (end[0][1] + 9 + 4, 0, 0)


def test_zeros_that_a_crashed_file_system_leaves_are_dropped(whole: Path, tmp_path: Path) -> None:
    first = summary_of(whole).chunk_indexes[0]
    end = first.chunk_start_offset + first.chunk_length + first.message_index_length
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:end] + bytes(4096))
    tail = complete(cut)
    assert (tail.usable_bytes, tail.dropped_bytes) == (end, 4096)
    assert times(cut) == list(range(first.message_end_time + 1))


# Damage in the middle


def messages(path: Path) -> list[tuple[str, int, int, bytes]]:
    with path.open("rb") as stream:
        return [(channel.topic, message.log_time, message.sequence, message.data)
                for _, channel, message in make_reader(stream).iter_messages()]  # fmt: skip


LENGTH = 9 + 22 + 64
"""Bytes of each message of `marked`, but for the last."""


def test_zeros_cost_the_messages_that_they_cover_and_no_other(marked: Path, tmp_path: Path) -> None:
    """Five messages of a chunk without compression; all messages of one with it."""
    third = summary_of(marked).chunk_indexes[2]
    data = bytearray(marked.read_bytes())
    covered = range(third.message_start_time, third.message_end_time + 1)
    if not third.compression:
        covered = range(third.message_start_time + 3, third.message_start_time + 8)
    stored = third.chunk_start_offset + third.chunk_length - third.compressed_size
    begin = stored + 3 * LENGTH if not third.compression else stored
    data[begin : begin + 5 * LENGTH] = bytes(5 * LENGTH)
    (tmp_path / "damaged.mcap").write_bytes(data)
    tail = salvage(tmp_path / "damaged.mcap", tmp_path / "copy.mcap")
    left = [message for message in messages(marked) if message[1] not in covered]
    assert messages(tmp_path / "copy.mcap") == left
    assert tail.message_count == len(left) == 200 - len(covered)


@pytest.mark.parametrize("place", [0, -30])
def test_a_file_with_a_damaged_begin_or_index_cannot_be_salvaged(marked: Path, tmp_path: Path, place: int) -> None:
    data = bytearray(marked.read_bytes())
    data[place : place + 8 if place + 8 else None] = bytes(8)
    (tmp_path / "damaged.mcap").write_bytes(data)
    with pytest.raises(ValueError, match=r"begin as an MCAP file|summary of the file is damaged"):
        salvage(tmp_path / "damaged.mcap", tmp_path / "copy.mcap")
