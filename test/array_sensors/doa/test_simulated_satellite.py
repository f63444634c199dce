"""Simulated satellite: holds nadir, is driven by the noise it is given, stops and resumes identically."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.multiplicative_filter import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_rotation_vector, rotation_angle_between_rad
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams, SimulatedSatellite

RATE = np.array([0.0, -1.038e-3, 0.0])
NONE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))


def satellite(noise: ProcessNoiseParams, quaternion: np.ndarray, seed: int = 1) -> SimulatedSatellite:
    rate = np.broadcast_to(RATE, (*quaternion.shape[:-1], 3))
    return SimulatedSatellite(
        SatelliteParams(), NadirHoldParams(), noise, t_s=0.0, quaternion=quaternion, rate_rad_s=rate, seed=seed
    )


def test_satellite_comes_back_to_nadir_and_stays() -> None:
    moving = satellite(ProcessNoiseParams(), quaternion_from_rotation_vector([0.1, -0.2, 0.15]))
    for _ in range(800):
        moving.step(1.0, moving.hold_torque(RATE), RATE)
    assert float(rotation_angle_between_rad(moving.state.quaternion, [0, 0, 0, 1])) < np.radians(0.2)


def test_an_offset_decays_as_the_second_order_equation_of_the_hold_says() -> None:
    """Small angles about each axis, orbital frame at rest, both signs of the quaternion."""
    hold, offset_rad, step_s = NadirHoldParams(bandwidth_rad_s=0.02, damping=0.6), 1e-4, 0.2
    silent = ProcessNoiseParams(attitude_rad2_s=0.0, rate_rad2_s3=0.0)
    start = quaternion_from_rotation_vector(offset_rad * np.eye(3))
    moving = SimulatedSatellite(
        SatelliteParams(), hold, silent, t_s=0.0, quaternion=np.stack([start, -start]),
        rate_rad_s=np.zeros((2, 3, 3)), seed=1,
    )  # fmt: skip
    root = np.sqrt(1.0 - hold.damping**2)
    for step in range(1, 601):
        moving.step(step_s, moving.hold_torque(np.zeros(3)), np.zeros(3))
        phase = hold.bandwidth_rad_s * step_s * step
        decayed = np.exp(-hold.damping * phase) * (np.cos(root * phase) + hold.damping / root * np.sin(root * phase))
        turn = 2.0 * moving.state.quaternion[..., :3] * np.sign(moving.state.quaternion[..., 3:])
        np.testing.assert_allclose(turn / offset_rad, np.broadcast_to(decayed * np.eye(3), (2, 3, 3)), atol=2e-3)


def test_noise_has_the_variances_asked_for() -> None:
    noise = ProcessNoiseParams(attitude_rad2_s=4e-8, rate_rad2_s3=1e-10)
    moving = satellite(noise, np.tile([0.0, 0.0, 0.0, 1.0], (40_000, 1)))
    moving.step(0.25, NONE, RATE)
    assert np.std(2 * moving.state.quaternion[:, 0]) == pytest.approx(1e-4, rel=0.02)
    assert np.std(moving.state.rate_rad_s[:, 2]) == pytest.approx(5e-6, rel=0.02)


def test_resuming_from_a_copied_state_gives_the_same_motion() -> None:
    running = satellite(ProcessNoiseParams(), np.array([0.0, 0.0, 0.0, 1.0]))
    running.step(0.25, running.hold_torque(RATE), RATE)
    state = running.state
    resumed = satellite(ProcessNoiseParams(), np.array([0.0, 0.6, 0.0, 0.8]), seed=7)
    resumed.restore(state)
    for each in (running, resumed):
        for _ in range(3):
            each.step(0.25, each.hold_torque(RATE), RATE)
    assert np.array_equal(running.state.quaternion, resumed.state.quaternion)
    assert np.array_equal(running.state.rate_rad_s, resumed.state.rate_rad_s)


def test_start_that_is_no_rotation_is_refused() -> None:
    with pytest.raises(ValueError, match="norm"):
        satellite(ProcessNoiseParams(), np.array([0.0, 0.0, 0.0, 1.2]))


def test_step_without_time_is_refused() -> None:
    with pytest.raises(ValueError, match=r"dt_s=0.0 must be >= 1e-06"):
        satellite(ProcessNoiseParams(), np.array([0.0, 0.0, 0.0, 1.0])).step(0.0, NONE, RATE)
