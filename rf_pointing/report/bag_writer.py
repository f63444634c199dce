"""Record serialized messages into a rosbag2 MCAP bag.

A full disk does not disturb the caller: writing stops, later messages are counted per topic as
lost, and `close` leaves a bag of everything that reached the disk.
"""

import json
import shutil
import struct
from array import array
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter

from rf_pointing.report.definitions import Definitions
from rf_pointing.report.mcap_tail import McapTail, complete

LOST_NOTE = "rf_pointing.lost"
"""Key in the bag's custom data: JSON list of what could not be recorded."""
PROBLEM_NOTE = "rf_pointing.problem"
"""Key in the bag's custom data: why recording stopped."""
# Size of a file that keeps room for the index of a bag that fills the disk.
_RESERVE_BYTES = 512 * 1024
# Publish time of an MCAP message: after opcode, length, channel, sequence and log time.
_PUBLISH_TIME_AT = 1 + 8 + 2 + 4 + 8


class _TwoTimes(McapWriter):
    """MCAP storage that gives a message a publish time; rosbags repeats the log time."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.publish_time_ns = 0
        self._published: list[tuple[int, int]] = []

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write one message, and note where it is."""
        self._published.append((self.chunk.bio.tell(), self.publish_time_ns))
        super().write(connection, timestamp, data)

    def close_chunk(self) -> None:
        """Close the chunk."""
        with self.chunk.bio.getbuffer() as content:
            for start, time_ns in self._published:
                struct.pack_into("<Q", content, start + _PUBLISH_TIME_AT, time_ns)
        super().close_chunk()
        # After it: a chunk that a full disk has refused is closed once more.
        self._published.clear()


@dataclass(frozen=True)
class _Completed:
    """File that is closed already: what a writer needs of its storage to write metadata.yaml."""

    path: Path

    def close(self, version: int, metadata: str) -> None:
        """Leave the file as it is."""


@dataclass(frozen=True)
class TopicLoss:
    """Messages of one topic that did not reach the bag, and the log time of the first of them."""

    topic: str
    count: int
    first_log_time_ns: int


@dataclass(frozen=True)
class BagResult:
    """How a recording ended: `problem` is empty when every message is in the bag."""

    path: Path
    counts: dict[str, int]
    lost: tuple[TopicLoss, ...] = ()
    problem: str = ""

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(self.counts.values())


class BagWriter:
    """Context manager around one bag directory; not for several threads.

    `definitions` are the message types that may be registered, `notes` free text by key for the
    bag's custom data (what was run), which `ros2 bag info` shows.  ValueError for a directory that
    exists; OSError where it cannot be made, or without room to begin a recording.
    """

    def __init__(self, path: Path | str, definitions: Definitions, *, notes: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        if self.path.exists():
            raise ValueError(f"path={self.path} exists already; choose another or remove it")
        self._definitions = definitions
        self._notes = dict(notes or {})
        self._reserve = self.path / ".reserve"
        self._writer = self._opened()
        self._connections: dict[str, Connection] = {}
        self._late: set[str] = set()
        # Log times of every message, 8 bytes each: what is lost is known only when the file is cut.
        self._accepted: dict[str, array[int]] = defaultdict(lambda: array("q"))
        self._rejected: dict[str, array[int]] = defaultdict(lambda: array("q"))
        self.problem = ""
        """Why recording stopped early; empty while it runs."""
        self._result: BagResult | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def register(self, topic: str, type_name: str, qos: Sequence[Qos] = ()) -> None:
        """Announce a topic; ValueError where it is announced already or its type is not known."""
        if topic in self._connections or topic in self._late:
            raise ValueError(f"topic={topic!r} is registered already")
        msgdef = self._definitions.schema(type_name)
        rihs01 = self._definitions.type_hash(type_name)
        if self.problem:
            self._late.add(topic)
            return
        self._connections[topic] = self._writer.add_connection(
            topic, type_name, msgdef=msgdef, rihs01=rihs01, offered_qos_profiles=list(qos)
        )

    def write(self, topic: str, log_time_ns: int, data: bytes | memoryview, at_ns: int = 0) -> None:
        """Append one serialized message; after a disk problem it is counted as lost instead.

        Its publish time is `at_ns`, or the log time.  ValueError for a topic that was not
        registered, and for a bag that is closed.
        """
        if self._result is not None:
            raise ValueError(f"path={self.path} is closed")
        if topic not in self._connections and topic not in self._late:
            raise ValueError(f"topic={topic!r} is not registered")
        if self.problem:
            self._rejected[topic].append(log_time_ns)
            return
        # Counted before it is written: a message whose writing fails is in no bag, and is lost.
        self._accepted[topic].append(log_time_ns)
        assert isinstance(self._writer.storage, _TwoTimes)
        self._writer.storage.publish_time_ns = at_ns or log_time_ns
        try:
            self._writer.write(self._connections[topic], log_time_ns, data)
        except OSError as error:
            self._stop(error)

    def close(self) -> BagResult:
        """Finish the bag and return what is in it; never raises for a disk problem."""
        if self._result is None:
            with suppress(OSError):
                self._reserve.unlink()
            self._result = self._closed()
        return self._result

    def _opened(self) -> Writer:
        writer = Writer(self.path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.STORAGE_PLUGINS = {StoragePlugin.MCAP: _TwoTimes}
        for key, value in self._notes.items():
            writer.set_custom_data(key, value)
        writer.open()
        try:
            self._reserve.write_bytes(bytes(_RESERVE_BYTES))
        except OSError:
            with suppress(OSError):
                writer.abort()
            # A disk that is full from the start leaves no empty bag.
            shutil.rmtree(self.path, ignore_errors=True)
            raise
        return writer

    def _closed(self) -> BagResult:
        if not self.problem:
            try:
                self._writer.close()
                return BagResult(self.path, {topic: len(self._accepted[topic]) for topic in self._connections})
            except OSError as error:
                self._stop(error)
        return self._rescued()

    def _stop(self, error: OSError) -> None:
        self.problem = f"recording stopped: {error.strerror or error}"
        # The half-written chunk is still in the buffer; closing writes it again, or fails again.
        with suppress(OSError):
            self._writer.abort()
        with suppress(OSError):
            self._reserve.unlink()

    def _rescued(self) -> BagResult:
        data = self.path / f"{self.path.name}.mcap"
        # The writer of rosbags leaves no index when it fails, so the file is closed by hand.
        tail, problem = McapTail(), self.problem
        try:
            tail = complete(data)
        except (OSError, ValueError) as error:
            problem = f"{problem}; the bag is not readable: {error}"
        counts = {topic: tail.counts.get(item.id, 0) for topic, item in self._connections.items()}
        lost = tuple(self._losses(counts))
        try:
            writer = self._writer
            writer.storage = _Completed(data)  # type: ignore[assignment]
            writer.counts = {item.id: counts[topic] for topic, item in self._connections.items()}
            writer.min_timestamp = min(tail.times, default=(0,))[0]
            writer.max_timestamp = max(tail.times, default=(0,))[0]
            writer.set_custom_data(PROBLEM_NOTE, problem)
            writer.set_custom_data(LOST_NOTE, json.dumps([vars(item) for item in lost]))
            writer.close()
        except OSError as error:
            problem = f"{problem}; metadata.yaml could not be written: {error}"
        return BagResult(self.path, counts, lost, problem)

    def _losses(self, counts: Mapping[str, int]) -> list[TopicLoss]:
        topics = (*self._connections, *sorted(self._late))
        # Accepted is not written: the last chunk may have been lost with everything in it.
        missing = ((t, self._accepted[t][counts.get(t, 0) :] + self._rejected[t]) for t in topics)
        return [TopicLoss(topic, len(times), times[0]) for topic, times in missing if times]
