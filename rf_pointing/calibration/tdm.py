"""CCSDS Tracking Data Message in KVN (503.0-B-2): angles, range and range rate of a station.

An X-Y mount writes the angles of its axes, XEYN (x to the east, y to the north) or XSYE (x to the
south, y to the east), every other mount AZEL.  All three are read; RADEC is refused.  TIME_SYSTEM
must be UTC, and the time tags those of reception.  The station is the last participant of PATH, the
target the other one.  RANGE (km) and DOPPLER_INSTANTANEOUS (km/s) are read from one-way paths at
the times of the angles and otherwise left out with a note: the angles of a two-way pass are as
good, and implementations disagree on whether its range is halved.  Data of quality DEGRADED are not
good.  Errors name the line.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rf_pointing.calibration.raw_tracking import RawTracking
from rf_pointing.core import (
    DATA_BYTES,
    LEVEL,
    Kinematics,
    from_utc_text,
    read_whole,
    to_utc_text,
    wrap_rad,
    write_whole,
)
from rf_pointing.core.kvn import key_and_value


def _keywords(text: str, numbered: tuple[str, ...]) -> frozenset[str]:
    """Return the words of `text` and the numbered ones, for up to five participants."""
    return frozenset([*text.split(), *(f"{stem}_{k}" for stem in numbered for k in range(1, 6))])


# All of CCSDS 503.0-B-2: one that is not here is a typing error, no extension.
METADATA_KEYWORDS = _keywords(
    """
    TRACK_ID DATA_TYPES TIME_SYSTEM START_TIME STOP_TIME MODE PATH PATH_1 PATH_2 TRANSMIT_BAND RECEIVE_BAND
    TURNAROUND_NUMERATOR TURNAROUND_DENOMINATOR TIMETAG_REF INTEGRATION_INTERVAL INTEGRATION_REF FREQ_OFFSET
    RANGE_MODE RANGE_MODULUS RANGE_UNITS ANGLE_TYPE REFERENCE_FRAME INTERPOLATION INTERPOLATION_DEGREE
    DOPPLER_COUNT_BIAS DOPPLER_COUNT_SCALE DOPPLER_COUNT_ROLLOVER DATA_QUALITY CORRECTION_ANGLE_1
    CORRECTION_ANGLE_2 CORRECTION_DOPPLER CORRECTION_MAG CORRECTION_RANGE CORRECTION_RCS CORRECTION_RECEIVE
    CORRECTION_TRANSMIT CORRECTION_ABERRATION_YEARLY CORRECTION_ABERRATION_DIURNAL CORRECTIONS_APPLIED
    """,
    ("PARTICIPANT", "EPHEMERIS_NAME", "TRANSMIT_DELAY", "RECEIVE_DELAY"),
)
DATA_KEYWORDS = _keywords(
    """
    RECEIVE_FREQ ANGLE_1 ANGLE_2 CARRIER_POWER CLOCK_BIAS CLOCK_DRIFT DOPPLER_COUNT DOPPLER_INSTANTANEOUS
    DOPPLER_INTEGRATED DOR MAG PC_N0 PR_N0 PRESSURE RANGE RCS RECEIVE_PHASE_CT_1 RHUMIDITY STEC TEMPERATURE
    TRANSMIT_PHASE_CT_1 TROPO_DRY TROPO_WET VLBI_DELAY
    """,
    ("TRANSMIT_FREQ", "TRANSMIT_FREQ_RATE", "RECEIVE_FREQ"),
)
_SECTIONS = ("META_START", "META_STOP", "DATA_START", "DATA_STOP")
# Which keyword may follow in which part of a message, and the part that it begins.
_NEXT_PLACE = {
    ("header", "META_START"): "metadata", ("between", "META_START"): "metadata",
    ("metadata", "META_STOP"): "described", ("described", "DATA_START"): "data",
    ("data", "DATA_STOP"): "between",
}  # fmt: skip
_HEADER = ("CCSDS_TDM_VERS", "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
# The X of a mount whose lower axis lies east and west is positive to the north.
_X_Y = {
    "XSYE": (Kinematics(type="x_y", lower_axis="east_west"), -1.0),
    "XEYN": (Kinematics(type="x_y", lower_axis="north_south"), 1.0),
}
"""The X-Y mount of an angle type, and the sign of its X in a message."""
_ONE_WAY = ("2,1", "1,2")
_ANGLES = ("ANGLE_1", "ANGLE_2")
_SCALE = {
    "ANGLE_1": math.radians(1.0), "ANGLE_2": math.radians(1.0), "RANGE": 1e3,
    "DOPPLER_INSTANTANEOUS": 1e3,
}  # fmt: skip


@dataclass
class _Segment:
    line: int
    metadata: dict[str, str] = field(default_factory=dict)
    values: dict[str, dict[float, tuple[int, float]]] = field(default_factory=dict)


def read_tdm(path: str | Path, *, band: str | None = None) -> list[RawTracking]:
    """Return the tracking data of every segment on the sky; ValueError names file and line.

    `band` is that of segments that do not name the received band; None refuses them.
    """
    source = Path(path)
    lines = read_whole(source, DATA_BYTES, "ascii").splitlines()
    try:
        return [_tracking(segment, band) for segment in _segments(lines)]
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None


def write_tdm(
    path: str | Path, tracks: Sequence[RawTracking], *, originator: str, created_t_s: float,
    mount: Kinematics = LEVEL,
) -> None:  # fmt: skip
    """Write one segment for each pass with good samples, and only those; undone by `read_tdm`.

    The angles of `tracks` are those of the axes of `mount`.  Raises ValueError if no sample is
    good, and for names that are not ASCII.
    """
    if not any(np.any(track.good) for track in tracks):
        raise ValueError(f"{path}: no good sample to write in {len(tracks)} passes")
    lines = [
        "CCSDS_TDM_VERS = 2.0",
        f"CREATION_DATE = {to_utc_text(created_t_s)}",
        f"ORIGINATOR = {originator}",
    ]
    angle_type = next((name for name, (own, _) in _X_Y.items() if own.same_axes(mount)), "AZEL")
    for track in (_as_sent(one, mount, angle_type) for one in tracks if np.any(one.good)):
        times = track.t_s[track.good]
        lines += [
            "", "META_START", "TIME_SYSTEM = UTC", f"START_TIME = {to_utc_text(float(times[0]))}",
            f"STOP_TIME = {to_utc_text(float(times[-1]))}", f"PARTICIPANT_1 = {track.station}",
            f"PARTICIPANT_2 = {track.target}", "MODE = SEQUENTIAL", "PATH = 2,1",
            f"RECEIVE_BAND = {track.band}", f"ANGLE_TYPE = {angle_type}", "RANGE_UNITS = km", "META_STOP",
            "", *_data_lines(track),
        ]  # fmt: skip
    text = "\n".join(lines) + "\n"
    if not text.isascii():
        raise ValueError(f"{path}: names of stations, targets and bands in a TDM must be ASCII")
    write_whole(Path(path), text)


def _segments(lines: Sequence[str]) -> list[_Segment]:
    segments: list[_Segment] = []
    place, header = "header", {}
    for number, key, value in _statements(lines):
        if key in _SECTIONS:
            if (place, key) not in _NEXT_PLACE:
                raise ValueError(f"line {number}: {key} does not belong here ({place})")
            place = _NEXT_PLACE[place, key]
            if key == "META_START":
                segments.append(_Segment(number))
        elif place == "header":
            if key not in _HEADER:
                raise ValueError(f"line {number}: {key} is not a header keyword")
            header[key] = value
        elif place == "metadata":
            _add_metadata(segments[-1], number, key, value)
        elif place == "data":
            _add_value(segments[-1], number, key, value)
        else:
            raise ValueError(f"line {number}: {key} outside a metadata or data section")
    if place not in ("between", "header"):
        raise ValueError(f"line {len(lines)}: the {place} section is not closed")
    if header.get("CCSDS_TDM_VERS") not in ("1.0", "2.0"):
        raise ValueError(f"CCSDS_TDM_VERS={header.get('CCSDS_TDM_VERS')} must be 1.0 or 2.0")
    if not segments:
        raise ValueError("no segment")
    return segments


def _statements(lines: Sequence[str]) -> Iterator[tuple[int, str, str]]:
    for number, line in enumerate(lines, start=1):
        if line.strip() in _SECTIONS:
            yield number, line.strip(), ""
        elif (pair := key_and_value(line, number)) is not None:
            if not pair[1]:
                raise ValueError(f"line {number}: {pair[0]} has no value")
            yield number, *pair


def _add_metadata(segment: _Segment, number: int, key: str, value: str) -> None:
    if key not in METADATA_KEYWORDS:
        raise ValueError(f"line {number}: {key} is not a metadata keyword")
    if key in segment.metadata:
        raise ValueError(f"line {number}: {key} is given twice")
    # TAI or TT taken for UTC is off by 37 or 69 s: degrees of a low pass.
    required = {
        "TIME_SYSTEM": ("UTC",), "ANGLE_TYPE": ("AZEL", *_X_Y), "MODE": ("SEQUENTIAL",),
        "TIMETAG_REF": ("RECEIVE",), "DATA_QUALITY": ("RAW", "VALIDATED", "DEGRADED"),
    }  # fmt: skip
    if key in required and value not in required[key]:
        raise ValueError(f"line {number}: {key}={value} must be {' or '.join(required[key])}")
    segment.metadata[key] = value


def _add_value(segment: _Segment, number: int, key: str, value: str) -> None:
    if key not in DATA_KEYWORDS:
        raise ValueError(f"line {number}: {key} is not a data keyword")
    # Frequencies, weather and clocks are valid in a message and of no use here.
    if key not in _SCALE:
        return
    parts = value.split()
    if len(parts) != 2:
        raise ValueError(f"line {number}: {key} needs a time and a value, has {len(parts)} words")
    try:
        t_s, measured = from_utc_text(parts[0]), float(parts[1])
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None
    if not math.isfinite(measured):
        raise ValueError(f"line {number}: {key}={parts[1]} must be finite")
    series = segment.values.setdefault(key, {})
    if t_s in series:
        raise ValueError(f"line {number}: {key} at {parts[0]} repeats line {series[t_s][0]}")
    series[t_s] = (number, measured * _SCALE[key])


def _tracking(segment: _Segment, band: str | None) -> RawTracking:
    for key in ("TIME_SYSTEM", "PARTICIPANT_1", "PARTICIPANT_2", "PATH", "ANGLE_TYPE"):
        if key not in segment.metadata:
            raise ValueError(f"line {segment.line}: {key} is missing in the metadata")
    for key in _ANGLES:
        if key not in segment.values:
            raise ValueError(f"line {segment.line}: the segment has no {key}")
    angles = segment.values["ANGLE_1"]
    _require_same_times("ANGLE_2", segment.values["ANGLE_2"], "ANGLE_1", angles)
    _require_same_times("ANGLE_1", angles, "ANGLE_2", segment.values["ANGLE_2"])
    station, target = _participants(segment)
    left_out = {key: why for key in segment.values if (why := _unusable(segment, key))}
    columns = {
        key: np.array([series[t][1] for t in angles]) + _correction(segment, key)
        for key, series in segment.values.items()
        if key not in left_out
    }
    found = RawTracking(
        station=segment.metadata[f"PARTICIPANT_{station}"], band=_band(segment, band),
        target=segment.metadata[f"PARTICIPANT_{target}"], t_s=np.array(list(angles)),
        azimuth_rad=columns["ANGLE_1"], elevation_rad=columns["ANGLE_2"],
        range_m=columns.get("RANGE"), range_rate_m_s=columns.get("DOPPLER_INSTANTANEOUS"),
        good=np.full(len(angles), segment.metadata.get("DATA_QUALITY") != "DEGRADED"),
        notes=tuple(f"{key}: {why}" for key, why in left_out.items()),
    )  # fmt: skip
    if (axes := _X_Y.get(segment.metadata["ANGLE_TYPE"])) is None:
        return found
    mount, sign = axes
    return found.turned(lambda x_rad, y_rad: mount.directions(sign * x_rad, y_rad))


def _participants(segment: _Segment) -> tuple[str, str]:
    """Return the numbers of the station and of the target."""
    # The last participant of a path receives; of a two-way path it is the first one too.
    path = [part.strip() for part in segment.metadata["PATH"].split(",")]
    others = dict.fromkeys(part for part in path if part != path[-1])
    target = next(iter(others), "")
    if len(others) != 1 or any(
        f"PARTICIPANT_{number}" not in segment.metadata for number in (path[-1], target)
    ):
        raise ValueError(
            f"line {segment.line}: PATH={segment.metadata['PATH']} must join station and target"
        )
    return path[-1], target


def _band(segment: _Segment, otherwise: str | None) -> str:
    """Return the band in which the station receives; a two-way uplink band says nothing of it."""
    one_way = segment.metadata["PATH"].replace(" ", "") in _ONE_WAY
    named = segment.metadata.get("RECEIVE_BAND") or (
        segment.metadata.get("TRANSMIT_BAND") if one_way else None
    )
    if named is None and otherwise is None:
        raise ValueError(f"line {segment.line}: RECEIVE_BAND is missing in the metadata")
    return named or str(otherwise)


def _unusable(segment: _Segment, key: str) -> str:
    """Return why the values of a keyword are left out, empty if they are not."""
    if key in _ANGLES:
        return ""
    path = segment.metadata["PATH"].replace(" ", "")
    units = segment.metadata.get("RANGE_UNITS", "km")
    if path not in _ONE_WAY:
        return f"left out of PATH={path}, only one-way is read"
    if key == "RANGE" and units != "km":
        return f"left out in RANGE_UNITS={units}, only km is read"
    if segment.values[key].keys() != segment.values["ANGLE_1"].keys():
        return "left out, its times are not those of the angles"
    return ""


def _require_same_times(
    key: str, series: dict[float, tuple[int, float]], other: str,
    known: dict[float, tuple[int, float]],
) -> None:  # fmt: skip
    for t_s, (number, _) in series.items():
        if t_s not in known:
            raise ValueError(
                f"line {number}: {key} at {to_utc_text(t_s)} has no {other} at that time"
            )


def _correction(segment: _Segment, key: str) -> float:
    name = "CORRECTION_DOPPLER" if key.startswith("DOPPLER") else f"CORRECTION_{key}"
    if name not in segment.metadata:
        return 0.0
    applied = segment.metadata.get("CORRECTIONS_APPLIED")
    if applied not in ("YES", "NO"):
        raise ValueError(f"line {segment.line}: {name} needs CORRECTIONS_APPLIED = YES or NO")
    try:
        value = float(segment.metadata[name])
    except ValueError:
        raise ValueError(
            f"line {segment.line}: {name}={segment.metadata[name]} must be a number"
        ) from None
    return value * _SCALE[key] if applied == "NO" else 0.0


def _as_sent(track: RawTracking, mount: Kinematics, angle_type: str) -> RawTracking:
    """Return samples of axes with the angles of a message."""
    # Joints count turns, messages do not: an azimuth of 370 deg is not allowed.
    sky = track.turned(mount.directions)
    if angle_type not in _X_Y:
        return sky.turned(lambda azimuth, elevation: (np.mod(azimuth, 2.0 * np.pi), elevation))
    sign = _X_Y[angle_type][1]
    axes = sky.turned(mount.of_directions)
    return axes.turned(lambda x_rad, y_rad: (wrap_rad(sign * x_rad), y_rad))


def _data_lines(track: RawTracking) -> list[str]:
    keys = {
        "ANGLE_1": (track.azimuth_rad, 9), "ANGLE_2": (track.elevation_rad, 9),
        "RANGE": (track.range_m, 9), "DOPPLER_INSTANTANEOUS": (track.range_rate_m_s, 12),
    }  # fmt: skip
    lines = ["DATA_START"]
    for row in np.flatnonzero(track.good):
        moment = to_utc_text(float(track.t_s[row]))
        for key, (values, digits) in keys.items():
            if values is not None:
                lines.append(f"{key} = {moment} {values[row] / _SCALE[key]:.{digits}f}")
    return [*lines, "DATA_STOP"]
