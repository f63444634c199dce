"""Orbit ephemeris messages (CCSDS 502.0-B, KVN): reading the segments.

Nothing is computed here; `OemTarget` interpolates.  Epochs are turned into TAI seconds, in which time runs evenly
over a leap second.
"""

from dataclasses import dataclass

import erfa
import numpy as np
from numpy.typing import NDArray

from rf_pointing.ephemeris.kvn import key_and_value
from rf_pointing.ephemeris.time_scales import (
    DAY_S,
    POSIX_EPOCH_JD,
    TAI_MINUS_GPS_S,
    TT_MINUS_TAI_S,
    leap_seconds,
    posix_from_calendar,
)
from rf_pointing.geometry import require_choice

__all__ = ["OemSegment", "read_oem"]

Array = NDArray[np.float64]

METHODS = ("HERMITE", "LAGRANGE", "LINEAR")
_SCALES = ("UTC", "TAI", "TT", "GPS", "TDB")
_REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
_MAX_DEGREE = 15


@dataclass(frozen=True, eq=False, kw_only=True)
class OemSegment:
    """One segment: states at `tai_s` (n,) [TAI s since 1970], `position_m` and `velocity_m_s` (n, 3) in `frame`.

    Interpolation may use every state, but only times in [`usable_from_s`, `usable_to_s`] (TAI) may be asked for.
    `method` is empty where the message declares none.
    """

    name: str
    object_id: str
    frame: str
    tai_s: Array
    position_m: Array
    velocity_m_s: Array
    usable_from_s: float
    usable_to_s: float
    method: str
    degree: int


def read_oem(text: str) -> list[OemSegment]:
    """Return the segments of a KVN message in file order; a malformed line is refused with its number."""
    found: list[OemSegment] = []
    meta: dict[str, str] | None = None
    states: list[tuple[str, list[float]]] = []
    place = "header"
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if line == "META_START":
            if meta is not None:
                found.append(_segment(meta, states))
            meta, states, place = {}, [], "meta"
        elif line == "META_STOP":
            place = "data"
        elif line == "COVARIANCE_START":
            place = "covariance"
        elif line == "COVARIANCE_STOP":
            place = "data"
        elif place == "data" and line and not line.startswith("COMMENT"):
            states.append(_state(line, number))
        elif place in ("header", "meta"):
            pair = key_and_value(line, number)
            if pair and meta is not None:
                meta[pair[0]] = pair[1]
            elif pair and number == 1 and pair[0] != "CCSDS_OEM_VERS":
                raise ValueError(f"line 1: {pair[0]} must be CCSDS_OEM_VERS")
    if meta is None:
        raise ValueError("OEM has no META_START")
    found.append(_segment(meta, states))
    return found


def _state(line: str, number: int) -> tuple[str, list[float]]:
    fields = line.split()
    if len(fields) not in (7, 10):
        raise ValueError(f"line {number}: a state must have an epoch and 6 or 9 numbers, has {len(fields)} fields")
    try:
        values = [float(field) for field in fields[1:7]]
    except ValueError:
        raise ValueError(f"line {number}: {line[:60]!r} holds something that is not a number") from None
    if not np.all(np.isfinite(values)):
        raise ValueError(f"line {number}: {line[:60]!r} must hold finite numbers")
    return fields[0], values


def _segment(meta: dict[str, str], states: list[tuple[str, list[float]]]) -> OemSegment:
    missing = [key for key in _REQUIRED if not meta.get(key)]
    if missing:
        raise ValueError(f"OEM segment of {meta.get('OBJECT_NAME', 'an unnamed object')} lacks {', '.join(missing)}")
    require_choice("TIME_SYSTEM", meta["TIME_SYSTEM"], _SCALES)
    if meta["CENTER_NAME"].upper() != "EARTH":
        raise ValueError(f"CENTER_NAME={meta['CENTER_NAME']!r} must be EARTH")
    method, degree = _interpolation(meta)
    tai_s = np.array([tai_from_text(epoch, meta["TIME_SYSTEM"]) for epoch, _ in states])
    if len(states) < 2 or np.any(np.diff(tai_s) <= 0.0):
        raise ValueError(f"OEM segment of {meta['OBJECT_NAME']} must have 2 or more states in increasing time")
    values = np.array([numbers for _, numbers in states]) * 1e3
    start = meta.get("USEABLE_START_TIME", meta["START_TIME"])
    stop = meta.get("USEABLE_STOP_TIME", meta["STOP_TIME"])
    return OemSegment(
        name=meta["OBJECT_NAME"],
        object_id=meta["OBJECT_ID"],
        frame=meta["REF_FRAME"].upper(),
        tai_s=tai_s,
        position_m=values[:, :3],
        velocity_m_s=values[:, 3:],
        usable_from_s=max(tai_from_text(start, meta["TIME_SYSTEM"]), float(tai_s[0])),
        usable_to_s=min(tai_from_text(stop, meta["TIME_SYSTEM"]), float(tai_s[-1])),
        method=method,
        degree=degree,
    )


def _interpolation(meta: dict[str, str]) -> tuple[str, int]:
    method = meta.get("INTERPOLATION", "").upper()
    if not method:
        return "", 0
    require_choice("INTERPOLATION", method, METHODS)
    text = meta.get("INTERPOLATION_DEGREE", "1" if method == "LINEAR" else "")
    if not text.isdigit() or not 1 <= int(text) <= _MAX_DEGREE:
        raise ValueError(f"INTERPOLATION_DEGREE={text!r} must be a whole number in [1, {_MAX_DEGREE}]")
    return method, int(text)


def tai_from_text(text: str, scale: str) -> float:
    """Return TAI seconds since 1970-01-01T00:00:00 TAI of a date written in `scale`."""
    seconds = posix_from_calendar(text)
    if scale == "UTC":
        return seconds + float(leap_seconds().tai_minus_utc_s(seconds))
    if scale == "TDB":
        whole, rest = divmod(seconds, DAY_S)
        seconds -= float(erfa.dtdb(POSIX_EPOCH_JD + whole, rest / DAY_S, 0.0, 0.0, 0.0, 0.0))
    return seconds + {"TAI": 0.0, "GPS": TAI_MINUS_GPS_S, "TT": -TT_MINUS_TAI_S, "TDB": -TT_MINUS_TAI_S}[scale]
