"""The base that moves: exact rates, prediction, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import Kinematics
from rf_pointing.core.moving_base import (
    BaseParams,
    BaseSample,
    MovingBase,
    deck_attitude,
    matrix_of_quaternion,
    quaternion_of_matrix,
)
from rf_pointing.servo.base_motion import BaseMotion, BaseMotionParams

PERIOD_S, STEP_S, LEVEL_RAD, RATE_RAD_S = 0.01, 1e-3, np.array([0.4, 0.7]), np.array([0.01, -0.02])
SEA = BaseMotionParams(
    roll_rms_rad=0.07, pitch_rms_rad=0.026, yaw_rms_rad=0.017, heading_rad=1.0, turn_rate_rad_s=0.05,
    attitude_noise_rad=0.0, gyro_noise_rad_s=0.0,
)  # fmt: skip
MOUNTS = (
    Kinematics(), Kinematics(type="x_y"), Kinematics(type="x_y", lower_axis="north_south"),
    Kinematics(type="ha_dec", latitude_rad=0.7), Kinematics(type="azimuth_elevation_tilt", tilt_rad=0.1, train_rad=1.0),
)  # fmt: skip
angles = st.floats(-1.4, 1.4)


def followed(motion: BaseMotion, base: MovingBase, seconds: float, begin_s: float = 1000.0) -> float:
    """Give the base what the IMU measures for some seconds, and return the time then."""
    for tick in range(round(seconds / 0.02) + 1):
        t_s = begin_s + 0.02 * tick
        for sample in motion.samples(t_s):
            assert not base.take(sample, t_s)
    return t_s


@given(st.tuples(angles, angles, st.floats(-3.1, 3.1)))
def test_quaternions_and_matrices_undo_each_other(turn: tuple[float, float, float]) -> None:
    """Any attitude survives both ways."""
    matrix = deck_attitude(*turn)
    assert np.allclose(matrix_of_quaternion(quaternion_of_matrix(matrix)), matrix, atol=1e-12)


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda mount: mount.words)
def test_axes_on_a_ship_hold_the_sky_with_exact_rates(mount: Kinematics) -> None:
    """The beam of the axes is on the sky where the level ones are; rates are the differences."""
    motion, base = BaseMotion(SEA, 1), MovingBase(BaseParams(moves=True), mount)
    t_s = followed(motion, base, 4.0)
    still = np.zeros(2)
    before, now, after = (
        base.at(t_s + by_s).to_axes(LEVEL_RAD + by_s * RATE_RAD_S, RATE_RAD_S, still) for by_s in (-STEP_S, 0.0, STEP_S)
    )
    assert np.allclose((after[0] - before[0]) / (2.0 * STEP_S), now[1], atol=5e-6)
    assert np.allclose((after[1] - before[1]) / (2.0 * STEP_S), now[2], atol=5e-6)
    level = base.at(t_s).to_level(now[0], now[1])
    assert np.allclose(level[0], LEVEL_RAD, atol=1e-12)
    assert np.allclose(level[1], RATE_RAD_S, atol=1e-12)
    # Predicted over the 20 ms of the latency, within 2 mdeg.
    truth, found = mount.sky_at(*LEVEL_RAD), motion.sky_at(t_s, *mount.sky_at(*now[0]))
    assert np.allclose(found, truth, atol=math.radians(2e-3))


def sample(t_s: float, roll_rad: float = 0.0, rate: float = 0.0) -> BaseSample:
    """Return a measurement of a base with its bow to the north."""
    attitude = deck_attitude(roll_rad, 0.0, 0.5 * math.pi)
    return BaseSample(t_s=t_s, quaternion=quaternion_of_matrix(attitude), rate_rad_s=np.array([rate, 0.0, 0.0]))


def test_what_is_no_attitude_is_refused() -> None:
    """NaN, a quaternion of another length, a jump, a stale, a repeated and a too fast sample."""
    base = MovingBase(BaseParams(moves=True))
    assert "yet" in base.lost(0.0)
    for quaternion in ((math.nan, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.9), (0.0, 0.0, 0.0, 0.0)):
        with pytest.raises(ValueError, match="quaternion"):
            BaseSample(t_s=0.0, quaternion=quaternion, rate_rad_s=np.zeros(3))
    assert not base.take(sample(10.0), 10.02)
    for given_, now_s, reason in (
        (sample(10.01, math.radians(5.0)), 10.02, "jumps by 5.00 deg, must be <= 2.00 deg"),
        (sample(10.01), 10.6, "is 0.590 s old"),
        (sample(10.0), 10.02, "before the last one"),
        (sample(10.01, rate=2.0), 10.02, "turns at 114.6 deg/s, must be <= 60.0 deg/s"),
    ):
        assert reason in base.take(given_, now_s)
    assert base.refused[0] == 4
    assert not base.lost(12.0)
    assert "for 2.1 s, at most 2 s (the base turns" in base.lost(12.1)
    # After the loss another attitude is believed.
    assert not base.take(sample(13.0, math.radians(5.0)), 13.0)
    assert not base.lost(13.0)


def test_a_silent_imu_is_bridged() -> None:
    """After 0.1 s without a sample the prediction is within 0.1 deg, after 2 s it has not run away."""
    motion, base = BaseMotion(SEA.replace(turn_rate_rad_s=0.0), 2), MovingBase(BaseParams(moves=True))
    t_s = followed(motion, base, 4.0)
    for after_s, most_deg in ((0.1, 0.1), (2.0, 20.0)):
        axes = base.at(t_s + after_s).to_axes(LEVEL_RAD, np.zeros(2), np.zeros(2))[0]
        apart = np.degrees(np.array(motion.sky_at(t_s + after_s, *axes)) - LEVEL_RAD)
        assert np.max(np.abs(apart)) < most_deg
