"""The simulated antenna as its control unit shows it: how it stands, how it follows, and what is its own of it."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import MDEG
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
from test.station.stepped_antenna import ENCODER_RAD, SETTLING_S, STANDING, START_S, TICK_S, enabled, hold_at, ramp


def test_a_steady_command_is_followed_within_a_millidegree() -> None:
    clock = enabled()
    for step in range(round(SETTLING_S * 10)):
        assert clock.antenna.accept(ramp(clock.t_s), clock.t_s) == ""
        clock.run(0.1)
        assert clock.antenna.mode == "tracking", step
    wanted = STANDING + np.radians([0.3, -0.3]) * (clock.t_s + TICK_S - START_S)
    np.testing.assert_allclose(clock.antenna.reading(clock.t_s).position_rad, wanted, atol=1.0 * MDEG)
    assert clock.antenna.status(clock.t_s).commands_accepted == round(SETTLING_S * 10)


def test_a_far_command_becomes_a_slew_within_the_limits() -> None:
    limits = CommandPreprocessorParams()
    clock = enabled()
    clock.antenna.accept(hold_at(START_S + 0.1, STANDING + np.radians([20.0, -10.0])), START_S)
    clock.run(1.0)
    for _ in range(round(12.0 + SETTLING_S)):
        clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
        clock.run(1.0)
    rates = clock.rates()
    assert np.max(np.abs(rates)) <= limits.rate_limit_rad_s[0] * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(rates, axis=0))) / TICK_S <= limits.acceleration_limit_rad_s2[0] * (1.0 + 1e-6)
    np.testing.assert_allclose(clock.position[-1], STANDING + np.radians([20.0, -10.0]), atol=1.0 * MDEG)


def test_new_limits_hold_from_the_next_tick_on() -> None:
    clock = enabled()
    for _ in range(30):
        clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
        clock.run(0.1)
    slow = math.radians(0.5)
    clock.antenna.retune(
        dss13_plant(), LoopParams(preprocessor=CommandPreprocessorParams(rate_limit_rad_s=(slow, slow)))
    )
    clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
    clock.run(1.0)
    clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
    clock.run(1.0)
    assert np.max(np.abs(clock.rates()[-10:])) <= slow * (1.0 + 1e-9)
    assert tuple(clock.antenna.status(clock.t_s).rate_limit_rad_s) == (slow, slow)


def test_one_seed_gives_one_run_and_another_seed_another() -> None:
    runs = []
    for seed in (1, 1, 2):
        params = SimulationParams(start_azimuth_rad=STANDING[0], start_elevation_rad=STANDING[1], seed=seed)
        clock = enabled(antenna=params, wind=WindParams(mean_speed_m_s=8.0))
        clock.run(2.0)
        runs.append(np.array(clock.position))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_the_boresight_is_the_encoder_direction_without_the_mounts_errors() -> None:
    mount = MountParams(azimuth_offset_rad=3e-3, non_orthogonality_rad=1e-3, elevation_offset_rad=-2e-3)
    clock, model = enabled(mount=mount), mount.model()
    reading, boresight = clock.antenna.step(START_S + TICK_S)
    zero = (0.0, 0.0, 0.0, 0.0)
    azimuth, elevation = model.remove(*reading.position_rad, *zero)
    assert boresight.azimuth_rad == pytest.approx(float(azimuth), abs=ENCODER_RAD)
    assert boresight.elevation_rad == pytest.approx(float(elevation), abs=ENCODER_RAD)
    assert abs(boresight.azimuth_rad - reading.position_rad[0]) > 1e-3


def test_the_longest_slew_is_no_oscillation() -> None:
    """Half a turn at full speed, against the wind: the servo error swings by degrees at both ends of it."""
    clock = enabled(wind=WindParams(mean_speed_m_s=12.0))
    goal = STANDING - np.radians([184.0, 47.0])
    for _ in range(110):
        assert clock.antenna.accept(hold_at(clock.t_s + 1.0, goal), clock.t_s) == ""
        clock.run(1.0)
    assert not any(watch.oscillating for watch in clock.antenna.axes.loops.watch)
    assert clock.antenna.mode == "tracking"
    np.testing.assert_allclose(clock.position[-1], goal, atol=5.0 * MDEG)
