"""Time scales as types: UTC, TAI, TT, GPS time and UT1 are different classes and cannot be mixed.

    TAI = UTC + leap seconds,    TT = TAI + 32.184 s,    GPS = TAI - 19 s,    UT1 = UTC + (UT1 - UTC)

Each class holds a Julian date as two floats.  Wire times `t_s` are UTC counted as POSIX seconds (a leap second
repeats the second before it).  Leap seconds come from the packaged IERS list, which states its own expiry.
Source: IERS Conventions (2010) chapter 5; IS-GPS-200 for the 19 s.
"""

import re
from bisect import bisect_right
from calendar import isleap
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from rf_pointing.core import require_finite
from rf_pointing.core.dates import utc_text

__all__ = [
    "DAY_S",
    "POSIX_EPOCH_JD",
    "Gps",
    "LeapSeconds",
    "Tai",
    "Tt",
    "Ut1",
    "Utc",
    "leap_seconds",
    "posix_from_calendar",
    "require_day_of_year",
    "tai_from_utc_calendar",
]

DAY_S = 86400.0
POSIX_EPOCH_JD = 2440587.5
"""Julian date of 1970-01-01T00:00:00."""
TT_MINUS_TAI_S = 32.184
TAI_MINUS_GPS_S = 19.0
_MJD_OF_POSIX_EPOCH = 40587.0


@dataclass(frozen=True)
class _JulianDate:
    """A date of one scale: `whole` + `fraction` days; the sum would lose 40 microseconds, the pair loses nothing."""

    whole: float
    fraction: float

    def __post_init__(self) -> None:
        require_finite("whole", self.whole)
        require_finite("fraction", self.fraction)

    def shifted_s(self, seconds: float) -> Self:
        """Return the date of the same scale `seconds` later."""
        return type(self)(self.whole, self.fraction + seconds / DAY_S)

    def seconds_since(self, other: Self) -> float:
        """Return the seconds from `other`; a date of another scale is refused."""
        if type(other) is not type(self):
            raise ValueError(f"{type(other).__name__} date cannot be subtracted from a {type(self).__name__} date")
        return ((self.whole - other.whole) + (self.fraction - other.fraction)) * DAY_S


class Utc(_JulianDate):
    """Coordinated universal time."""

    @classmethod
    def from_posix(cls, t_s: float) -> Self:
        """Return the date of `t_s` [UTC s since 1970-01-01]; the inverse is `posix_s`."""
        require_finite("t_s", t_s)
        days, seconds = divmod(t_s, DAY_S)
        return cls(POSIX_EPOCH_JD + days, seconds / DAY_S)

    def posix_s(self) -> float:
        """Return UTC seconds since 1970-01-01."""
        return (self.whole - POSIX_EPOCH_JD) * DAY_S + self.fraction * DAY_S

    def to_tai(self) -> "Tai":
        """Return the same instant in TAI."""
        return Tai(self.whole, self.fraction).shifted_s(leap_seconds().tai_minus_utc_s(self.posix_s()))

    def to_ut1(self, ut1_minus_utc_s: float) -> "Ut1":
        """Return the same instant in UT1, given the offset of that day."""
        return Ut1(self.whole, self.fraction).shifted_s(ut1_minus_utc_s)


class Tai(_JulianDate):
    """International atomic time."""

    def to_utc(self) -> Utc:
        """Return the same instant in UTC; within an inserted leap second the POSIX second repeats."""
        table = leap_seconds()
        as_if_utc = Utc(self.whole, self.fraction)
        first = as_if_utc.shifted_s(-table.tai_minus_utc_s(as_if_utc.posix_s()))
        return as_if_utc.shifted_s(-table.tai_minus_utc_s(first.posix_s()))

    def to_tt(self) -> "Tt":
        """Return the same instant in terrestrial time."""
        return Tt(self.whole, self.fraction).shifted_s(TT_MINUS_TAI_S)

    def to_gps(self) -> "Gps":
        """Return the same instant in GPS time."""
        return Gps(self.whole, self.fraction).shifted_s(-TAI_MINUS_GPS_S)


class Tt(_JulianDate):
    """Terrestrial time."""

    def to_tai(self) -> Tai:
        """Return the same instant in TAI."""
        return Tai(self.whole, self.fraction).shifted_s(-TT_MINUS_TAI_S)


class Gps(_JulianDate):
    """GPS time."""

    def to_tai(self) -> Tai:
        """Return the same instant in TAI."""
        return Tai(self.whole, self.fraction).shifted_s(TAI_MINUS_GPS_S)


class Ut1(_JulianDate):
    """Universal time: the rotation angle of the Earth."""

    def to_utc(self, ut1_minus_utc_s: float) -> Utc:
        """Return the same instant in UTC, given the offset of that day."""
        return Utc(self.whole, self.fraction).shifted_s(-ut1_minus_utc_s)


@dataclass(frozen=True)
class LeapSeconds:
    """TAI - UTC: `offset_s[i]` holds from `start_t_s[i]` on."""

    start_t_s: tuple[float, ...]
    offset_s: tuple[float, ...]
    expires_t_s: float

    def tai_minus_utc_s(self, t_s: Any) -> Any:
        """Return TAI - UTC in seconds at UTC times (float or array); before 1972 UTC had no whole offset: refused."""
        if (t_s if isinstance(t_s, float) else np.min(t_s)) < self.start_t_s[0]:
            raise ValueError(f"t_s={np.min(t_s)} must be >= {self.start_t_s[0]} (1972-01-01, the first leap second)")
        if isinstance(t_s, float):
            return self.offset_s[bisect_right(self.start_t_s, t_s) - 1]
        return np.asarray(self.offset_s)[np.searchsorted(self.start_t_s, t_s, side="right") - 1]

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return the reason why the offset at `t_s` is not certain, if there is one."""
        if t_s <= self.expires_t_s:
            return ()
        return (f"leap second table expired on {utc_text(self.expires_t_s)[:10]}; TAI-UTC is assumed unchanged since",)


@lru_cache(maxsize=1)
def leap_seconds() -> LeapSeconds:
    """Return the packaged IERS table (Bulletin C)."""
    from astropy_iers_data import IERS_LEAP_SECOND_FILE

    text = Path(IERS_LEAP_SECOND_FILE).read_text(encoding="ascii")
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    expiry = re.search(r"File expires on (\d+ \w+ \d{4})", text)
    if expiry is None:
        raise ValueError(f"{IERS_LEAP_SECOND_FILE} must state 'File expires on'")
    return LeapSeconds(
        start_t_s=tuple((float(row[0]) - _MJD_OF_POSIX_EPOCH) * DAY_S for row in rows),
        offset_s=tuple(float(row[4]) for row in rows),
        expires_t_s=datetime.strptime(expiry[1], "%d %B %Y").replace(tzinfo=UTC).timestamp(),
    )


_CALENDAR = re.compile(r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z?")


def posix_from_calendar(text: str) -> float:
    """Return POSIX-style seconds of a CCSDS calendar or ordinal date, as 2026-11-21T03:30:00.5 or 2026-325T03:30:00.

    The result counts seconds of the scale in which the text is written; only a UTC text gives a wire time.  A leap second
    has no time of its own on the wire, so second 60 is refused; `tai_from_utc_calendar` reads it.
    """
    minute_s, second = _minute_and_second(text)
    if second >= 60.0:
        raise ValueError(f"date={text!r} has second {second:g}, must be < 60")
    return minute_s + second


def tai_from_utc_calendar(text: str) -> float:
    """Return TAI seconds since 1970-01-01T00:00:00 TAI of a UTC date; second 60 is read where there is one."""
    minute_s, second = _minute_and_second(text)
    table = leap_seconds()
    before_s = float(table.tai_minus_utc_s(minute_s))
    seconds = 60.0 + float(table.tai_minus_utc_s(minute_s + 60.0)) - before_s
    if second >= seconds:
        raise ValueError(f"date={text!r} has second {second:g}, must be < {seconds:g} in that minute")
    return minute_s + second + before_s


def _minute_and_second(text: str) -> tuple[float, float]:
    """Return the POSIX-style seconds of a date's minute, and its second, which may be beyond the minute's end."""
    match = _CALENDAR.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"date={text!r} must read YYYY-MM-DDThh:mm:ss or YYYY-DDDThh:mm:ss")
    year, month, day, ordinal, hour, minute, second = match.groups()
    try:
        midnight = datetime(int(year), int(month or 1), int(day or 1), int(hour), int(minute), tzinfo=UTC)
    except ValueError as error:
        raise ValueError(f"date={text!r}: {error}") from None
    if ordinal is None:
        return midnight.timestamp(), float(second)
    require_day_of_year(text, int(year), int(ordinal))
    return midnight.timestamp() + (int(ordinal) - 1) * DAY_S, float(second)


def require_day_of_year(text: str, year: int, day: float) -> None:
    """Raise ValueError, naming the `text` that it comes from, unless the (fractional) day of a year lies in it."""
    days = 366 if isleap(year) else 365
    if not 1.0 <= day < days + 1:
        raise ValueError(f"date={text!r} has day {day:g} of {year}, must be >= 1 and < {days + 1}")
