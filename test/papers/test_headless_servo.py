"""The headless servo: same as the parts it is made of, compiled or not, batched or not."""

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoop, dss13_loops
from rf_pointing.core import random_stream
from rf_pointing.papers.headless_servo import ServoRunSetup, run_servo, servo_monte_carlo
from rf_pointing.servo import AntennaPlant, PlantParams, WindParams, dss13_plant

ROUNDING_RAD = 1e-12
TICK_S = 0.02


def setup(ticks: int = 200, plant: PlantParams | None = None, **changes: object) -> ServoRunSetup:
    time = TICK_S * np.arange(ticks)[:, None]
    rate, start = np.array([4e-3, -2e-3]), np.array([0.3, 0.9])
    return ServoRunSetup(
        position_rad=start + rate * time + 5e-4 * time**2,
        velocity_rad_s=rate + 1e-3 * time,
        acceleration_rad_s2=np.full((ticks, 2), 1e-3),
        plant=plant or dss13_plant().replace(substep_s=0.001),
        **changes,
    )


def rough_plant() -> PlantParams:
    """Dead time, play without countertorque, strong friction and a stop within reach."""
    params = dss13_plant().replace(substep_s=0.001)
    rough = {"countertorque_n_m": 0.0, "coulomb_friction_n_m": 4000.0, "drive_delay_s": 0.0345}
    return params.replace(
        azimuth=params.azimuth.replace(**rough),
        elevation=params.elevation.replace(travel_max_rad=0.9001, **rough),
    )


def test_a_run_is_plant_and_loops_stepped_in_turn() -> None:
    case = setup(ticks=50)
    run = run_servo(case)
    plant = AntennaPlant(case.plant, random_stream(1, "encoder"), case.position_rad[0])
    loops = [PositionLoop(params) for params in case.loops]
    for k in range(50):
        measured = plant.encoder_rad
        rates = [
            loop.output(case.position_rad[k, i], case.velocity_rad_s[k, i], measured[i], 1e-3)
            for i, loop in enumerate(loops)
        ]
        plant.step(rates, (0.0, 0.0), TICK_S)
        for loop, rate in zip(loops, rates, strict=True):
            loop.update(TICK_S, rate)
        np.testing.assert_array_equal(run.beam_rad[k], plant.beam_rad)


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("gains", ["published", "tuned"])
def test_the_compiled_loop_gives_the_same_result(rough: bool, gains: str) -> None:
    pytest.importorskip("numba", reason="extra [fast] not installed")
    case = setup(
        ticks=400,
        plant=rough_plant() if rough else None,
        loops=dss13_loops(gains),
        wind=WindParams(mean_speed_m_s=12.0, from_azimuth_rad=1.0),
    )
    plain, compiled = run_servo(case), run_servo(case, compiled=True)
    np.testing.assert_allclose(compiled.beam_rad, plain.beam_rad, atol=ROUNDING_RAD)
    np.testing.assert_allclose(compiled.rate_command_rad_s, plain.rate_command_rad_s, atol=1e3 * ROUNDING_RAD)


def test_the_compiled_loop_refuses_a_tick_that_is_no_whole_number_of_substeps() -> None:
    pytest.importorskip("numba", reason="extra [fast] not installed")
    with pytest.raises(ValueError, match=r"tick_s=0\.02 must be a whole number of substeps of 0\.003 s"):
        run_servo(setup(plant=dss13_plant().replace(substep_s=0.003)), compiled=True)


def test_monte_carlo_gives_each_seed_its_own_run_whatever_the_number_of_workers() -> None:
    case = setup(ticks=60, plant=dss13_plant(), wind=WindParams(mean_speed_m_s=8.0))
    alone = servo_monte_carlo(case, [3, 4, 5], workers=1)
    together = servo_monte_carlo(case, [3, 4, 5], workers=2)
    np.testing.assert_array_equal(alone, together)
    assert len(np.unique(alone[:, 1])) == 3


def test_compiled_monte_carlo_gives_the_same_as_the_plain_one_whatever_the_number_of_threads() -> None:
    pytest.importorskip("numba", reason="extra [fast] not installed")
    case = setup(ticks=60, wind=WindParams(mean_speed_m_s=8.0))
    plain = servo_monte_carlo(case, [3, 4, 5], workers=1)
    for workers in (1, 3):
        fast = servo_monte_carlo(case, [3, 4, 5], workers=workers, compiled=True)
        np.testing.assert_allclose(fast, plain, atol=ROUNDING_RAD)


def test_tables_of_unequal_length_are_refused() -> None:
    case = setup(ticks=10)
    with pytest.raises(ValueError, match=r"velocity_rad_s has shape \(9, 2\), must be \(10, 2\)"):
        ServoRunSetup(
            position_rad=case.position_rad,
            velocity_rad_s=case.velocity_rad_s[:9],
            acceleration_rad_s2=case.acceleration_rad_s2,
        )
