"""The `metadata.yaml` of a bag whose MCAP file had to be closed by `mcap_tail.complete`.

Fields and names are those of rosbag2 metadata version 9 (Jazzy); a bag that closed normally gets its file from rosbags.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2.metadata import dump_qos_v9

__all__ = ["write_metadata"]


def write_metadata(
    mcap: Path,
    connections: Iterable[Connection],
    counts: Mapping[str, int],
    times_ns: tuple[int, int],
    notes: Mapping[str, str],
) -> None:
    """Write `metadata.yaml` beside `mcap`.

    Parameters
    ----------
    mcap
        The data file.
    connections
        Topics as they were registered.
    counts
        Messages in the file by topic.
    times_ns
        First and last log time, in nanoseconds.
    notes
        Free text by key, shown by `ros2 bag info`.
    """
    start = {"nanoseconds_since_epoch": times_ns[0]}
    duration = {"nanoseconds": times_ns[1] - times_ns[0]}
    total = sum(counts.values())
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        "message_count": total,
        "topics_with_message_count": [_topic(item, counts.get(item.topic, 0)) for item in connections],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [mcap.name],
        "files": [{"path": mcap.name, "starting_time": start, "duration": duration, "message_count": total}],
        "custom_data": dict(notes) or None,
        "ros_distro": "rosbags",
    }
    text = yaml.dump({"rosbag2_bagfile_information": information}, Dumper=_PlainDumper, sort_keys=False)
    (mcap.parent / "metadata.yaml").write_text(text, encoding="utf-8")


class _PlainDumper(yaml.SafeDumper):  # type: ignore[misc]
    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def _topic(connection: Connection, count: int) -> dict[str, Any]:
    ext = connection.ext
    assert isinstance(ext, ConnectionExtRosbag2)
    metadata = {
        "name": connection.topic,
        "type": connection.msgtype,
        "serialization_format": ext.serialization_format,
        "offered_qos_profiles": dump_qos_v9(ext.offered_qos_profiles),
        "type_description_hash": connection.digest,
    }
    return {"topic_metadata": metadata, "message_count": count}
