"""The messages of one topic as arrays, and the small pieces that turn serialized messages into them."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import get_types_from_idl, get_types_from_msg
from rosbags.typesys.store import Typestore

__all__ = ["TopicData", "as_column", "head_reader", "types_of"]

Ints = NDArray[np.int64]
Head = tuple[int, ...]
_IDL_SEPARATOR = "=" * 80 + "\n"


@dataclass(frozen=True)
class TopicData:
    """Messages of one topic in order of reception, n in number.

    `stamp_ns` and `sequence` are None where the type has none; `columns` holds arrays of length n.
    """

    topic: str
    type_name: str
    log_time_ns: Ints
    stamp_ns: Ints | None
    sequence: Ints | None
    columns: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.log_time_ns)

    def part(self, chosen: NDArray[np.bool_]) -> "TopicData":
        """Return only the messages that are `chosen` (n,)."""
        return TopicData(
            topic=self.topic,
            type_name=self.type_name,
            log_time_ns=self.log_time_ns[chosen],
            stamp_ns=None if self.stamp_ns is None else self.stamp_ns[chosen],
            sequence=None if self.sequence is None else self.sequence[chosen],
            columns={name: values[chosen] for name, values in self.columns.items()},
        )

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]


def head_reader(type_name: str, typestore: Typestore) -> tuple[Callable[[bytes], Head], int]:
    """Return a function from serialized bytes to (stamp in ns, sequence), and how many of the two the type has."""
    fields = typestore.fielddefs[type_name][1]
    names = [name for name, _ in fields[:2]]
    if names == ["header", "sequence"]:
        return _stamp_and_sequence, 2
    if names[:1] in (["header"], ["clock"]):
        return _stamp, 1
    return lambda _: (), 0


def _stamp(raw: bytes) -> Head:
    seconds, nanoseconds = struct.unpack_from("<iI" if raw[1] else ">iI", raw, 4)
    return (seconds * 10**9 + nanoseconds,)


def _stamp_and_sequence(raw: bytes) -> Head:
    order = "<" if raw[1] else ">"
    (length,) = struct.unpack_from(f"{order}I", raw, 12)
    # CDR aligns the counter to 8 bytes, counted from behind the 4-byte encapsulation.
    start = (12 + length + 7) // 8 * 8 + 4
    (sequence,) = struct.unpack_from(f"{order}q", raw, start)
    return (*_stamp(raw), sequence)


def as_column(values: Sequence[Any]) -> NDArray[Any]:
    """Return an array with one entry per message: numbers, booleans, text, or the lists of messages themselves."""
    if values and isinstance(values[0], list) and not all(v and isinstance(v[0], (int, float)) for v in values):
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column
    return np.array(values)


@lru_cache(maxsize=256)
def types_of(type_name: str, definition: MessageDefinition) -> Typesdict:
    """Return the types that a bag's definition of `type_name` names; empty when the bag holds none."""
    text = definition.data
    if definition.format == MessageDefinitionFormat.MSG:
        return get_types_from_msg(text, type_name)
    if definition.format == MessageDefinitionFormat.NONE:
        return {}
    types: Typesdict = {}
    for part in text.split(_IDL_SEPARATOR):
        types.update(get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part))
    return types
