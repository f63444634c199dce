"""Comma-separated tables whose column names carry their units, read with errors that name the line.

Lines "# name: value" before the header hold what is the same for all rows (station, band, target).

Raw tracking and calibration points as CSV: angles in degrees at this edge, radians inside.
"""

import csv
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.raw_tracking import RawTracking
from rf_pointing.core import from_degrees, to_degrees

__all__ = [
    "Table",
    "edge_columns",
    "read_observations",
    "read_table",
    "read_tracking",
    "write_observations",
    "write_table",
    "write_tracking",
]


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Column values (n,) by name, and the notes before the header."""

    notes: Mapping[str, str]
    columns: Mapping[str, Array]


def read_table(path: str | Path, notes: Sequence[str], needed: Sequence[str], optional: Sequence[str]) -> Table:
    """Read a table that has all `notes` and `needed` columns and none beyond the `optional` ones."""
    source = Path(path)
    try:
        return _parsed(source.read_text(encoding="utf-8-sig").splitlines(), notes, needed, optional)
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None


def write_table(path: str | Path, table: Table) -> None:
    """Write a table that `read_table` reads back; all digits are kept, and it appears complete or not at all."""
    target = Path(path)
    part = target.with_name(target.name + ".part")
    with part.open("w", encoding="utf-8", newline="") as stream:
        for name, value in table.notes.items():
            stream.write(f"# {name}: {value}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows([repr(value) for value in row] for row in np.stack(list(table.columns.values()), 1).tolist())
    os.replace(part, target)


def _parsed(lines: Sequence[str], notes: Sequence[str], needed: Sequence[str], optional: Sequence[str]) -> Table:
    found, start = _notes(lines, notes)
    header = [name.strip() for name in next(csv.reader([lines[start]]))] if start < len(lines) else []
    _check_header(start + 1, header, needed, optional)
    rows = []
    for number, cells in enumerate(csv.reader(lines[start + 1 :]), start=start + 2):
        if cells:
            rows.append(_numbers(number, header, cells))
    if not rows:
        raise ValueError(f"line {len(lines)}: no rows after the header")
    return Table(found, dict(zip(header, np.array(rows).T, strict=True)))


def _notes(lines: Sequence[str], wanted: Sequence[str]) -> tuple[dict[str, str], int]:
    found, start = {}, 0
    while start < len(lines) and (lines[start].startswith("#") or not lines[start].strip()):
        name, colon, value = lines[start].lstrip("# ").partition(":")
        if colon:
            found[name.strip()] = value.strip()
        start += 1
    missing = [name for name in wanted if not found.get(name)]
    if missing:
        raise ValueError(f"line {start + 1}: the note '# {missing[0]}: ...' is missing before the header")
    return found, start


def _check_header(number: int, header: Sequence[str], needed: Sequence[str], optional: Sequence[str]) -> None:
    unknown = [name for name in header if name not in needed and name not in optional]
    if unknown:
        raise ValueError(f"line {number}: unknown column {unknown[0]!r}; known: {', '.join([*needed, *optional])}")
    missing = [name for name in needed if name not in header]
    if missing:
        raise ValueError(f"line {number}: column {missing[0]} is missing")
    if len(set(header)) != len(header):
        raise ValueError(f"line {number}: a column is given twice")


def _numbers(number: int, header: Sequence[str], cells: Sequence[str]) -> list[float]:
    if len(cells) != len(header):
        raise ValueError(f"line {number}: {len(cells)} values, must be {len(header)}")
    values = []
    for name, cell in zip(header, cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            raise ValueError(f"line {number}: {name}={cell.strip()!r} must be a number") from None
        if not math.isfinite(value):
            raise ValueError(f"line {number}: {name}={cell.strip()} must be finite")
        values.append(value)
    return values


_NOTES = ("station", "band", "target")
_NEEDED = ("t_s", "azimuth_deg", "elevation_deg")
_OPTIONAL = ("range_m", "range_rate_m_s", "good")
_POINT_OPTIONAL = ("range_m", "range_rate_m_s", "temperature_k")


def read_tracking(path: str | Path) -> RawTracking:
    """Read the samples of one pass (`t_s` UTC seconds since 1970); without a column `good` all are good."""
    table = read_table(path, _NOTES, _NEEDED, _OPTIONAL)
    column = table.columns
    good = column.get("good", np.ones(len(column["t_s"])))
    if not np.all(np.isin(good, (0.0, 1.0))):
        raise ValueError(f"{path}: column good must hold 0 or 1")
    _refuse_radians(path, column, "")
    return RawTracking(
        station=table.notes["station"],
        band=table.notes["band"],
        target=table.notes["target"],
        t_s=column["t_s"],
        azimuth_rad=np.radians(column["azimuth_deg"]),
        elevation_rad=np.radians(column["elevation_deg"]),
        range_m=column.get("range_m"),
        range_rate_m_s=column.get("range_rate_m_s"),
        good=good == 1.0,
    )


def write_tracking(path: str | Path, raw: RawTracking) -> None:
    """Write the samples of one pass; `read_tracking` is the inverse."""
    columns = {
        "t_s": raw.t_s,
        "azimuth_deg": np.degrees(raw.azimuth_rad),
        "elevation_deg": np.degrees(raw.elevation_rad),
    }
    if raw.range_m is not None:
        columns["range_m"] = raw.range_m
    if raw.range_rate_m_s is not None:
        columns["range_rate_m_s"] = raw.range_rate_m_s
    columns["good"] = raw.good.astype(np.float64)
    write_table(path, Table({name: getattr(raw, name) for name in _NOTES}, columns))


def read_observations(path: str | Path) -> Observations:
    """Read calibration points; raises ValueError naming the file, and the line of a damaged one."""
    needed = [_edge(name) for name in _point_columns() if name not in _POINT_OPTIONAL]
    table = read_table(path, _NOTES[:2], needed, _POINT_OPTIONAL)
    for kind in ("observed_", "true_"):
        _refuse_radians(path, table.columns, kind)
    columns = {}
    for name, value in table.columns.items():
        core, _ = from_degrees(name, 0.0)
        columns[core] = np.radians(value) if core != name else value
    if not np.all(columns["pass_id"] == np.round(columns["pass_id"])):
        raise ValueError(f"{path}: column pass_id must hold whole numbers")
    pass_id = columns.pop("pass_id").astype(np.int64)
    try:
        return Observations(station=table.notes["station"], band=table.notes["band"], pass_id=pass_id, **columns)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_observations(path: str | Path, points: Observations) -> None:
    """Write calibration points; `read_observations` is the inverse."""
    write_table(path, Table({"station": points.station, "band": points.band}, edge_columns(points)))


def edge_columns(points: Observations) -> dict[str, Array]:
    """Return the columns of the file by name, angles in degrees."""
    columns = {}
    for name in _point_columns():
        value = getattr(points, name)
        if value is not None:
            edge = _edge(name)
            columns[edge] = np.degrees(value) if edge != name else value.astype(np.float64)
    return columns


def _refuse_radians(path: str | Path, columns: Mapping[str, Array], kind: str) -> None:
    """Refuse angles that make sense as radians only: no antenna is calibrated below 2 deg next to north."""
    azimuth, elevation = columns[f"{kind}azimuth_deg"], columns[f"{kind}elevation_deg"]
    if np.all(np.abs(elevation) <= 0.5 * np.pi) and np.all(np.abs(azimuth) <= 3.0 * np.pi):
        raise ValueError(
            f"{path}: {kind}elevation_deg is at most {np.max(elevation):.3f} and {kind}azimuth_deg at most "
            f"{np.max(azimuth):.3f} in all {len(azimuth)} rows; radians given where degrees are expected?"
        )


def _point_columns() -> tuple[str, ...]:
    return tuple(item.name for item in fields(Observations) if item.name not in ("station", "band"))


def _edge(name: str) -> str:
    return to_degrees(name, 0.0)[0]
