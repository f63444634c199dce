"""A recording as tables for other programs: CSV, Parquet, MATLAB, and pandas in a notebook.

A topic is a table with a row for each message.  A column's name ends in its unit (SI and radians),
pairs of axes are two columns.  Every table begins with

    stamp_ns      when the values are valid: UTC in ns since 1970, -1 where the type has no stamp
    log_time_ns   when the recorder received them, by its own clock
    t_s           stamp in s after the first one of the recording

The dictionary that is written with every export says what each column means and where it comes
from.
"""

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_choice, write_whole
from rf_pointing.report.recording import Pass, Recording
from rf_pointing.report.topics import TOPICS, TopicData

Columns = dict[str, NDArray[Any]]
Meaning = tuple[str, str]
FORMATS = ("csv", "parquet", "mat")
DICTIONARY = "dictionary"
MESSAGES = Path(__file__).parent / "messages"
"""The definitions of rf_pointing_msgs; in a checkout a link to msg_defs/msg.

They ship with the package, so that they are there without ROS.  A comment begins with the unit:
`# rad/s, after limits`.
"""
SUFFIXES = {"rad": "_rad", "rad/s": "_rad_s", "rad/s^2": "_rad_s2", "m": "_m", "m/s": "_m_s", "s": "_s", "dB": "_db",
            "dB-Hz": "_db_hz", "W": "_w", "ns": "_ns", "": ""}  # fmt: skip
"""End of the name of a column, by its unit."""
FIELD = re.compile(r"^(\S+) (\w+)(?: -?[\d.]+)? *(?:# *(.*(?:\n +#.*)*))?$", re.MULTILINE)
"""Type, name and comment of a field of a definition, with its default or without."""
_JOINTS = {"position": ("rad", "encoder angle, continuous over all turns"), "velocity": ("rad/s", "encoder rate")}
"""JointState is a message of ROS, whose comments are not at hand without it."""
# A row of these tables is made of the elements of a list in their messages.
_INNER = {"passes": "Pass", "pass_certificate": "PassBranch"}
_PASSES = ("target", "aos", "tca", "los", "peak_elevation")
_HEAD = {
    "stamp_ns": ("ns", "when the values are valid: UTC since 1970; -1 without a stamp"),
    "log_time_ns": ("ns", "when the recorder received the message, by its own clock"),
    "t_s": ("s", "stamp after the first one of the recording"),
}


@dataclass(frozen=True, slots=True)
class ColumnMeaning:
    """One row of the data dictionary; `source` is the topic and the field of its message."""

    table: str
    column: str
    unit: str
    meaning: str
    source: str
    type_name: str


@cache
def meanings() -> dict[str, dict[str, Meaning]]:
    """Return unit and meaning of every column that is exported, by topic."""
    return {topic: _of_topic(topic) for topic, layout in TOPICS.items() if layout.columns}


def _of_topic(topic: str) -> dict[str, Meaning]:
    package, _, name = TOPICS[topic].type_name.partition("/msg/")
    if package != "rf_pointing_msgs":
        return _JOINTS
    fields = (_fields(_INNER[topic]) if topic in _INNER else {}) | _fields(name)
    return {column: fields[column] for column in (_PASSES if topic == "passes" else TOPICS[topic].columns)}


@cache
def _fields(name: str) -> dict[str, Meaning]:
    """Return unit and meaning of every field of a message; a time is read in ns."""
    found = {}
    definition = (MESSAGES / f"{name}.msg").read_text(encoding="utf-8")
    for kind, field_name, comment in FIELD.findall(definition):
        text = re.sub(r"\s*\n +#\s*", " ", comment)
        unit = re.split("[, ]", text, maxsplit=1)[0]
        if kind == "builtin_interfaces/Time":
            found[field_name] = ("ns", f"{text} since 1970")
        elif unit in SUFFIXES:
            found[field_name] = (unit, text.removeprefix(unit).lstrip(", "))
        else:
            found[field_name] = ("", text)
    return found


def topic_table(recording: Recording, topic: str) -> Columns:
    """Return a topic of a recording as columns (n,); ValueError for one that it does not have."""
    return _columns(recording, topic)[0]


def exported_topics(recording: Recording) -> list[str]:
    """Return the topics of a recording that have columns and messages."""
    return [topic for topic in meanings() if recording.get(topic) is not None]


def export_recording(recording: Recording, folder: Path, kind: str) -> list[Path]:
    """Write every topic of a recording in one of `FORMATS`; return the files.

    CSV and Parquet are a file for each topic in `folder` and `dictionary.csv`; MATLAB is
    `recording.mat` with a structure for each topic, and `dictionary`.  ValueError for an unknown
    format, Parquet without pyarrow, and a recording without a topic to export.
    """
    require_choice("export", kind, FORMATS)
    if kind == "parquet":
        _pyarrow()
    topics = exported_topics(recording)
    if not topics:
        raise ValueError(f"{recording.path} holds no message of {', '.join(meanings())}")
    tables = {_file_name(topic): _columns(recording, topic) for topic in topics}
    described = [row for _, rows in tables.values() for row in rows]
    if kind == "mat":
        return [_write_mat(folder / "recording.mat", {name: each for name, (each, _) in tables.items()}, described)]
    files = [folder / f"{name}.{kind}" for name in tables]
    for file, (columns, rows) in zip(files, tables.values(), strict=True):
        if kind == "csv":
            # tolist() gives Python's floats: their shortest text is read back to the last bit.
            values = (column.tolist() for column in columns.values())
            _write_csv(file, columns, zip(*values, strict=True))
        else:
            _write_parquet(file, columns, rows)
    dictionary = folder / f"{DICTIONARY}.csv"
    _write_csv(dictionary, [each.name for each in fields(ColumnMeaning)], map(astuple, described))
    return [*files, dictionary]


def _columns(recording: Recording, topic: str) -> tuple[Columns, list[ColumnMeaning]]:
    """Return the columns of a topic, and what they mean."""
    require_choice("topic", topic, meanings())
    data = recording.get(topic)
    if data is None:
        raise ValueError(f"{recording.path} has no message of {topic}; it has {', '.join(exported_topics(recording))}")
    own = topic == "passes"
    values = _passes(recording) if own else _times(recording, data) | _values(data, topic, recording.axes)
    rows = []
    for name in values:
        field_name, unit, meaning = _meaning(topic, name, recording.axes)
        source = f"{data.topic}: {field_name}" if field_name else data.topic
        rows.append(ColumnMeaning(_file_name(topic), name, unit, meaning, source, data.type_name))
    return values, rows


def _meaning(topic: str, column: str, axes: Sequence[str]) -> tuple[str, str, str]:
    """Return the field of the message, the unit and the meaning of an exported column."""
    if column in _HEAD:
        return {"stamp_ns": "header.stamp"}.get(column, ""), *_HEAD[column]
    for name, (unit, meaning) in meanings()[topic].items():
        if column == f"{name}{SUFFIXES[unit]}":
            return name, unit, meaning
        for index, axis in enumerate(axes):
            if column == f"{name}_{axis}{SUFFIXES[unit]}":
                return f"{name}[{index}]", unit, f"{meaning}, {axis}"
    raise ValueError(f"column {column} of {topic} has no meaning in the data dictionary")


def _times(recording: Recording, data: TopicData) -> Columns:
    known = [each.stamp_ns for each in recording.topics.values() if each.stamp_ns is not None]
    if data.stamp_ns is None:
        stamps, since = np.full(len(data), -1), data.log_time_ns - data.log_time_ns[0]
    else:
        stamps = data.stamp_ns
        since = stamps - min(int(each.min()) for each in known if len(each))
    return {"stamp_ns": stamps, "log_time_ns": data.log_time_ns, "t_s": since * 1e-9}


def _values(data: TopicData, topic: str, axes: Sequence[str]) -> Columns:
    found: Columns = {}
    for name, (unit, _) in meanings()[topic].items():
        if name not in data.columns:
            continue
        values, suffix = data.columns[name], SUFFIXES[unit]
        # Older recordings lack a field; its blank is a scalar for pairs, too.
        if values.ndim == 2 and values.shape[1] == len(axes):
            found |= {f"{name}_{axis}{suffix}": values[:, index] for index, axis in enumerate(axes)}
        else:
            found[f"{name}{suffix}"] = values
    return found


def _passes(recording: Recording) -> Columns:
    """Return the announced passes, each once in its newest version."""
    names = [each.name for each in fields(Pass)]
    columns = {name: np.array([getattr(each, name) for each in recording.passes]) for name in names}
    return columns | {"stamp_ns": columns["aos_ns"]}


def _file_name(topic: str) -> str:
    return topic.replace("/", "_")


def _write_csv(path: Path, head: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    write_whole(path, text.getvalue())


def _pyarrow() -> Any:
    try:
        import pyarrow.parquet
    except ImportError:
        missing = "the package pyarrow, which is not installed: pip install pyarrow"
        raise ValueError(f"export=parquet needs {missing}") from None
    return pyarrow


def _write_parquet(path: Path, columns: Columns, rows: list[ColumnMeaning]) -> None:
    """Write a table whose fields carry unit, meaning and source as metadata."""
    arrow = _pyarrow()
    arrays = [arrow.array(column.tolist()) for column in columns.values()]
    described = [
        arrow.field(row.column, array.type, metadata={"unit": row.unit, "meaning": row.meaning, "source": row.source})
        for row, array in zip(rows, arrays, strict=True)
    ]
    sink = io.BytesIO()
    arrow.parquet.write_table(arrow.Table.from_arrays(arrays, schema=arrow.schema(described)), sink)
    write_whole(path, sink.getvalue())


def _write_mat(path: Path, tables: Mapping[str, Columns], rows: list[ColumnMeaning]) -> Path:
    from scipy.io import savemat

    names = [each.name for each in fields(ColumnMeaning)]
    described = {name: np.array([getattr(row, name) for row in rows]) for name in names}
    # Texts as a cell array: a matrix of characters would pad them with blanks.
    content = {
        name: {key: one[key].astype(object) if one[key].dtype.kind == "U" else one[key] for key in one}
        for name, one in {**tables, DICTIONARY: described}.items()
    }
    sink = io.BytesIO()
    savemat(sink, content, long_field_names=True, oned_as="column", do_compression=True)
    write_whole(path, sink.getvalue())
    return path
