"""Recordings of any kind become the same arrays; damage is reported, not hidden."""

import itertools
import math
import re
import shutil
import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as IndependentWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg

from rf_pointing.report import recording as recording_module
from rf_pointing.report.bag_writer import BagWriter
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.recording import namespaces, read_recording
from rf_pointing.report.summary import Complaint

Runs = type[Any]
START_NS = 1_700_000_000 * 10**9


def write(path: Path, types: Definitions, topics: dict[str, tuple[str, Iterable[bytes]]]) -> None:
    """Write messages of topics by their types, a nanosecond apart."""
    with BagWriter(path, types) as bag:
        for topic, (kind, messages) in topics.items():
            bag.register(topic, kind)
            for log_time_ns, data in enumerate(messages):
                bag.write(topic, log_time_ns, data)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, synthetic_run: Runs, types: Definitions) -> Path:
    path = tmp_path_factory.mktemp("recording") / "bag"
    synthetic_run(seconds=40.0, aos_los_s=(1.0, 9.0)).write(path, types, {"seed": "1"})
    return path


def test_topics_come_with_stamps_log_times_sequences_and_columns(bag: Path) -> None:
    recording = read_recording(bag)
    assert (recording.namespace, recording.problems, recording.notes) == ("/gs1", (), {"seed": "1"})
    boresight = recording.topics["sim/boresight"]
    assert len(boresight) == 2_000
    assert boresight.stamp_ns is not None
    assert list(boresight.stamp_ns[:3] - START_NS) == [0, 20_000_000, 40_000_000]
    assert boresight.sequence is not None
    assert list(boresight.sequence) == list(range(2_000))
    assert np.allclose(np.degrees(boresight["azimuth"]), 100.0 + 0.5 * np.arange(2_000) / 50, rtol=0.0, atol=1e-12)
    assert recording.topics["joint_states"]["position"].shape == (2_000, 2)
    assert recording.topics["joint_states"].sequence is None
    assert recording.topics["clock"].stamp_ns is not None
    assert recording.topics["tracking_status"]["mode"][0] == "monopulse"
    assert [item.los_ns - item.aos_ns for item in recording.passes] == [8 * 10**9]


def test_simulated_log_times_give_the_same_recording_by_the_wall_times_of_its_messages(
    bag: Path, tmp_path: Path, types: Definitions
) -> None:
    """The wall times stand as publish times, where `ros2 bag record --use-sim-time` has them, too."""
    recorded = read_recording(bag).topics
    clock = recorded["clock"]
    assert clock.stamp_ns is not None
    with Reader(bag) as reader, BagWriter(tmp_path / "simulated", types) as simulated:
        for connection in reader.connections:
            simulated.register(connection.topic, connection.msgtype)
        for connection, wall_ns, data in reader.messages():
            newest = max(0, int(np.searchsorted(clock.log_time_ns, wall_ns, side="right")) - 1)
            simulated.write(connection.topic, int(clock.stamp_ns[newest]), data, wall_ns)
    with (tmp_path / "simulated" / "simulated.mcap").open("rb") as stream:
        messages = [(channel.topic, message) for _, channel, message in make_reader(stream).iter_messages()]
    joints = [message for topic, message in messages if topic == "/gs1/joint_states"]
    rate_hz = 1e9 / np.diff([message.log_time for message in joints])
    assert np.all(np.abs(rate_hz - 50.0) < 1e-6), "a viewer plots the rate of the drive, not of the run"
    assert [message.publish_time for message in joints] == recorded["joint_states"].log_time_ns.tolist()
    for name, data in read_recording(tmp_path / "simulated").topics.items():
        assert np.array_equal(data.log_time_ns, recorded[name].log_time_ns), name
        assert np.array_equal(data.stamp_ns, recorded[name].stamp_ns), name


def test_the_bags_of_a_pass_that_was_joined_again_are_read_as_one_recording(bag: Path, tmp_path: Path) -> None:
    for name in ("bag", "bag-2"):
        shutil.copytree(bag, tmp_path / "p0" / name)
    once, both = (len(read_recording(path).topics["tracking_status"]) for path in (bag, tmp_path / "p0"))
    assert both == 2 * once > 0


def test_single_file_of_another_writer_is_read(tmp_path: Path, types: Definitions) -> None:
    path = tmp_path / "independent.mcap"
    with path.open("wb") as stream:
        writer = IndependentWriter(stream)
        schema = writer.register_msgdef(
            "rf_pointing_msgs/msg/Boresight", types.schema("rf_pointing_msgs/msg/Boresight")
        )
        for number in range(5):
            header = {"stamp": {"sec": number, "nanosec": 7}, "frame_id": "antenna"}
            content = {"header": header, "sequence": 40 + number, "azimuth": 0.1 * number, "elevation": math.nan}
            writer.write_message("/gs7/sim/boresight", schema, content, log_time=number, publish_time=number)
        writer.finish()
    recording = read_recording(path)
    data = recording.topics["sim/boresight"]
    assert recording.namespace == "/gs7"
    assert data.sequence is not None
    assert data.stamp_ns is not None
    assert list(data.sequence) == [40, 41, 42, 43, 44]
    assert list(data.stamp_ns) == [number * 10**9 + 7 for number in range(5)]
    assert list(data["azimuth"]) == [0.0, 0.1, 0.2, 0.1 * 3, 0.4]
    assert np.all(np.isnan(data["elevation"]))


def test_joints_are_found_by_name_whatever_their_order(tmp_path: Path, types: Definitions, maker: Any) -> None:
    kind = "sensor_msgs/msg/JointState"
    data = maker.serialized(kind, name=["elevation", "azimuth"], position=np.array([0.5, 6.5]))
    write(tmp_path / "bag", types, {"/joint_states": (kind, [data])})
    joints = read_recording(tmp_path / "bag").topics["joint_states"]
    assert joints["position"].tolist() == [[6.5, 0.5]]
    assert np.all(np.isnan(joints["velocity"]))


def test_several_antennas_need_a_choice(tmp_path: Path, synthetic_run: Runs, types: Definitions) -> None:
    for name in ("/gs1", "/north/gs2"):
        synthetic_run(seconds=1.0, namespace=name).write(tmp_path / name[-3:], types)
    merged = tmp_path / "both"
    with BagWriter(merged, types) as bag:
        for name in ("gs1", "gs2"):
            with Reader(tmp_path / name) as reader:
                for connection in reader.connections:
                    bag.register(connection.topic, connection.msgtype)
                for connection, log_time_ns, data in reader.messages():
                    bag.write(connection.topic, log_time_ns, data)
    with pytest.raises(ValueError, match="several antennas \\(/gs1, /north/gs2\\)"):
        read_recording(merged)
    with pytest.raises(ValueError, match="namespace=/gs3 is not in"):
        read_recording(merged, namespace="gs3")
    recording = read_recording(merged, namespace="north/gs2")
    assert len(recording.topics["sim/boresight"]) == 50
    assert recording.topics["sim/boresight"].topic == "/north/gs2/sim/boresight"
    assert recording.others["/gs1/sim/boresight"] == 50


def test_namespaces_are_told_from_topic_names() -> None:
    assert namespaces(["/gs1/sim/pointing_error", "/gs1/pointing_error", "/clock", "/rosout"]) == ["/gs1"]
    assert namespaces(["/joint_states", "/a/b/tracking_status"]) == ["", "/a/b"]
    assert namespaces(["/clock", "/parameter_events"]) == []


def test_bag_without_an_antenna_is_refused(tmp_path: Path, types: Definitions) -> None:
    write(tmp_path / "bag", types, {"/rosout": ("rcl_interfaces/msg/Log", [])})
    with pytest.raises(ValueError, match="holds no topic of an antenna"):
        read_recording(tmp_path / "bag")


def test_missing_and_empty_paths_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing does not exist"):
        read_recording(tmp_path / "nothing")
    with pytest.raises(ValueError, match="it holds no recording"):
        read_recording(tmp_path)
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(ValueError, match=r"metadata.yaml is missing.*broken\.mcap is not readable"):
        read_recording(tmp_path)


@pytest.mark.parametrize("metadata", [True, False])
def test_a_recording_that_was_cut_short_gives_what_was_whole(bag: Path, tmp_path: Path, metadata: bool) -> None:
    whole, killed = read_recording(bag), Path(shutil.copytree(bag, tmp_path / "bag"))
    data = (killed / "bag.mcap").read_bytes()[: -(bag / "bag.mcap").stat().st_size // 10]
    (killed / "bag.mcap").write_bytes(data)
    if not metadata:
        (killed / "metadata.yaml").unlink()
    recording = read_recording(killed)
    assert ("metadata.yaml is missing" in recording.problems[0]) is not metadata
    assert "bag.mcap was cut short" in recording.problems[-1]
    part = recording.topics["sim/boresight"]
    assert 100 < len(part) < len(whole.topics["sim/boresight"])
    assert np.array_equal(part["azimuth"], whole.topics["sim/boresight"]["azimuth"][: len(part)])
    assert (killed / "bag.mcap").read_bytes() == data


def test_message_that_cannot_be_decoded_is_counted(tmp_path: Path, types: Definitions, maker: Any) -> None:
    kind = "rf_pointing_msgs/msg/Boresight"
    good = maker.serialized(kind, azimuth=0.1)
    write(tmp_path / "bag", types, {"/sim/boresight": (kind, [good, good[:20], b"", good])})
    recording = read_recording(tmp_path / "bag")
    assert len(recording.topics["sim/boresight"]) == 2
    # With the reason of the first.
    assert re.fullmatch(r"2 messages of sim/boresight could not be decoded \(.*buffer.*\)", recording.problems[0])


def test_topic_of_an_unexpected_type_is_named_and_left_out(tmp_path: Path, types: Definitions) -> None:
    joints = ("sensor_msgs/msg/JointState", [])
    write(tmp_path / "bag", types, {"/gs1/joint_states": joints,
                                    "/gs1/pointing_error": ("rf_pointing_msgs/msg/Boresight", [])})  # fmt: skip
    recording = read_recording(tmp_path / "bag")
    (problem,) = recording.problems
    assert problem.startswith("pointing_error has type rf_pointing_msgs/msg/Boresight, not rf_pointing_msgs/msg/Poi")
    assert "pointing_error" not in recording.topics


def test_types_of_the_bag_win_over_those_known_here(tmp_path: Path, types: Definitions) -> None:
    text = types.texts["rf_pointing_msgs/msg/Boresight"].replace(
        "float64 elevation ", "float64 temperature\nfloat64 elevation "
    )
    kind = "rf_pointing_msgs/msg/Boresight"
    other = Definitions(typestore=types.typestore.__class__(), texts={kind: text})
    header_types = {
        name: types.typestore.fielddefs[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    }
    other.typestore.register({**header_types, **get_types_from_msg(text, kind)})
    make = other.typestore.types
    header = make["std_msgs/msg/Header"](make["builtin_interfaces/msg/Time"](3, 0), "")
    data = other.typestore.serialize_cdr(make[kind](header, 1, 0.1, 20.0, 0.2), kind)
    write(tmp_path / "bag", other, {"/sim/boresight": (kind, [bytes(data)])})
    data = read_recording(tmp_path / "bag").topics["sim/boresight"]
    assert (data["azimuth"][0], data["elevation"][0]) == (0.1, 0.2)


def test_standard_types_that_a_bag_does_not_define_are_known(
    tmp_path: Path, types: Definitions, maker: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in older sqlite3 bags; a type that is not standard is named."""
    fields = {"name": ["azimuth", "elevation"], "position": np.array([0.5, 0.25])}
    joints, own = "sensor_msgs/msg/JointState", "rf_pointing_msgs/msg/Boresight"
    write(tmp_path / "bag", types, {"/joint_states": (joints, [maker.serialized(joints, **fields)]),
                                    "/sim/boresight": (own, [maker.serialized(own)])})  # fmt: skip
    monkeypatch.setattr(recording_module, "types_of", lambda *_: {})
    recording = read_recording(tmp_path / "bag")
    assert recording.topics["joint_states"]["position"].tolist() == [[0.5, 0.25]]
    assert recording.problems == (
        "sim/boresight cannot be decoded: the bag does not define rf_pointing_msgs/msg/Boresight",
    )


def test_what_diagnostics_complained_about_is_counted(tmp_path: Path, types: Definitions, maker: Any) -> None:
    kind = "diagnostic_msgs/msg/DiagnosticArray"

    def said(count: int) -> bytes:
        status = [
            maker.message("diagnostic_msgs/msg/DiagnosticStatus", level=level, name=f"gs1/{name}", message=text)
            for level, name, text in (
                (0, "servo", "running"),
                (1, "receiver", f"{count} samples, {0.5 * count} s late"),
            )
        ]
        for name, text in (
            ("gs10/antenna_servo: drive", "fault"),
            ("/gs2/receiver", "late"),
            ("cpu: temperature", "70 C"),
        ):
            status.append(maker.message("diagnostic_msgs/msg/DiagnosticStatus", level=2, name=name, message=text))
        for name in ("gs1/ephemeris_publisher: target", "gs2/ephemeris_publisher: target"):
            value = maker.message("diagnostic_msgs/msg/KeyValue", key="learned", value=f"+{count}.0 s, {name[:3]}")
            status.append(maker.message("diagnostic_msgs/msg/DiagnosticStatus", name=name, values=[value]))
        return bytes(maker.serialized(kind, status=status))

    joints = ("sensor_msgs/msg/JointState", [])
    write(tmp_path / "bag", types, {"/diagnostics": (kind, map(said, range(3))), "/gs1/joint_states": joints})
    recording = read_recording(tmp_path / "bag")
    # Another antenna shares the topic; a host belongs to both.
    assert recording.warnings[0] == Complaint(component="cpu: temperature", message="70 C", count=3)
    assert recording.warnings[1:] == (Complaint(component="gs1/receiver", message="2 samples, 1.0 s late", count=3),)
    assert recording.others == {"/diagnostics": 3}
    # The report shows notes: the newest that earlier passes taught of this antenna's target.
    assert recording.notes["learned"] == "+2.0 s, gs1"


def test_newest_announcement_of_a_pass_counts(tmp_path: Path, types: Definitions, maker: Any) -> None:
    def announced(*aos_s: int) -> bytes:
        passes = [
            maker.message(
                "rf_pointing_msgs/msg/Pass", target="1", aos=maker.time(aos * 10**9),
                tca=maker.time((aos + 50) * 10**9), los=maker.time((aos + 100) * 10**9),
            )
            for aos in aos_s
        ]  # fmt: skip
        return bytes(maker.serialized("rf_pointing_msgs/msg/PassList", passes=passes))

    lists = announced(), announced(1_000, 7_000), announced(7_001, 13_000)
    write(tmp_path / "bag", types, {"/passes": ("rf_pointing_msgs/msg/PassList", lists)})
    passes = read_recording(tmp_path / "bag").passes
    assert [item.aos_ns // 10**9 for item in passes] == [1_000, 7_001, 13_000]


@pytest.mark.parametrize("share", [0.05, 0.1, 0.3, 0.6, 0.9])
def test_a_block_of_zeros_is_never_passed_over_in_silence(bag: Path, tmp_path: Path, share: float) -> None:
    """4 kB of the file lost: what is left is read, and what is missing is counted."""
    damaged = Path(shutil.copytree(bag, tmp_path / "bag"))
    data = bytearray((damaged / "bag.mcap").read_bytes())
    at = int(share * len(data))
    data[at : at + 4096] = bytes(4096)
    (damaged / "bag.mcap").write_bytes(data)
    whole, rest = read_recording(bag), read_recording(damaged)
    count = sum(len(topic) for topic in rest.topics.values())
    assert count < sum(len(topic) for topic in whole.topics.values())
    damage = re.fullmatch(
        r"(\d+) of (\d+) messages of bag are not readable: the file is damaged; (\d+) messages beyond the damage are used",
        "; ".join(problem for problem in rest.problems if "damage" in problem),
    )
    assert damage is not None, rest.problems
    missing, total, beyond = map(int, damage.groups())
    assert total == sum(len(topic) for topic in whole.topics.values())
    assert missing - beyond == total - sum(len(topic) for topic in rest.topics.values())
    # Some 20 messages lie in 4 kB; the index of one chunk names the others.
    assert count > 0.98 * sum(len(topic) for topic in whole.topics.values())
    for name, topic in rest.topics.items():
        assert set(topic.log_time_ns) <= set(whole.topics[name].log_time_ns)


def test_a_chunk_of_zstd_with_a_wrong_head_costs_its_own_messages(bag: Path, tmp_path: Path) -> None:
    """As other recorders compress them."""
    path, type_name = tmp_path / "squeezed.mcap", "rf_pointing_msgs/msg/TrackingStatus"
    with path.open("wb") as stream, Reader(bag) as reader:
        writer = McapWriter(stream, chunk_size=4_096, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="independent")
        (status,) = (item for item in reader.connections if item.msgtype == type_name)
        schema = writer.register_schema(type_name, "ros2msg", status.msgdef.data.encode())
        channel = writer.register_channel(status.topic, "cdr", schema)
        for number, (_, log_time_ns, data) in enumerate(reader.messages([status])):
            writer.add_message(channel, log_time_ns, data, log_time_ns, number)
        writer.finish()
    whole = len(read_recording(path).topics["tracking_status"])
    data = bytearray(path.read_bytes())
    # The magic number of the second frame.
    at = data.find(b"\x28\xb5\x2f\xfd", data.find(b"\x28\xb5\x2f\xfd") + 4)
    data[at] ^= 0xFF
    path.write_bytes(data)
    recording = read_recording(path)
    assert recording.problems
    assert 0 < len(recording.topics["tracking_status"]) < whole


@pytest.mark.parametrize("text", ["[" * 100_000, "a: [", "{}", "rosbag2_bagfile_information: [1]"])
def test_metadata_that_cannot_be_read_costs_nothing(bag: Path, tmp_path: Path, text: str) -> None:
    damaged = Path(shutil.copytree(bag, tmp_path / "bag"))
    (damaged / "metadata.yaml").write_text(text)
    recording = read_recording(damaged)
    assert any("the bag is damaged" in problem for problem in recording.problems)
    assert len(recording.topics["joint_states"]) == len(read_recording(bag).topics["joint_states"])


@pytest.fixture(scope="module")
def splits(bag: Path, tmp_path_factory: pytest.TempPathFactory, types: Definitions) -> dict[StoragePlugin, list[Path]]:
    """The bag in six files, overlapping in time as those of several caches do."""
    parts: dict[StoragePlugin, list[Path]] = {}
    with Reader(bag) as reader:
        messages = list(reader.messages())
    for plugin in StoragePlugin:
        folder = tmp_path_factory.mktemp("splits")
        for number in range(6):
            with Writer(folder / f"part_{number}", version=9, storage_plugin=plugin) as writer:
                known: dict[str, Any] = {}
                for index, (connection, log_time_ns, data) in enumerate(messages):
                    if (index * 6 // len(messages) + (index % 7 == 0)) % 6 != number:
                        continue
                    if connection.topic not in known:
                        known[connection.topic] = writer.add_connection(
                            connection.topic, connection.msgtype, typestore=types.typestore
                        )
                    writer.write(known[connection.topic], log_time_ns, data)
        ending = "mcap" if plugin is StoragePlugin.MCAP else "db3"
        parts[plugin] = [next((folder / f"part_{number}").glob(f"*.{ending}")) for number in range(6)]
    return parts


def packed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor().compress(data)


@pytest.mark.parametrize("plugin", StoragePlugin)
@pytest.mark.parametrize("left", [range(6), (0, 2, 3, 5)], ids=["all", "some"])
@pytest.mark.parametrize("ending", ["", ".zstd", ".zst", "mixed"])
def test_any_splits_of_a_bag_give_its_numbers_less_what_is_missing(
    plugin: StoragePlugin, left: Any, ending: str, bag: Path, splits: Any, tmp_path: Path
) -> None:
    """Compressed or not, without metadata, overlapping in time."""
    whole = read_recording(bag)
    for number in left:
        name = f"bag_{number}{splits[plugin][number].suffix}"
        kind = ("", ".zstd")[number % 2] if ending == "mixed" else ending
        data = splits[plugin][number].read_bytes()
        (tmp_path / f"{name}{kind}").write_bytes(packed(data) if kind else data)
    found = read_recording(tmp_path)
    assert found.problems == ("metadata.yaml is missing: the recorder did not finish",)
    for name, data in whole.topics.items():
        mine = found.topics.get(name)
        if mine is None:
            # Its few messages were in the files that are missing.
            assert len(left) < 6
            assert len(data) < 10
            continue
        assert np.all(np.diff(mine.log_time_ns) >= 0)
        if len(left) == 6:
            assert np.array_equal(mine.log_time_ns, data.log_time_ns)
            assert data.sequence is None or np.array_equal(mine.sequence, data.sequence)
            for column in set(data.columns) - {"passes"}:
                assert np.array_equal(mine[column], data[column])
        else:
            assert 0 < len(mine) <= len(data)
            assert set(mine.log_time_ns.tolist()) <= set(data.log_time_ns.tolist())


@pytest.mark.parametrize("complete", [True, False], ids=["metadata", "no metadata"])
@pytest.mark.parametrize(
    ("plugin", "mode"),
    # Only MCAP has a compression of its own.
    sorted({*itertools.product(StoragePlugin, CompressionMode)} - {(StoragePlugin.SQLITE3, CompressionMode.STORAGE)}),
)
def test_every_kind_of_compression_gives_the_whole_bag(
    bag: Path, tmp_path: Path, types: Definitions, plugin: StoragePlugin, mode: CompressionMode, complete: bool
) -> None:
    packed_bag = tmp_path / "packed"
    writer = Writer(packed_bag, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with Reader(bag) as reader, writer:
        topics = {
            item.id: writer.add_connection(item.topic, item.msgtype, typestore=types.typestore)
            for item in reader.connections
        }
        for connection, log_time_ns, data in reader.messages():
            writer.write(topics[connection.id], log_time_ns, data)
    if not complete:
        (packed_bag / "metadata.yaml").unlink()
    whole, found = read_recording(bag), read_recording(packed_bag)
    assert {name: len(data) for name, data in found.topics.items()} == {n: len(d) for n, d in whole.topics.items()}
    assert found.problems == (() if complete else ("metadata.yaml is missing: the recorder did not finish",))


def test_what_is_beside_the_splits_is_named(bag: Path, splits: Any, tmp_path: Path) -> None:
    files = splits[StoragePlugin.MCAP]
    shutil.copy(files[0], tmp_path / "bag_0.mcap")
    (tmp_path / "bag_0.mcap.zstd").write_bytes(packed(files[0].read_bytes()))
    (tmp_path / "bag_1.mcap.gz").write_bytes(b"\x1f\x8b")
    (tmp_path / "bag_2.mcap.zstd").write_bytes(packed(files[2].read_bytes())[:-5000])
    (tmp_path / "notes.txt").write_text("of the evening")
    found = read_recording(tmp_path)
    said = "; ".join(found.problems)
    assert "bag_0.mcap.zstd is not used: bag_0.mcap is there too" in said
    assert "bag_1.mcap.gz is not used: it is of no kind that is read" in said
    assert "bag_2.mcap.zstd was unpacked up to " in said
    assert "notes.txt" not in said
    assert len(found.topics["sim/boresight"]) >= len(read_recording(tmp_path / "bag_0.mcap").topics["sim/boresight"])
    listed = tmp_path / "listed"
    shutil.copytree(bag, listed)
    shutil.copy(files[1], listed / "later_1.mcap")
    more = read_recording(listed)
    assert more.problems == ("metadata.yaml does not list later_1.mcap: read all the same",)


def test_what_sqlite_has_only_written_ahead_is_read(bag: Path, splits: Any, tmp_path: Path) -> None:
    live = tmp_path / "live.db3"
    shutil.copy(splits[StoragePlugin.SQLITE3][0], live)
    before = read_recording(live).topics["sim/boresight"]
    connection = sqlite3.connect(live)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    connection.execute(
        "INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, timestamp + 1, data FROM messages"
    )
    connection.commit()
    folder = tmp_path / "killed"
    folder.mkdir()
    for file in (live, live.with_name("live.db3-wal")):
        shutil.copy(file, folder)
    connection.close()
    held = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert len(read_recording(folder).topics["sim/boresight"]) == 2 * len(before)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == held
