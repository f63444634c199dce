"""UT1 - UTC and the position of the pole, from the packaged IERS tables.

The final series (EOP 20 C04, since 1962) is used where it reaches, then the rapid service and its
predictions of a year (finals2000A).  Between days UT1 - TAI is interpolated linearly.  The tides
inside a day, below 0.1 ms or 5 cm on the ground, are not modelled.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.dates import DAY_S, utc_text
from rf_pointing.ephemeris.time_scales import leap_seconds

Array = NDArray[np.float64]

# A month at once: a pass needs one block, a year's search thirteen.
BLOCK_DAYS = 32
_ARCSEC = math.radians(1.0 / 3600.0)
_MJD_OF_POSIX_EPOCH = 40587
# 1972-01-01: UT1 - TAI is not defined by whole leap seconds before.
_FIRST_LEAP_MJD = 41317
_C04_LINE, _FINALS_LINE = 219, 188
# The first line of finals2000A; the line of a day follows from it without a search.
_FINALS_FIRST_MJD = 41684


class _Row(NamedTuple):
    mjd: int
    ut1_minus_utc_s: float
    pole_x_rad: float
    pole_y_rad: float
    predicted: bool


@dataclass(frozen=True, eq=False)
class OrientationBlock:
    """Daily nodes of one block and the first of the next: UT1 - TAI [s], x and y [rad], each (n,).

    `columns` are the same values as lists, which are faster to look one number up in.
    """

    first_t_s: float
    t_s: Array
    values: tuple[Array, Array, Array]
    columns: tuple[list[float], list[float], list[float]]


def block_number(t_s: float) -> int:
    """Return the number of the block that holds the UTC time `t_s`."""
    return int((t_s // DAY_S + _MJD_OF_POSIX_EPOCH) // BLOCK_DAYS)


@lru_cache(maxsize=1)
def table_span_t_s() -> tuple[float, float]:
    """Return the first and last tabulated UTC time [s]."""
    low, high = _last_c04_mjd(), _FINALS_FIRST_MJD + _size(_finals_path()) // _FINALS_LINE - 1
    while low < high:  # the file ends in lines that carry a date but no value yet
        middle = (low + high + 1) // 2
        low, high = (middle, high) if _finals_rows(middle, middle) else (low, middle - 1)
    return (_FIRST_LEAP_MJD - _MJD_OF_POSIX_EPOCH) * DAY_S, (low - _MJD_OF_POSIX_EPOCH) * DAY_S


@lru_cache(maxsize=1)
def last_measured_t_s() -> float:
    """Return the UTC time [s] of the last UT1 that is measured; what follows is predicted."""
    low, high = _last_c04_mjd(), int(table_span_t_s()[1] / DAY_S) + _MJD_OF_POSIX_EPOCH
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (low, middle - 1) if _finals_rows(middle, middle)[0].predicted else (middle, high)
    return (low - _MJD_OF_POSIX_EPOCH) * DAY_S


@lru_cache(maxsize=64)
def orientation_block(number: int) -> OrientationBlock:
    """Return the nodes of block `number`, cut off at the ends of the tables."""
    first_s, last_s = table_span_t_s()
    first = max(number * BLOCK_DAYS, int(first_s / DAY_S) + _MJD_OF_POSIX_EPOCH)
    last = min((number + 1) * BLOCK_DAYS, int(last_s / DAY_S) + _MJD_OF_POSIX_EPOCH)
    # Final values as far as they reach, then the rapid ones.
    switch = min(max(_last_c04_mjd(), first - 1), last)
    rows = _c04_rows(first, switch) + _finals_rows(switch + 1, last)
    t_s = np.array([(row.mjd - _MJD_OF_POSIX_EPOCH) * DAY_S for row in rows])
    # Interpolated as UT1 - TAI: UT1 - UTC jumps by a second at a leap second.
    ut1_minus_tai = np.array([row.ut1_minus_utc_s for row in rows]) - leap_seconds().tai_minus_utc_s(t_s)
    x, y = np.array([row.pole_x_rad for row in rows]), np.array([row.pole_y_rad for row in rows])
    return OrientationBlock(
        first_t_s=float(t_s[0]),
        t_s=t_s,
        values=(ut1_minus_tai, x, y),
        columns=(ut1_minus_tai.tolist(), x.tolist(), y.tolist()),
    )


def _c04_path() -> str:
    from astropy_iers_data import IERS_B_FILE

    return str(IERS_B_FILE)


def _finals_path() -> str:
    from astropy_iers_data import IERS_A_FILE

    return str(IERS_A_FILE)


def _size(path: str) -> int:
    return os.stat(path).st_size


@lru_cache(maxsize=1)
def _c04_start() -> tuple[int, int]:
    """Byte offset and date of the first data line."""
    offset = 0
    with open(_c04_path(), "rb") as file:
        for line in file:
            if not line.startswith(b"#"):
                return offset, int(float(line.split()[4]))
            offset += len(line)
    raise ValueError(f"{_c04_path()} has no data line")


def _last_c04_mjd() -> int:
    offset, first = _c04_start()
    return first + (_size(_c04_path()) - offset) // _C04_LINE - 1


def _c04_rows(first: int, last: int) -> list[_Row]:
    offset, start = _c04_start()
    return _rows(_c04_path(), offset + (first - start) * _C04_LINE, _C04_LINE, first, last, _c04_row)


def _finals_rows(first: int, last: int) -> list[_Row]:
    return _rows(_finals_path(), (first - _FINALS_FIRST_MJD) * _FINALS_LINE, _FINALS_LINE, first, last, _finals_row)


def _rows(
    path: str, offset: int, length: int, first: int, last: int, parse: Callable[[str], _Row | None]
) -> list[_Row]:
    if last < first:
        return []
    with open(path, "rb") as file:
        file.seek(offset)
        text = file.read(length * (last - first + 1)).decode("ascii")
    rows = [parse(text[i : i + length]) for i in range(0, len(text), length)]
    found = [row for row in rows if row is not None]
    # A package with another line length must not be read as nonsense.
    if [row.mjd for row in found] != list(range(first, first + len(found))):
        raise ValueError(f"{path} does not have one line of {length} characters per day")
    return found


def _c04_row(line: str) -> _Row:
    fields = line.split()
    return _Row(int(float(fields[4])), float(fields[7]), float(fields[5]) * _ARCSEC, float(fields[6]) * _ARCSEC, False)


def _finals_row(line: str) -> _Row | None:
    """Bulletin A columns of the IERS description; None where the line has a date but no UT1."""
    # finals2000A ends in lines that carry a date but no value yet.
    if not line[58:68].strip():
        return None
    x, y = float(line[18:27]) * _ARCSEC, float(line[37:46]) * _ARCSEC
    return _Row(int(float(line[7:15])), float(line[58:68]), x, y, line[57] == "P")


LONG_PREDICTION_DAYS = 60.0


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
    """The packaged tables; the blocks once read are shared by the process."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at UTC times (float or array); ValueError outside the tables."""
        if np.ndim(t_s) == 0:
            return _interpolate_one(float(t_s))
        times = np.asarray(t_s, dtype=np.float64)
        if times.size == 0:
            return EarthOrientation(times, times, times)
        first, last = _block_number(float(times.min())), _block_number(float(times.max()))
        blocks = [orientation_block(number) for number in range(first, last + 1)]
        ut1_minus_tai, x, y = (
            np.interp(times, np.concatenate([b.t_s for b in blocks]), np.concatenate([b.values[i] for b in blocks]))
            for i in range(3)
        )
        return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(times), x, y)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return that the leap seconds have expired or that UT1 is a long prediction, where so.

        Predictions are part of daily work: 60 days ahead they are good to 6 ms, 3 m on the equator
        (Bulletin A).
        """
        _block_number(t_s)
        found = leap_seconds().warnings(t_s)
        ahead_days = (t_s - last_measured_t_s()) / DAY_S
        if ahead_days > LONG_PREDICTION_DAYS:
            error_ms = 0.25 * ahead_days**0.75
            found += (
                f"UT1-UTC at {utc_text(t_s)} is predicted {ahead_days:.0f} days ahead, good to {error_ms:.0f} ms; "
                "renew astropy-iers-data",
            )
        return found


def _interpolate_one(t_s: float) -> EarthOrientation:
    block = orientation_block(_block_number(t_s))
    days = (t_s - block.first_t_s) / DAY_S
    i = int(days)
    part = days - i
    ut1_minus_tai, x, y = (column[i] + part * (column[i + 1] - column[i]) for column in block.columns)
    return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(t_s), x, y)


def _block_number(t_s: float) -> int:
    first_s, last_s = table_span_t_s()
    if not first_s <= t_s < last_s:
        raise ValueError(
            f"t_s={t_s} must be in [{first_s}, {last_s}): Earth orientation is tabulated to {utc_text(last_s)[:10]}; "
            "renew astropy-iers-data"
        )
    return block_number(t_s)
