"""Gains that the antenna could not live with are refused before they run."""

import math

import pytest

from rf_pointing.controllers import PositionLoop, PositionLoopParams, dss13_loops, load_lqg_designs
from rf_pointing.core import random_stream
from rf_pointing.servo import AntennaPlant, PlantParams, dss13_plant
from rf_pointing.station.antenna.loop_stability import closed_loop_pole, require_stable

TICK_S = 0.02
EDGE_LOW, EDGE_HIGH = 0.98, 1.02
"""A gain this far from the computed edge decays or grows visibly within the simulated time."""


@pytest.fixture(scope="module")
def plant() -> PlantParams:
    return dss13_plant(ideal=True)


def gains(proportional: float) -> PositionLoopParams:
    return PositionLoopParams(proportional_gain=proportional, integral_gain=0.5)


def swing(plant: PlantParams, loop: PositionLoopParams) -> tuple[float, float]:
    """Return the largest elevation error of two spans of 50 s, 100 s apart, after a step of 0.1 mrad."""
    antenna = AntennaPlant(plant, random_stream(1, "encoder"))
    loops = [PositionLoop(loop, TICK_S) for _ in range(2)]
    start = antenna.encoder_rad
    errors = []
    for _ in range(round(200.0 / TICK_S)):
        measured = antenna.encoder_rad
        rates = [each.output(start[i] + 1e-4 * i, 0.0, measured[i]) for i, each in enumerate(loops)]
        antenna.step(rates, (0.0, 0.0), TICK_S)
        for each, rate in zip(loops, rates, strict=True):
            each.update(TICK_S, rate)
        errors.append(abs(measured[1] - start[1] - 1e-4))
    span = round(50.0 / TICK_S)
    return max(errors[span : 2 * span]), max(errors[3 * span :])


def test_the_computed_edge_is_where_the_simulated_loop_begins_to_grow(plant: PlantParams) -> None:
    def radius(proportional: float) -> float:
        return abs(closed_loop_pole(plant, (PositionLoopParams(), gains(proportional)), TICK_S))

    low, high = 0.5, 50.0
    assert radius(low) < 1.0 < radius(high)
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    wide = plant.replace(
        elevation=plant.elevation.replace(rate_limit_rad_s=10.0, acceleration_limit_rad_s2=100.0),
        azimuth=plant.azimuth.replace(rate_limit_rad_s=10.0, acceleration_limit_rad_s2=100.0),
    )
    early, late = swing(wide, gains(EDGE_LOW * low))
    assert late < early
    early, late = swing(wide, gains(EDGE_HIGH * low))
    assert late > early


@pytest.mark.parametrize("laws", [dss13_loops("published"), dss13_loops("tuned"), load_lqg_designs()])
def test_the_laws_that_come_with_the_package_are_accepted(laws: tuple) -> None:
    require_stable(dss13_plant(), laws, TICK_S)


def test_a_refusal_names_axis_gains_frequency_and_bound(plant: PlantParams) -> None:
    with pytest.raises(ValueError, match=r"^elevation\.proportional_gain=40\.0.* elevation is unstable.* must be <= 1"):
        require_stable(plant, (gains(0.5), gains(40.0)), TICK_S)


def test_a_dead_time_counts(plant: PlantParams) -> None:
    late = plant.replace(azimuth=plant.azimuth.replace(drive_delay_s=0.3))
    laws = dss13_loops("tuned")
    assert abs(closed_loop_pole(plant, laws, TICK_S)) < 1.0 < abs(closed_loop_pole(late, laws, TICK_S))
    with pytest.raises(ValueError, match=r"^azimuth"):
        require_stable(late, laws, TICK_S)


def test_a_loop_without_gains_is_no_instability(plant: PlantParams) -> None:
    dead = PositionLoopParams(proportional_gain=0.0, integral_gain=0.0, feedforward_gain=0.0)
    require_stable(plant, (dead, gains(0.5)), TICK_S)
