"""Messages and signals as pairs: there and back gives the same, and wire data that cannot be used is refused in words."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState, Temperature

from rf_pointing.core import CarrierPower, JointReading, JointTrajectory, MonopulseCluster, SkyUncertainty, Target
from rf_pointing.core.mount_types import MOUNTS
from rf_pointing.ros import convert

T_S = 1_151_384_323.813083


def same(one: Any, other: Any) -> bool:
    """Whether two signals are equal field by field, arrays included."""
    names = [item.name for item in dataclasses.fields(one)]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def numbers(kind: type, random: np.random.Generator, **fixed: Any) -> Any:
    """A signal with random numbers in every float field that is not fixed."""
    floats = {item.name: float(random.uniform(-1.0, 1.0)) for item in dataclasses.fields(kind) if item.type is float}
    return kind(**{**floats, **fixed})


def test_joints_in_another_order_are_sorted_by_name(random: np.random.Generator) -> None:
    reading = JointReading(t_s=T_S, position_rad=random.uniform(-4, 4, 2), velocity_rad_s=random.uniform(-1, 1, 2))
    message = convert.joints_to_message(reading)
    for name in ("name", "position", "velocity"):
        setattr(message, name, list(getattr(message, name))[::-1])
    assert same(convert.joints_from_message(message), reading)


@pytest.mark.parametrize("axes", [each.axes for each in MOUNTS.values()])
def test_joints_of_any_mount_keep_their_names_and_those_of_another_are_refused(
    axes: tuple[str, str], random: np.random.Generator
) -> None:
    reading = JointReading(t_s=T_S, position_rad=random.uniform(-4, 4, 2), velocity_rad_s=random.uniform(-1, 1, 2))
    message = convert.joints_to_message(reading, axes)
    assert list(message.name) == list(axes)
    for known in ((), axes):
        assert same(convert.joints_from_message(message, known), reading)
    still = np.zeros((1, 2))
    motion = JointTrajectory(t_s=[T_S + 1.0], position_rad=still + 0.5, velocity_rad_s=still, acceleration_rad_s2=still)
    command = convert.trajectory_to_message(motion, T_S, axes)
    assert same(convert.trajectory_from_message(command, T_S, axes), motion)
    for other in {each.axes for each in MOUNTS.values()} - {axes}:
        with pytest.raises(ValueError, match=f"unknown joint {axes[0]}, {axes[1]}; the joints are {', '.join(other)}"):
            convert.trajectory_from_message(command, T_S, other)
        with pytest.raises(ValueError, match="unknown joint"):
            convert.joints_from_message(message, other)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"name": ["azimuth", "roll"]}, "unknown joint roll; the joints are azimuth, elevation"),
        ({"name": ["azimuth", "azimuth"]}, "joints are azimuth, azimuth, must be azimuth, elevation, each once"),
        ({"name": ["azimuth"]}, "joints are azimuth, must be azimuth, elevation, each once"),
        ({"name": []}, "joints are none, must be azimuth, elevation"),
        ({"position": [1.0]}, "position has 1 values, must have one for each of 2 joints"),
        ({"velocity": []}, "velocity has 0 values, must have one for each of 2 joints"),
        ({"position": [1.0, math.nan]}, "position_rad=.* must be finite"),
        ({"velocity": [math.inf, 0.0]}, "velocity_rad_s=.* must be finite"),
    ],
)
def test_joint_states_that_cannot_be_used_are_refused(changes: dict[str, Any], complaint: str) -> None:
    message = JointState(name=["azimuth", "elevation"], position=[1.0, 0.5], velocity=[0.0, 0.0])
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=complaint):
        convert.joints_from_message(message)


def trajectory(random: np.random.Generator, stamp_s: float) -> JointTrajectory:
    return JointTrajectory(
        t_s=np.round(stamp_s + 0.1 * np.arange(1, 11), 6),
        position_rad=random.uniform(-4, 4, (10, 2)),
        velocity_rad_s=random.uniform(-1, 1, (10, 2)),
        acceleration_rad_s2=random.uniform(-1, 1, (10, 2)),
    )


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda m: setattr(m, "joint_names", ["azimuth", "tilt"]), "unknown joint tilt"),
        (lambda m: setattr(m, "joint_names", []), "joints are none"),
        (lambda m: m.points[3].positions.append(1.0), r"points\[3\]\.positions has 3 values, must have 2"),
        (lambda m: m.points[0].velocities.pop(), r"points\[0\]\.velocities has 1 values, must have 2"),
        (lambda m: setattr(m.points[9], "accelerations", []), r"points\[9\]\.accelerations has 0 values, must have 2"),
        (lambda m: m.points[5].positions.__setitem__(0, math.nan), r"position_rad=(.|\n)* must be finite"),
        (lambda m: m.points[5].velocities.__setitem__(1, math.inf), r"velocity_rad_s=(.|\n)* must be finite"),
        (lambda m: m.points.clear(), "t_s has 0 points, must have at least 1"),
        (lambda m: m.points.reverse(), "t_s must increase from point to point"),
    ],
)
def test_trajectories_that_cannot_be_used_are_refused(
    spoil: Callable[[Any], Any], complaint: str, random: np.random.Generator
) -> None:
    message = convert.trajectory_to_message(trajectory(random, T_S), T_S)
    spoil(message)
    with pytest.raises(ValueError, match=complaint):
        convert.trajectory_from_message(message, T_S)


def test_points_of_positions_alone_are_legal_and_end_at_rest(random: np.random.Generator) -> None:
    """A straight line keeps its rate; the accelerations that no point has are 0."""
    message = convert.trajectory_to_message(trajectory(random, T_S), T_S)
    for index, point in enumerate(message.points):
        point.positions, point.velocities, point.accelerations = [0.1 * index, 1.0 - 0.02 * index], [], []
    back = convert.trajectory_from_message(message, T_S + 5.0)
    assert back.t_s[0] == pytest.approx(T_S + 5.1)
    np.testing.assert_allclose(back.velocity_rad_s[:-1], [[1.0, -0.2]] * 9)
    np.testing.assert_array_equal(back.velocity_rad_s[-1], [0.0, 0.0])
    np.testing.assert_array_equal(back.acceleration_rad_s2, np.zeros((10, 2)))


def cluster(random: np.random.Generator, count: int = 5) -> MonopulseCluster:
    channels = random.standard_normal((3, count)) + 1j * random.standard_normal((3, count))
    return MonopulseCluster(
        t_s=np.round(T_S + 0.02 * np.arange(count), 6), sum=channels[0],
        difference_cross_elevation=channels[1], difference_elevation=channels[2],
        carrier_to_noise_db_hz=58.2,
    )  # fmt: skip


def test_a_target_carries_light_time_doppler_and_the_error_of_its_elements(random: np.random.Generator) -> None:
    target = numbers(Target, random, t_s=T_S, name="bird", range_m=9e5)
    shift = random.normal(size=(2, 3)) * 1e-4
    sky = SkyUncertainty(
        age_s=7200.0, along_track_rad=2e-4, cross_track_rad=1e-4, along_track_s=0.1, covariance_rad2=shift @ shift.T
    )
    known = dataclasses.replace(target, uncertainty=sky)
    message = convert.target_to_message(known)
    assert message.light_time == pytest.approx(target.range_m / 299792458.0, rel=1e-12)
    assert message.doppler_factor == pytest.approx(1.0 - target.range_rate_m_s / 299792458.0, abs=1e-15)
    assert list(message.covariance) == sky.covariance_rad2.ravel().tolist()
    assert (message.element_age, message.along_track_time_sigma) == (7200.0, 0.1)
    assert (message.along_track_sigma, message.cross_track_sigma) == (2e-4, 1e-4)
    back = convert.target_from_message(message).uncertainty
    assert back is not None
    assert (back.age_s, back.along_track_s) == (7200.0, 0.1)
    np.testing.assert_array_equal(back.covariance_rad2, sky.covariance_rad2)
    bare = convert.target_to_message(target)
    assert list(bare.covariance) == []
    assert convert.target_from_message(bare).uncertainty is None


@pytest.mark.parametrize(
    ("values", "refusal"),
    [
        ({"covariance": [1e-6, 0.0, 0.0]}, "covariance has 3 values, must have 4 or none"),
        ({"covariance": [1e300, 0.0, 0.0, 1e-6]}, "covariance_rad2\\[0\\]=1e\\+300 must be <= 9.8"),
        ({"covariance": [math.nan, 0.0, 0.0, 1e-6]}, "(?s)covariance_rad2=.* must be finite"),
        ({"covariance": [1e-6, 0.0, 0.0, -1e-6]}, "covariance_rad2\\[3\\]=-1e-06 must be >= 0"),
        ({"covariance": [1e-6, 2e-6, 2e-6, 1e-6]}, "must be symmetric, with both its variances >= 0"),
        ({"covariance": [1e-6, 5e-7, -5e-7, 1e-6]}, "must be symmetric"),
        ({"along_track_time_sigma": 1e300}, "along_track_s=1e\\+300 must be <= 3600"),
        ({"along_track_time_sigma": -1.0}, "along_track_s=-1.0 must be >= 0"),
        ({"cross_track_sigma": 4.0}, "cross_track_rad=4.0 must be <= 3.14"),
    ],
)
def test_an_impossible_uncertainty_is_refused_at_the_door(
    values: dict[str, object], refusal: str, random: np.random.Generator
) -> None:
    message = convert.target_to_message(numbers(Target, random, t_s=T_S, name="bird", range_m=9e5))
    message.covariance = [1e-6, 0.0, 0.0, 1e-6]
    for name, value in values.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=refusal):
        convert.target_from_message(message)


@pytest.mark.parametrize("period_s", [1e17, -0.1, math.nan])
def test_samples_over_an_impossible_time_are_refused(period_s: float, random: np.random.Generator) -> None:
    message = convert.monopulse_to_message(cluster(random))
    message.sample_period = period_s
    with pytest.raises(ValueError, match="sample_period="):
        convert.monopulse_from_message(message)
    power = numbers(CarrierPower, random, t_s=T_S, integration_s=0.1)
    message = convert.power_to_message(power)
    message.integration_time = period_s
    with pytest.raises(ValueError, match="integration_time="):
        convert.power_from_message(message)


@pytest.mark.parametrize(
    ("celsius", "kelvin"), [(-93.0, 180.15), (20.0, 293.15), (56.8, 329.95), (-93.2, None), (56.9, None)]
)
def test_a_temperature_is_one_of_air_on_the_earth(celsius: float, kelvin: float | None) -> None:
    message = Temperature(temperature=celsius)
    if kelvin is None:
        with pytest.raises(ValueError, match="temperature_k="):
            convert.temperature_from_message(message)
    else:
        assert convert.temperature_from_message(message) == pytest.approx(kelvin, abs=1e-9)


@pytest.mark.parametrize(("size", "taken"), [(0.995, True), (1.0, True), (1.005, True), (0.985, False), (1.015, False)])
def test_a_quaternion_of_nearly_unit_length_is_made_one(size: float, taken: bool) -> None:
    message = ours.Attitude()
    message.header.frame_id = "bird/orbit"
    parts = {"x": 0.1, "y": -0.5, "z": 0.7, "w": 0.5}
    for name, value in parts.items():
        setattr(message.orientation, name, size * value)
    if taken:
        assert convert.satellite_quaternion_from_message(message) == pytest.approx((0.1, -0.5, 0.7, 0.5), abs=1e-12)
    else:
        with pytest.raises(ValueError, match="length of the quaternion"):
            convert.satellite_quaternion_from_message(message)


@pytest.mark.parametrize("name", ["sum_q", "difference_cross_elevation_i", "difference_elevation_q"])
def test_each_channel_has_as_many_samples(random: np.random.Generator, name: str) -> None:
    message = convert.monopulse_to_message(cluster(random))
    setattr(message, name, getattr(message, name)[:-1])
    with pytest.raises(ValueError, match=r"has [45] I and [45] Q samples, must have 5"):
        convert.monopulse_from_message(message)
