"""Raw tracking data of a recorded run, and the ephemeris that it followed.

Each pass is one stay of monopulse on a target, at the rate of the errors.  Its reference is the
recorded target, which is apparent already.  A damaged recording is refused with its damage, unless
`allow_damage` takes its sound part.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import RawTracking, ReferenceTrack
from rf_pointing.core.modes import Sensor
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.topics import TopicData

Array = NDArray[np.float64]

PASS_GAP_S = 120.0
FEWEST_SAMPLES = 30
_REFERENCE_COLUMNS = {
    "azimuth_rad": "azimuth",
    "elevation_rad": "elevation",
    "azimuth_rate_rad_s": "azimuth_rate",
    "elevation_rate_rad_s": "elevation_rate",
    "azimuth_acceleration_rad_s2": "azimuth_acceleration",
    "elevation_acceleration_rad_s2": "elevation_acceleration",
    "range_m": "range",
    "range_rate_m_s": "range_rate",
}


def tracking_from_bag(
    path: Path | str,
    station: str,
    band: str,
    *,
    namespace: str | None = None,
    largest_error_rad: float = np.inf,
    allow_damage: bool = False,
) -> list[tuple[RawTracking, ReferenceTrack]]:
    """Return the passes of a recording in order of time, each with its ephemeris' motion.

    Parameters
    ----------
    path
        Any rosbag2 recording: a bag directory, or one MCAP or sqlite3 file.
    station, band
        The owner of the data; refused if the recording's notes contradict it.
    namespace
        Name of the antenna, needed when the bag holds several.
    largest_error_rad
        Samples of a larger sensed error are not good: off its axis a sensor is not calibrated.
    allow_damage
        Use what could be read of a damaged recording.

    Raises
    ------
    ValueError
        Not a recording, damage, another station or band, or no monopulse tracking in it.
    """
    recording = read_recording(path, namespace=namespace)
    if recording.problems and not allow_damage:
        raise ValueError(f"{path} is damaged: {'; '.join(recording.problems)}")
    for name, wanted in (("station", station), ("band", band)):
        noted = recording.notes.get(name, wanted)
        if noted != wanted:
            raise ValueError(f"{path} was recorded with {name} {noted!r}, must be {wanted!r}")
    errors, joints, targets = (_needed(recording, name) for name in ("pointing_error", "joint_states", "target"))
    passes = []
    for target, reference in _stretches(targets):
        raw = _recorded(errors, joints, reference, target, station, band, largest_error_rad)
        if raw is not None:
            passes.append((raw, reference))
    if not passes:
        raise ValueError(f"{path} holds no monopulse tracking of {FEWEST_SAMPLES} samples or more")
    return passes


def _needed(recording: Recording, name: str) -> TopicData:
    data = recording.get(name)
    if data is None or data.stamp_ns is None:
        raise ValueError(f"{recording.path} holds no message of {name}")
    return data


def _stretches(targets: TopicData) -> list[tuple[str, ReferenceTrack]]:
    """Return name and motion of each target for as long as it was followed without a gap."""
    t_s = _seconds(targets)
    names = targets["target"]
    new = np.flatnonzero((names[1:] != names[:-1]) | (np.abs(np.diff(t_s)) > PASS_GAP_S)) + 1
    found = []
    for rows in np.split(np.arange(len(t_s)), new):
        times, first = np.unique(t_s[rows], return_index=True)
        chosen = rows[first]
        if len(times) >= 2:
            columns = {core: targets[name][chosen].astype(np.float64) for core, name in _REFERENCE_COLUMNS.items()}
            # A target that crosses north jumps by a turn, which no interpolation may follow.
            columns["azimuth_rad"] = np.unwrap(columns["azimuth_rad"])
            found.append((str(names[chosen[0]]), ReferenceTrack(t_s=times, **columns)))
    return found


def _recorded(
    errors: TopicData,
    joints: TopicData,
    reference: ReferenceTrack,
    target: str,
    station: str,
    band: str,
    largest_error_rad: float,
) -> RawTracking | None:
    t_s, joint_s = _seconds(errors), _seconds(joints)
    position = np.array(joints["position"].tolist(), dtype=np.float64)
    # A recorder under load may write messages out of order.
    order = np.argsort(joint_s, kind="stable")
    within = reference.covers(t_s) & (t_s >= joint_s[order[0]]) & (t_s <= joint_s[order[-1]])
    # Conscan and steptrack move the beam on purpose: their errors are not those of where it points.
    rows = np.flatnonzero(within & (errors["sensor"] == Sensor.MONOPULSE))
    t_s = t_s[rows]
    azimuth, elevation = (np.interp(t_s, joint_s[order], position[order, axis]) for axis in (0, 1))
    across, up = errors["cross_elevation"][rows], errors["elevation"][rows]
    good = errors["valid"][rows].astype(bool) & (np.hypot(across, up) <= largest_error_rad)
    if int(np.sum(good)) < FEWEST_SAMPLES:
        return None
    return RawTracking(
        station=station,
        band=band,
        target=target,
        t_s=t_s,
        azimuth_rad=azimuth + across / np.cos(elevation),
        elevation_rad=elevation + up,
        range_m=None,
        range_rate_m_s=None,
        good=good,
    )


def _seconds(data: TopicData) -> Array:
    assert data.stamp_ns is not None
    return np.asarray(data.stamp_ns * 1e-9, dtype=np.float64)
