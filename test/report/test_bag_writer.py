"""Bags written by `BagWriter`, read by two independent readers, on disks that last and disks that fill."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader, StoragePlugin

from rf_pointing.report.bag_writer import LOST_NOTE, PROBLEM_NOTE, BagWriter
from rf_pointing.report.definitions import Definitions
from test.report.conftest import offered_qos

JOINTS = "sensor_msgs/msg/JointState"
BORESIGHT = "rf_pointing_msgs/msg/Boresight"
LARGE = bytes(1024)


def metadata(path: Path) -> dict[str, Any]:
    text = (path / "metadata.yaml").read_text()
    return dict(yaml.safe_load(text)["rosbag2_bagfile_information"])


@contextmanager
def file_size_limit(limit_bytes: int) -> Iterator[None]:
    """Let every file of this process end at `limit_bytes`: writing further raises OSError, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_both_readers_get_back_what_was_written(tmp_path: Path, types: Definitions, maker: Any) -> None:
    path = tmp_path / "bag"
    with BagWriter(path, types, notes={"station": "DSS-13"}) as bag:
        bag.register("/gs1/sim/boresight", BORESIGHT, [offered_qos()])
        bag.register("/gs1/joint_states", JOINTS)
        for number in range(10):
            bag.write("/gs1/sim/boresight", 1_000 + number, maker.serialized(BORESIGHT, azimuth=0.25 * number))
        bag.write("/gs1/joint_states", 2_000, maker.serialized(JOINTS))
    result = bag.close()
    assert (result.message_count, result.lost, result.problem) == (11, (), "")
    with Reader(path) as reader:
        raw = [data for connection, _, data in reader.messages() if connection.msgtype == BORESIGHT]
        assert raw == [maker.serialized(BORESIGHT, azimuth=0.25 * number) for number in range(10)]
    with (path / "bag.mcap").open("rb") as stream:
        independent = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        decoded = list(independent.iter_decoded_messages(topics=["/gs1/sim/boresight"]))
    assert [(message.log_time, content.azimuth) for _, _, message, content in decoded] == [
        (1_000 + number, 0.25 * number) for number in range(10)
    ]


def test_metadata_has_every_field_of_version_9(tmp_path: Path, types: Definitions, maker: Any) -> None:
    path = tmp_path / "bag"
    with BagWriter(path, types, notes={"speed": "max"}) as bag:
        bag.register("/gs1/sim/boresight", BORESIGHT, [offered_qos(depth=1, durability="TRANSIENT_LOCAL")])
        bag.write("/gs1/sim/boresight", 7_000, maker.serialized(BORESIGHT, azimuth=0.25 * 0))
        bag.write("/gs1/sim/boresight", 9_500, maker.serialized(BORESIGHT, azimuth=0.25 * 1))
    information = metadata(path)
    topic = information.pop("topics_with_message_count")[0]
    infinite = {"sec": 9223372036, "nsec": 854775807}
    assert information == {
        "version": 9, "storage_identifier": "mcap", "relative_file_paths": ["bag.mcap"],
        "duration": {"nanoseconds": 2_500}, "starting_time": {"nanoseconds_since_epoch": 7_000},
        "message_count": 2, "compression_format": "", "compression_mode": "",
        "files": [
            {
                "path": "bag.mcap", "starting_time": {"nanoseconds_since_epoch": 7_000},
                "duration": {"nanoseconds": 2_500}, "message_count": 2,
            }
        ],
        "custom_data": {"speed": "max"}, "ros_distro": "rosbags",
    }  # fmt: skip
    assert topic == {
        "message_count": 2,
        "topic_metadata": {
            "name": "/gs1/sim/boresight", "type": BORESIGHT, "serialization_format": "cdr",
            "type_description_hash": types.type_hash(BORESIGHT),
            "offered_qos_profiles": [
                {
                    "history": "keep_last", "depth": 1, "reliability": "reliable",
                    "durability": "transient_local", "deadline": infinite, "lifespan": infinite,
                    "liveliness": "automatic", "liveliness_lease_duration": infinite,
                    "avoid_ros_namespace_conventions": False,
                }
            ],
        },
    }  # fmt: skip


def test_existing_directory_is_refused_and_left_alone(tmp_path: Path, types: Definitions) -> None:
    (tmp_path / "kept.txt").write_text("kept")
    with pytest.raises(ValueError, match="exists already"):
        BagWriter(tmp_path, types)
    assert (tmp_path / "kept.txt").read_text() == "kept"


def test_misuse_is_named(tmp_path: Path, types: Definitions, maker: Any) -> None:
    with BagWriter(tmp_path / "bag", types) as bag:
        bag.register("/joint_states", JOINTS)
        with pytest.raises(ValueError, match="topic='/joint_states' is registered already"):
            bag.register("/joint_states", JOINTS)
        with pytest.raises(ValueError, match="type_name='no_msgs/msg/None'"):
            bag.register("/other", "no_msgs/msg/None")
        with pytest.raises(ValueError, match="topic='/other' is not registered"):
            bag.write("/other", 0, b"")
    with pytest.raises(ValueError, match="is closed"):
        bag.write("/joint_states", 0, maker.serialized(JOINTS))


def fill(bag: BagWriter, count: int) -> None:
    for number in range(count):
        bag.write(f"/{'ab'[number % 2]}", 1_000 + number, LARGE)


def test_disk_that_fills_stops_recording_and_every_message_is_accounted_for(
    tmp_path: Path, types: Definitions, maker: Any
) -> None:
    path = tmp_path / "bag"
    bag = BagWriter(path, types, notes={"speed": "max"})
    for topic in ("/a", "/b"):
        bag.register(topic, JOINTS, [offered_qos()])
    with file_size_limit(5 * 2**19):
        fill(bag, 6_000)
        assert "recording stopped" in bag.problem
        bag.register("/late", BORESIGHT)
        bag.write("/late", 9_000, maker.serialized(BORESIGHT, azimuth=0.25 * 0))
        result = bag.close()
    with Reader(path) as reader:
        read = [log_time_ns for _, log_time_ns, _ in reader.messages()]
    assert len(read) > 1_000
    assert read == list(range(1_000, 1_000 + len(read)))
    assert result.message_count == len(read)
    lost = {item.topic: item for item in result.lost}
    assert lost["/a"].count + lost["/b"].count == 6_000 - len(read)
    assert min(lost["/a"].first_log_time_ns, lost["/b"].first_log_time_ns) == 1_000 + len(read)
    assert (lost["/late"].count, lost["/late"].first_log_time_ns) == (1, 9_000)
    with (path / "bag.mcap").open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == len(read)
    assert not (path / ".reserve").exists()
    assert {PROBLEM_NOTE, LOST_NOTE} <= metadata(path)["custom_data"].keys()


def test_disk_that_is_full_at_the_last_write_keeps_what_reached_it(tmp_path: Path, types: Definitions) -> None:
    bag = BagWriter(tmp_path / "bag", types)
    for topic in ("/a", "/b"):
        bag.register(topic, JOINTS)
    fill(bag, 1_500)
    with file_size_limit(2**20 + 2**18):
        result = bag.close()
    assert result.problem.startswith("recording stopped")
    assert 0 < result.message_count < 1_500
    assert result.message_count + sum(item.count for item in result.lost) == 1_500
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == result.message_count


def test_no_room_to_begin_leaves_no_directory_behind(tmp_path: Path, types: Definitions) -> None:
    with file_size_limit(4_096), pytest.raises(OSError, match="File too large"):
        BagWriter(tmp_path / "bag", types)
    assert not (tmp_path / "bag").exists()


def test_an_empty_bag_is_readable_and_its_storage_the_one_ros_uses_by_default(
    tmp_path: Path, types: Definitions
) -> None:
    with BagWriter(tmp_path / "bag", types) as bag:
        bag.register("/joint_states", JOINTS)
    assert StoragePlugin[metadata(tmp_path / "bag")["storage_identifier"].upper()] is StoragePlugin.MCAP
    assert sorted(item.name for item in (tmp_path / "bag").iterdir()) == ["bag.mcap", "metadata.yaml"]
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 0
