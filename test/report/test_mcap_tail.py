"""Closing MCAP files that were cut short."""

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from rf_pointing.report.mcap_tail import complete

COUNT = 2_000


@pytest.fixture(scope="module", params=[CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of another writer, in many small chunks."""
    path = tmp_path_factory.mktemp("mcap") / "whole.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=4_096, compression=request.param)
        writer.start(profile="ros2", library="independent")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
        for number in range(COUNT):
            data = b"\0\1\0\0" + number.to_bytes(60, "little")
            writer.add_message(channels[number % 2], number, data, number, number)
        writer.finish()
    return path


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


@pytest.mark.parametrize("kept", [0.1, 0.37, 0.5, 0.73, 0.9, 0.999])
def test_cut_file_gives_its_first_messages_without_gap(whole: Path, tmp_path: Path, kept: float) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: round(kept * whole.stat().st_size)])
    tail = complete(cut)
    found = times(cut)
    assert found == list(range(len(found)))
    assert len(found) == tail.message_count == len(tail.times)


def test_every_cut_inside_one_chunk_and_its_index_is_closed_alike(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    third, fourth = summary.chunk_indexes[2:4]
    before = summary.chunk_indexes[1].message_end_time + 1
    for end in range(third.chunk_start_offset, fourth.chunk_start_offset + 1, 41):
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:end])
        complete(cut)
        whole_chunk = end >= third.chunk_start_offset + third.chunk_length
        assert len(times(cut)) == (third.message_end_time + 1 if whole_chunk else before)


def test_index_that_was_cut_off_is_written_as_it_was(whole: Path, tmp_path: Path) -> None:
    with whole.open("rb") as stream:
        original = make_reader(stream).get_summary()
    assert original is not None
    third = original.chunk_indexes[2]
    cut = tmp_path / "cut.mcap"
    end = third.chunk_start_offset + third.chunk_length
    cut.write_bytes(whole.read_bytes()[: end + third.message_index_length // 2])
    complete(cut)
    with cut.open("rb") as stream:
        closed = make_reader(stream).get_summary()
    assert closed is not None
    assert closed.chunk_indexes == original.chunk_indexes[:3]
    assert closed.schemas == original.schemas
    assert closed.channels == original.channels
    written = cut.read_bytes()[end : end + third.message_index_length]
    assert written == whole.read_bytes()[end : end + third.message_index_length]


def test_whole_file_keeps_every_message(whole: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(whole, tmp_path))
    complete(copy)
    assert times(copy) == list(range(COUNT))


def test_damaged_chunk_ends_what_can_be_used(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
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
