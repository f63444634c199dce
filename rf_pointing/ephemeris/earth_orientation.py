"""UT1 - UTC and the position of the pole, from the packaged IERS tables.

The final series (EOP 20 C04, since 1962) is used where it reaches, then the rapid service and its predictions
(finals2000A).  Both files have lines of one length and one line per day, so a block around the date is read by
seeking instead of parsing 9 MB.  Between days UT1 - TAI is interpolated linearly (UT1 - UTC would jump at a leap
second); the tides inside a day, below 0.1 ms or 5 cm on the ground, are not modelled.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rf_pointing.core import Params, parameter
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris.iers_tables import block_number, last_measured_t_s, orientation_block, table_span_t_s
from rf_pointing.ephemeris.time_scales import DAY_S, leap_seconds

__all__ = ["EarthOrientation", "EarthOrientationSource", "FixedEarthOrientation", "IersEarthOrientation"]


LONG_PREDICTION_DAYS = 60.0


@dataclass(frozen=True, slots=True)
class EarthOrientation:
    """Rotation and pole of the Earth: floats, or arrays like the times they were asked for."""

    ut1_minus_utc_s: Any
    pole_x_rad: Any
    pole_y_rad: Any


class EarthOrientationSource(Protocol):
    """Anything that knows the orientation of the Earth at UTC times."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at `t_s` (float or array), or raise ValueError where it is not known."""

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return the reasons why the orientation at `t_s` is less certain than a final value."""


@dataclass(frozen=True, kw_only=True)
class FixedEarthOrientation(Params):
    """An assumed orientation, for dates that no table covers; `warnings` says so."""

    ut1_minus_utc_s: float = parameter(0.0, "UT1 - UTC", low=-0.9, high=0.9)
    pole_x_rad: float = parameter(0.0, "pole position towards Greenwich", low=-5e-6, high=5e-6)
    pole_y_rad: float = parameter(0.0, "pole position towards 90 deg west", low=-5e-6, high=5e-6)

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the assumed orientation."""
        ones = 1.0 if np.ndim(t_s) == 0 else np.ones(np.shape(t_s))
        return EarthOrientation(self.ut1_minus_utc_s * ones, self.pole_x_rad * ones, self.pole_y_rad * ones)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return that the orientation is an assumption."""
        return (f"UT1-UTC = {self.ut1_minus_utc_s} s is assumed, not taken from a table, at {utc_text(t_s)}",)


class IersEarthOrientation:
    """The packaged tables; the blocks once read are shared by the process."""

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at UTC times (float or array); outside the tables raise ValueError."""
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

        Predictions are part of daily work: 60 days ahead they are good to 6 ms, 3 m on the equator (Bulletin A).
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
            "renew astropy-iers-data or give a FixedEarthOrientation"
        )
    return block_number(t_s)
