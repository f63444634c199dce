"""Times as text: UTC seconds since 1970 (leap seconds not counted) and their ISO forms."""

import math
import re
from calendar import isleap
from datetime import UTC, datetime, timedelta

from rf_pointing.core.checks import require_finite

DAY_S = 86400.0

# What CCSDS writes: a calendar or an ordinal date, any number of decimals, Z or nothing.
_DATE = re.compile(r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z?")


def to_utc_text(t_s: float) -> str:
    """Return a time for files, like 1996-03-21T05:11:02.070000; `from_utc_text` is the inverse."""
    # Whole seconds apart: a float of 2026 holds microseconds, its product with 1e6 does not.
    whole = math.floor(t_s)
    micro = round((t_s - whole) * 1e6)
    moment = datetime.fromtimestamp(whole, UTC) + timedelta(microseconds=micro)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f")


def from_utc_text(text: str) -> float:
    """Return the seconds of a calendar (YYYY-MM-DD) or ordinal (YYYY-DDD) text, Z or not.

    A text in another scale gives the seconds of that scale.  A leap second has no time of its own
    in POSIX seconds, so second 60 raises ValueError; `minute_and_second` reads it.
    """
    minute_s, second = minute_and_second(text)
    if second >= 60.0:
        raise ValueError(f"date={text!r} has second {second:g}, must be < 60")
    return minute_s + second


def minute_and_second(text: str) -> tuple[float, float]:
    """Return seconds since 1970 of a date's minute, and its second, which may lie beyond it."""
    match = _DATE.fullmatch(text.strip())
    if match is None:
        raise ValueError(
            f"date={text!r} must read like the time 1996-03-21T05:11:02.07 or 1996-081T05:11:02.07"
        )
    year, month, day, ordinal, hour, minute, second = match.groups()
    try:
        whole = datetime(
            int(year), int(month or 1), int(day or 1), int(hour), int(minute), tzinfo=UTC
        )
    except ValueError as error:
        raise ValueError(f"date={text!r} is not a time: {error}") from None
    if ordinal is None:
        return whole.timestamp(), float(second)
    require_day_of_year(text, int(year), int(ordinal))
    return whole.timestamp() + (int(ordinal) - 1) * DAY_S, float(second)


def require_day_of_year(text: str, year: int, day: float) -> None:
    """Raise ValueError with the `text` unless the (fractional) day lies in that year."""
    days = 366 if isleap(year) else 365
    if not 1.0 <= day < days + 1:
        raise ValueError(f"date={text!r} has day {day:g} of {year}, must be >= 1 and < {days + 1}")


def parse_utc(text: str) -> float:
    """Return UTC seconds of an ISO time; without a zone it is UTC."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(
            f"start={text!r} must be an ISO time such as 2006-06-27T04:00:00"
        ) from error
    # Without a zone Python would take the computer's own time.
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def utc_text(t_s: float) -> str:
    """Return a time for people, to the millisecond, like 2006-06-26T17:03:12.345Z."""
    require_finite("t_s", t_s)
    # Rounded before it is split, so that 0.9996 s becomes the next second and not 1000 ms.
    milliseconds = round(t_s * 1e3)
    stamp = datetime.fromtimestamp(math.floor(milliseconds / 1000), tz=UTC)
    return f"{stamp:%Y-%m-%dT%H:%M:%S}.{milliseconds % 1000:03d}Z"
