"""Messages of the array sensors and the core's signals, there and back; unusable wire data is refused in plain words."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="messages need ROS 2")
from rclpy.serialization import deserialize_message, serialize_message

from rf_pointing.array_sensors.attitude.attitude_report import AttitudeReport, RateReport
from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_rotation_vector, quaternion_to_matrix
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque
from rf_pointing.array_sensors.doa.array_source import SnapshotBlock
from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock, HeldTorque
from rf_pointing.array_sensors.interferometer.docking import Rep103Pose
from rf_pointing.array_sensors.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.tripulse.receiver import TripulseMeasurement
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame

pytestmark = pytest.mark.usefixtures("ros_domain")

T_S = 1_767_225_600.123456
RATE_HZ = 4e6
SLOTS = 16
QUATERNION = quaternion_from_rotation_vector([0.4, -1.2, 2.0])
RNG = np.random.Generator(np.random.PCG64(7))
TORQUE = HeldTorque(
    t_s=T_S,
    known=KnownTorque(
        control_n_m=np.array([1e-4, 2e-4, -3e-4]),
        wheel_momentum_n_m_s=np.array([0.1, 0.2, 0.3]),
        wheel_momentum_rate_n_m=np.array([-1.0, 0.5, 0.25]),
    ),
)
SEQUENCE = InterferometerMeasurement(
    t_s=T_S, phase_rad=RNG.uniform(0.0, 6.28, (SLOTS, 3, 3)),
    phase_rate_rad_s=RNG.normal(size=(SLOTS, 3, 3)), amplitudes=RNG.normal(size=(2, 2)),
    amplitude_sigma=0.01, snr_forward=RNG.uniform(20.0, 90.0, SLOTS),
    snr_return=RNG.uniform(20.0, 90.0, (SLOTS, 3, 3)), locked=RNG.uniform(size=(SLOTS, 3, 3)) > 0.3,
)  # fmt: skip


def covariance(size: int) -> np.ndarray:
    root = RNG.normal(size=(size, size))
    return root @ root.T


def complex_normal(*shape: int) -> np.ndarray:
    return RNG.normal(size=(*shape, 2)) @ np.array([1.0, 1j])


FRAME = TripulseFrame(
    t_s=T_S, station="usingen", sequence=17, steering=np.array([0.01, -0.02]), samples=complex_normal(60)
)
LINE = TripulseMeasurement(
    t_s=T_S, station="usingen", sequence=17, projections=np.array([0.011, -0.021]),
    covariance=covariance(2), sum_snr_db=34.5, shift_hz=-120.5, estimator="ratio", valid=False,
    reason="lost lock",
)  # fmt: skip
HEARD = ChannelBlock(transmitters=("a", "b"), block=SnapshotBlock(t_s=T_S, snapshots=complex_normal(12, 5)))
ATTITUDE = AttitudeReport(
    t_s=T_S, quaternion=QUATERNION, covariance_rad2=covariance(3), valid=False, reason="one station"
)
RATE = RateReport(t_s=T_S, rate_rad_s=np.array([1e-3, -2e-3, 3e-3]), covariance_rad2_s2=covariance(3))
POSE = Rep103Pose(
    position_m=np.array([100.0, -3.0, 4.0]), orientation=quaternion_to_matrix(QUATERNION),
    pose_covariance=covariance(6), velocity_m_s=np.array([-1.0, 0.1, 0.2]),
    angular_velocity_rad_s=np.array([0.01, 0.02, -0.03]), twist_covariance=covariance(6),
)  # fmt: skip


def over_the_wire(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


def assert_same(got: Any, sent: Any) -> None:
    if is_dataclass(sent):
        assert type(got) is type(sent)
        for field in fields(sent):
            assert_same(getattr(got, field.name), getattr(sent, field.name))
    elif isinstance(sent, np.ndarray):
        assert got.dtype == sent.dtype
        assert got.shape == sent.shape
        np.testing.assert_allclose(got, sent, rtol=1e-13, atol=1e-15)
    else:
        assert got == sent


PAIRS: dict[str, tuple[Any, Callable[[Any], Any], Callable[[Any], Any]]] = {
    "frame": (
        FRAME,
        lambda frame: convert.frame_to_message(frame, RATE_HZ),
        lambda message: convert.frame_from_message(message, RATE_HZ),
    ),
    "line": (LINE, convert.line_to_message, convert.line_from_message),
    "snapshots": (HEARD, convert.snapshots_to_message, convert.snapshots_from_message),
    "torque": (TORQUE, convert.torque_to_message, convert.torque_from_message),
    "attitude": (ATTITUDE, lambda a: convert.attitude_to_message(a, "body"), convert.attitude_from_message),
    "rate": (RATE, convert.rate_to_message, convert.rate_from_message),
    "sequence": (SEQUENCE, convert.sequence_to_message, convert.sequence_from_message),
}


@pytest.mark.parametrize("name", PAIRS)
def test_signal_comes_back_as_it_was_sent(name: str) -> None:
    sent, to_message, from_message = PAIRS[name]
    assert_same(from_message(over_the_wire(to_message(sent))), sent)


def test_pose_and_twist_come_back_as_they_were_sent() -> None:
    where, moving = map(over_the_wire, convert.pose_to_messages(T_S, POSE))
    t_s, got = convert.pose_from_messages(where, moving)
    assert t_s == T_S
    assert_same(got, POSE)


def test_truth_comes_back_as_it_was_sent() -> None:
    t_s, quaternion = convert.orientation_from_message(
        over_the_wire(convert.orientation_to_message(T_S, QUATERNION, "orbit"))
    )
    assert t_s == T_S
    np.testing.assert_allclose(quaternion, QUATERNION, rtol=1e-14)
    t_s, vector = convert.vector_from_message(over_the_wire(convert.vector_to_message(T_S, np.arange(3.0), "body")))
    assert (t_s, vector.tolist()) == (T_S, [0.0, 1.0, 2.0])


def changed(message: Any, path: str, value: Any) -> Any:
    *above, last = path.split(".")
    owner = message
    for part in above:
        owner = getattr(owner, part)
    setattr(owner, last, value)
    return message


def with_nan(values: Any) -> Any:
    return [float("nan"), *list(values)[1:]]


REFUSED: list[tuple[str, str, Callable[[Any], Any], str]] = [
    ("frame", "samples_i", with_nan, "samples_i"),
    ("frame", "samples_q", with_nan, "samples_q"),
    ("frame", "samples_q", lambda v: list(v)[1:], "samples: 60 I and 59 Q, must be as many"),
    ("frame", "sample_rate", lambda _: 1e6, "sample_rate=1000000.0 Hz, must be 4000000.0 Hz"),
    ("frame", "steering", with_nan, "steering"),
    ("line", "projections", with_nan, "projections"),
    ("line", "covariance", with_nan, "covariance"),
    ("line", "covariance", lambda _: [1.0, 0.0, 0.0, -1.0], "covariance has eigenvalue"),
    ("line", "sum_snr", lambda _: float("inf"), "sum_snr"),
    ("snapshots", "samples_i", with_nan, "samples_i"),
    ("snapshots", "samples_q", lambda v: list(v)[1:], "samples: 60 I and 59 Q, must be 60 of each"),
    ("snapshots", "elements", lambda _: 13, "must be 65 of each"),
    ("snapshots", "snapshots", lambda _: 2**32 - 1, "of each"),
    ("torque", "control_torque", with_nan, "control_torque"),
    ("torque", "wheel_momentum", with_nan, "wheel_momentum"),
    ("attitude", "orientation.w", lambda _: 2.0, "norm"),
    ("attitude", "orientation.x", lambda _: float("nan"), "quaternion"),
    ("attitude", "covariance", with_nan, "covariance"),
    ("rate", "twist.covariance", lambda v: [-1.0 if i == 21 else x for i, x in enumerate(v)], "eigenvalue"),
    ("rate", "twist.twist.angular.x", lambda _: float("nan"), "rate_rad_s"),
    ("sequence", "phase", with_nan, "phase_rad"),
    ("sequence", "phase", lambda v: list(v)[1:], "phase has 143 values, must have 9 for each of 16 slots"),
    ("sequence", "locked", lambda v: list(v)[9:], "locked has 135 values"),
    ("sequence", "snr_forward", lambda v: list(v)[1:], "must have 9 for each of 15 slots"),
    ("sequence", "coupling_sigma", lambda _: 0.0, "amplitude_sigma"),
    ("sequence", "coupling", with_nan, "amplitudes"),
]


@pytest.mark.parametrize(
    ("name", "path", "change", "words"),
    REFUSED,
    ids=[f"{name}.{path}-{k}" for k, (name, path, *_) in enumerate(REFUSED)],
)
def test_unusable_message_is_refused(name: str, path: str, change: Callable[[Any], Any], words: str) -> None:
    sent, to_message, from_message = PAIRS[name]
    message = to_message(sent)
    present: Any = message
    for part in path.split("."):
        present = getattr(present, part)
    with pytest.raises(ValueError, match=words):
        from_message(over_the_wire(changed(message, path, change(present))))


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("pose.pose.orientation.w", 3.0, "norm"),
        ("pose.pose.position.x", float("nan"), "position"),
        ("header.stamp.sec", 1, "one stamp"),
        ("pose.covariance", [float("nan")] * 36, "pose covariance"),
    ],
)
def test_unusable_pose_is_refused(path: str, value: Any, words: str) -> None:
    where, moving = convert.pose_to_messages(T_S, POSE)
    with pytest.raises(ValueError, match=words):
        convert.pose_from_messages(changed(where, path, value), moving)


def test_a_frame_holds_at_least_one_sample() -> None:
    message = convert.frame_to_message(FRAME, RATE_HZ)
    message.samples_i, message.samples_q = [0.5], [-0.25]
    assert convert.frame_from_message(message, RATE_HZ).samples.tolist() == [0.5 - 0.25j]
    message.samples_i, message.samples_q = [], []
    with pytest.raises(ValueError, match="number of samples=0 must be >= 1"):
        convert.frame_from_message(message, RATE_HZ)


def test_every_signal_is_stamped_and_said_in_its_frame() -> None:
    sent = {
        "array": (convert.frame_to_message(FRAME, RATE_HZ), convert.line_to_message(LINE)),
        "body": (
            convert.snapshots_to_message(HEARD), convert.torque_to_message(TORQUE),
            convert.rate_to_message(RATE), convert.vector_to_message(T_S, np.arange(3.0), "body"),
        ),
        "active_body": (convert.sequence_to_message(SEQUENCE), *convert.pose_to_messages(T_S, POSE)),
        "orbit": (
            convert.attitude_to_message(ATTITUDE, "body"),
            convert.orientation_to_message(T_S, QUATERNION, "orbit"),
        ),
    }  # fmt: skip
    for frame, messages in sent.items():
        for message in messages:
            assert message.header.frame_id == frame
            assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_767_225_600, 123_456_000)
    assert convert.attitude_to_message(ATTITUDE, convert.ARRAY_FRAME).child_frame_id == "array"
