"""The simulated antenna as its control unit shows it: what it accepts, how it moves, how it stops."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams, PositionLoopParams
from rf_pointing.geometry import MDEG, JointTrajectory
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna import AntennaParams, LoopParams, SimulatedAntenna
from rf_pointing.station.mount import MountParams

TICK_S = AntennaParams().tick_s
START_S = 1_151_384_000.0
STANDING = np.radians([120.0, 60.0])
CALM = WindParams(mean_speed_m_s=0.0)
ENCODER_RAD = 0.2 * MDEG
"""An antenna that holds in calm air stays within its encoder's quantisation and noise."""
SETTLING_S = 30.0
"""The position loop of the paper's gains (0.5, 1.8) rings at 1.34 rad/s and decays with 0.25 1/s."""


def antenna(wind: WindParams = CALM, **changes: Any) -> SimulatedAntenna:
    params = AntennaParams(start_azimuth_rad=STANDING[0], start_elevation_rad=STANDING[1])
    values = {"params": params, "plant": dss13_plant(), "loops": LoopParams(), "mount": MountParams().model()}
    return SimulatedAntenna(**{**values, "wind": wind, **changes})


class Clock:
    """Steps an antenna from `START_S` on and keeps what it said."""

    def __init__(self, stepped: SimulatedAntenna) -> None:
        self.antenna, self.ticks = stepped, 0
        self.position: list[np.ndarray] = []
        self.commanded: list[np.ndarray] = []
        self.modes: list[str] = []

    @property
    def t_s(self) -> float:
        return round(START_S + self.ticks * TICK_S, 6)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.ticks += 1
            self.antenna.step(self.t_s)
            self.position.append(self.antenna.reading(self.t_s).position_rad)
            self.commanded.append(self.antenna.status(self.t_s).commanded_rad)
            self.modes.append(self.antenna.mode)

    def rates(self) -> np.ndarray:
        return np.diff(np.array(self.commanded), axis=0) / TICK_S


def ramp(
    begin_s: float, seconds: float = 1.0, rate_rad_s: float = math.radians(0.3), lead_s: float = 0.1
) -> JointTrajectory:
    """A command that starts at the standing position at `START_S` and moves both axes at a steady rate."""
    times = begin_s + lead_s + np.arange(0.0, seconds - lead_s + 1e-9, 0.1)
    rates = np.tile([rate_rad_s, -rate_rad_s], (len(times), 1))
    return JointTrajectory(
        t_s=times,
        position_rad=STANDING + rates * (times - START_S)[:, None],
        velocity_rad_s=rates,
        acceleration_rad_s2=np.zeros_like(rates),
    )


def hold_at(t_s: float, position: np.ndarray) -> JointTrajectory:
    zero = np.zeros((1, 2))
    return JointTrajectory(t_s=[t_s], position_rad=position[None, :], velocity_rad_s=zero, acceleration_rad_s2=zero)


def enabled(**changes: Any) -> Clock:
    clock = Clock(antenna(**changes))
    clock.antenna.modes.enable()
    return clock


# Standing


def test_activation_does_not_move_the_antenna() -> None:
    clock = Clock(antenna())
    before = clock.antenna.reading(START_S).position_rad
    clock.antenna.modes.enable()
    clock.run(5.0)
    assert np.max(np.abs(np.array(clock.position) - before)) < ENCODER_RAD
    assert set(clock.modes) == {"holding"}


def test_wind_shakes_the_held_antenna_by_millidegrees_only() -> None:
    clock = enabled(wind=WindParams(mean_speed_m_s=8.0))
    clock.run(20.0)
    moved = np.array(clock.position) - STANDING
    assert 0.01 * MDEG < np.max(np.abs(moved)) < 5.0 * MDEG


def test_brakes_hold_an_inactive_antenna_and_commands_are_rejected() -> None:
    clock = Clock(antenna(wind=WindParams(mean_speed_m_s=8.0)))
    assert clock.antenna.commands.accept(ramp(START_S), START_S) == "the antenna is not active"
    clock.run(3.0)
    status = clock.antenna.status(clock.t_s)
    assert (status.mode, status.commands_accepted, status.commands_rejected) == ("inactive", 0, 1)
    assert np.max(np.abs(np.array(clock.position) - STANDING)) < ENCODER_RAD


def test_deactivation_stops_the_axes_under_control_before_it_sets_the_brakes() -> None:
    clock = enabled()
    clock.antenna.commands.accept(ramp(START_S, 3.0), START_S)
    clock.run(2.0)
    clock.antenna.disable()
    clock.run(0.2)
    braked = clock.antenna.reading(clock.t_s)
    assert np.max(np.abs(braked.velocity_rad_s)) < 1e-12
    clock.run(5.0)
    # The drives stand; the structure above them swings out.
    assert np.max(np.abs(np.array(clock.position[-250:]) - braked.position_rad)) < 20.0 * MDEG
    assert clock.antenna.mode == "inactive"
    assert clock.antenna.status(clock.t_s).command_lead_s == 0.0


# Following


def test_a_steady_command_is_followed_within_a_millidegree() -> None:
    clock = enabled()
    for step in range(round(SETTLING_S * 10)):
        assert clock.antenna.commands.accept(ramp(clock.t_s), clock.t_s) == ""
        clock.run(0.1)
        assert clock.antenna.mode == "tracking", step
    wanted = STANDING + np.radians([0.3, -0.3]) * (clock.t_s + TICK_S - START_S)
    np.testing.assert_allclose(clock.antenna.reading(clock.t_s).position_rad, wanted, atol=1.0 * MDEG)
    assert clock.antenna.status(clock.t_s).commands_accepted == round(SETTLING_S * 10)


def test_a_far_command_becomes_a_slew_within_the_limits() -> None:
    limits = CommandPreprocessorParams()
    clock = enabled()
    clock.antenna.commands.accept(hold_at(START_S + 0.1, STANDING + np.radians([20.0, -10.0])), START_S)
    clock.run(1.0)
    for _ in range(round(12.0 + SETTLING_S)):
        clock.antenna.commands.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
        clock.run(1.0)
    rates = clock.rates()
    assert np.max(np.abs(rates)) <= limits.rate_limit_rad_s[0] * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(rates, axis=0))) / TICK_S <= limits.acceleration_limit_rad_s2[0] * (1.0 + 1e-6)
    np.testing.assert_allclose(clock.position[-1], STANDING + np.radians([20.0, -10.0]), atol=1.0 * MDEG)


def test_a_command_beyond_the_travel_is_refused_with_the_limit_and_moves_nothing() -> None:
    loops = LoopParams(preprocessor=CommandPreprocessorParams(travel_max_rad=(3.9, STANDING[1] + 0.05)))
    clock = enabled(loops=loops)
    refused = clock.antenna.commands.accept(hold_at(clock.t_s + 0.1, STANDING + np.array([0.0, 0.5])), clock.t_s)
    assert refused == "elevation 88.648 deg is 25.783 deg past the limit 62.865 deg"
    assert clock.antenna.status(clock.t_s).last_rejection == refused
    clock.run(2.0)
    assert np.max(np.abs(np.array(clock.commanded) - STANDING)) < ENCODER_RAD


def test_the_status_shows_how_long_the_commands_last() -> None:
    clock = enabled()
    assert clock.antenna.status(START_S).command_lead_s == 0.0
    clock.antenna.commands.accept(ramp(START_S, 1.0), START_S)
    assert clock.antenna.status(START_S).command_lead_s == pytest.approx(1.0)


# Stopping


def test_commands_that_stop_in_motion_end_in_a_controlled_stop_and_a_latched_fault() -> None:
    limits = CommandPreprocessorParams()
    clock = enabled()
    clock.antenna.commands.accept(ramp(START_S, 1.0), START_S)
    clock.run(8.0)
    order = list(dict.fromkeys(clock.modes))
    assert order == ["tracking", "stopping", "fault"]
    last_tracking_s = TICK_S * (len(clock.modes) - clock.modes[::-1].index("tracking"))
    assert last_tracking_s == pytest.approx(1.0 + LoopParams().table.extrapolation_s, abs=2 * TICK_S)
    assert clock.antenna.status(clock.t_s).fault.startswith("commands ran dry")
    rates = clock.rates()
    assert np.max(np.abs(np.diff(rates, axis=0))) / TICK_S <= limits.acceleration_limit_rad_s2[0] * (1.0 + 1e-6)
    clock.run(SETTLING_S)
    np.testing.assert_allclose(clock.position[-1], clock.commanded[-1], atol=1.0 * MDEG)
    np.testing.assert_array_equal(clock.commanded[-1], clock.commanded[round(7.0 / TICK_S)])


def test_commands_that_end_at_rest_are_no_fault() -> None:
    clock = enabled()
    goal = STANDING + np.radians([0.2, 0.1])
    clock.antenna.commands.accept(hold_at(START_S + 0.1, goal), START_S)
    clock.run(SETTLING_S)
    assert clock.modes[-1] == "holding"
    assert clock.antenna.status(clock.t_s).fault == ""
    np.testing.assert_allclose(clock.position[-1], goal, atol=1.0 * MDEG)


def test_a_latched_fault_refuses_commands_until_it_is_reset_at_rest() -> None:
    clock = enabled()
    clock.antenna.commands.accept(ramp(START_S, 2.0), START_S)
    clock.run(1.0)
    clock.antenna.modes.stop("stop was requested")
    assert clock.antenna.modes.reset_fault() == "the axes are still moving"
    assert (
        clock.antenna.commands.accept(ramp(clock.t_s), clock.t_s)
        == "fault latched (stop was requested); reset it first"
    )
    clock.run(5.0)
    assert clock.antenna.mode == "fault"
    assert clock.antenna.modes.reset_fault() == ""
    assert clock.antenna.mode == "holding"
    assert clock.antenna.commands.accept(ramp(clock.t_s), clock.t_s) == ""


def test_without_a_fault_there_is_nothing_to_reset() -> None:
    assert enabled().antenna.modes.reset_fault() == "no fault is latched"


def test_a_stop_without_a_reason_leaves_no_fault() -> None:
    clock = enabled()
    clock.antenna.commands.accept(ramp(START_S, 2.0), START_S)
    clock.run(1.0)
    clock.antenna.modes.stop()
    clock.run(5.0)
    assert list(dict.fromkeys(clock.modes)) == ["tracking", "stopping", "holding"]


def test_a_fault_outlasts_deactivation() -> None:
    clock = enabled()
    clock.antenna.modes.stop("stop was requested")
    clock.run(1.0)
    clock.antenna.disable()
    clock.antenna.modes.enable()
    assert clock.antenna.mode == "fault"
    assert "fault latched" in clock.antenna.commands.accept(ramp(clock.t_s), clock.t_s)


# Rejections


def test_rejected_commands_change_nothing_but_the_count() -> None:
    """Two antennas of one seed, one of them pestered: bit for bit the same motion."""
    calm, pestered = enabled(wind=WindParams(mean_speed_m_s=8.0)), enabled(wind=WindParams(mean_speed_m_s=8.0))
    for step in range(30):
        for clock in (calm, pestered):
            good = ramp(clock.t_s)
            assert clock.antenna.commands.accept(good, clock.t_s) == ""
            if clock is pestered:
                far = dataclasses.replace(good, position_rad=good.position_rad + 1.0)
                for shift_s in (-5.0, 100.0, -0.05):
                    assert (
                        clock.antenna.commands.accept(dataclasses.replace(far, t_s=far.t_s + shift_s), clock.t_s) != ""
                    )
                assert clock.antenna.commands.accept(good, clock.t_s) == "duplicate of the latest message"
                clock.antenna.commands.reject("position_rad must be finite")
            clock.run(0.1)
        np.testing.assert_array_equal(pestered.position[-1], calm.position[-1], err_msg=f"step {step}")
    assert calm.antenna.status(calm.t_s).commands_rejected == 0
    status = pestered.antenna.status(pestered.t_s)
    assert (status.commands_accepted, status.commands_rejected) == (30, 150)
    assert status.last_rejection == "position_rad must be finite"


@pytest.mark.parametrize(
    ("shift_s", "words"),
    [
        (-1.2, "stale: its last point is"),
        (70.0, "future: it begins"),
        (-0.05, "out of order: it begins 0.050 s before"),
    ],
)
def test_commands_out_of_time_are_rejected_with_the_reason(shift_s: float, words: str) -> None:
    clock = enabled()
    good = ramp(START_S)
    clock.antenna.commands.accept(good, START_S)
    reason = clock.antenna.commands.accept(dataclasses.replace(good, t_s=good.t_s + shift_s), START_S)
    assert words in reason
    assert clock.antenna.status(START_S).last_rejection == reason


# Parameters and randomness


def test_an_impossible_set_of_loops_is_refused_as_a_whole() -> None:
    with pytest.raises(ValueError, match="rate_limit_rad_s"):
        LoopParams().preprocessor.replace(rate_limit_rad_s=(0.0, 0.01))


def test_new_limits_hold_from_the_next_tick_on() -> None:
    clock = enabled()
    for _ in range(30):
        clock.antenna.commands.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
        clock.run(0.1)
    slow = math.radians(0.5)
    clock.antenna.axes.retune(
        dss13_plant(), LoopParams(preprocessor=CommandPreprocessorParams(rate_limit_rad_s=(slow, slow)))
    )
    clock.antenna.commands.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
    clock.run(1.0)
    clock.antenna.commands.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([20.0, -10.0])), clock.t_s)
    clock.run(1.0)
    assert np.max(np.abs(clock.rates()[-10:])) <= slow * (1.0 + 1e-9)
    assert tuple(clock.antenna.status(clock.t_s).rate_limit_rad_s) == (slow, slow)


def test_one_seed_gives_one_run_and_another_seed_another() -> None:
    runs = []
    for seed in (1, 1, 2):
        params = AntennaParams(start_azimuth_rad=STANDING[0], start_elevation_rad=STANDING[1], seed=seed)
        clock = enabled(params=params, wind=WindParams(mean_speed_m_s=8.0))
        clock.run(2.0)
        runs.append(np.array(clock.position))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_each_axis_has_its_own_loop() -> None:
    """A late-binding closure would give both axes the last one's gains."""
    dead = PositionLoopParams(proportional_gain=0.0, integral_gain=0.0, feedforward_gain=0.0)
    clock = enabled(loops=LoopParams(azimuth=dead))
    clock.antenna.commands.accept(hold_at(START_S + 0.1, STANDING + np.radians([0.2, 0.2])), START_S)
    clock.run(3.0)
    azimuth, elevation = clock.position[-1] - STANDING
    assert abs(azimuth) < ENCODER_RAD
    assert abs(elevation - math.radians(0.2)) < 50.0 * MDEG


def test_the_boresight_is_the_encoder_direction_without_the_mounts_errors() -> None:
    model = MountParams(azimuth_offset_rad=3e-3, non_orthogonality_rad=1e-3, elevation_offset_rad=-2e-3).model()
    clock = enabled(mount=model)
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
        assert clock.antenna.commands.accept(hold_at(clock.t_s + 1.0, goal), clock.t_s) == ""
        clock.run(1.0)
    assert not any(watch.oscillating for watch in clock.antenna.axes.loops.watch)
    assert clock.antenna.mode == "tracking"
    np.testing.assert_allclose(clock.position[-1], goal, atol=5.0 * MDEG)
