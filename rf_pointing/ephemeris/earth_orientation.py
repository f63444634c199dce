"""UT1 - UTC and the position of the pole, from the packaged IERS tables.

The final series (EOP 20 C04, since 1962) is used where it reaches, then the rapid service and its
predictions of a year (finals2000A).  Between days UT1 - TAI is interpolated linearly.  The tides
inside a day, below 0.1 ms or 5 cm on the ground, are not modelled.

The table is continued to 1000 days after its last measured day, as Bulletin A does it:

    UT2 = UT1 + season,  UT2 - TAI linear;   pole = mean + drift + year + Chandler

From there on UT1 - TAI and the pole keep their last values.  `sigmas_at` states how far all this
may be off: growth laws that cover what the same prediction would have missed since 1978.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import DAY_S, Array, Pair, utc_text
from rf_pointing.ephemeris.time_scales import leap_seconds

_ARCSEC = math.radians(1.0 / 3600.0)
_MJD_OF_POSIX_EPOCH = 40587
# 1972-01-01: UT1 - TAI is not defined by whole leap seconds before.
_FIRST_LEAP_MJD = 41317
# Columns of the two files by their descriptions, and the length of their lines.
_C04 = {"mjd": (16, 26), "x": (26, 38), "y": (38, 50), "ut1": (50, 62)}, 219
_FINALS = {"mjd": (7, 15), "x": (18, 27), "y": (37, 46), "flag": (57, 58), "ut1": (58, 68)}, 188
LONG_PREDICTION_DAYS = 60.0
# Days after the last measured one at which a prediction becomes as uncertain as a fixed value.
PREDICTED_DAYS = 1000
# The farthest time that is accepted: what lies beyond is a mistyped date.
_LATEST_DAYS = 20 * 365
_RATE_DAYS, _POLE_DAYS, _POLE_MEMORY_DAYS = 90, 6 * 365, 60.0
_POLE_PERIODS_DAYS = (365.2422, 433.0)
# Sigmas of fixed values: UT1 - UTC stays within 0.9 s of zero, the pole within 10 m of its mean.
_FIXED_SIGMAS = 0.5, 0.18 * _ARCSEC


@dataclass(frozen=True, eq=False)
class OrientationTable:
    """Daily nodes at `t_s` (n,): UT1 - TAI [s], x and y [rad], each (n,).

    `columns` are the same values as lists, which are faster to look one number up in.  `span_t_s`
    is what the files tabulate; nodes after it are predicted here.
    """

    t_s: Array
    values: tuple[Array, Array, Array]
    columns: tuple[list[float], list[float], list[float]]
    span_t_s: Pair
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
    # The predictions end the files; what precedes them is measured.
    last_measured_s = float(t_s[len(t_s) - int(np.count_nonzero(rapid["flag"] == b"P")) - 1])
    span_t_s = float(t_s[0]), float(t_s[-1])
    ahead = np.arange(1.0, PREDICTED_DAYS - (span_t_s[1] - last_measured_s) / DAY_S + 1.0)
    after = predicted(t_s, values, ahead)
    t_s = np.concatenate([t_s, span_t_s[1] + DAY_S * ahead])
    ut1_tai, x, y = (np.concatenate(pair) for pair in zip(values, after, strict=True))
    columns = (ut1_tai.tolist(), x.tolist(), y.tolist())
    return OrientationTable(t_s, (ut1_tai, x, y), columns, span_t_s, last_measured_s)


def predicted(t_s: Array, values: tuple[Array, Array, Array], ahead_days: Array) -> tuple[Array, Array, Array]:
    """Return UT1 - TAI [s] and pole [rad] some days (m,) after nodes (n,) of six years or more."""
    ut2 = values[0] + _season_s(t_s)
    rate_s_day = (ut2[-1] - ut2[-1 - _RATE_DAYS]) / _RATE_DAYS
    ut1 = ut2[-1] + rate_s_day * ahead_days - _season_s(t_s[-1] + DAY_S * ahead_days)
    past_days = np.arange(1.0 - _POLE_DAYS, 1.0)
    columns, ahead_columns = _pole_columns(past_days), _pole_columns(ahead_days)
    poles = []
    for value in values[1:]:
        recent = value[-_POLE_DAYS:]
        coefficients = np.linalg.lstsq(columns, recent, rcond=None)[0]
        # What the periods do not explain at the end fades: the prediction begins without a jump.
        rest = recent[-1] - columns[-1] @ coefficients
        poles.append(ahead_columns @ coefficients + rest * np.exp(-ahead_days / _POLE_MEMORY_DAYS))
    return np.asarray(ut1), np.asarray(poles[0]), np.asarray(poles[1])


def _season_s(t_s: Any) -> Any:
    """Return the conventional seasonal variation UT2 - UT1 (IERS Bulletin A, explanation)."""
    phase = 2.0 * np.pi * (t_s / DAY_S + _MJD_OF_POSIX_EPOCH - 51544.03) / 365.2422
    return 0.0220 * np.sin(phase) - 0.0120 * np.cos(phase) - 0.0060 * np.sin(2.0 * phase) + 0.0070 * np.cos(2.0 * phase)


def _pole_columns(days: Array) -> Array:
    waves = [wave(2.0 * np.pi * days / period) for period in _POLE_PERIODS_DAYS for wave in (np.cos, np.sin)]
    return np.stack([np.ones_like(days), days / _POLE_DAYS, *waves], axis=1)


def predicted_sigmas(days: float) -> Pair:
    """Return the sigmas of UT1 [s] and of each coordinate of the pole [rad], `days` ahead."""
    if days > PREDICTED_DAYS:
        return _FIXED_SIGMAS
    days = max(days, 0.0)
    # Tides of weeks, the season of other years, and a length of day that walks.
    ut1_ms = math.hypot(1.5 * (1.0 - math.exp(-days / 5.0)), 0.15 * days, 0.0095 * days**1.5)
    pole_mas = 40.0 * (1.0 - math.exp(-days / 40.0)) + 0.015 * days
    return 1e-3 * ut1_ms, 1e-3 * pole_mas * _ARCSEC


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


class IersEarthOrientation:
    """The packaged tables and their continuation, read once; another source has these methods."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at UTC times (float or array).

        Raises ValueError before 1972 and more than 20 years after the end of the tables.
        """
        if np.ndim(t_s) == 0:
            return _interpolate_one(float(t_s))
        times = np.asarray(t_s, dtype=np.float64)
        if times.size == 0:
            return EarthOrientation(times, times, times)
        _require_known(float(times.min()))
        _require_known(float(times.max()))
        table = orientation_table()
        # Beyond the last node np.interp holds the last value.
        ut1_minus_tai, x, y = (np.interp(times, table.t_s, values) for values in table.values)
        return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(times), x, y)

    def sigmas_at(self, t_s: float) -> Pair:
        """Return the sigmas of UT1 [s] and of each coordinate of the pole [rad]; 0 if measured."""
        _require_known(t_s)
        return predicted_sigmas((t_s - orientation_table().last_measured_t_s) / DAY_S)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return that the leap seconds have expired or that UT1 is a long prediction, where so.

        Predictions are part of daily work: 60 days ahead they are good to 10 ms, 5 m on the
        equator.
        """
        ut1_sigma_s, _ = self.sigmas_at(t_s)
        table, found = orientation_table(), leap_seconds().warnings(t_s)
        ahead_days = (t_s - table.last_measured_t_s) / DAY_S
        if ahead_days <= LONG_PREDICTION_DAYS:
            return found
        state = f"is predicted {ahead_days:.0f} days ahead"
        if ahead_days > PREDICTED_DAYS:
            state = f"is held at {self.at(t_s).ut1_minus_utc_s:.3f} s"
        if t_s >= table.span_t_s[1]:
            state += f", beyond the table that ends on {utc_text(table.span_t_s[1])[:10]}"
        good = f"good to {1e3 * ut1_sigma_s:.0f} ms"
        return (*found, f"UT1-UTC at {utc_text(t_s)} {state}, {good}; renew astropy-iers-data")


def _interpolate_one(t_s: float) -> EarthOrientation:
    _require_known(t_s)
    table = orientation_table()
    days, seconds = divmod(t_s - table.span_t_s[0], DAY_S)
    i, part = int(days), seconds / DAY_S
    if i >= len(table.t_s) - 1:
        i, part = len(table.t_s) - 2, 1.0
    ut1_minus_tai, x, y = (column[i] + part * (column[i + 1] - column[i]) for column in table.columns)
    return EarthOrientation(ut1_minus_tai + leap_seconds().tai_minus_utc_s(t_s), x, y)


def _require_known(t_s: float) -> None:
    first_s, last_s = orientation_table().span_t_s
    latest_s = last_s + _LATEST_DAYS * DAY_S
    if not first_s <= t_s < latest_s:
        known = f"Earth orientation is tabulated to {utc_text(last_s)[:10]} and extended by 20 years"
        bounds = f"[{first_s}, {latest_s}): {known}; renew astropy-iers-data"
        raise ValueError(f"t_s={t_s} must be in {bounds}")
