"""Raw tracking data of a recorded run, and the ephemeris that it followed.

Each pass is one stay of a sensor on a target, at the rate of its errors.  Those of monopulse belong
to the encoders; those of a scan (conscan, step-track) to its centre, the commanded angles.  The
reference is the recorded target, which is apparent already.  A damaged recording is refused with
its damage, unless `allow_damage` takes its sound part.
"""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration import RawTracking, ReferenceTrack, split_passes
from rf_pointing.core.types import Array, BoolArray
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.topics import TopicData, wire_name
from rf_pointing.tracking.sensors import SENSORS, load_trackers

PASS_GAP_S = 120.0
FEWEST_SAMPLES = 30
_REFERENCE = [each.name for each in fields(ReferenceTrack) if each.name not in ("t_s", "mount")]


def tracking_from_bag(
    path: Path | str, station: str, band: str, *, namespace: str | None = None,
    largest_error_rad: float = np.inf, allow_damage: bool = False,
) -> list[tuple[RawTracking, ReferenceTrack]]:  # fmt: skip
    """Return the passes of a recording in order of time, each with its ephemeris' motion.

    Parameters
    ----------
    path : a bag directory, or one MCAP or sqlite3 file.
    station, band : the owner of the data; refused if the recording's notes contradict it.
    namespace : name of the antenna, needed when the bag holds several.
    largest_error_rad : a larger sensed error is not good: off its axis a sensor is not calibrated.
    allow_damage : use what could be read of a damaged recording.

    ValueError for another kind of file, damage, another station or band, and no tracking by a
    sensor.
    """
    recording = read_recording(path, namespace=namespace)
    if recording.problems and not allow_damage:
        raise ValueError(f"{path} is damaged: {'; '.join(recording.problems)}")
    for name, wanted in (("station", station), ("band", band)):
        noted = recording.notes.get(name, wanted)
        if noted != wanted:
            raise ValueError(f"{path} was recorded with {name} {noted!r}, must be {wanted!r}")
    load_trackers()
    sensed = _sensed(recording)
    passes = []
    for target, reference in _stretches(_needed(recording, "target")):
        raw = _recorded(sensed, reference, target, station, band, largest_error_rad)
        parts = [] if raw is None else split_passes(raw, PASS_GAP_S)
        passes += [(part, reference) for part in parts if int(np.sum(part.good)) >= FEWEST_SAMPLES]
    if not passes:
        raise ValueError(f"{path} holds no tracking by a sensor of {FEWEST_SAMPLES} samples or more")
    return passes


def _needed(recording: Recording, name: str) -> TopicData:
    data = recording.get(name)
    if data is None or data.stamp_ns is None:
        raise ValueError(f"{recording.path} holds no message of {name}")
    return data


def _stretches(targets: TopicData) -> list[tuple[str, ReferenceTrack]]:
    """Return name and motion of each target for as long as it was followed without a gap."""
    t_s = targets.t_s
    names = targets["target"]
    new = np.flatnonzero((names[1:] != names[:-1]) | (np.abs(np.diff(t_s)) > PASS_GAP_S)) + 1
    found = []
    for rows in np.split(np.arange(len(t_s)), new):
        times, first = np.unique(t_s[rows], return_index=True)
        chosen = rows[first]
        if len(times) >= 2:
            values = (targets[wire_name(name)][chosen].astype(np.float64) for name in _REFERENCE)
            columns: dict[str, Any] = dict(zip(_REFERENCE, values, strict=True))
            # A target that crosses north jumps by a turn, which no interpolation may follow.
            columns["azimuth_rad"] = np.unwrap(columns["azimuth_rad"])
            found.append((str(names[chosen[0]]), ReferenceTrack(t_s=times, **columns)))
    return found


_Sensed = tuple[Array, Array, Array, BoolArray]
"""Times (n,), axis angles and the errors of the sensor (n, 2) there, and which are valid."""


def _sensed(recording: Recording) -> _Sensed:
    """Return the errors of the sensor in force."""
    errors = _needed(recording, "pointing_error")
    t_s, sensor = errors.t_s, errors["sensor"].astype(str)
    moving = [traits.name for traits in SENSORS.values() if traits.scans]
    scanning = np.isin(sensor, moving)
    position = _interpolated(_needed(recording, "joint_states"), "position", t_s)
    usable = np.all(np.isfinite(position), axis=1)
    if recording.get("tracking_status") is not None:
        status = _needed(recording, "tracking_status")
        centre = _interpolated(status, "scan_centre", t_s)
        latest = np.searchsorted(status.t_s, t_s, side="right") - 1
        mode = np.where(latest >= 0, status["mode"].astype(str)[latest], "")
        # Where the beam is while it scans is part of the scan, for every sensor.
        scans = np.isin(mode, moving)
        position = np.where(scanning[:, None], centre, position)
        usable = np.all(np.isfinite(position), axis=1) & np.where(scanning, mode == sensor, ~scans)
    else:
        usable &= ~scanning
    # Several trackers write side by side: in order of their stamps, the first of two.
    rows = np.flatnonzero(usable)
    _, first = np.unique(t_s[rows], return_index=True)
    rows = rows[first]
    error = np.column_stack([errors["cross_elevation"], errors["elevation"]])
    return t_s[rows], position[rows], error[rows], errors["valid"].astype(bool)[rows]


def _interpolated(data: TopicData, column: str, t_s: Array) -> Array:
    """Return a column (n, 2) of a topic at `t_s`, NaN outside of it."""
    values = np.array(data[column].tolist(), dtype=np.float64)
    own_s = data.t_s
    # A recorder under load may write messages out of order.
    order = np.argsort(own_s, kind="stable")
    axes = [np.interp(t_s, own_s[order], values[order, axis], left=np.nan, right=np.nan) for axis in (0, 1)]
    return np.column_stack(axes)


def _recorded(
    sensed: _Sensed, reference: ReferenceTrack, target: str, station: str, band: str, largest_error_rad: float
) -> RawTracking | None:
    t_s, position, error, is_valid = sensed
    rows = np.flatnonzero(reference.covers(t_s))
    (azimuth, elevation), (across, up) = position[rows].T, error[rows].T
    valid, near = is_valid[rows], np.hypot(across, up) <= largest_error_rad
    good = valid & near
    if int(np.sum(good)) < FEWEST_SAMPLES:
        return None
    far = int(np.sum(valid & ~near))
    left_out = (
        f"{target}: {far} of {int(np.sum(valid))} samples are left out, with a sensed error above "
        f"{np.degrees(largest_error_rad):.4g} deg (largest-error)"
    )
    # Over the top upward on the sky is downward on the axis.
    upward = np.where(elevation > 0.5 * np.pi, -up, up)
    return RawTracking(
        station=station, band=band, target=target, t_s=t_s[rows],
        azimuth_rad=azimuth + across / np.abs(np.cos(elevation)), elevation_rad=elevation + upward,
        range_m=None, range_rate_m_s=None, good=good, notes=(left_out,) if far else (),
    )  # fmt: skip
