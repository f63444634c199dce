"""Columns that a report reads of each topic of an antenna, and the messages of one topic as arrays.

A column is a name and the attribute of the message it comes from; no other attribute is read.
"""

import math
import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import get_types_from_idl, get_types_from_msg
from rosbags.typesys.store import Typestore

from rf_pointing.core import Array, BoolArray, IntArray, Sensor, axes_among

Head = tuple[int, ...]
# The leftmost match counts: `aos_t_s` loses `_t_s`, not only `_s`.
_UNIT = re.compile(r"_(rad_s2|rad_s|rad2|rad|m_s|m|t_s|s|w|db_hz|db)$")
_IDL_SEPARATOR = "=" * 80 + "\n"


def wire_name(name: str) -> str:
    """Return the name of a message's field: that of the signal's without the unit."""
    return _UNIT.sub("", name)


@dataclass(frozen=True)
class TopicData:
    """Messages (n,) of a topic in order of reception; None for what its type does not have.

    `labels` are those of the pairs in its columns, where its messages name them.
    """

    topic: str
    type_name: str
    log_time_ns: IntArray
    stamp_ns: IntArray | None
    sequence: IntArray | None
    columns: dict[str, NDArray[Any]]
    labels: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.log_time_ns)

    def part(self, chosen: BoolArray) -> "TopicData":
        """Return only the messages that are `chosen` (n,)."""
        return replace(
            self, log_time_ns=self.log_time_ns[chosen],
            stamp_ns=None if self.stamp_ns is None else self.stamp_ns[chosen],
            sequence=None if self.sequence is None else self.sequence[chosen],
            columns={name: values[chosen] for name, values in self.columns.items()},
        )  # fmt: skip

    @property
    def t_s(self) -> Array:
        """Stamps (n,) in s, of a type that has them."""
        assert self.stamp_ns is not None
        return np.asarray(self.stamp_ns * 1e-9, dtype=np.float64)

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]


def head_reader(type_name: str, typestore: Typestore) -> tuple[Callable[[bytes], Head], int]:
    """Return a function from serialized bytes to (stamp in ns, sequence), and how many it gives."""
    fields = typestore.fielddefs[type_name][1]
    # Every message of ours begins with header and sequence; clock with its time.
    names = [name for name, _ in fields[:2]]
    if names == ["header", "sequence"]:
        return _stamp_and_sequence, 2
    if names[:1] in (["header"], ["clock"]):
        return _stamp, 1
    return lambda _: (), 0


def _stamp(raw: bytes) -> Head:
    # CDR: byte 1 is the byte order, the stamp follows the 4-byte encapsulation.
    seconds, nanoseconds = struct.unpack_from("<iI" if raw[1] else ">iI", raw, 4)
    return (seconds * 10**9 + nanoseconds,)


def _stamp_and_sequence(raw: bytes) -> Head:
    order = "<" if raw[1] else ">"
    # A string (the frame) is between stamp and counter.
    (length,) = struct.unpack_from(f"{order}I", raw, 12)
    # CDR aligns the counter to 8 bytes, counted from behind the 4-byte encapsulation.
    start = (12 + length + 7) // 8 * 8 + 4
    (sequence,) = struct.unpack_from(f"{order}q", raw, start)
    return (*_stamp(raw), sequence)


def as_column(values: Sequence[Any]) -> NDArray[Any]:
    """Return an array with one entry per message: a number, a boolean, text, or a list."""
    # Lists of messages differ in length; numpy would refuse to make them one array.
    if values and isinstance(values[0], list) and not all(v and isinstance(v[0], (int, float)) for v in values):
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column
    return np.array(values)


@lru_cache(maxsize=256)
def types_of(type_name: str, definition: MessageDefinition) -> Typesdict:
    """Return the types in a bag's definition of `type_name`; empty if the bag has none."""
    text = definition.data
    if definition.format == MessageDefinitionFormat.MSG:
        return get_types_from_msg(text, type_name)
    if definition.format == MessageDefinitionFormat.NONE:
        return {}
    types: Typesdict = {}
    for part in text.split(_IDL_SEPARATOR):
        types.update(get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part))
    return types


Row = tuple[Any, ...]


@dataclass(frozen=True)
class TopicLayout:
    """Type of one topic, how a message becomes a row of `columns`, and whether it has a period.

    `labels` gives those of the pairs in the columns, from one message.
    """

    type_name: str
    columns: tuple[str, ...]
    row: Callable[[Any], Any]
    periodic: bool = True
    labels: Callable[[Any], tuple[str, ...]] = lambda _: ()


def own_layout(name: str, *columns: str, periodic: bool = True, added: dict[str, Any] | None = None) -> TopicLayout:
    """Return the layout of a message of ours; `added` fields are missing in older recordings."""
    later = added or {}

    def row(message: Any) -> Row:
        own = (getattr(message, column) for column in columns)
        return *own, *(getattr(message, column, blank) for column, blank in later.items())

    return TopicLayout(f"rf_pointing_msgs/msg/{name}", (*columns, *later), row, periodic)


def _joint_row(message: Any) -> Row:
    # The order of the joints is the publisher's choice.
    order = [message.name.index(axis) for axis in axes_among(message.name)]
    # A driver need not publish rates; a report then has no axis rates.
    velocity = [message.velocity[i] for i in order] if len(message.velocity) else [math.nan, math.nan]
    return [message.position[i] for i in order], velocity


def _certificate_row(message: Any) -> Row:
    chosen = next((branch for branch in message.branches if branch.works), None)
    times = [time.sec * 10**9 + time.nanosec for time in (message.aos, message.los)]
    # The blanks are those of older recordings, and of a pass that was refused.
    numbers = (getattr(chosen, name, 0.0) for name in ("lost", "late", "acquisition", "mean_loss"))
    return message.target, *times, chosen is not None, *numbers, getattr(message, "least_share", 0.0)


_ERROR = own_layout("PointingError", "cross_elevation", "elevation", "carrier_to_noise", "sensor", "valid", "reason")

TOPICS: dict[str, TopicLayout] = {
    "clock": TopicLayout("rosgraph_msgs/msg/Clock", (), lambda _: ()),
    "target": own_layout(
        "Target", "target", "azimuth", "elevation", "azimuth_rate", "elevation_rate", "azimuth_acceleration",
        "elevation_acceleration", "range", "range_rate",
    ),
    "passes": own_layout("PassList", "passes", periodic=False),
    "pointing_model": own_layout("PointingModel", "name", periodic=False),
    "joint_trajectory": TopicLayout("trajectory_msgs/msg/JointTrajectory", (), lambda _: ()),
    "tracking_status": own_layout(
        "TrackingStatus", "mode", "target", "reason", "azimuth", "elevation", "scan_centre", "cross_elevation_error",
        "elevation_error", "cross_elevation_offset", "elevation_offset", "carrier_to_noise", "beamwidth",
        "command_lead", "commands_sent",
        added={"level": 0, "alarm": "", "seconds_tracked": 0.0, "seconds_lost": 0.0, "mean_loss": 0.0,
               "offsets": ""},
    ),
    "pass_certificate": TopicLayout(
        "rf_pointing_msgs/msg/PassCertificate",
        ("target", "aos", "los", "accepted", "lost", "late", "acquisition", "mean_loss", "least_share"),
        _certificate_row, periodic=False,
    ),
    "joint_states": TopicLayout("sensor_msgs/msg/JointState", ("position", "velocity"), _joint_row,
                                 labels=lambda message: axes_among(message.name)),
    "antenna_status": own_layout(
        "AntennaStatus", "mode", "fault", "rate_command", "rate_limit", "acceleration_limit", "at_limit",
        "command_lead", "tick_lateness", "commands_accepted", "commands_rejected", "last_rejection",
        added={"set_points": 0, "starts": [0, 0], "reversals": [0, 0], "sun_permit": ""},
    ),
    "sim/boresight": own_layout("Boresight", "azimuth", "elevation"),
    "sim/pointing_error": _ERROR,
    # The topic of the samples bears the name of their sensor.
    Sensor.MONOPULSE: own_layout("Monopulse", "carrier_to_noise"),
    "carrier_power": own_layout("CarrierPower", "power", "carrier_to_noise"),
    "pointing_error": _ERROR,
}  # fmt: skip
"""Layout by topic name relative to the antenna's namespace."""
