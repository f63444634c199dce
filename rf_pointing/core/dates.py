"""Times as text: UTC seconds since 1970 (leap seconds not counted) and their ISO forms."""

import math
import re
from datetime import UTC, datetime, timedelta

from rf_pointing.core.checks import require_finite

__all__ = ["from_utc_text", "parse_utc", "to_utc_text", "utc_text"]

_CALENDAR = re.compile(r"(\d{4})-(\d{2})-(\d{2})T(\d{2}):(\d{2}):(\d{2})(\.\d+)?Z?$")
_ORDINAL = re.compile(r"(\d{4})-(\d{3})T(\d{2}):(\d{2}):(\d{2})(\.\d+)?Z?$")


def to_utc_text(t_s: float) -> str:
    """Return a time for files, to the microsecond, like 1996-03-21T05:11:02.070000; `from_utc_text` is the inverse."""
    whole = int(t_s // 1.0)
    micro = round((t_s - whole) * 1e6)
    moment = datetime.fromtimestamp(whole, UTC) + timedelta(microseconds=micro)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f")


def from_utc_text(text: str) -> float:
    """Return the seconds of a calendar (YYYY-MM-DD) or ordinal (YYYY-DDD) text; a final Z is allowed."""
    calendar, ordinal = _CALENDAR.match(text), _ORDINAL.match(text)
    try:
        if calendar:
            year, month, day, hour, minute, second = (int(calendar.group(k)) for k in range(1, 7))
            moment, fraction = datetime(year, month, day, hour, minute, second, tzinfo=UTC), calendar.group(7)
        elif ordinal:
            year, days, hour, minute, second = (int(ordinal.group(k)) for k in range(1, 6))
            moment = datetime(year, 1, 1, hour, minute, second, tzinfo=UTC) + timedelta(days=days - 1)
            if moment.year != year:
                raise ValueError(f"{text!r}: the year {year} has no day {days}")
            fraction = ordinal.group(6)
        else:
            raise ValueError(f"{text!r} must be a time like 1996-03-21T05:11:02.070")
    except ValueError as error:
        raise ValueError(f"{text!r} is not a time: {error}") from None
    return moment.timestamp() + (float(fraction) if fraction else 0.0)


def parse_utc(text: str) -> float:
    """Return UTC seconds of an ISO time; without a zone it is UTC."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"start={text!r} must be an ISO time such as 2006-06-27T04:00:00") from error
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def utc_text(t_s: float) -> str:
    """Return a time for people, to the millisecond, like 2006-06-26T17:03:12.345Z."""
    require_finite("t_s", t_s)
    milliseconds = round(t_s * 1e3)
    stamp = datetime.fromtimestamp(math.floor(milliseconds / 1000), tz=UTC)
    return f"{stamp:%Y-%m-%dT%H:%M:%S}.{milliseconds % 1000:03d}Z"
