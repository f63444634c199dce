"""Raw tracking and calibration points as CSV: angles in degrees at this edge, radians inside."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.csv_table import Table, read_table, write_table
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.raw_tracking import RawTracking
from rf_pointing.core import from_degrees, to_degrees

__all__ = ["edge_columns", "read_observations", "read_tracking", "write_observations", "write_tracking"]

Array = NDArray[np.float64]

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
