"""A recorded run of one antenna as numpy arrays, from any rosbag2 bag.

The bag is read once; each message of the antenna becomes a row of its topic.  Types come from the
bag itself.  Stamps are simulation time, log times the wall clock of the recorder, both integer
nanoseconds; a bag whose log times are simulated has the wall clock in its publish times.  A message
that cannot be decoded is counted; NaN values are kept.
"""

import json
import re
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Connection
from rosbags.interfaces.typing import Typesdict
from rosbags.rosbag2.storage_mcap import zstd  # type: ignore[attr-defined]  # whichever zstd it uses
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.store import Typestore

from rf_pointing.core import AXES, LEVEL, Kinematics, axes_among, mount_from_notes
from rf_pointing.report.bag_source import READ_ERRORS, BagSource, open_bag
from rf_pointing.report.bag_writer import LOST_NOTE, PROBLEM_NOTE, TopicLoss
from rf_pointing.report.mcap_tail import publish_times
from rf_pointing.report.summary import Complaint
from rf_pointing.report.topics import TOPICS, TopicData, TopicLayout, as_column, head_reader, types_of

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_DECODE_ERRORS = (SerdeError, AttributeError, *READ_ERRORS)
_ZSTD = b"\x28\xb5\x2f\xfd"
"""Begin of a compressed message; one of ROS begins with a zero."""
_TICK_NS = 100_000_000
"""Longest step of a simulated clock; log times that follow it so closely are taken from it."""
# Value on /diagnostics: what earlier passes taught of the target.
LEARNED = "learned"
_NUMBER = re.compile(r"\d+(\.\d+)?")
Take = Callable[[int, bytes], None]
Layouts = Mapping[str, TopicLayout]


class _Rows:
    """Growing columns of one topic."""

    def __init__(self, layout: TopicLayout, topic: str, typestore: Typestore) -> None:
        self.topic, self.layout, self.typestore = topic, layout, typestore
        self.head, self.head_length = head_reader(layout.type_name, typestore)
        self.logs: list[int] = []
        self.heads: list[tuple[int, ...]] = []
        self.rows: list[tuple[Any, ...]] = []
        self.labels: tuple[str, ...] = ()
        self.unreadable = 0
        self.first_error = ""

    def take(self, log_time_ns: int, raw: bytes) -> None:
        layout = self.layout
        try:
            # A topic without columns (clock, commands) is not decoded: only its stamps are used.
            head = self.head(raw)
            message = self.typestore.deserialize_cdr(raw, layout.type_name) if layout.columns else None
            row = layout.row(message) if layout.columns else ()
            self.labels = self.labels or layout.labels(message)
        except _DECODE_ERRORS as error:
            # One damaged message must not cost the report; the first error is enough for the user.
            self.unreadable += 1
            self.first_error = self.first_error or str(error)
            return
        self.logs.append(log_time_ns)
        self.heads.append(head)
        self.rows.append(row)

    def data(self, published: Iterable[tuple[int, int]] = ()) -> TopicData:
        """Return the columns, with the `published` time to each log time (both ns) in its place."""
        times = defaultdict[int, deque[int]](deque)
        for log_time_ns, time_ns in published:
            times[log_time_ns].append(time_ns)
        found = [times[each].popleft() if times.get(each) else each for each in self.logs]
        # Without messages the array still needs its columns.
        logs = np.array(found, dtype=np.int64)
        heads = np.array(self.heads, dtype=np.int64).reshape(len(self.heads), self.head_length)
        rows = self.rows
        # Splits may overlap in time, and are read one after the other.
        if np.any(np.diff(logs) < 0):
            order = np.argsort(logs, kind="stable")
            logs, heads, rows = logs[order], heads[order], [rows[index] for index in order]
        names = self.layout.columns
        values = list(zip(*rows, strict=True)) or [()] * len(names)
        return TopicData(
            topic=self.topic, type_name=self.layout.type_name, log_time_ns=logs,
            stamp_ns=heads[:, 0] if self.head_length > 0 else None,
            sequence=heads[:, 1] if self.head_length > 1 else None,
            columns={name: as_column(column) for name, column in zip(names, values, strict=True)}, labels=self.labels,
        )  # fmt: skip


class _Collector:
    """Reads all messages of `source` once; `namespace` chooses the antenna."""

    def __init__(self, source: BagSource, namespace: str, layouts: Layouts) -> None:
        self._layouts = layouts
        self.problems = list(source.problems)
        self.warnings: dict[tuple[str, str], tuple[str, int]] = {}
        self.learned: dict[str, str] = {}
        self.others: dict[str, int] = defaultdict(int)
        self._namespace = namespace
        self._typestore = self._types(source)
        self._rows: dict[str, _Rows] = {}
        self.count = self.missing = 0
        self._published: dict[str, list[tuple[int, int]]] = defaultdict(list)
        for reader in source.readers:
            self._read(reader)
        self._read_publish_times(source)

    def topics(self) -> dict[str, TopicData]:
        """Return the topics of the antenna by relative name, in the order of their layouts."""
        rows, times = self._rows, self._published
        found = [name for name in self._layouts if name in rows]
        return {name: rows[name].data(times[rows[name].topic]) for name in found}

    def all_problems(self) -> tuple[str, ...]:
        """Return what is wrong with the recording, each problem once, in words for the user."""
        damage = [
            f"{rows.unreadable} messages of {name} could not be decoded ({rows.first_error})"
            for name, rows in self._rows.items() if rows.unreadable
        ]  # fmt: skip
        return tuple(dict.fromkeys(self.problems + damage))

    def complaints(self) -> tuple[Complaint, ...]:
        """Return the reports on `/diagnostics` above OK, with the last of equal messages."""
        found = sorted(self.warnings.items())
        return tuple(Complaint(component, *last) for (component, _), last in found)

    def _types(self, source: BagSource) -> Typestore:
        types: Typesdict = {}
        for connection in source.connections:
            try:
                types.update(types_of(connection.msgtype, connection.msgdef))
            except (TypesysError, *READ_ERRORS) as error:
                self.problems.append(f"the definition of {connection.msgtype} cannot be used: {error}")
        # A bag without definitions still has standard types, which are known here.
        # The types of the bag come first: the recorded version may differ from the installed one.
        if any(connection.msgtype not in types for connection in source.connections):
            types = {**get_typestore(Stores.ROS2_JAZZY).fielddefs, **types}
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(types)
        return typestore

    def _read(self, reader: Any) -> None:
        # Decided once per connection, not once per message: a pass has some 160 000 of them.
        takers = {item.id: self._taker(item) for item in reader.connections}
        count = 0
        try:
            for connection, log_time_ns, raw in reader.messages():
                # Without metadata only the message tells that it is compressed.
                plain = zstd.decompress(raw) if raw[:4] == _ZSTD else raw
                takers[connection.id](log_time_ns, plain)
                count += 1
        except READ_ERRORS as error:
            self.problems.append(f"reading stopped after {count} messages of {reader.path.name}: {error}")
        self.count += count
        # rosbags passes over a block of zeros, and over all that it takes for a record after it.
        if count < (whole := reader.message_count):
            self.missing += whole - count
            lost = f"{whole - count} of {whole} messages of {reader.path.name}"
            self.problems.append(f"{lost} are not readable: the file is damaged")

    def _read_publish_times(self, source: BagSource) -> None:
        """Read the wall times of a bag whose log times are those that its clock tells."""
        clock = self._rows.get("clock")
        if clock is None or not clock.logs:
            return
        if np.median(np.abs(np.subtract(clock.logs, [head[0] for head in clock.heads]))) > _TICK_NS:
            return
        storages: list[Any] = [each.storage for each in source.readers]
        for part in (part for each in storages for part in getattr(each, "storages", (each,))):
            # What is damaged keeps its log times.
            with suppress(*READ_ERRORS):
                for topic, times in publish_times(Path(part.path)).items():
                    self._published[topic] += times

    def _taker(self, connection: Connection) -> Take:
        name = connection.topic.removeprefix(f"{self._namespace}/")
        mine = connection.topic == f"{self._namespace}/{name}"
        layout = self._layouts.get(name) if mine else None
        if layout is None:
            diagnostics = connection.topic == "/diagnostics" and connection.msgtype == _DIAGNOSTICS
            return self._take_diagnostics if diagnostics else partial(self._count, connection.topic)
        if connection.msgtype != layout.type_name:
            self.problems.append(f"{name} has type {connection.msgtype}, not {layout.type_name}: it is not used")
        elif connection.msgtype not in self._typestore.fielddefs:
            self.problems.append(f"{name} cannot be decoded: the bag does not define {connection.msgtype}")
        else:
            rows = _Rows(layout, connection.topic, self._typestore)
            return self._rows.setdefault(name, rows).take
        return partial(self._count, connection.topic)

    def _count(self, topic: str, _log_time_ns: int, _raw: bytes) -> None:
        self.others[topic] += 1

    def _is_ours(self, name: str) -> bool:
        """Return whether a status is of this antenna: its nodes put their namespace before it."""
        node = name.lstrip("/").partition(":")[0]
        # One without a namespace is of no antenna in particular, as a host or a driver.
        return "/" not in node or node.startswith(f"{self._namespace.strip('/')}/")

    def _take_diagnostics(self, _log_time_ns: int, raw: bytes) -> None:
        self.others["/diagnostics"] += 1
        try:
            message: Any = self._typestore.deserialize_cdr(raw, _DIAGNOSTICS)
        except _DECODE_ERRORS:
            return
        for status in message.status:
            if not self._is_ours(status.name):
                continue
            self.learned.update((each.key, each.value) for each in status.values if each.key == LEARNED)
            if status.level:
                # A message with a count in it changes every second, but is one warning.
                key = (status.name, _NUMBER.sub("#", status.message))
                self.warnings[key] = (status.message, self.warnings.get(key, ("", 0))[1] + 1)


# "sim/pointing_error" also ends with "pointing_error".
_LONGEST_FIRST = sorted(TOPICS, key=len, reverse=True)


@dataclass(frozen=True)
class Pass:
    """One predicted pass: times in nanoseconds of simulation time, angle in radians."""

    target: str
    aos_ns: int
    tca_ns: int
    los_ns: int
    peak_elevation_rad: float


@dataclass(frozen=True)
class Recording:
    """All topics of one antenna, by name relative to its namespace, and what is wrong with them.

    `others` counts the messages of topics that belong to no antenna or to another.  `warnings` are
    the reports on `/diagnostics` above OK.  `not_recorded` is what the recorder reported as lost.
    """

    path: Path
    namespace: str
    topics: dict[str, TopicData]
    passes: tuple[Pass, ...]
    warnings: tuple[Complaint, ...]
    others: dict[str, int]
    notes: dict[str, str]
    not_recorded: tuple[TopicLoss, ...]
    problems: tuple[str, ...]

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the lower and the upper axis: those of the joints."""
        joints = self.get("joint_states")
        return AXES if joints is None else axes_among(joints.labels)

    @property
    def mount(self) -> Kinematics | None:
        """The mount; None for a damaged note, or without it for another type of axes."""
        return mount if (mount := mount_from_notes(self.notes)) != LEVEL or self.axes == AXES else None

    def get(self, name: str) -> TopicData | None:
        """Return topic `name`, None if the recording has no message of it."""
        data = self.topics.get(name)
        return data if data is not None and len(data) else None


def namespaces(topics: Iterable[str]) -> list[str]:
    """Return the antenna namespaces among full topic names, sorted; the root namespace is ""."""
    found = set()
    for topic in topics:
        name = next((known for known in _LONGEST_FIRST if topic.endswith(f"/{known}")), None)
        # The global clock of an ordinary simulation is not a sign of an antenna.
        if name is not None and topic != "/clock":
            found.add(topic.removesuffix(f"/{name}"))
    return sorted(found)


def antennas(path: Path | str) -> list[str]:
    """Return the antenna namespaces of a bag; ValueError where nothing of it can be read."""
    with ExitStack() as stack:
        return _antennas(open_bag(Path(path), stack))


def read_recording(path: Path | str, *, namespace: str | None = None, layouts: Layouts = TOPICS) -> Recording:
    """Read the recording of one antenna from a bag directory, or one of its files.

    `namespace` chooses one of several, `layouts` what is read of which topics.  ValueError for
    nothing readable at `path`, no antenna in it, several and no `namespace`, or another one.
    """
    path = Path(path)
    with ExitStack() as stack:
        source = open_bag(path, stack)
        found = _antennas(source)
        if not found:
            raise ValueError("; ".join([f"path={path} holds no topic of an antenna", *source.problems]))
        chosen = _chosen(found, namespace, path)
        collector = _Collector(source, chosen, layouts)
        topics = collector.topics()
        if collector.missing:
            # A second time, from what is intact, with what was found of the first.
            damage, before = collector.problems, collector.count
            rest = open_bag(path, stack, damaged=True)
            rest.notes, collector = source.notes, _Collector(rest, chosen, layouts)
            topics = collector.topics()
            collector.problems += [*damage, f"{collector.count - before} messages beyond the damage are used"]
        problem = source.notes.get(PROBLEM_NOTE, "")
        lost = json.loads(source.notes.get(LOST_NOTE, "[]"))
        own = (LOST_NOTE, PROBLEM_NOTE)
        return Recording(
            path=path, namespace=chosen, topics=topics, passes=_passes(topics.get("passes")),
            warnings=collector.complaints(), others=dict(sorted(collector.others.items())),
            notes={key: text for key, text in source.notes.items() if key not in own} | collector.learned,
            not_recorded=tuple(TopicLoss(**item) for item in lost),
            problems=(*filter(None, [problem]), *collector.all_problems()),
        )  # fmt: skip


def _antennas(source: BagSource) -> list[str]:
    # The types of our own topics are a safer sign than names such as joint_states.
    ours = {item.topic for item in source.connections if item.msgtype.startswith("rf_pointing_msgs/")}
    return namespaces(ours or {item.topic for item in source.connections})


def _chosen(found: list[str], wanted: str | None, path: Path) -> str:
    names = ", ".join(name or "/" for name in found)
    if wanted is None:
        if len(found) > 1:
            raise ValueError(f"path={path} holds several antennas ({names}); choose one by its namespace")
        return found[0]
    stem = wanted.strip("/")
    full = f"/{stem}" if stem else ""
    if full not in found:
        raise ValueError(f"namespace={full or '/'} is not in {path}, which holds {names}")
    return full


def _passes(data: TopicData | None) -> tuple[Pass, ...]:
    """Return every announced pass in its newest version, in order of acquisition."""
    found: list[Pass] = []
    for new in (_pass(item) for entry in (data["passes"] if data is not None else ()) for item in entry):
        # A list that is published again has better times of the same pass.
        apart = (old.aos_ns >= new.los_ns or new.aos_ns >= old.los_ns for old in found)
        others = [o for o, far in zip(found, apart, strict=True) if far or o.target != new.target]
        found = [*others, new]
    return tuple(sorted(found, key=lambda item: item.aos_ns))


def _pass(message: Any) -> Pass:
    aos, tca, los = (time.sec * 10**9 + time.nanosec for time in (message.aos, message.tca, message.los))
    return Pass(message.target, aos, tca, los, message.peak_elevation)
