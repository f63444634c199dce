"""The scales of time that an ephemeris needs, and the leap seconds between them.

    TAI = UTC + leap seconds,   TT = TAI + 32.184 s,   GPS = TAI - 19 s,   UT1 = UTC + (UT1 - UTC)

Wire times `t_s` are UTC counted as POSIX seconds: a leap second repeats the second before it.
Julian dates are handed to SOFA as two floats, whole and fraction.  Leap seconds come from the
packaged IERS list, which states its own expiry.
Source: IERS Conventions (2010) chapter 5; IS-GPS-200 for the 19 s.
"""

import re
from bisect import bisect_right
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core.dates import DAY_S, minute_and_second, utc_text

# Julian date of 1970-01-01T00:00:00.
POSIX_EPOCH_JD = 2440587.5
TT_MINUS_TAI_S = 32.184
TAI_MINUS_GPS_S = 19.0
_MJD_OF_POSIX_EPOCH = 40587.0


@dataclass(frozen=True)
class LeapSeconds:
    """TAI - UTC: `offset_s[i]` holds from `start_t_s[i]` on."""

    start_t_s: tuple[float, ...]
    offset_s: tuple[float, ...]
    expires_t_s: float

    def tai_minus_utc_s(self, t_s: Any) -> Any:
        """Return TAI - UTC in seconds at UTC times (float or array); ValueError before 1972."""
        if (t_s if isinstance(t_s, float) else np.min(t_s, initial=np.inf)) < self.start_t_s[0]:
            raise ValueError(f"t_s={np.min(t_s)} must be >= {self.start_t_s[0]} (1972-01-01, the first leap second)")
        if isinstance(t_s, float):
            # Plain floats: it is called several times a control period.
            return self.offset_s[bisect_right(self.start_t_s, t_s) - 1]
        return np.array(self.offset_s)[np.searchsorted(self.start_t_s, t_s, side="right") - 1]

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
    # The list states its own expiry in a comment; a list without one is another file.
    expiry = re.search(r"File expires on (\d+ \w+ \d{4})", text)
    if expiry is None:
        raise ValueError(f"{IERS_LEAP_SECOND_FILE} must state 'File expires on'")
    return LeapSeconds(
        start_t_s=tuple((float(row[0]) - _MJD_OF_POSIX_EPOCH) * DAY_S for row in rows),
        offset_s=tuple(float(row[4]) for row in rows),
        expires_t_s=datetime.strptime(expiry[1], "%d %B %Y").replace(tzinfo=UTC).timestamp(),
    )


def utc_from_tai_s(tai_s: float) -> float:
    """Return POSIX seconds of TAI seconds since 1970; a leap second repeats its second."""
    table = leap_seconds()
    # The table is by UTC.  The first guess is at most one leap second off, the second one is right.
    first_s = tai_s - float(table.tai_minus_utc_s(tai_s))
    return tai_s - float(table.tai_minus_utc_s(first_s))


def tai_from_utc_calendar(text: str) -> float:
    """Return TAI seconds since 1970 of a UTC date; second 60 is read where there is one."""
    minute_s, second = minute_and_second(text)
    table = leap_seconds()
    before_s = float(table.tai_minus_utc_s(minute_s))
    # 61 s in a minute that ends with a leap second.
    seconds = 60.0 + float(table.tai_minus_utc_s(minute_s + 60.0)) - before_s
    if second >= seconds:
        raise ValueError(f"date={text!r} has second {second:g}, must be < {seconds:g} in that minute")
    return minute_s + second + before_s
