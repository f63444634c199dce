"""UT1 - UTC and the position of the pole, from the packaged IERS tables.

The final series (EOP 20 C04, since 1962) is used where it reaches, then the rapid service and its
predictions of a year (finals2000A).  Between days UT1 - TAI is interpolated linearly.  The tides
inside a day, below 0.1 ms or 5 cm on the ground, are not modelled.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.dates import DAY_S, utc_text
from rf_pointing.ephemeris.time_scales import leap_seconds

Array = NDArray[np.float64]

_ARCSEC = math.radians(1.0 / 3600.0)
_MJD_OF_POSIX_EPOCH = 40587
# 1972-01-01: UT1 - TAI is not defined by whole leap seconds before.
_FIRST_LEAP_MJD = 41317
# Columns of the two files by their descriptions, and the length of their lines.
_C04 = {"mjd": (16, 26), "x": (26, 38), "y": (38, 50), "ut1": (50, 62)}, 219
_FINALS = {"mjd": (7, 15), "x": (18, 27), "y": (37, 46), "flag": (57, 58), "ut1": (58, 68)}, 188
LONG_PREDICTION_DAYS = 60.0


@dataclass(frozen=True, eq=False)
class OrientationTable:
    """Daily nodes at `t_s` (n,): UT1 - TAI [s], x and y [rad], each (n,).

    `columns` are the same values as lists, which are faster to look one number up in.
    """

    t_s: Array
    values: tuple[Array, Array, Array]
    columns: tuple[list[float], list[float], list[float]]
    span_t_s: tuple[float, float]
    last_measured_t_s: float


@lru_cache(maxsize=1)
def orientation_table() -> OrientationTable:
    """Return final values as far as they reach, then the rapid ones and the predictions."""
    from astropy_iers_data import IERS_A_FILE, IERS_B_FILE

    final, rapid = _lines(IERS_B_FILE, *_C04), _lines(IERS_A_FILE, *_FINALS)
    final_mjd, rapid_mjd = _days(IERS_B_FILE, final), _days(IERS_A_FILE, rapid)
    final, rapid = final[final_mjd >= _FIRST_LEAP_MJD], rapid[rapid_mjd > final_mjd[-1]]
    mjd, ut1, x, y = (np.concatenate([final[name], rapid[name]]).astype(float) for name in ("mjd", "ut1", "x", "y"))
    t_s = (mjd - _MJD_OF_POSIX_EPOCH) * DAY_S
    # Interpolated as UT1 - TAI: UT1 - UTC jumps by a second at a leap second.
    values = (ut1 - leap_seconds().tai_minus_utc_s(t_s), x * _ARCSEC, y * _ARCSEC)
    columns = (values[0].tolist(), values[1].tolist(), values[2].tolist())
    # The predictions end the table; what precedes them is measured.
    measured = len(t_s) - int(np.count_nonzero(rapid["flag"] == b"P"))
    return OrientationTable(t_s, values, columns, (float(t_s[0]), float(t_s[-1])), float(t_s[measured - 1]))


def _lines(path: str, columns: dict[str, tuple[int, int]], length: int) -> NDArray[Any]:
    """Return the data lines that have a value, as records of texts: 0.1 s for both files."""
    formats, offsets = [f"S{end - first}" for first, end in columns.values()], [first for first, _ in columns.values()]
    layout = np.dtype({"names": list(columns), "formats": formats, "offsets": offsets, "itemsize": length})
    data = Path(path).read_bytes()
    start = 0
    while data.startswith(b"#", start):
        start = data.index(b"\n", start) + 1
    lines = np.frombuffer(data, layout, count=(len(data) - start) // length, offset=start)
    # finals2000A ends in lines that carry a date but no value yet.
    filled: NDArray[Any] = lines[np.char.strip(lines["ut1"]) != b""]
    return filled


def _days(path: str, lines: NDArray[Any]) -> Array:
    mjd: Array = lines["mjd"].astype(float)
    # A package with another line length must not be read as nonsense.
    if len(mjd) == 0 or np.any(np.diff(mjd) != 1.0):
        raise ValueError(f"{path} does not have one line of {lines.dtype.itemsize} characters per day")
    return mjd


@dataclass(frozen=True, slots=True)
class EarthOrientation:
    """Rotation and pole of the Earth: floats, or arrays like the times."""

    ut1_minus_utc_s: Any
    pole_x_rad: Any
    pole_y_rad: Any


class EarthOrientationSource(Protocol):
    """Anything that knows the orientation of the Earth at UTC times."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at `t_s` (float or array); ValueError where it is not known."""

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return the reasons why the orientation at `t_s` is less certain than a final value."""


class IersEarthOrientation:
    """The packaged tables, read once by the process."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at UTC times (float or array); ValueError outside the tables."""
        if np.ndim(t_s) == 0:
            return _interpolate_one(float(t_s))
        times = np.asarray(t_s, dtype=np.float64)
        if times.size == 0:
            return EarthOrientation(times, times, times)
        _require_tabulated(float(times.min()))
        _require_tabulated(float(times.max()))
        table = orientation_table()
        ut1_minus_tai, x, y = (np.interp(times, table.t_s, values) for values in table.values)
        return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(times), x, y)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return that the leap seconds have expired or that UT1 is a long prediction, where so.

        Predictions are part of daily work: 60 days ahead they are good to 6 ms, 3 m on the equator
        (Bulletin A).
        """
        _require_tabulated(t_s)
        found = leap_seconds().warnings(t_s)
        ahead_days = (t_s - orientation_table().last_measured_t_s) / DAY_S
        if ahead_days > LONG_PREDICTION_DAYS:
            error_ms = 0.25 * ahead_days**0.75
            found += (
                f"UT1-UTC at {utc_text(t_s)} is predicted {ahead_days:.0f} days ahead, good to {error_ms:.0f} ms; "
                "renew astropy-iers-data",
            )
        return found


def _interpolate_one(t_s: float) -> EarthOrientation:
    _require_tabulated(t_s)
    table = orientation_table()
    days, seconds = divmod(t_s - table.span_t_s[0], DAY_S)
    i, part = int(days), seconds / DAY_S
    ut1_minus_tai, x, y = (column[i] + part * (column[i + 1] - column[i]) for column in table.columns)
    return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(t_s), x, y)


def _require_tabulated(t_s: float) -> None:
    first_s, last_s = orientation_table().span_t_s
    if not first_s <= t_s < last_s:
        raise ValueError(
            f"t_s={t_s} must be in [{first_s}, {last_s}): Earth orientation is tabulated to {utc_text(last_s)[:10]}; "
            "renew astropy-iers-data"
        )
