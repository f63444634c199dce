"""Angles, times and durations of the public surface: each is named with its unit, never guessed."""

import math

from rf_pointing.core import DAY_S, parse_utc, require_finite


def angle_rad(name: str, deg: float | None, rad: float | None, default_rad: float | None = None) -> float:
    """Return the angle that a caller gives as `{name}_deg` or as `{name}_rad`.

    Raises
    ------
    ValueError
        Both are given, neither is and there is no default, or the number is not finite.
    """
    if deg is not None and rad is not None:
        raise ValueError(f"{name}_deg={deg} and {name}_rad={rad}: give one of them")
    found = math.radians(deg) if deg is not None else rad if rad is not None else default_rad
    if found is None:
        raise ValueError(f"{name}: give {name}_deg or {name}_rad")
    require_finite(f"{name}_rad", found)
    return found


def time_s(name: str, utc: str | None, t_s: float | None) -> float | None:
    """Return the time given as UTC text `{name}` or as `{name}_t_s`, None where neither is.

    Times are UTC in s since 1970.  Raises ValueError for both, and for a text that is not a time.
    """
    if utc is not None and t_s is not None:
        raise ValueError(f"{name}={utc!r} and {name}_t_s={t_s}: give one of them")
    if utc is not None:
        return parse_utc(utc)
    if t_s is not None:
        require_finite(f"{name}_t_s", t_s)
    return t_s


def span_s(hours: float | None, days: float | None, default_s: float = DAY_S) -> float:
    """Return the duration given as `hours` or as `days`; ValueError for both, or not above zero."""
    if hours is not None and days is not None:
        raise ValueError(f"hours={hours} and days={days}: give one of them")
    found = hours * 3600.0 if hours is not None else days * DAY_S if days is not None else default_s
    require_finite("duration_s", found)
    if found <= 0.0:
        raise ValueError(f"duration_s={found} must be > 0")
    return found
