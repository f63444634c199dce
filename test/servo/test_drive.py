"""Friction and gear play of one axis, alone and in the plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.servo import AntennaPlant, AxisParams, dss13_plant
from rf_pointing.servo.drive import axis_inputs, drive_constants, gear_correction

CALM = (0.0, 0.0)


def axis(**changes: float) -> AxisParams:
    return dss13_plant().elevation.replace(**changes)


def run(elevation: AxisParams, commands: list[float], wind_n_m: float = 0.0) -> tuple[AntennaPlant, np.ndarray]:
    params = dss13_plant(ideal=True).replace(elevation=elevation)
    antenna = AntennaPlant(params, random_stream(1, "encoder"))
    rates = []
    for command in commands:
        antenna.step((0.0, command), (0.0, wind_n_m), 0.01)
        rates.append(antenna.velocity_rad_s[1])
    return antenna, np.array(rates)


def test_command_below_breakaway_does_not_move_the_axis_and_above_it_does() -> None:
    elevation = axis()
    breakaway_rate = 1.3 * elevation.coulomb_friction_n_m / elevation.inertia_kg_m2 / 20.0
    _, stuck = run(elevation, [0.99 * breakaway_rate] * 200)
    _, moving = run(elevation, [1.05 * breakaway_rate] * 400)
    assert np.max(np.abs(stuck)) < 1e-18
    assert moving[-1] > 0.0


def test_steady_motion_lags_the_command_by_the_friction_over_the_rate_loop() -> None:
    elevation = axis(coulomb_friction_n_m=4000.0)
    _, rates = run(elevation, [2e-3] * 300)
    assert 2e-3 - rates[-1] == pytest.approx(4000.0 / elevation.inertia_kg_m2 / 20.0, rel=1e-6)


def test_friction_falls_from_breakaway_to_coulomb_over_the_stribeck_rate() -> None:
    elevation = axis()
    constants = drive_constants(elevation, 0.001)
    coulomb = elevation.coulomb_friction_n_m / elevation.inertia_kg_m2
    stribeck = elevation.stribeck_rate_rad_s
    for rate, ratio in ((stribeck, 1.0 + 0.3 / math.e), (100.0 * stribeck, 1.0)):
        friction = axis_inputs(rate, 0.03, 0.0, True, False, constants)[1]
        assert friction == pytest.approx(-ratio * coulomb, rel=1e-9)


def test_wind_below_breakaway_does_not_move_an_unpowered_axis() -> None:
    elevation = axis(coulomb_friction_n_m=4000.0, static_friction_ratio=1.0)
    params = dss13_plant(ideal=True).replace(elevation=elevation)
    antenna = AntennaPlant(params, random_stream(1, "encoder"))
    antenna.state = replace(antenna.state, powered=False)
    for _ in range(50):
        antenna.step(CALM, (0.0, 3900.0), 0.02)
    assert abs(antenna.velocity_rad_s[1]) < 1e-18
    for _ in range(50):
        antenna.step(CALM, (0.0, 4200.0), 0.02)
    assert antenna.velocity_rad_s[1] == pytest.approx(200.0 / elevation.inertia_kg_m2, rel=1e-6)


@pytest.mark.parametrize("deflection_rad", [-3e-4, -1.2e-4, -2e-5, 1e-5, 9e-5, 2.2e-4])
def test_gear_torque_is_the_sum_of_two_trains_with_play(deflection_rad: float) -> None:
    elevation = axis(backlash_rad=5e-5, countertorque_n_m=1e5)
    constants = drive_constants(elevation, 0.005)
    stiffness = elevation.gear_frequency_rad_s**2
    preload = 1e5 / elevation.inertia_kg_m2 / stiffness

    def train(wound_rad: float) -> float:
        if wound_rad >= 0.0:
            return wound_rad
        return min(wound_rad + 1e-4, 0.0)

    torque = 0.5 * stiffness * (train(preload + deflection_rad) - train(preload - deflection_rad))
    linear = stiffness * deflection_rad
    assert linear - gear_correction(deflection_rad, 0.0, constants) == pytest.approx(torque, rel=1e-12)


def test_countertorque_keeps_the_gear_linear_until_the_load_exceeds_it() -> None:
    elevation = axis(countertorque_n_m=2e5)
    constants = drive_constants(elevation, 0.005)
    edge = 2e5 / elevation.inertia_kg_m2 / elevation.gear_frequency_rad_s**2
    assert gear_correction(0.999 * edge, 0.0, constants) == 0.0
    assert gear_correction(1.5 * edge, 0.0, constants) > 0.0


@pytest.mark.parametrize("number", [0, 1])
def test_without_countertorque_the_reversed_axis_loses_the_whole_play(number: int) -> None:
    """Slow back-and-forth motion with a load torque that changes sides: the joint lags the drive by the half width.

    The other axis, whose gears stay loaded against each other, keeps to its drive.
    """
    play, name = 1e-4, ("azimuth", "elevation")[number]
    loose = axis(countertorque_n_m=0.0, backlash_rad=play, coulomb_friction_n_m=0.0)
    params = dss13_plant(ideal=True).replace(**{name: loose})
    offsets = []
    for torque_n_m in (4000.0, -4000.0):
        antenna = AntennaPlant(params, random_stream(1, "encoder"), (0.5, 0.5))
        for _ in range(600):
            antenna.step(CALM, [torque_n_m * (axis_number == number) for axis_number in (0, 1)], 0.01)
        offsets.append(antenna.true_joint_rad - antenna.state.x[:2])
    windup = 2.0 * 4000.0 / loose.inertia_kg_m2 / loose.gear_frequency_rad_s**2
    assert offsets[0][number] == pytest.approx(play + windup, rel=0.02)
    assert offsets[1][number] == pytest.approx(-play - windup, rel=0.02)
    assert np.max(np.abs(offsets), axis=0)[1 - number] < 0.01 * play


def test_the_load_crosses_the_play_freely() -> None:
    """Inside the play neither stiffness nor damping acts: the load falls behind the drive with its own inertia."""
    elevation = axis(countertorque_n_m=0.0, backlash_rad=1e-4)
    constants = drive_constants(elevation, 0.005)
    spring = elevation.gear_frequency_rad_s**2 * (4e-5 + 0.5 * 0.005 * 3e-3)
    damper = 2.0 * elevation.gear_damping * elevation.gear_frequency_rad_s * 3e-3
    assert gear_correction(4e-5, 3e-3, constants) == pytest.approx(spring + damper, rel=1e-12)


@pytest.mark.parametrize("rate", [2.65, -3.0, 1e200])
def test_far_above_the_stribeck_rate_the_friction_is_coulombs_exactly(rate: float) -> None:
    constants = drive_constants(axis(stribeck_rate_rad_s=0.1, static_friction_ratio=5.0), 0.005)
    friction = axis_inputs(rate, rate, 0.0, True, False, constants)[1]
    assert friction == pytest.approx(-math.copysign(constants.friction, rate), rel=1e-15)
