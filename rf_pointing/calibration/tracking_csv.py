"""Raw tracking and calibration points as CSV: angles in degrees in the file, radians inside.

Column names carry their units.  Lines "# name: value" before the header hold what is the same for
all rows (station, band, target).  An error names the line.
"""

import csv
import errno
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration.observations import COLUMNS, Observations
from rf_pointing.calibration.raw_tracking import RawTracking
from rf_pointing.core import LEVEL, Array, Kinematics, from_degrees, to_degrees
from rf_pointing.core.whole_file import JOURNAL_BYTES, read_bytes, read_whole, write_whole

CsvTable = tuple[Mapping[str, str], Mapping[str, Array]]

_MOST_OF_A_NAME = 1000
_NOTES = ("station", "band", "target")
_NEEDED = ("t_s", "azimuth_deg", "elevation_deg")
_OPTIONAL = ("range_m", "range_rate_m_s", "good")
_POINT_OPTIONAL = ("range_m", "range_rate_m_s", "temperature_k")


def read_tracking(path: str | Path, mount: Kinematics = LEVEL) -> RawTracking:
    """Read the samples of one pass (`t_s` UTC seconds); without a column `good` all are good."""
    notes, column = _read_table(path, _NOTES, _NEEDED, _OPTIONAL, mount)
    good = column.get("good", np.ones(len(column["t_s"])))
    if not np.all(np.isin(good, (0.0, 1.0))):
        raise ValueError(f"{path}: column good must hold 0 or 1")
    _refuse_radians(path, column, "")
    return RawTracking(
        station=notes["station"], band=notes["band"], target=notes["target"], t_s=column["t_s"],
        azimuth_rad=np.radians(column["azimuth_deg"]),
        elevation_rad=np.radians(column["elevation_deg"]), range_m=column.get("range_m"),
        range_rate_m_s=column.get("range_rate_m_s"), good=good == 1.0,
    )  # fmt: skip


def read_observations(path: str | Path, mount: Kinematics = LEVEL) -> Observations:
    """Read calibration points; raises ValueError naming the file, and the line of a damaged one."""
    needed = [to_degrees(name, 0.0)[0] for name in COLUMNS if name not in _POINT_OPTIONAL]
    notes, table = _read_table(path, _NOTES[:2], needed, _POINT_OPTIONAL, mount)
    for kind in ("observed_", "true_"):
        _refuse_radians(path, table, kind)
    columns: dict[str, Any] = {}
    for name, value in table.items():
        # `from_degrees` knows which names end in degrees; the values are converted as an array.
        core, _ = from_degrees(name, 0.0)
        columns[core] = np.radians(value) if core != name else value
    if not np.all(columns["pass_id"] == np.round(columns["pass_id"])):
        raise ValueError(f"{path}: column pass_id must hold whole numbers")
    pass_id = columns.pop("pass_id").astype(np.int64)
    try:
        return Observations(
            station=notes["station"], band=notes["band"], pass_id=pass_id, mount=mount, **columns
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_observations(path: str | Path, points: Observations) -> None:
    """Write calibration points, all digits kept; `read_observations` is the inverse."""
    write_whole(Path(path), "".join(_head_and_lines(points)))


class ObservationJournal:
    """The points of one station and band in `path`; `points` were in it when it was opened.

    Each is on the disk before the next one: a killed process loses at most the line it was writing
    (docs/decisions/0062).  Opening cuts off a last line without its end.  Other damage raises
    ValueError with the line's number, and nothing is overwritten.  `read_observations` reads it.
    """

    def __init__(
        self, path: str | Path, station: str, band: str, mount: Kinematics = LEVEL
    ) -> None:
        self.path, self.station, self.band, self.mount = Path(path), station, band, mount
        self.points = self._recovered()

    def append(self, points: Observations) -> None:
        """Add points; they are on the disk when this returns.

        Raises
        ------
        ValueError
            For points of another station or band.
        OSError
            When the disk does not take them; the file is then as it was.
        """
        self._check_owner(points)
        head, lines = _head_and_lines(points)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Without a buffer: a buffer would try again, unnoticed, when the file is closed.
        with self.path.open("ab", buffering=0) as stream:
            end = stream.tell()
            content = (lines if end else head + lines).encode()
            try:
                if stream.write(content) != len(content):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), stream.name)
                os.fsync(stream.fileno())
            except OSError:
                stream.truncate(end)
                raise

    def set_aside(self, name: str) -> Path | None:
        """Rename the file, so that the next point begins a new one; return it, None without any.

        Nothing is overwritten: where `name` is taken a number follows it.
        """
        if not self.path.exists():
            return None
        stems = (
            f"{self.path.stem}-{name}{tail}"
            for tail in ("", *(f"-{k}" for k in range(2, _MOST_OF_A_NAME)))
        )
        free = (
            place
            for stem in stems
            if not (place := self.path.with_name(stem + self.path.suffix)).exists()
        )
        old = next(free, None)
        if old is None:
            raise ValueError(
                f"{self.path.stem}-{name}-* are all taken; observations are never overwritten"
            )
        os.rename(self.path, old)
        self.points = None
        return old

    def _recovered(self) -> Observations | None:
        if not self.path.exists():
            return None
        content = read_bytes(self.path, JOURNAL_BYTES)
        whole = content[: content.rfind(b"\n") + 1]
        if len(whole) < len(content):
            with self.path.open("rb+") as stream:
                stream.truncate(len(whole))
                os.fsync(stream.fileno())
        # Killed in the header it has observed nothing: the next point writes the header again.
        if len([line for line in whole.splitlines() if not line.startswith(b"#")]) < 2:
            self.path.unlink()
            return None
        points = read_observations(self.path, self.mount)
        self._check_owner(points)
        return points

    def _check_owner(self, points: Observations) -> None:
        for name in ("station", "band"):
            if getattr(points, name) != getattr(self, name):
                raise ValueError(
                    f"{self.path}: points of {name} {getattr(points, name)!r}, must be of {getattr(self, name)!r}"
                )


def _refuse_radians(path: str | Path, columns: Mapping[str, Array], kind: str) -> None:
    """Refuse angles that make sense in radians only: no antenna is calibrated below 2 deg."""
    azimuth, elevation = columns[f"{kind}azimuth_deg"], columns[f"{kind}elevation_deg"]
    if np.all(np.abs(elevation) <= 0.5 * np.pi) and np.all(np.abs(azimuth) <= 3.0 * np.pi):
        raise ValueError(
            f"{path}: {kind}elevation_deg is at most {np.max(elevation):.3f} and {kind}azimuth_deg at most "
            f"{np.max(azimuth):.3f} in all {len(azimuth)} rows; radians given where degrees are expected?"
        )


def _named(column: str, mount: Kinematics) -> str:
    """Return the name of a column in a file of a mount, after its axes."""
    return column.replace("azimuth", mount.axes[0]).replace("elevation", mount.axes[1])


def _head_and_lines(points: Observations) -> tuple[str, str]:
    """Return the text of the file, angles in degrees, as head and rows."""
    columns = {}
    for name in COLUMNS:
        value = getattr(points, name)
        if value is not None:
            # `to_degrees` knows which names are angles; the values are converted as an array.
            edge, _ = to_degrees(name, 0.0)
            columns[edge] = np.degrees(value) if edge != name else value.astype(np.float64)
    names = ",".join(_named(name, points.mount) for name in columns)
    head = f"# station: {points.station}\n# band: {points.band}\n{names}\n"
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return head, "".join(",".join(map(repr, row)) + "\n" for row in rows)


def _read_table(
    path: str | Path, notes: Sequence[str], needed: Sequence[str], optional: Sequence[str],
    mount: Kinematics,
) -> CsvTable:  # fmt: skip
    """Return notes and columns (n,) of a table that has all `notes` and all `needed` columns."""
    # A column that is neither is an error, or one with a typing error would go unnoticed.
    source = Path(path)
    # Spreadsheets write a byte-order mark, which "utf-8-sig" takes off.
    lines = read_whole(source, JOURNAL_BYTES, "utf-8-sig").splitlines()
    try:
        found, start = _read_notes(lines, notes)
        header = [name.strip() for name in next(csv.reader(lines[start : start + 1]), [])]
        needed_of = {_named(name, mount): name for name in needed}
        _check_header(start + 1, header, list(needed_of), optional)
        rows = [
            _numbers(number, header, cells)
            for number, cells in enumerate(csv.reader(lines[start + 1 :]), start=start + 2)
            if cells
        ]
        if not rows:
            raise ValueError(f"line {len(lines)}: no rows after the header")
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{source}: {error}") from None
    header = [needed_of.get(name, name) for name in header]
    return found, dict(zip(header, np.array(rows).T, strict=True))


def _read_notes(lines: Sequence[str], wanted: Sequence[str]) -> tuple[dict[str, str], int]:
    found, start = {}, 0
    while start < len(lines) and (lines[start].startswith("#") or not lines[start].strip()):
        name, colon, value = lines[start].lstrip("# ").partition(":")
        if colon:
            found[name.strip()] = value.strip()
        start += 1
    missing = [name for name in wanted if not found.get(name)]
    if missing:
        raise ValueError(
            f"line {start + 1}: the note '# {missing[0]}: ...' is missing before the header"
        )
    return found, start


def _check_header(
    number: int, header: Sequence[str], needed: Sequence[str], optional: Sequence[str]
) -> None:
    unknown = [name for name in header if name not in needed and name not in optional]
    if unknown:
        raise ValueError(
            f"line {number}: unknown column {unknown[0]!r}; known: {', '.join([*needed, *optional])}"
        )
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
