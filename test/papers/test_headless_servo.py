"""The headless servo: same as the parts it is made of, alone or many at a time."""

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoop
from rf_pointing.core import random_stream
from rf_pointing.papers.headless_servo import ServoRun, ServoRunSetup, error_statistics, run_servo, servo_monte_carlo
from rf_pointing.servo import AntennaPlant, PlantParams, WindParams, dss13_plant

TICK_S = 0.02


def run_setup(ticks: int = 200, plant: PlantParams | None = None, **changes: object) -> ServoRunSetup:
    time = TICK_S * np.arange(ticks)[:, None]
    rate, start = np.array([4e-3, -2e-3]), np.array([0.3, 0.9])
    return ServoRunSetup(
        position_rad=start + rate * time + 5e-4 * time**2, velocity_rad_s=rate + 1e-3 * time,
        acceleration_rad_s2=np.full((ticks, 2), 1e-3),
        plant=plant or dss13_plant().replace(substep_s=0.001), **changes,
    )  # fmt: skip


def test_a_run_is_plant_and_loops_stepped_in_turn() -> None:
    case = run_setup(ticks=50)
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


def test_monte_carlo_gives_each_seed_its_own_run_whatever_the_number_of_workers() -> None:
    case = run_setup(ticks=60, plant=dss13_plant(), wind=WindParams(mean_speed_m_s=8.0))
    alone = servo_monte_carlo(case, [3, 4, 5], workers=1)
    together = servo_monte_carlo(case, [3, 4, 5], workers=2)
    np.testing.assert_array_equal(alone, together)
    assert len(np.unique(alone[:, 1])) == 3


def test_tables_of_unequal_length_are_refused() -> None:
    case = run_setup(ticks=10)
    with pytest.raises(ValueError, match=r"velocity_rad_s has shape \(9, 2\), must be \(10, 2\)"):
        ServoRunSetup(
            position_rad=case.position_rad,
            velocity_rad_s=case.velocity_rad_s[:9],
            acceleration_rad_s2=case.acceleration_rad_s2,
        )


def test_statistics_are_of_the_second_half_on_the_sky_each_command_against_the_beam_at_its_time() -> None:
    case = run_setup(ticks=8)
    miss = np.zeros((8, 2))
    # The beam at the end of tick k belongs to command k + 1.
    miss[1:] = 1e-3 * np.arange(1.0, 8.0)[:, None] * np.array([1.0, -2.0])
    beam = np.vstack([case.position_rad[1:] - miss[1:], [9.0, 9.0]])
    found = error_statistics(case, ServoRun(np.zeros((8, 2)), np.zeros((8, 2)), beam))
    late = 1e-3 * np.array([5.0, 6.0, 7.0])
    assert found[0] == pytest.approx(np.sqrt(np.mean((late * np.cos(case.position_rad[5:, 1])) ** 2)))
    assert found[1] == pytest.approx(2.0 * np.sqrt(np.mean(late**2)))


def test_too_many_workers_are_refused() -> None:
    with pytest.raises(ValueError, match="workers=257 must be <= 256"):
        servo_monte_carlo(run_setup(ticks=3), [1], workers=257)
