"""A flight that is known before: a table of places or directions over time, as a target.

    time,azimuth_deg,elevation_deg[,range_m]      time,latitude_deg,longitude_deg,height_m

The first line names the columns; times are ISO 8601 or seconds since 1970, UTC, increasing.  The
place between two rows is that of a cubic spline (Earth-fixed, not-a-knot), the steps between rows
are at most `LONGEST_STEP_S`.  Directions are true ones, without refraction.
"""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from rf_pointing.core import DATA_BYTES, Array, parse_utc, read_whole
from rf_pointing.designate.report import Report, ReportNoise
from rf_pointing.ephemeris import Site, StateVector

PLACES = ("time", "latitude_deg", "longitude_deg", "height_m")
DIRECTIONS = ("time", "azimuth_deg", "elevation_deg")
# Range of directions without one; only the light time shows it.
FAR_M = 1e5
FEWEST_ROWS, LONGEST_STEP_S = 4, 3600.0


class TableTarget:
    """A `TargetSource` in Earth-fixed axes that do not turn, known between first and last row."""

    rotation_rate_rad_s, at_infinity, orientation = 0.0, False, None
    node_step_s = 1.0

    def __init__(self, name: str, reports: list[Report]) -> None:
        self.name = name
        times = np.array([report.t_s for report in reports])
        if len(times) < FEWEST_ROWS:
            raise ValueError(f"{name}: {len(times)} rows, must be >= {FEWEST_ROWS}")
        steps = np.diff(times)
        if not np.all((steps > 0.0) & (steps <= LONGEST_STEP_S)):
            row = int(np.argmax(~((steps > 0.0) & (steps <= LONGEST_STEP_S)))) + 2
            raise ValueError(
                f"{name}: row {row} is {steps[row - 2]:g} s after the one before, must be > 0 and "
                f"<= {LONGEST_STEP_S:.0f} s"
            )
        self._spline = CubicSpline(times, np.array([report.position_m for report in reports]))
        # A table has one accuracy: the station states it.
        self._covariance_m2 = reports[0].covariance_m2
        self.spans_t_s = ((float(times[0]), float(times[-1])),)

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the motion at UTC `t_s`, float or (n,); ValueError outside the table."""
        first, last = self.spans_t_s[0]
        at = np.asarray(t_s) + ahead_s
        if np.any((at < first) | (at > last)):
            raise ValueError(
                f"{self.name} has no place {ahead_s + float(np.max(t_s)) - last:.1f} s after its last row"
            )
        return StateVector(
            *(tuple(np.moveaxis(self._spline(at, order), -1, 0)) for order in range(4))
        )

    def warnings(self, _t_s: float) -> tuple[str, ...]:
        """Return nothing: a table says nothing about its age."""
        return ()

    def covariance_m2(self, _t_s: float) -> Array:
        """Return the covariance (3, 3) of the position, as the station states it."""
        return self._covariance_m2


def read_table(path: Path, site: Site, noise: ReportNoise) -> TableTarget:
    """Return the target of a file; ValueError names its row."""
    lines = csv.reader(read_whole(path, DATA_BYTES).lstrip("\ufeff").splitlines())
    columns = tuple(each.strip() for each in next(lines, []))
    if columns[:4] != PLACES and columns[:3] != DIRECTIONS:
        known = " or ".join(",".join(each) for each in (PLACES, DIRECTIONS))
        raise ValueError(f"{path.name}: columns {','.join(columns)[:80]!r} must be {known}")
    name, reports = path.stem[:80], []
    for number, row in enumerate(filter(None, lines), start=2):
        try:
            t_s, values = _time(row[0]), [float(text) for text in row[1:4] if text.strip()]
            if columns[:4] == PLACES:
                reports.append(Report.of_place(t_s, name, values, noise))
                continue
            azimuth, elevation = map(math.radians, values[:2])
            range_m = values[2] if len(values) > 2 else FAR_M
            reports.append(Report.of_direction(t_s, name, azimuth, elevation, range_m, site, noise))
        except (ValueError, IndexError, TypeError) as error:
            raise ValueError(f"{path.name}: row {number}: {error}") from error
    return TableTarget(name, reports)


def _time(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return parse_utc(text)
