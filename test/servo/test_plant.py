"""The moving antenna against exact solutions, its limits and its brakes."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from rf_pointing.core import MDEG, random_stream
from rf_pointing.servo import AntennaPlant, PlantParams, dss13_plant
from rf_pointing.servo.linear_model import linear_model

CALM = (0.0, 0.0)


def plant(params: PlantParams | None = None, **options: object) -> AntennaPlant:
    return AntennaPlant(params or dss13_plant(ideal=True), random_stream(1, "encoder"), **options)


def test_linear_motion_is_exact_at_any_mixture_of_step_lengths() -> None:
    params = dss13_plant(ideal=True)
    antenna, model = plant(params), linear_model(params)
    command, wind = np.array([1.2e-3, -0.8e-3]), np.array([900.0, -700.0])
    forcing = model.b_command @ command + model.b_wind @ (wind / (params.azimuth.inertia_kg_m2, 2.0e7))
    steps = [0.02, 0.001, 0.0137, 0.02, 0.0453, 0.005] * 6
    for dt_s in steps:
        antenna.step(command, wind, dt_s)
    start = np.zeros(len(model.a) + 1)
    start[1], start[-1] = math.pi / 4.0, 1.0
    block = np.zeros((len(start), len(start)))
    block[:-1, :-1], block[:-1, -1] = model.a, forcing
    exact = (scipy.linalg.expm(block * sum(steps)) @ start)[:-1]
    np.testing.assert_allclose(antenna.beam_rad, model.beam @ exact, atol=1e-12)
    np.testing.assert_allclose(antenna.true_joint_rad, model.encoder @ exact, atol=1e-12)


def test_time_below_the_grid_is_carried_not_lost() -> None:
    fine, coarse = plant(), plant()
    for _ in range(1000):
        fine.step((1e-3, 1e-3), CALM, 0.02 + 0.00003)
    for _ in range(1000):
        coarse.step((1e-3, 1e-3), CALM, 0.02)
    for _ in range(3):
        coarse.step((1e-3, 1e-3), CALM, 0.01)
    np.testing.assert_allclose(fine.beam_rad, coarse.beam_rad, atol=1e-9)


def test_encoder_reads_in_steps_of_a_twentyfour_bit_turn_with_the_stated_noise() -> None:
    antenna = plant(dss13_plant())
    step = 2.0 * math.pi / 2**24
    readings = []
    for _ in range(2000):
        antenna.step(CALM, CALM, 0.02)
        readings.append(antenna.encoder_rad)
    counts = np.array(readings) / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    expected = math.sqrt(1.0 + 1.0 / 12.0)
    assert np.std(counts, axis=0) == pytest.approx([expected, expected], rel=0.06)


def test_rate_and_acceleration_stay_within_the_drive_limits() -> None:
    antenna = plant()
    rates = [antenna.velocity_rad_s]
    for _ in range(400):
        antenna.step((1.0, 0.2), CALM, 0.01)
        rates.append(antenna.velocity_rad_s)
    limit = math.radians(2.0)
    acceleration = np.diff(rates, axis=0) / 0.01
    assert np.max(np.abs(rates)) <= limit + 1e-12
    assert np.max(acceleration) == pytest.approx(limit, rel=0.06)
    assert np.max(np.abs(acceleration)) <= limit * (1.0 + 1e-9)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [0, 1])
def test_either_stop_of_either_axis_holds_it_where_it_is(axis: int, end: int) -> None:
    params = dss13_plant(ideal=True)
    section = (params.azimuth, params.elevation)[axis]
    stop, side = (section.travel_min_rad, section.travel_max_rad)[end], (-1.0, 1.0)[end]
    place, command = [0.0, 1.0], [0.0, 0.0]
    place[axis], command[axis] = stop - side * math.radians(0.05), side * 0.02
    antenna = plant(params, position_rad=(place[0], place[1]))
    for _ in range(200):
        antenna.step(command, CALM, 0.02)
        assert side * (antenna.state.x[axis] - stop) <= 0.0
    assert antenna.state.x[axis] == pytest.approx(stop)
    assert antenna.at_stop[axis]
    assert not antenna.at_stop[1 - axis]
    antenna.step([-rate for rate in command], CALM, 0.1)
    assert antenna.at_stop == (False, False)
    assert side * antenna.velocity_rad_s[axis] < 0.0


def test_hitting_a_stop_shakes_the_beam() -> None:
    antenna = plant(position_rad=(0.0, math.radians(91.9)))
    while antenna.at_stop == (False, False):
        antenna.step((0.0, 0.02), CALM, 0.005)
    swings = []
    for _ in range(50):
        antenna.step((0.0, 0.02), CALM, 0.01)
        swings.append(antenna.beam_rad[1] - math.radians(92.0))
    assert max(swings) > 5.0 * MDEG


def test_brakes_stop_at_their_torque_and_hold_against_wind() -> None:
    antenna = plant()
    for _ in range(200):
        antenna.step((0.02, 0.0), CALM, 0.02)
    antenna.brake()
    start = antenna.velocity_rad_s[0]
    antenna.step((0.02, 0.0), CALM, 0.1)
    braking = (start - antenna.velocity_rad_s[0]) / 0.1
    assert braking == pytest.approx(math.radians(2.0), rel=1e-6)
    for _ in range(100):
        antenna.step((0.02, 0.02), (2e5, -2e5), 0.02)
    held = antenna.state.x[:2].copy()
    antenna.step((0.02, 0.02), (2e5, -2e5), 0.5)
    np.testing.assert_allclose(antenna.state.x[:2], held, atol=1e-12)
    antenna.release_brake()
    antenna.step((0.02, 0.0), CALM, 0.5)
    assert antenna.velocity_rad_s[0] > 0.01


def test_unpowered_axis_coasts_and_accelerates_with_the_wind_alone() -> None:
    antenna = plant()
    for _ in range(100):
        antenna.step((0.01, 0.0), CALM, 0.02)
    antenna.state = replace(antenna.state, powered=False)
    start = antenna.velocity_rad_s[0]
    antenna.step((0.02, 0.0), CALM, 0.1)
    assert antenna.velocity_rad_s[0] == pytest.approx(start, rel=1e-9)
    antenna.step((0.02, 0.0), (2.5e4, 0.0), 0.1)
    assert antenna.velocity_rad_s[0] == pytest.approx(start + 1e-4, rel=1e-9)


def test_reconfiguring_keeps_the_motion_and_changes_the_drive() -> None:
    params = dss13_plant(ideal=True)
    antenna = plant(params)
    antenna.step((1e-3, 1e-3), CALM, 0.5)
    before = antenna.state.x
    antenna.reconfigure(params.replace(elevation=params.elevation.replace(amplifier_gain=20.0)))
    np.testing.assert_array_equal(antenna.state.x, before)
    assert antenna.params.elevation.amplifier_gain == 20.0
    few = params.elevation.replace(
        mode_frequency_hz=(2.0,), mode_damping=(0.01,), mode_encoder_residue=(0.1,), mode_beam_residue=(0.1,)
    )
    with pytest.raises(ValueError, match="must keep 3 while the antenna runs"):
        antenna.reconfigure(params.replace(elevation=few, elevation_modes_in_azimuth=(0.001,)))


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.0, math.inf)])
def test_non_finite_commands_are_refused_and_change_nothing(command: tuple[float, float]) -> None:
    antenna = plant()
    before = antenna.state.x
    with pytest.raises(ValueError, match="rate_command_rad_s"):
        antenna.step(command, CALM, 0.02)
    np.testing.assert_array_equal(antenna.state.x, before)


def test_start_outside_the_travel_is_refused() -> None:
    with pytest.raises(ValueError, match=r"position_rad \(elevation\)=-0.1 must be >= 0.03"):
        plant(position_rad=(0.0, -0.1))


def test_equal_axes_without_coupling_move_alike() -> None:
    """Through friction, play and a stop: whatever one axis does, the other does with the same command and wind."""
    shipped = dss13_plant()
    axis = shipped.elevation.replace(travel_min_rad=-0.02, travel_max_rad=0.02, encoder_noise_rad=0.0)
    params = shipped.replace(
        azimuth=axis, elevation=axis, azimuth_to_bending=0.0, pinion_floor=1.0, cross_mode_residue=0.0,
        azimuth_modes_in_elevation=(0.0, 0.0, 0.0), elevation_modes_in_azimuth=(0.0, 0.0, 0.0),
    )  # fmt: skip
    antenna = plant(params, position_rad=(0.0, 0.0))
    struck = 0
    for k in range(400):
        rate = 6e-3 * math.sin(0.05 * k) + 0.01 * (k % 100 > 50)
        antenna.step((rate, rate), (3e4, 3e4), 0.02)
        for angles in (antenna.true_joint_rad, antenna.beam_rad, antenna.encoder_rad):
            assert angles[0] == pytest.approx(angles[1], abs=1e-12)
        struck += all(antenna.state.at_stop)
    assert struck > 0


def test_between_two_ticks_of_the_grid_the_outputs_move_on() -> None:
    """At a steady rate every step of 20.03 ms shows 20.03 ms of motion, not now 20.0 and now 20.1."""
    antenna, rate, shown = plant(), 2e-3, []
    for _ in range(1500):
        antenna.step((rate, 0.0), CALM, 0.02003)
        shown.append(antenna.true_joint_rad[0])
    steps = np.diff(shown[-300:]) / 0.02003
    # The modes that still swing leave 3e-4; a step of the grid would be 5e-3.
    np.testing.assert_allclose(steps, rate, rtol=1e-3)


def test_an_antenna_starts_at_rest_where_it_is_put_and_its_encoders_show_that() -> None:
    antenna, step = plant(dss13_plant(), position_rad=(-1.234567, 0.7654321)), 2.0 * math.pi / 2**24
    np.testing.assert_allclose(antenna.encoder_rad, (-1.234567, 0.7654321), atol=0.5 * step)
    np.testing.assert_allclose(antenna.encoder_rad / step, np.round(antenna.encoder_rad / step), atol=1e-6)
    np.testing.assert_allclose(antenna.beam_rad, (-1.234567, 0.7654321), atol=1e-15)
    assert not np.any(antenna.velocity_rad_s)
    assert antenna.powered
    assert antenna.at_stop == (False, False)
    state = antenna.state
    assert (state.time_s, state.debt_s, state.braked, state.held_axis, state.commands) == (0.0, 0.0, False, -1, ())
    antenna.step(CALM, CALM, 0.02003)
    assert (antenna.state.time_s, antenna.state.debt_s) == pytest.approx((0.02, 3e-5))


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_held_by_its_brake_stays_while_the_other_follows(axis: int) -> None:
    antenna = plant()
    antenna.brake()
    assert not antenna.powered
    antenna.release_brake(axis)
    assert antenna.powered
    before = antenna.state.x[:2].copy()
    for _ in range(50):
        antenna.step((5e-3, 5e-3), (1e5, 1e5), 0.02)
    moved = antenna.state.x[:2] - before
    assert moved[axis] == pytest.approx(0.0, abs=1e-12)
    assert moved[1 - axis] > 3e-3
    antenna.release_brake()
    antenna.step((5e-3, 5e-3), CALM, 0.5)
    assert antenna.velocity_rad_s[axis] > 3e-3


def test_dead_times_of_both_axes_count_each_for_itself_and_old_commands_are_forgotten() -> None:
    shipped = dss13_plant(ideal=True)
    delays = (0.05, 0.02)
    params = shipped.replace(
        azimuth=shipped.azimuth.replace(drive_delay_s=delays[0]),
        elevation=shipped.elevation.replace(drive_delay_s=delays[1]),
    )
    late, longest = plant(params), 0
    commands = [1e-3 * math.sin(0.7 * k) for k in range(60)]
    rates = []
    for command in commands:
        late.step((command, 2.0 * command), CALM, 0.01)
        rates.append(late.velocity_rad_s)
        longest = max(longest, len(late.state.commands))
    for axis, delay in enumerate(delays):
        prompt, shift = plant(shipped), round(delay / 0.01)
        expected = [np.zeros(2)] * shift
        for command in commands[: 60 - shift]:
            prompt.step((command, 2.0 * command), CALM, 0.01)
            expected.append(prompt.velocity_rad_s)
        # The drives do not feel each other, nor the modes.
        np.testing.assert_allclose(np.array(rates)[:, axis], np.array(expected)[:, axis], atol=1e-15)
    # Those of the last 50 ms, and the one before them that is in force on the slower axis.
    assert longest == 6


@pytest.mark.parametrize("sigmas", [(2e-3, 5e-3), (0.0, 5e-3)])
def test_an_encoder_reads_the_joint_plus_sigma_times_what_the_generator_gives(sigmas: tuple[float, float]) -> None:
    """A new pair of numbers for every step, azimuth first, also where one axis has no noise."""
    shipped = dss13_plant()
    params = shipped.replace(
        azimuth=shipped.azimuth.replace(encoder_noise_rad=sigmas[0]),
        elevation=shipped.elevation.replace(encoder_noise_rad=sigmas[1]),
    )
    antenna, drawn = plant(params), random_stream(1, "encoder")
    for _ in range(4):
        antenna.step((1e-3, -2e-3), CALM, 0.02)
        off = antenna.encoder_rad - antenna.true_joint_rad
        np.testing.assert_allclose(off, sigmas * drawn.standard_normal(2), rtol=0.0, atol=2.0 * math.pi / 2**24)


@pytest.mark.parametrize(
    ("dt_s", "words"), [(0.9e-6, "dt_s=9e-07 must be >= 1e-06$"), (1.1, "dt_s=1.1 must be <= 1.0$")]
)
def test_a_step_is_of_a_microsecond_to_a_second(dt_s: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        plant().step(CALM, CALM, dt_s)
    for fits_s in (1e-6, 1.0):
        antenna = plant()
        antenna.step(CALM, CALM, fits_s)
        assert antenna.state.time_s + antenna.state.debt_s == pytest.approx(fits_s)


@pytest.mark.parametrize(("substep_s", "parts_s"), [(0.005, (0.005, 0.005, 0.003)), (0.05, (0.013,))])
def test_the_largest_acceleration_is_judged_once_in_a_substep(substep_s: float, parts_s: tuple[float, ...]) -> None:
    """From rest at full torque: in each substep the rate goes towards what it was plus the largest gap."""
    antenna = plant(dss13_plant(ideal=True).replace(substep_s=substep_s))
    antenna.step((0.5, -0.5), CALM, 0.013)
    gap = math.radians(2.0) / 20.0
    rate = gap * sum(1.0 - math.exp(-20.0 * part_s) for part_s in parts_s)
    np.testing.assert_allclose(antenna.velocity_rad_s, (rate, -rate), rtol=1e-9)


def test_a_substep_below_the_grid_is_one_step_of_the_grid() -> None:
    shipped = dss13_plant()
    fine = plant(shipped.replace(substep_s=2e-5))
    single = plant(shipped)
    for k in range(20):
        command = (2e-5 * (-1.0) ** k, 3e-5)
        fine.step(command, (4e3, -4e3), 1e-3)
        for _ in range(10):
            single.step(command, (4e3, -4e3), 1e-4)
    np.testing.assert_allclose(fine.state.x, single.state.x, rtol=1e-9, atol=1e-18)
