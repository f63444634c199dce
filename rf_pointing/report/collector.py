"""One reading of a bag: every message of one antenna sorted into columns by topic, damage counted."""

import re
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
from rosbags.interfaces import Connection
from rosbags.interfaces.typing import Typesdict
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.store import Typestore

from rf_pointing.report.bag_source import READ_ERRORS, BagSource
from rf_pointing.report.topic_data import TopicData, as_column, head_reader, types_of
from rf_pointing.report.topics import TOPICS

__all__ = ["Collector"]

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_DECODE_ERRORS = (SerdeError, AttributeError, *READ_ERRORS)
_NUMBER = re.compile(r"\d+(\.\d+)?")
Take = Callable[[int, bytes], None]


class _Rows:
    """Growing columns of one topic."""

    def __init__(self, name: str, topic: str, typestore: Typestore) -> None:
        self.topic = topic
        self.layout = TOPICS[name]
        self.head, self.head_length = head_reader(self.layout.type_name, typestore)
        self.typestore = typestore
        self.logs: list[int] = []
        self.heads: list[tuple[int, ...]] = []
        self.rows: list[tuple[Any, ...]] = []
        self.unreadable = 0
        self.first_error = ""

    def take(self, log_time_ns: int, raw: bytes) -> None:
        layout = self.layout
        try:
            head = self.head(raw)
            row = layout.row(self.typestore.deserialize_cdr(raw, layout.type_name)) if layout.columns else ()
        except _DECODE_ERRORS as error:
            self.unreadable += 1
            self.first_error = self.first_error or str(error)
            return
        self.logs.append(log_time_ns)
        self.heads.append(head)
        self.rows.append(row)

    def data(self) -> TopicData:
        heads = np.array(self.heads, dtype=np.int64).reshape(len(self.heads), self.head_length)
        names = self.layout.columns
        values = list(zip(*self.rows, strict=True)) or [()] * len(names)
        return TopicData(
            topic=self.topic,
            type_name=self.layout.type_name,
            log_time_ns=np.array(self.logs, dtype=np.int64),
            stamp_ns=heads[:, 0] if self.head_length > 0 else None,
            sequence=heads[:, 1] if self.head_length > 1 else None,
            columns={name: as_column(column) for name, column in zip(names, values, strict=True)},
        )


def _undefined(source: BagSource, types: Typesdict) -> bool:
    return any(connection.msgtype not in types for connection in source.connections)


class Collector:
    """Reads all messages of `source` once; `namespace` chooses the antenna."""

    def __init__(self, source: BagSource, namespace: str) -> None:
        self.problems = list(source.problems)
        self.warnings: dict[tuple[str, str], tuple[str, int]] = {}
        self.others: dict[str, int] = defaultdict(int)
        self._namespace = namespace
        self._typestore = self._types(source)
        self._rows: dict[str, _Rows] = {}
        for reader in source.readers:
            self._read(reader)

    def topics(self) -> dict[str, TopicData]:
        """Return the topics of the antenna by relative name, in the order of the table of topics."""
        return {name: self._rows[name].data() for name in TOPICS if name in self._rows}

    def all_problems(self) -> tuple[str, ...]:
        """Return what is wrong with the recording, each once, in the user's words."""
        damage = [
            f"{rows.unreadable} messages of {name} could not be decoded ({rows.first_error})"
            for name, rows in self._rows.items()
            if rows.unreadable
        ]
        return tuple(dict.fromkeys(self.problems + damage))

    def _types(self, source: BagSource) -> Typestore:
        types: Typesdict = {}
        for connection in source.connections:
            try:
                types.update(types_of(connection.msgtype, connection.msgdef))
            except (TypesysError, *READ_ERRORS) as error:
                self.problems.append(f"the definition of {connection.msgtype} cannot be used: {error}")
        # A recorder that stored no definitions leaves the standard types to us.
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(
            {**get_typestore(Stores.ROS2_JAZZY).fielddefs, **types} if _undefined(source, types) else types
        )
        return typestore

    def _read(self, reader: Any) -> None:
        takers = {item.id: self._taker(item) for item in reader.connections}
        count = 0
        try:
            for connection, log_time_ns, raw in reader.messages():
                takers[connection.id](log_time_ns, raw)
                count += 1
        except READ_ERRORS as error:
            self.problems.append(f"reading stopped after {count} messages of {reader.path.name}: {error}")

    def _taker(self, connection: Connection) -> Take:
        name = connection.topic.removeprefix(f"{self._namespace}/")
        layout = TOPICS.get(name) if connection.topic == f"{self._namespace}/{name}" else None
        if layout is None:
            diagnostics = connection.topic == "/diagnostics" and connection.msgtype == _DIAGNOSTICS
            return self._take_diagnostics if diagnostics else self._counter(connection.topic)
        if connection.msgtype != layout.type_name:
            self.problems.append(f"{name} has type {connection.msgtype}, not {layout.type_name}: it is not used")
        elif connection.msgtype not in self._typestore.fielddefs:
            self.problems.append(f"{name} cannot be decoded: the bag does not define {connection.msgtype}")
        else:
            return self._rows.setdefault(name, _Rows(name, connection.topic, self._typestore)).take
        return self._counter(connection.topic)

    def _counter(self, topic: str) -> Take:
        def count(_log_time_ns: int, _raw: bytes) -> None:
            self.others[topic] += 1

        return count

    def _take_diagnostics(self, _log_time_ns: int, raw: bytes) -> None:
        self.others["/diagnostics"] += 1
        try:
            message: Any = self._typestore.deserialize_cdr(raw, _DIAGNOSTICS)
        except _DECODE_ERRORS:
            return
        for status in message.status:
            if status.level:
                key = (status.name, _NUMBER.sub("#", status.message))
                self.warnings[key] = (status.message, self.warnings.get(key, ("", 0))[1] + 1)
