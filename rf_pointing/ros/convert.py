"""Messages from and to the core's signals, as pairs; no other module makes or reads a message.

Wire data is not trusted: a number that is not finite, an array of the wrong length or an unknown
joint raises the ValueError of the signal.
"""

import math
import re
from array import array
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, get_origin, get_type_hints

import numpy as np
from builtin_interfaces.msg import Time
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState, NavSatFix, NavSatStatus, Temperature
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from rf_pointing import core
from rf_pointing.core import Array, axes_among
from rf_pointing.core.constants import ZERO_CELSIUS_K
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.pointing.status import TrackingStatus

Signal = TypeVar("Signal")
Message = TypeVar("Message")
ORBIT_FRAME = "orbit"
NOT_KNOWN = -1.0
# Samples over a longer time do not measure a moving antenna.
LONGEST_CLUSTER_S = 100.0
# The leftmost match counts: `aos_t_s` loses `_t_s`, not only `_s`.
_UNIT = re.compile(r"_(rad_s2|rad_s|rad2|rad|m_s|m|t_s|s|w|db_hz|db)$")


def pair(
    signal_type: type[Signal], message_type: type[Message], **other_names: str | None
) -> tuple[Callable[..., Message], Callable[..., Signal]]:
    """Return the function from a signal to its message, and the one from the message to the signal.

    Their fields have the same names, but for the unit that only the signal's carry; `t_s` is the
    stamp of the header.  A number that may be None is negative on the wire while it is.
    `other_names` are the message's names that differ, by the signal's; None for a field that is not
    on the wire.  Both functions take the values of further fields, or of
    those that another shape on the wire keeps from being copied, as keywords.
    """
    kinds = get_type_hints(signal_type)
    names = {name: other_names.get(name, _UNIT.sub("", name)) for name in kinds if name != "t_s"}
    wires = {name: wire for name, wire in names.items() if wire is not None}
    # A field without a counterpart is found here, when the module is imported.
    blank = message_type()
    makers = {name: _maker(getattr(blank, wire)) for name, wire in wires.items()}

    def to_message(signal: Signal, **further: Any) -> Message:
        message = message_type(**further)
        if "t_s" in kinds:
            message.header.stamp = stamp_from_seconds(signal.t_s)
        for name, wire in wires.items():
            setattr(message, wire, makers[name](getattr(signal, name)))
        return message

    def from_message(message: Message, **further: Any) -> Signal:
        if "t_s" in kinds:
            further["t_s"] = seconds_from_stamp(message.header.stamp)
        copied = wires.keys() - further.keys()
        return signal_type(**further, **{name: _read(getattr(message, wires[name]), kinds[name]) for name in copied})

    return to_message, from_message


def _maker(blank: Any) -> Callable[[Any], Any]:
    """Return what makes the value of a field whose initial value is `blank`."""
    if isinstance(blank, Time):
        return stamp_from_seconds
    # Only a number that may be unknown has a default: the wire has no None.
    if isinstance(blank, float) and blank == NOT_KNOWN:
        return lambda value: NOT_KNOWN if value is None else float(value)
    # The wire has fixed arrays without shape: row-major.
    if isinstance(blank, np.ndarray):
        return lambda values: np.asarray(values, dtype=blank.dtype).ravel()
    # The length is any: its own type is that of the wire.
    return list if isinstance(blank, array) else type(blank)


def _read(value: Any, kind: Any) -> Any:
    if isinstance(value, Time):
        return seconds_from_stamp(value)
    if kind == float | None:
        return None if value < 0.0 else value
    return tuple(np.array(value).tolist()) if get_origin(kind) is tuple else value


_target_to_message, _target_from_message = pair(core.Target, ours.Target, name="target", uncertainty=None)
boresight_to_message, boresight_from_message = pair(core.Boresight, ours.Boresight)
power_to_message, _power_from_message = pair(core.CarrierPower, ours.CarrierPower, integration_s="integration_time")
error_to_message, _error_from_message = pair(core.PointingError, ours.PointingError)
tracking_status_to_message, _ = pair(TrackingStatus, ours.TrackingStatus, half_power_beamwidth_rad="beamwidth")


def target_to_message(target: core.Target) -> ours.Target:
    """Return the target, with how uncertain its direction is where that is known."""
    message = _target_to_message(target, light_time=target.light_time_s, doppler_factor=target.doppler_factor)
    if (known := target.uncertainty) is not None:
        message.covariance = known.covariance_rad2.ravel().tolist()
        message.element_age, message.along_track_time_sigma = known.age_s, known.along_track_s
        message.along_track_sigma, message.cross_track_sigma = known.along_track_rad, known.cross_track_rad
    return message


def target_from_message(message: ours.Target) -> core.Target:
    known = None
    if len(message.covariance):
        if len(message.covariance) != 4:
            raise ValueError(f"covariance has {len(message.covariance)} values, must have 4 or none")
        known = core.SkyUncertainty(
            covariance_rad2=np.array(message.covariance).reshape(2, 2), age_s=message.element_age,
            along_track_rad=message.along_track_sigma, cross_track_rad=message.cross_track_sigma,
            along_track_s=message.along_track_time_sigma,
        )  # fmt: skip
    return _target_from_message(message, uncertainty=known)


def held_direction_from_message(message: ours.TrackingStatus) -> core.HeldDirection | None:
    """Return the direction in which a sensor holds the target, None while none does."""
    # Imported here: a node without a controller needs no table of sensors.
    from rf_pointing.tracking.sensors import SENSORS

    if not (message.held and message.mode in SENSORS):
        return None
    return core.HeldDirection(
        t_s=seconds_from_stamp(message.header.stamp), azimuth_rad=message.azimuth, elevation_rad=message.elevation,
        beamwidth_rad=message.beamwidth,
    )  # fmt: skip


def satellite_quaternion_from_message(message: ours.Attitude) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) from the body's axes to the orbital frame."""
    if message.header.frame_id.rpartition("/")[2] != ORBIT_FRAME:
        raise ValueError(f"frame_id={message.header.frame_id!r} of an attitude must be {ORBIT_FRAME!r}")
    turn = message.orientation
    parts, size = (turn.x, turn.y, turn.z, turn.w), math.hypot(turn.x, turn.y, turn.z, turn.w)
    core.require_between("length of the quaternion", size, 0.99, 1.01)
    x, y, z, w = (part / size for part in parts)
    return x, y, z, w


def temperature_from_message(message: Temperature) -> float:
    """Return the temperature in K of the air or of the mount."""
    temperature_k = message.temperature + ZERO_CELSIUS_K
    core.require_between("temperature_k", temperature_k, 180.0, 330.0)
    return float(temperature_k)


def place_from_fix(message: NavSatFix) -> tuple[float, float, float]:
    """Return latitude and longitude in deg and height in m; ValueError without a fix."""
    if message.status.status == NavSatStatus.STATUS_NO_FIX:
        raise ValueError("a NavSatFix without a fix")
    return message.latitude, message.longitude, message.altitude


def joints_to_message(reading: core.JointReading, axes: Sequence[str] = core.AXES) -> JointState:
    message = JointState(name=list(axes))
    message.header.stamp = stamp_from_seconds(reading.t_s)
    message.position = reading.position_rad.tolist()
    message.velocity = reading.velocity_rad_s.tolist()
    return message


def joints_from_message(message: JointState, axes: Sequence[str] = ()) -> core.JointReading:
    """Return the reading of these axes; unless they are named, of any mount's."""
    order = _axis_order(list(message.name), axes or axes_among(message.name))
    position, velocity = np.array(message.position), np.array(message.velocity)
    for name, values in (("position", position), ("velocity", velocity)):
        if len(values) != len(message.name):
            raise ValueError(f"{name} has {len(values)} values, must have one for each of {len(message.name)} joints")
    return core.JointReading(
        t_s=seconds_from_stamp(message.header.stamp), position_rad=position[order], velocity_rad_s=velocity[order]
    )


def trajectory_to_message(
    trajectory: core.JointTrajectory, stamp_s: float, axes: Sequence[str] = core.AXES
) -> TrajectoryMessage:
    """Return the command with `stamp_s` as its base time; every point must lie after it."""
    message = TrajectoryMessage(joint_names=list(axes))
    message.header.stamp = stamp_from_seconds(stamp_s)
    for t_s, position, velocity, acceleration in zip(
        trajectory.t_s, trajectory.position_rad, trajectory.velocity_rad_s, trajectory.acceleration_rad_s2, strict=True
    ):
        point = JointTrajectoryPoint(
            positions=position.tolist(), velocities=velocity.tolist(), accelerations=acceleration.tolist()
        )
        # From whole microseconds, as the stamp: the receiver adds both and must find the same time.
        microseconds = round((t_s - stamp_s) * 1e6)
        point.time_from_start.sec = microseconds // 1_000_000
        point.time_from_start.nanosec = microseconds % 1_000_000 * 1000
        message.points.append(point)
    return message


def trajectory_from_message(
    message: TrajectoryMessage, base_s: float, axes: Sequence[str] = core.AXES
) -> core.JointTrajectory:
    """Return the command whose points lie after `base_s`: its stamp, or now where that is 0.

    Rates that no point has are those of the positions, at rest at the end; accelerations are 0.
    """
    order = _axis_order(list(message.joint_names), axes)
    points = message.points
    given = {
        "positions": True,
        **{name: any(getattr(p, name) for p in points) for name in ("velocities", "accelerations")},
    }
    for name in (name for name, stated in given.items() if stated):
        for index, point in enumerate(points):
            count = len(getattr(point, name))
            if count != len(order):
                raise ValueError(f"points[{index}].{name} has {count} values, must have {len(order)}")
    since_s = [p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in points]
    position, velocity, acceleration = (
        _stacked([getattr(p, name) for p in points], order) if stated else np.zeros((len(points), len(order)))
        for name, stated in given.items()
    )
    if not given["velocities"] and len(points) > 1 and min(np.diff(since_s)) > 0.0:
        velocity = np.gradient(position, since_s, axis=0)
        velocity[-1] = 0.0
    times = np.round(base_s + np.array(since_s), 6)
    return core.JointTrajectory(
        t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
    )


def power_from_message(message: ours.CarrierPower) -> core.CarrierPower:
    core.require_between("integration_time", message.integration_time, 0.0, LONGEST_CLUSTER_S)
    return _power_from_message(message)


def error_from_message(message: ours.PointingError) -> core.PointingError:
    return _error_from_message(message, covariance_rad2=np.array(message.covariance).reshape(2, 2))


def monopulse_to_message(cluster: core.MonopulseCluster) -> ours.Monopulse:
    message = ours.Monopulse(carrier_to_noise=float(cluster.carrier_to_noise_db_hz))
    message.header.stamp = stamp_from_seconds(float(cluster.t_s[-1]))
    message.sample_period = round(float(cluster.t_s[1] - cluster.t_s[0]), 6) if len(cluster.t_s) > 1 else 0.0
    for name in ("sum", "difference_cross_elevation", "difference_elevation"):
        samples = getattr(cluster, name)
        setattr(message, f"{name}_i", samples.real.tolist())
        setattr(message, f"{name}_q", samples.imag.tolist())
    return message


def monopulse_from_message(message: ours.Monopulse) -> core.MonopulseCluster:
    count = len(message.sum_i)
    channels = {}
    for name in ("sum", "difference_cross_elevation", "difference_elevation"):
        in_phase, quadrature = np.array(getattr(message, f"{name}_i")), np.array(getattr(message, f"{name}_q"))
        if not len(in_phase) == len(quadrature) == count:
            raise ValueError(f"{name} has {len(in_phase)} I and {len(quadrature)} Q samples, must have {count}")
        channels[name] = in_phase + 1j * quadrature
    core.require_between("sample_period", message.sample_period, 0.0, LONGEST_CLUSTER_S / max(count, 1))
    # The stamp is that of the last sample; the others lie before it.
    last_s = seconds_from_stamp(message.header.stamp)
    t_s = last_s - message.sample_period * np.arange(count - 1, -1, -1)
    return core.MonopulseCluster(t_s=t_s, carrier_to_noise_db_hz=message.carrier_to_noise, **channels)


def scan_centre_from_message(message: ours.TrackingStatus) -> tuple[float, Array, Array, str, str]:
    """Return time, scan centre (2,), its offset from the prediction (2,), mode and sensor."""
    offset = np.array([message.cross_elevation_offset, message.elevation_offset])
    centre = np.array(message.scan_centre)
    if not np.all(np.isfinite([offset, centre])):
        raise ValueError("scan_centre and the offsets must be finite")
    return seconds_from_stamp(message.header.stamp), centre, offset, message.mode, message.sensor


def _axis_order(names: list[str], axes: Sequence[str]) -> list[int]:
    # Joints may come in any order, but each of them once: a missing one must not become 0.
    unknown = [name for name in names if name not in axes]
    if unknown:
        raise ValueError(f"unknown joint {', '.join(unknown)}; the joints are {', '.join(axes)}")
    if sorted(names) != sorted(axes):
        raise ValueError(f"joints are {', '.join(names) or 'none'}, must be {', '.join(axes)}, each once")
    return [names.index(axis) for axis in axes]


def _stacked(rows: list[list[float]], order: list[int]) -> Array:
    return np.array([[row[index] for index in order] for row in rows], dtype=np.float64).reshape(len(rows), len(order))
