"""Comma-separated tables whose column names carry their units, read with errors that name the line.

Lines "# name: value" before the header hold what is the same for all rows (station, band, target).
"""

import csv
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Table", "read_table", "write_table"]

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
