"""Messages from and to the core's signals, as pairs; no other module makes or reads a message.

Wire data is not trusted: a number that is not finite, an array of the wrong length or an unknown
joint raises the ValueError of the signal.
"""

import numpy as np
from numpy.typing import NDArray
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from rf_pointing.core import (
    AXES,
    Boresight,
    CarrierPower,
    JointReading,
    JointTrajectory,
    MonopulseCluster,
    PointingError,
    Target,
    require_finite,
)
from rf_pointing.ephemeris import SkyUncertainty
from rf_pointing.nodes.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.pointing.status import AntennaStatus, TrackingStatus

_TARGET_FIELDS = {
    "azimuth": "azimuth_rad",
    "elevation": "elevation_rad",
    "azimuth_rate": "azimuth_rate_rad_s",
    "elevation_rate": "elevation_rate_rad_s",
    "azimuth_acceleration": "azimuth_acceleration_rad_s2",
    "elevation_acceleration": "elevation_acceleration_rad_s2",
    "range": "range_m",
    "range_rate": "range_rate_m_s",
    "refraction": "refraction_rad",
}
_UNCERTAINTY_FIELDS = {
    "element_age": "age_s",
    "along_track_sigma": "along_track_rad",
    "cross_track_sigma": "cross_track_rad",
    "along_track_time_sigma": "along_track_s",
}


def target_to_message(target: Target, uncertainty: SkyUncertainty | None = None) -> ours.Target:
    """Return the target, with what the age of its elements means on the sky if that is known."""
    message = ours.Target(target=target.name, light_time=target.light_time_s, doppler_factor=target.doppler_factor)
    message.header.stamp = stamp_from_seconds(target.t_s)
    for wire, core in _TARGET_FIELDS.items():
        setattr(message, wire, float(getattr(target, core)))
    if uncertainty is not None:
        message.covariance = uncertainty.covariance_rad2.ravel().tolist()
        for wire, core in _UNCERTAINTY_FIELDS.items():
            setattr(message, wire, float(getattr(uncertainty, core)))
    return message


def uncertainty_from_message(message: ours.Target) -> SkyUncertainty | None:
    """Return the uncertainty that a target carries, None when it carries none."""
    if not message.covariance:
        return None
    if len(message.covariance) != 4:
        raise ValueError(f"covariance has {len(message.covariance)} values, must have 4 or none")
    values = {core: getattr(message, wire) for wire, core in _UNCERTAINTY_FIELDS.items()}
    require_finite("covariance", np.array([*message.covariance, *values.values()]))
    return SkyUncertainty(covariance_rad2=np.array(message.covariance).reshape(2, 2), **values)


def target_from_message(message: ours.Target) -> Target:
    values = {core: getattr(message, wire) for wire, core in _TARGET_FIELDS.items()}
    return Target(t_s=seconds_from_stamp(message.header.stamp), name=message.target, **values)


def joints_to_message(reading: JointReading) -> JointState:
    message = JointState(name=list(AXES))
    message.header.stamp = stamp_from_seconds(reading.t_s)
    message.position = reading.position_rad.tolist()
    message.velocity = reading.velocity_rad_s.tolist()
    return message


def joints_from_message(message: JointState) -> JointReading:
    order = _axis_order(list(message.name))
    position, velocity = np.array(message.position), np.array(message.velocity)
    for name, values in (("position", position), ("velocity", velocity)):
        if len(values) != len(message.name):
            raise ValueError(f"{name} has {len(values)} values, must have one for each of {len(message.name)} joints")
    return JointReading(
        t_s=seconds_from_stamp(message.header.stamp), position_rad=position[order], velocity_rad_s=velocity[order]
    )


def trajectory_to_message(trajectory: JointTrajectory, stamp_s: float) -> TrajectoryMessage:
    """Return the command with `stamp_s` as its base time; every point must lie after it."""
    message = TrajectoryMessage(joint_names=list(AXES))
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


def trajectory_from_message(message: TrajectoryMessage) -> JointTrajectory:
    order = _axis_order(list(message.joint_names))
    base_s = seconds_from_stamp(message.header.stamp)
    for name in ("positions", "velocities", "accelerations"):
        for index, point in enumerate(message.points):
            if len(getattr(point, name)) != len(order):
                raise ValueError(
                    f"points[{index}].{name} has {len(getattr(point, name))} values, must have {len(order)}"
                )
    return JointTrajectory(
        t_s=np.array(
            [round(base_s + p.time_from_start.sec + p.time_from_start.nanosec * 1e-9, 6) for p in message.points]
        ),
        position_rad=_stacked([p.positions for p in message.points], order),
        velocity_rad_s=_stacked([p.velocities for p in message.points], order),
        acceleration_rad_s2=_stacked([p.accelerations for p in message.points], order),
    )


def boresight_to_message(boresight: Boresight) -> ours.Boresight:
    message = ours.Boresight(azimuth=boresight.azimuth_rad, elevation=boresight.elevation_rad)
    message.header.stamp = stamp_from_seconds(boresight.t_s)
    return message


def boresight_from_message(message: ours.Boresight) -> Boresight:
    return Boresight(
        t_s=seconds_from_stamp(message.header.stamp), azimuth_rad=message.azimuth, elevation_rad=message.elevation
    )


def monopulse_to_message(cluster: MonopulseCluster) -> ours.Monopulse:
    message = ours.Monopulse(carrier_to_noise=float(cluster.carrier_to_noise_db_hz))
    message.header.stamp = stamp_from_seconds(float(cluster.t_s[-1]))
    message.sample_period = round(float(cluster.t_s[1] - cluster.t_s[0]), 6) if len(cluster.t_s) > 1 else 0.0
    for name in ("sum", "difference_cross_elevation", "difference_elevation"):
        samples = getattr(cluster, name)
        setattr(message, f"{name}_i", samples.real.tolist())
        setattr(message, f"{name}_q", samples.imag.tolist())
    return message


def monopulse_from_message(message: ours.Monopulse) -> MonopulseCluster:
    channels = {}
    for name in ("sum", "difference_cross_elevation", "difference_elevation"):
        in_phase, quadrature = np.array(getattr(message, f"{name}_i")), np.array(getattr(message, f"{name}_q"))
        if len(in_phase) != len(quadrature) or len(in_phase) != len(message.sum_i):
            raise ValueError(
                f"{name} has {len(in_phase)} I and {len(quadrature)} Q samples, must have {len(message.sum_i)}"
            )
        channels[name] = in_phase + 1j * quadrature
    # The stamp is that of the last sample; the others lie before it.
    count = len(message.sum_i)
    last_s = seconds_from_stamp(message.header.stamp)
    t_s = last_s - message.sample_period * np.arange(count - 1, -1, -1)
    return MonopulseCluster(t_s=t_s, carrier_to_noise_db_hz=message.carrier_to_noise, **channels)


def power_to_message(power: CarrierPower) -> ours.CarrierPower:
    message = ours.CarrierPower(
        integration_time=power.integration_s,
        power=power.power_w,
        sigma=power.sigma_w,
        carrier_to_noise=power.carrier_to_noise_db_hz,
    )
    message.header.stamp = stamp_from_seconds(power.t_s)
    return message


def power_from_message(message: ours.CarrierPower) -> CarrierPower:
    return CarrierPower(
        t_s=seconds_from_stamp(message.header.stamp),
        integration_s=message.integration_time,
        power_w=message.power,
        sigma_w=message.sigma,
        carrier_to_noise_db_hz=message.carrier_to_noise,
    )


def error_to_message(error: PointingError) -> ours.PointingError:
    message = ours.PointingError(
        sensor=error.sensor,
        valid=error.valid,
        reason=error.reason,
        cross_elevation=float(error.cross_elevation_rad),
        elevation=float(error.elevation_rad),
        carrier_to_noise=float(error.carrier_to_noise_db_hz),
    )
    # The wire has fixed arrays without shape: row-major.
    message.covariance = np.asarray(error.covariance_rad2, dtype=np.float64).ravel()
    message.header.stamp = stamp_from_seconds(error.t_s)
    return message


def error_from_message(message: ours.PointingError) -> PointingError:
    return PointingError(
        t_s=seconds_from_stamp(message.header.stamp),
        sensor=message.sensor,
        cross_elevation_rad=message.cross_elevation,
        elevation_rad=message.elevation,
        covariance_rad2=np.array(message.covariance).reshape(2, 2),
        carrier_to_noise_db_hz=message.carrier_to_noise,
        valid=message.valid,
        reason=message.reason,
    )


def tracking_status_to_message(status: TrackingStatus) -> ours.TrackingStatus:
    message = ours.TrackingStatus(
        mode=status.mode,
        sensor=status.sensor,
        target=status.target,
        reason=status.reason,
        los=stamp_from_seconds(status.los_t_s),
        azimuth=status.azimuth_rad,
        elevation=status.elevation_rad,
        cross_elevation_error=status.cross_elevation_error_rad,
        elevation_error=status.elevation_error_rad,
        cross_elevation_offset=status.cross_elevation_offset_rad,
        elevation_offset=status.elevation_offset_rad,
        carrier_to_noise=status.carrier_to_noise_db_hz,
        beamwidth=status.half_power_beamwidth_rad,
        command_lead=status.command_lead_s,
    )
    message.scan_centre = status.scan_centre_rad
    message.header.stamp = stamp_from_seconds(status.t_s)
    return message


def scan_centre_from_message(
    message: ours.TrackingStatus,
) -> tuple[float, NDArray[np.float64], NDArray[np.float64], str, str]:
    """Return time, scan centre (2,), its offset from the prediction (2,), mode and sensor."""
    offset = np.array([message.cross_elevation_offset, message.elevation_offset])
    centre = np.array(message.scan_centre)
    if not (np.all(np.isfinite(offset)) and np.all(np.isfinite(centre))):
        raise ValueError("scan_centre and the offsets must be finite")
    return seconds_from_stamp(message.header.stamp), centre, offset, message.mode, message.sensor


def antenna_status_to_message(status: AntennaStatus) -> ours.AntennaStatus:
    message = ours.AntennaStatus(
        mode=status.mode,
        fault=status.fault,
        at_limit=list(status.at_limit),
        command_lead=float(status.command_lead_s),
        commands_accepted=status.commands_accepted,
        commands_rejected=status.commands_rejected,
        last_rejection=status.last_rejection,
        warning=status.warning,
        transmit_inhibit=status.transmit_inhibit,
        commander=status.commander,
    )
    message.commanded, message.rate_command = status.commanded_rad, status.rate_command_rad_s
    message.rate_limit, message.acceleration_limit = status.rate_limit_rad_s, status.acceleration_limit_rad_s2
    message.header.stamp = stamp_from_seconds(status.t_s)
    return message


def _axis_order(names: list[str]) -> list[int]:
    # Joints may come in any order, but each of them once: a missing one must not become 0.
    unknown = [name for name in names if name not in AXES]
    if unknown:
        raise ValueError(f"unknown joint {', '.join(unknown)}; the joints are {', '.join(AXES)}")
    if sorted(names) != sorted(AXES):
        raise ValueError(f"joints are {', '.join(names) or 'none'}, must be {', '.join(AXES)}, each once")
    return [names.index(axis) for axis in AXES]


def _stacked(rows: list[list[float]], order: list[int]) -> NDArray[np.float64]:
    return np.array([[row[index] for index in order] for row in rows], dtype=np.float64).reshape(len(rows), len(order))
