"""Messages of the array sensors from and to the core's signals, as pairs.

Nothing else makes or reads their fields.  Wire data is not trusted: what is not finite, of the
wrong length, or no rotation raises ValueError in the signal's words.
"""

from typing import Any

import numpy as np
from geometry_msgs.msg import (
    PoseWithCovarianceStamped,
    Quaternion,
    QuaternionStamped,
    TwistWithCovarianceStamped,
    Vector3,
    Vector3Stamped,
)
from numpy.typing import NDArray
from rf_pointing_msgs import msg as ours

from rf_pointing.array_sensors.attitude.attitude_report import (
    AttitudeReport,
    RateReport,
    require_covariance,
)
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_matrix,
    quaternion_to_matrix,
    unit_quaternion,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque
from rf_pointing.array_sensors.doa.array_source import SnapshotBlock
from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock, HeldTorque
from rf_pointing.array_sensors.interferometer.docking import Rep103Pose
from rf_pointing.array_sensors.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.interferometer.tracker import TrackerOutput
from rf_pointing.array_sensors.tripulse.receiver import TripulseMeasurement
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame
from rf_pointing.core import as_finite_array, require_between, require_finite
from rf_pointing.core.types import Array
from rf_pointing.ros.convert import ORBIT_FRAME as ORBIT_FRAME
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

BODY_FRAME, ARRAY_FRAME, ACTIVE_FRAME = "body", "array", "active_body"
_PATHS = (3, 3)
_TORQUE_FIELDS = {
    "control_torque": "control_n_m",
    "wheel_momentum": "wheel_momentum_n_m_s",
    "wheel_momentum_rate": "wheel_momentum_rate_n_m",
}


def frame_to_message(frame: TripulseFrame, sample_rate_hz: float) -> ours.TripulseFrame:
    message = ours.TripulseFrame(
        station=frame.station, frame=frame.sequence, sample_rate=sample_rate_hz
    )
    message.header.stamp, message.header.frame_id = stamp_from_seconds(frame.t_s), ARRAY_FRAME
    message.steering = frame.steering
    message.samples_i, message.samples_q = frame.samples.real.tolist(), frame.samples.imag.tolist()
    return message


def frame_from_message(message: ours.TripulseFrame, sample_rate_hz: float) -> TripulseFrame:
    """Return the frame; `sample_rate_hz` is the rate that the receiver works at."""
    # At another rate every tone would be found at a wrong frequency: a configuration error, not
    # noise.
    if message.sample_rate != sample_rate_hz:
        raise ValueError(f"sample_rate={message.sample_rate} Hz, must be {sample_rate_hz} Hz")
    return TripulseFrame(
        t_s=seconds_from_stamp(message.header.stamp),
        station=message.station,
        sequence=message.frame,
        steering=np.array(message.steering),
        samples=_complex(message, None),
    )


def line_to_message(measured: TripulseMeasurement) -> ours.TripulseMeasurement:
    message = ours.TripulseMeasurement(
        station=measured.station,
        frame=measured.sequence,
        valid=measured.valid,
        reason=measured.reason,
        sum_snr=float(measured.sum_snr_db),
        frequency_shift=float(measured.shift_hz),
        estimator=measured.estimator,
    )
    message.header.stamp, message.header.frame_id = stamp_from_seconds(measured.t_s), ARRAY_FRAME
    message.projections, message.covariance = measured.projections, np.ravel(measured.covariance)
    return message


def line_from_message(message: ours.TripulseMeasurement) -> TripulseMeasurement:
    for name in ("projections", "covariance", "sum_snr", "frequency_shift"):
        require_finite(name, getattr(message, name))
    return TripulseMeasurement(
        t_s=seconds_from_stamp(message.header.stamp),
        station=message.station,
        sequence=message.frame,
        projections=np.array(message.projections),
        covariance=require_covariance("covariance", np.array(message.covariance).reshape(2, 2), 2),
        sum_snr_db=message.sum_snr,
        shift_hz=message.frequency_shift,
        estimator=message.estimator,
        valid=message.valid,
        reason=message.reason,
    )


def snapshots_to_message(heard: ChannelBlock) -> ours.ArraySnapshots:
    samples = heard.block.snapshots
    message = ours.ArraySnapshots(transmitters=list(heard.transmitters))
    message.elements, message.snapshots = samples.shape
    message.header.stamp, message.header.frame_id = stamp_from_seconds(heard.block.t_s), BODY_FRAME
    message.samples_i, message.samples_q = (
        samples.real.ravel().tolist(),
        samples.imag.ravel().tolist(),
    )
    return message


def snapshots_from_message(message: ours.ArraySnapshots) -> ChannelBlock:
    samples = _complex(message, message.elements * message.snapshots)
    block = SnapshotBlock(
        t_s=seconds_from_stamp(message.header.stamp),
        snapshots=samples.reshape(message.elements, message.snapshots),
    )
    return ChannelBlock(transmitters=tuple(message.transmitters), block=block)


def torque_to_message(torque: HeldTorque) -> ours.KnownTorque:
    message = ours.KnownTorque()
    message.header.stamp, message.header.frame_id = stamp_from_seconds(torque.t_s), BODY_FRAME
    for wire, core in _TORQUE_FIELDS.items():
        setattr(message, wire, getattr(torque.known, core))
    return message


def torque_from_message(message: ours.KnownTorque) -> HeldTorque:
    values = {
        core: as_finite_array(wire, getattr(message, wire), (3,))
        for wire, core in _TORQUE_FIELDS.items()
    }
    return HeldTorque(t_s=seconds_from_stamp(message.header.stamp), known=KnownTorque(**values))


def attitude_to_message(report: AttitudeReport, child_frame: str) -> ours.Attitude:
    message = ours.Attitude(child_frame_id=child_frame, valid=report.valid, reason=report.reason)
    message.header.stamp, message.header.frame_id = stamp_from_seconds(report.t_s), ORBIT_FRAME
    message.orientation = _quaternion(report.quaternion)
    message.covariance = np.ravel(report.covariance_rad2)
    return message


def attitude_from_message(message: ours.Attitude) -> AttitudeReport:
    return AttitudeReport(
        t_s=seconds_from_stamp(message.header.stamp),
        quaternion=_components(message.orientation),
        covariance_rad2=np.array(message.covariance).reshape(3, 3),
        valid=message.valid,
        reason=message.reason,
    )


def rate_to_message(report: RateReport) -> TwistWithCovarianceStamped:
    """Return the angular velocity.

    The linear one is zero by definition, since the body turns about its own origin.
    """
    message = TwistWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp_from_seconds(report.t_s), BODY_FRAME
    message.twist.twist.angular = _vector(report.rate_rad_s)
    covariance = np.zeros((6, 6))
    covariance[3:, 3:] = report.covariance_rad2_s2
    message.twist.covariance = covariance.ravel()
    return message


def rate_from_message(message: TwistWithCovarianceStamped) -> RateReport:
    return RateReport(
        t_s=seconds_from_stamp(message.header.stamp),
        rate_rad_s=_components(message.twist.twist.angular),
        covariance_rad2_s2=np.array(message.twist.covariance).reshape(6, 6)[3:, 3:],
    )


def orientation_to_message(t_s: float, quaternion: Array, frame: str) -> QuaternionStamped:
    message = QuaternionStamped(quaternion=_quaternion(quaternion))
    message.header.stamp, message.header.frame_id = stamp_from_seconds(t_s), frame
    return message


def orientation_from_message(message: QuaternionStamped) -> tuple[float, Array]:
    """Return time and unit quaternion (4,)."""
    return seconds_from_stamp(message.header.stamp), unit_quaternion(
        _components(message.quaternion)
    )


def vector_to_message(t_s: float, vector: Array, frame: str) -> Vector3Stamped:
    message = Vector3Stamped(vector=_vector(vector))
    message.header.stamp, message.header.frame_id = stamp_from_seconds(t_s), frame
    return message


def vector_from_message(message: Vector3Stamped) -> tuple[float, Array]:
    """Return time and vector (3,)."""
    return seconds_from_stamp(message.header.stamp), as_finite_array(
        "vector", _components(message.vector), (3,)
    )


def sequence_to_message(measured: InterferometerMeasurement) -> ours.InterferometerMeasurement:
    message = ours.InterferometerMeasurement(coupling_sigma=float(measured.amplitude_sigma))
    message.header.stamp, message.header.frame_id = stamp_from_seconds(measured.t_s), ACTIVE_FRAME
    message.phase, message.phase_rate = (
        measured.phase_rad.ravel().tolist(),
        measured.phase_rate_rad_s.ravel().tolist(),
    )
    message.coupling = measured.amplitudes.ravel()
    message.snr_forward, message.snr_return = (
        measured.snr_forward.tolist(),
        measured.snr_return.ravel().tolist(),
    )
    message.locked = measured.locked.ravel().tolist()
    return message


def sequence_from_message(message: ours.InterferometerMeasurement) -> InterferometerMeasurement:
    slots = len(message.snr_forward)
    for name in ("phase", "phase_rate", "snr_return", "locked"):
        if len(getattr(message, name)) != 9 * slots:
            raise ValueError(
                f"{name} has {len(getattr(message, name))} values, must have 9 for each of {slots} slots"
            )
    return InterferometerMeasurement(
        t_s=seconds_from_stamp(message.header.stamp),
        phase_rad=np.array(message.phase).reshape(slots, *_PATHS),
        phase_rate_rad_s=np.array(message.phase_rate).reshape(slots, *_PATHS),
        amplitudes=np.array(message.coupling).reshape(2, 2),
        amplitude_sigma=message.coupling_sigma,
        snr_forward=np.array(message.snr_forward),
        snr_return=np.array(message.snr_return).reshape(slots, *_PATHS),
        locked=np.array(message.locked, dtype=np.bool_).reshape(slots, *_PATHS),
    )


def pose_to_messages(
    t_s: float, pose: Rep103Pose
) -> tuple[PoseWithCovarianceStamped, TwistWithCovarianceStamped]:
    """Return pose and twist of the passive body, both in the active body's frame."""
    where, moving = PoseWithCovarianceStamped(), TwistWithCovarianceStamped()
    for message in (where, moving):
        message.header.stamp, message.header.frame_id = stamp_from_seconds(t_s), ACTIVE_FRAME
    where.pose.pose.position.x, where.pose.pose.position.y, where.pose.pose.position.z = map(
        float, pose.position_m
    )
    where.pose.pose.orientation = _quaternion(quaternion_from_matrix(pose.orientation))
    where.pose.covariance = pose.pose_covariance.ravel()
    moving.twist.twist.linear = _vector(pose.velocity_m_s)
    moving.twist.twist.angular = _vector(pose.angular_velocity_rad_s)
    moving.twist.covariance = pose.twist_covariance.ravel()
    return where, moving


def pose_from_messages(
    where: PoseWithCovarianceStamped, moving: TwistWithCovarianceStamped
) -> tuple[float, Rep103Pose]:
    """Return time and pose of two messages of one stamp."""
    # Pose and twist come from one estimate; stamps that differ mean that one message was lost.
    if where.header.stamp != moving.header.stamp:
        raise ValueError("pose and twist must have one stamp")
    quaternion = unit_quaternion(_components(where.pose.pose.orientation))
    pose = Rep103Pose(
        position_m=as_finite_array("position", _components(where.pose.pose.position), (3,)),
        orientation=quaternion_to_matrix(quaternion),
        pose_covariance=require_covariance(
            "pose covariance", np.array(where.pose.covariance).reshape(6, 6), 6
        ),
        velocity_m_s=as_finite_array("velocity", _components(moving.twist.twist.linear), (3,)),
        angular_velocity_rad_s=as_finite_array(
            "angular velocity", _components(moving.twist.twist.angular), (3,)
        ),
        twist_covariance=require_covariance(
            "twist covariance", np.array(moving.twist.covariance).reshape(6, 6), 6
        ),
    )
    return seconds_from_stamp(where.header.stamp), pose


def status_to_message(output: TrackerOutput) -> ours.RelativePoseStatus:
    message = ours.RelativePoseStatus(status=output.status, reason=output.reason)
    message.header.stamp = stamp_from_seconds(output.t_s)
    return message


def _complex(message: Any, count: int | None) -> NDArray[np.complex128]:
    """Return the I and Q samples of a message, `count` of them where that is known."""
    in_phase, quadrature = np.array(message.samples_i), np.array(message.samples_q)
    # A cut message must not be padded: it would shift Q against I.
    if len(in_phase) != len(quadrature) or (count is not None and len(in_phase) != count):
        wanted = "as many" if count is None else f"{count} of each"
        raise ValueError(f"samples: {len(in_phase)} I and {len(quadrature)} Q, must be {wanted}")
    require_between("number of samples", len(in_phase), 1, None)
    require_finite("samples_i", in_phase)
    require_finite("samples_q", quadrature)
    return np.asarray(in_phase + 1j * quadrature, dtype=np.complex128)


def _components(message: Any) -> Array:
    names = ("x", "y", "z", "w") if hasattr(message, "w") else ("x", "y", "z")
    return np.array([getattr(message, name) for name in names])


def _quaternion(quaternion: Array) -> Quaternion:
    x, y, z, w = map(float, quaternion)
    return Quaternion(x=x, y=y, z=z, w=w)


def _vector(vector: Array) -> Vector3:
    x, y, z = map(float, vector)
    return Vector3(x=x, y=y, z=z)
