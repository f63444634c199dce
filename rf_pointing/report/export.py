"""A recording as tables for other programs: CSV, Parquet, MATLAB, and pandas in a notebook.

A topic is a table with a row for each message.  A column's name ends in its unit (SI and radians),
pairs of axes are two columns.  Every table begins with

    stamp_ns      when the values are valid: UTC in ns since 1970, -1 where the type has no stamp
    log_time_ns   when the recorder received them, by its own clock
    t_s           stamp in s after the first one of the recording

`data_dictionary` says what each column means and where it comes from; it is written with every
export.
"""

import csv
import io
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import AXES
from rf_pointing.core.whole_file import write_whole
from rf_pointing.report.recording import Recording
from rf_pointing.report.topics import TopicData

Columns = dict[str, NDArray[Any]]
FORMATS = ("csv", "parquet", "mat")
DICTIONARY = "dictionary"
_SUFFIXES = {"rad": "_rad", "rad/s": "_rad_s", "rad/s^2": "_rad_s2", "m": "_m", "m/s": "_m_s", "s": "_s", "dB": "_db",
             "dB-Hz": "_db_hz", "W": "_w", "ns": "_ns", "": ""}  # fmt: skip
_HEAD = {
    "stamp_ns": ("ns", "when the values are valid: UTC since 1970; -1 without a stamp"),
    "log_time_ns": ("ns", "when the recorder received the message, by its own clock"),
    "t_s": ("s", "stamp after the first one of the recording"),
}
_ERROR = {
    "cross_elevation": ("rad", "target minus beam on the sky, positive to the right"),
    "elevation": ("rad", "target minus beam, positive above"),
    "carrier_to_noise": ("dB-Hz", "carrier over noise density, as the sensor measured it"),
    "sensor": ("", "which sensor measured"),
    "valid": ("", "whether the error may be used"),
    "reason": ("", "why it is not valid"),
}
MEANINGS: dict[str, dict[str, tuple[str, str]]] = {
    "target": {
        "target": ("", "catalogue number or name"),
        "azimuth": ("rad", "apparent direction of the target, from true north through east"),
        "elevation": ("rad", "apparent elevation of the target, refraction included"),
        "azimuth_rate": ("rad/s", "its rate"),
        "elevation_rate": ("rad/s", "its rate"),
        "azimuth_acceleration": ("rad/s^2", "its acceleration"),
        "elevation_acceleration": ("rad/s^2", "its acceleration"),
        "range": ("m", "distance of the target"),
        "range_rate": ("m/s", "positive: the target recedes"),
    },
    "passes": {
        "target": ("", "catalogue number or name"),
        "aos": ("ns", "acquisition of signal, UTC since 1970"),
        "tca": ("ns", "closest approach, UTC since 1970"),
        "los": ("ns", "loss of signal, UTC since 1970"),
        "peak_elevation": ("rad", "largest elevation of the pass"),
    },
    "pointing_model": {"name": ("", "name of the bias model that came into force")},
    "tracking_status": {
        "mode": ("", "what the controller does"),
        "target": ("", "what it tracks; empty: nothing"),
        "reason": ("", "why this mode"),
        "azimuth": ("rad", "commanded direction on the sky"),
        "elevation": ("rad", "commanded direction on the sky"),
        "scan_centre": ("rad", "commanded axis angle, without scans"),
        "cross_elevation_error": ("rad", "last sensed error, or that of the axes without a sensor"),
        "elevation_error": ("rad", "last sensed error, or that of the axes without a sensor"),
        "cross_elevation_offset": ("rad", "what tracking adds to the prediction"),
        "elevation_offset": ("rad", "what tracking adds to the prediction"),
        "carrier_to_noise": ("dB-Hz", "carrier over noise density"),
        "beamwidth": ("rad", "half-power beamwidth of the band in use"),
        "command_lead": ("s", "from now to the last commanded point"),
        "commands_sent": ("", "trajectories published since activation"),
        "level": ("", "0 ok, 1 warning, 2 error"),
        "alarm": ("", "why the level is not ok"),
        "seconds_tracked": ("s", "of the pass so far with the target within the half-power beam"),
        "seconds_lost": ("s", "of the pass so far without"),
        "mean_loss": ("dB", "pointing loss of the mean power of the pass so far"),
    },
    "pass_certificate": {
        "target": ("", "catalogue number or name"),
        "aos": ("ns", "acquisition of signal, UTC since 1970"),
        "los": ("ns", "loss of signal, UTC since 1970"),
        "accepted": ("", "whether a branch works"),
        "lost": ("s", "predicted below half power"),
        "late": ("s", "after acquisition at which the axes arrive"),
        "acquisition": ("s", "that the sensor is expected to need"),
        "mean_loss": ("dB", "expected over the pass"),
        "least_share": ("", "share of the pass that must be held"),
    },
    "joint_states": {
        "position": ("rad", "encoder angle, continuous over all turns"),
        "velocity": ("rad/s", "encoder rate"),
    },
    "antenna_status": {
        "mode": ("", "mode of the antenna"),
        "fault": ("", "latched fault; empty: none"),
        "rate_command": ("rad/s", "command of the drive, after limits"),
        "rate_limit": ("rad/s", "largest rate"),
        "acceleration_limit": ("rad/s^2", "largest acceleration"),
        "at_limit": ("", "whether the axis is at its stop"),
        "command_lead": ("s", "of commands still in the table"),
        "tick_lateness": ("s", "wall time by which the control tick began late"),
        "commands_accepted": ("", "since activation"),
        "commands_rejected": ("", "since activation"),
        "last_rejection": ("", "why the last of them was rejected"),
        "set_points": ("", "sent to a drive that takes positions"),
        "starts": ("", "of its motion"),
        "reversals": ("", "of its motion"),
    },
    "sim/boresight": {
        "azimuth": ("rad", "true direction of the simulated beam"),
        "elevation": ("rad", "true direction of the simulated beam"),
    },
    "sim/pointing_error": _ERROR,
    "monopulse": {"carrier_to_noise": ("dB-Hz", "the receiver's estimate on the sum channel")},
    "carrier_power": {
        "power": ("W", "carrier power, averaged over the integration time before the stamp"),
        "carrier_to_noise": ("dB-Hz", "carrier over noise density"),
    },
    "pointing_error": _ERROR,
}
"""Unit and meaning of what is read of each topic."""


@dataclass(frozen=True, slots=True)
class ColumnMeaning:
    """One row of the data dictionary; `source` is the topic and the field of its message."""

    table: str
    column: str
    unit: str
    meaning: str
    source: str
    type_name: str


def topic_table(recording: Recording, topic: str) -> Columns:
    """Return a topic of a recording as columns (n,); ValueError for one that it does not have."""
    return _columns(recording, topic)[0]


def data_dictionary(recording: Recording) -> list[ColumnMeaning]:
    """Return what each column of the export of a recording means."""
    return [row for topic in exported_topics(recording) for row in _columns(recording, topic)[1]]


def exported_topics(recording: Recording) -> list[str]:
    """Return the topics of a recording that have columns and messages."""
    return [topic for topic in MEANINGS if recording.get(topic) is not None]


def export_recording(recording: Recording, folder: Path, kind: str) -> list[Path]:
    """Write every topic of a recording in one of `FORMATS`; return the files.

    CSV and Parquet are a file for each topic in `folder` and `dictionary.csv`; MATLAB is
    `recording.mat` with a structure for each topic, and `dictionary`.

    Raises
    ------
    ValueError
        An unknown format, Parquet without pyarrow, or a recording without a topic to export.
    """
    if kind not in FORMATS:
        raise ValueError(f"export={kind!r} must be one of {', '.join(FORMATS)}")
    if kind == "parquet":
        _pyarrow()
    topics = exported_topics(recording)
    if not topics:
        raise ValueError(f"{recording.path} holds no message of {', '.join(MEANINGS)}")
    tables = {_file_name(topic): _columns(recording, topic) for topic in topics}
    meanings = [row for _, rows in tables.values() for row in rows]
    if kind == "mat":
        return [_write_mat(folder / "recording.mat", {name: each for name, (each, _) in tables.items()}, meanings)]
    write = _write_csv if kind == "csv" else _write_parquet
    files = [write(folder / f"{name}.{kind}", columns, rows) for name, (columns, rows) in tables.items()]
    return [*files, _write_dictionary(folder / f"{DICTIONARY}.csv", meanings)]


def _columns(recording: Recording, topic: str) -> tuple[Columns, list[ColumnMeaning]]:
    """Return the columns of a topic, and what they mean."""
    if topic not in MEANINGS:
        raise ValueError(f"topic={topic!r} must be one of {', '.join(MEANINGS)}")
    data = recording.get(topic)
    if data is None:
        raise ValueError(f"{recording.path} has no message of {topic}; it has {', '.join(exported_topics(recording))}")
    values = _passes(recording) if topic == "passes" else _times(recording, data) | _values(data)
    rows = []
    for name in values:
        field_name, unit, meaning = _meaning(topic, name)
        source = f"{data.topic}: {field_name}" if field_name else data.topic
        rows.append(ColumnMeaning(_file_name(topic), name, unit, meaning, source, data.type_name))
    return values, rows


def _meaning(topic: str, column: str) -> tuple[str, str, str]:
    """Return the field of the message, the unit and the meaning of an exported column."""
    if column in _HEAD:
        return {"stamp_ns": "header.stamp"}.get(column, ""), *_HEAD[column]
    for name, (unit, meaning) in MEANINGS[topic].items():
        if column == f"{name}{_SUFFIXES[unit]}":
            return name, unit, meaning
        for axis in AXES:
            if column == f"{name}_{axis}{_SUFFIXES[unit]}":
                return f"{name}[{AXES.index(axis)}]", unit, f"{meaning}, {axis}"
    raise ValueError(f"column {column} of {topic} has no meaning in the data dictionary")


def _times(recording: Recording, data: TopicData) -> Columns:
    first = min(
        int(each.stamp_ns.min()) for each in recording.topics.values() if each.stamp_ns is not None and len(each)
    )
    unstamped = data.stamp_ns is None
    stamps = np.full(len(data), -1) if data.stamp_ns is None else data.stamp_ns
    since = data.log_time_ns - data.log_time_ns[0] if unstamped else stamps - first
    return {"stamp_ns": stamps, "log_time_ns": data.log_time_ns, "t_s": since * 1e-9}


def _values(data: TopicData) -> Columns:
    found: Columns = {}
    for name, (unit, _) in MEANINGS[_relative(data.topic)].items():
        if name not in data.columns:
            continue
        values, suffix = data.columns[name], _SUFFIXES[unit]
        # Older recordings lack a field; its blank is a scalar for pairs, too.
        if values.ndim == 2 and values.shape[1] == len(AXES):
            found |= {f"{name}_{axis}{suffix}": values[:, index] for index, axis in enumerate(AXES)}
        else:
            found[f"{name}{suffix}"] = values
    return found


def _relative(topic: str) -> str:
    return max((name for name in MEANINGS if topic.endswith(f"/{name}")), key=len)


def _passes(recording: Recording) -> Columns:
    """Return the announced passes, each once in its newest version."""
    passes = recording.passes
    return {
        "target": np.array([each.target for each in passes]),
        **{f"{name}_ns": np.array([getattr(each, f"{name}_ns") for each in passes]) for name in ("aos", "tca", "los")},
        "peak_elevation_rad": np.array([each.peak_elevation_rad for each in passes]),
        "stamp_ns": np.array([each.aos_ns for each in passes]),
    }


def _file_name(topic: str) -> str:
    return topic.replace("/", "_")


def _write_csv(path: Path, columns: Columns, _rows: list[ColumnMeaning]) -> Path:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    # tolist() gives Python's floats: their shortest text is read back to the last bit.
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_whole(path, text.getvalue())
    return path


def _write_dictionary(path: Path, rows: list[ColumnMeaning]) -> Path:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([each.name for each in fields(ColumnMeaning)])
    writer.writerows(astuple(row) for row in rows)
    write_whole(path, text.getvalue())
    return path


def _pyarrow() -> Any:
    try:
        import pyarrow.parquet
    except ImportError:
        raise ValueError(
            "export=parquet needs the package pyarrow, which is not installed: pip install pyarrow"
        ) from None
    return pyarrow


def _write_parquet(path: Path, columns: Columns, rows: list[ColumnMeaning]) -> Path:
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
    return path


def _write_mat(path: Path, tables: Mapping[str, Columns], rows: list[ColumnMeaning]) -> Path:
    from scipy.io import savemat

    content: dict[str, Any] = {
        name: {key: _for_matlab(each) for key, each in one.items()} for name, one in tables.items()
    }
    content[DICTIONARY] = {
        each.name: _for_matlab(np.array([getattr(row, each.name) for row in rows])) for each in fields(ColumnMeaning)
    }
    sink = io.BytesIO()
    savemat(sink, content, long_field_names=True, oned_as="column", do_compression=True)
    write_whole(path, sink.getvalue())
    return path


def _for_matlab(column: NDArray[Any]) -> NDArray[Any]:
    """Return texts as a cell array: a matrix of characters would pad them with blanks."""
    return column.astype(object) if column.dtype.kind == "U" else column
