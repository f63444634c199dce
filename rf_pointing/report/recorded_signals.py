"""A recording as the signals of the core: what the parts of a station can be given once more.

Each message becomes the dataclass that its node makes of it; one that is refused there is counted
as a problem of the recording here.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core import (
    CarrierPower,
    JointReading,
    JointTrajectory,
    MonopulseCluster,
    PointingError,
    Sensor,
    SkyUncertainty,
    Target,
)
from rf_pointing.core.mount_types import axes_among
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import Pass
from rf_pointing.report.analysis import Timeline, timeline, tracked_pass
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.topics import TOPICS, TopicLayout, own_layout, wire_name
from rf_pointing.simulation.open_loop import Signals
from rf_pointing.station.pointing.status import TrackingStatus

CHANNELS = ("sum", "difference_cross_elevation", "difference_elevation")
WIND = "weather/wind"
_MOTION = {"position_rad": "positions", "velocity_rad_s": "velocities", "acceleration_rad_s2": "accelerations"}


def _t_s(stamp: Any) -> float:
    # Stamps are whole microseconds: rounded, they are the sender's number again.
    return round(float(stamp.sec + stamp.nanosec * 1e-9), 6)


def _maker(kind: type, **own: Any) -> Callable[[Any], Any]:
    """Return what makes a signal of a message: fields of the same name, or by `own` functions.

    A field that an older recording does not have keeps its default.
    """
    names = {each.name: wire_name(each.name) for each in fields(kind) if each.name not in own}

    def made(message: Any) -> Any:
        found = {name: make(message) for name, make in own.items()}
        for name, wire in names.items():
            value = _t_s(message.header.stamp) if name == "t_s" else getattr(message, wire, None)
            if value is not None:
                found[name] = _t_s(value) if hasattr(value, "nanosec") else value
        return kind(**found)

    return made


def _joints(message: Any) -> JointReading:
    # In the order of our axes, whatever the order of the publisher.
    position, velocity = TOPICS["joint_states"].row(message)
    motion = {"position_rad": np.array(position), "velocity_rad_s": np.array(velocity)}
    return JointReading(t_s=_t_s(message.header.stamp), **motion)


def _trajectory(message: Any) -> tuple[float, JointTrajectory]:
    base_s = _t_s(message.header.stamp)
    order = [message.joint_names.index(axis) for axis in axes_among(message.joint_names)]
    motion = {
        name: np.array([getattr(point, wire) for point in message.points])[:, order]
        for name, wire in _MOTION.items()
    }  # fmt: skip
    since = (point.time_from_start for point in message.points)
    times = np.array([each.sec + each.nanosec * 1e-9 for each in since])
    return base_s, JointTrajectory(t_s=np.round(base_s + times, 6), **motion)


def _cluster(message: Any) -> MonopulseCluster:
    real, imaginary = ([getattr(message, f"{name}_{part}") for name in CHANNELS] for part in "iq")
    parts = {name: i + 1j * q for name, i, q in zip(CHANNELS, real, imaginary, strict=True)}
    # The stamp is that of the last sample.
    ages = np.arange(len(message.sum_i) - 1, -1, -1)
    t_s = _t_s(message.header.stamp) - message.sample_period * ages
    return MonopulseCluster(t_s=t_s, carrier_to_noise_db_hz=message.carrier_to_noise, **parts)


def _uncertainty(message: Any) -> SkyUncertainty | None:
    if not len(message.covariance):
        return None
    return SkyUncertainty(
        covariance_rad2=np.reshape(message.covariance, (2, 2)), age_s=message.element_age,
        along_track_rad=message.along_track_sigma, cross_track_rad=message.cross_track_sigma,
        along_track_s=message.along_track_time_sigma,
    )  # fmt: skip


@dataclass(frozen=True)
class DriveStatus:
    """Rate command (2,) of both axes at `t_s`, and the counts of a drive that takes positions."""

    t_s: float
    rate_command_rad_s: Array
    starts: Any = (0, 0)
    reversals: Any = (0, 0)


def _with(name: str, column: str, make: Callable[[Any], Any]) -> TopicLayout:
    """Return a layout of the reports with one more column."""
    layout = TOPICS[name]

    def row(message: Any) -> tuple[Any, ...]:
        # In a list of one, which a column keeps as it is: numpy would take a tuple apart.
        return *layout.row(message), [make(message)]

    return replace(layout, columns=(*layout.columns, column), row=row)


_WHOLE = dict.fromkeys(("rises_before", "sets_after"), lambda _: False)
_PASS = _maker(Pass, name=lambda m: m.target, **_WHOLE)
_ERROR = _maker(PointingError, covariance_rad2=lambda m: np.reshape(m.covariance, (2, 2)))
MAKERS: dict[str, Callable[[Any], Any]] = {
    "target": _maker(Target, name=lambda m: m.target, uncertainty=_uncertainty),
    "joint_states": _joints, "joint_trajectory": _trajectory, "antenna_status": _maker(DriveStatus),
    "tracking_status": _maker(TrackingStatus, half_power_beamwidth_rad=lambda m: m.beamwidth),
    Sensor.MONOPULSE: _cluster,
    "carrier_power": _maker(CarrierPower, integration_s=lambda m: m.integration_time),
    "pointing_error": _ERROR, "sim/pointing_error": _ERROR,
}  # fmt: skip
"""Signal of a message, by topic."""
LAYOUTS: dict[str, TopicLayout] = {
    **TOPICS,
    **{name: _with(name, "signal", make) for name, make in MAKERS.items()},
    "passes": _with("passes", "signal", lambda message: [_PASS(each) for each in message.passes]),
    "pointing_model": _with("pointing_model", "signal", lambda m: BiasModel(dict(zip(m.terms, m.values, strict=True)))),
    "station_in_use": own_layout("StationInUse", "node", "digest", periodic=False),
    WIND: TopicLayout(
        "geometry_msgs/msg/Vector3Stamped", ("velocity",), lambda m: ([float(m.vector.x), float(m.vector.y)],)
    ),
}


@dataclass(frozen=True)
class RecordedPass:
    """A recorded pass and its signals; `model` is None where no bias model was recorded.

    `wind` holds times (n,) and velocities (n, 2) of the air to east and north, None without an
    anemometer; `digests` are those of the descriptions in use.
    """

    recording: Recording
    signals: Signals
    modes: Timeline
    window: Pass
    sensor: str
    model: BiasModel | None
    wind: tuple[Array, Array] | None
    digests: tuple[str, ...]


def read_pass(path: Path | str, namespace: str | None = None) -> RecordedPass:
    """Read the tracked pass of a recording; ValueError names the topic that it lacks."""
    recording = read_recording(path, namespace=namespace, layouts=LAYOUTS)
    modes = timeline(recording)
    if modes is None:
        raise ValueError(f"{path} holds no tracking_status: nothing tells what was tracked")
    found = tracked_pass(recording, modes)
    if found is None:
        raise ValueError(f"{path}: no pass of its passes was tracked")
    signals = Signals()
    for name in MAKERS:
        data = recording.get(name)
        if data is not None:
            # Log times of several senders overtake each other; a stamp is when it was true.
            order = np.argsort(data.t_s, kind="stable")
            signals.topics[name] = [data["signal"][index][0] for index in order]
    windows = [each for row in recording.topics["passes"]["signal"] for each in row[0]]
    # Announced again in every list, with the same times to a microsecond.
    window = min(windows, key=lambda each: abs(each.aos_t_s - found.aos_ns * 1e-9))
    model, wind, used = (recording.get(name) for name in ("pointing_model", WIND, "station_in_use"))
    # The newest: what the pass ended with is what its elements and limits were judged by.
    chosen = [str(each.sensor) for each in signals.of("tracking_status") if each.target]
    return RecordedPass(
        recording=recording, signals=signals, modes=modes, window=window,
        sensor=recording.notes.get("sensor") or (chosen[-1] if chosen else Sensor.PROGRAM.value),
        model=None if model is None else model["signal"][-1][0],
        wind=None if wind is None else (wind.t_s, np.array(wind["velocity"])),
        digests=() if used is None else tuple(dict.fromkeys(map(str, used["digest"]))),
    )  # fmt: skip
