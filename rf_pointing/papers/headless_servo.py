"""Plant, wind and position loops alone, without messages: long runs and many of them.

Per control tick: command table, position loops on the encoders, wind, plant, all of the classes
that the antenna's node uses.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rf_pointing.controllers import PositionLoop, PositionLoopParams
from rf_pointing.core import as_finite_array, random_stream, require_between
from rf_pointing.core.types import Array
from rf_pointing.papers.bare_antenna import BareAntenna, LawsOnCommand
from rf_pointing.papers.sweeps import processes
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, dss13_plant
from rf_pointing.simulation.closed_loop import ticks


@dataclass(frozen=True, kw_only=True)
class ServoRunSetup:
    """Commands (ticks, 2) at the control ticks and what carries them out; starts at rest on the
    first command.
    """

    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    plant: PlantParams = field(default_factory=dss13_plant)
    loops: tuple[PositionLoopParams, PositionLoopParams] = (
        PositionLoopParams(),
        PositionLoopParams(),
    )
    wind: WindParams = field(default_factory=WindParams)
    tick_s: float = 0.02
    seed: int = 1

    def __post_init__(self) -> None:
        require_between("tick_s", self.tick_s, 1e-3, 0.1)
        count = len(self.position_rad)
        for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2"):
            object.__setattr__(self, name, as_finite_array(name, getattr(self, name), (count, 2)))


@dataclass(frozen=True, slots=True)
class ServoRun:
    """Rate commands given at each tick, and encoder and beam angles at its end, each (ticks, 2)."""

    rate_command_rad_s: Array
    encoder_rad: Array
    beam_rad: Array


def run_servo(setup: ServoRunSetup) -> ServoRun:
    """Return one run."""
    plant = AntennaPlant(setup.plant, random_stream(setup.seed, "encoder"), setup.position_rad[0])
    laws = LawsOnCommand(
        [PositionLoop(params, setup.tick_s) for params in setup.loops],
        setup.tick_s,
        lambda k: (setup.position_rad[k], setup.velocity_rad_s[k], setup.acceleration_rad_s2[k]),
    )
    antenna = BareAntenna(
        plant, Wind(setup.wind, random_stream(setup.seed, "wind")), setup.tick_s, laws
    )
    rates, encoder, beam = (np.zeros_like(setup.position_rad) for _ in range(3))
    for k, command in ticks(antenna, len(setup.position_rad)):
        rates[k], encoder[k], beam[k] = command, plant.encoder_rad, plant.beam_rad
    return ServoRun(rates, encoder, beam)


def servo_monte_carlo(
    setup: ServoRunSetup, seeds: Sequence[int], *, workers: int | None = None
) -> Array:
    """Return `error_statistics` (runs, 2) of one run per seed, spread over `workers` processes
    (None: one per core).
    """
    count = workers or os.cpu_count() or 1
    require_between("workers", count, 1, 256)
    cases = [replace(setup, seed=seed) for seed in seeds]
    if count == 1:
        return np.array([_statistics(case) for case in cases])
    with processes(count) as pool:
        # One share a worker: the setup with its tables is sent with every run, which costs more
        # than the result.
        return np.array(list(pool.map(_statistics, cases, chunksize=math.ceil(len(cases) / count))))


def error_statistics(setup: ServoRunSetup, run: ServoRun) -> Array:
    """Return the rms of command minus beam (2,) on the sky: cross-elevation, elevation, over the
    second half.
    """
    half = len(run.beam_rad) // 2
    error = setup.position_rad[half + 1 :] - run.beam_rad[half:-1]
    error[:, 0] *= np.cos(setup.position_rad[half + 1 :, 1])
    rms: Array = np.sqrt(np.mean(error**2, axis=0))
    return rms


def _statistics(setup: ServoRunSetup) -> Array:
    return error_statistics(setup, run_servo(setup))
