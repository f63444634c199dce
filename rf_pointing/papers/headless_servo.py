"""Plant, wind and position loops alone, without messages: long runs and many of them.

Per control tick: command table, position loops on the encoders, wind, plant.  `run_servo` steps the very classes the
antenna node uses; with `compiled=True` the same equations run as one compiled loop (extra `[fast]`), with the same
random numbers and the same result to rounding.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoop, PositionLoopParams
from rf_pointing.core import as_finite_array, random_stream, require_between
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, dss13_plant

__all__ = ["ServoRun", "ServoRunSetup", "error_statistics", "run_servo", "servo_monte_carlo"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ServoRunSetup:
    """Commands (ticks, 2) at the control ticks and what carries them out; starts at rest on the first command."""

    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    plant: PlantParams = field(default_factory=dss13_plant)
    loops: tuple[PositionLoopParams, PositionLoopParams] = (PositionLoopParams(), PositionLoopParams())
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


def run_servo(setup: ServoRunSetup, *, compiled: bool = False) -> ServoRun:
    """Return one run.

    Raises
    ------
    ModuleNotFoundError
        With `compiled` if numba is not installed (extra `[fast]`).
    """
    if compiled:
        from rf_pointing.papers.compiled_servo import CompiledServo

        return ServoRun(*CompiledServo(setup).run(setup.seed))
    plant = AntennaPlant(setup.plant, random_stream(setup.seed, "encoder"), setup.position_rad[0])
    wind = Wind(setup.wind, random_stream(setup.seed, "wind"))
    loops = [PositionLoop(params, setup.tick_s) for params in setup.loops]
    count = len(setup.position_rad)
    rates, encoder, beam = (np.zeros((count, 2)) for _ in range(3))
    commands = (setup.position_rad.tolist(), setup.velocity_rad_s.tolist(), setup.acceleration_rad_s2.tolist())
    for k, (position, velocity, acceleration) in enumerate(zip(*commands, strict=True)):
        measured = plant.encoder_rad.tolist()
        applied = [loop.output(position[i], velocity[i], measured[i], acceleration[i]) for i, loop in enumerate(loops)]
        plant.step(applied, wind.step(setup.tick_s, measured[0], measured[1]), setup.tick_s)
        for loop, rate in zip(loops, applied, strict=True):
            loop.update(setup.tick_s, rate)
        rates[k], encoder[k], beam[k] = applied, plant.encoder_rad, plant.beam_rad
    return ServoRun(rates, encoder, beam)


def servo_monte_carlo(
    setup: ServoRunSetup, seeds: Sequence[int], *, compiled: bool = False, workers: int | None = None
) -> Array:
    """Return `error_statistics` (runs, 2) of one run per seed, spread over `workers` (None: all cores).

    Compiled runs share one preparation and go to threads, as the compiled loop needs no interpreter; the others to
    processes.
    """
    count = workers or os.cpu_count() or 1
    require_between("workers", count, 1, 256)
    batch = _compiled_batch(setup) if compiled else partial(_batch, setup)
    shares = [list(seeds[start::count]) for start in range(count)]
    if count == 1:
        return batch(shares[0])
    with ThreadPoolExecutor(count) if compiled else ProcessPoolExecutor(count) as pool:
        parts = list(pool.map(batch, shares))
    result = np.empty((len(seeds), 2))
    for start, part in enumerate(parts):
        result[start::count] = part
    return result


def error_statistics(setup: ServoRunSetup, run: ServoRun) -> Array:
    """Return the rms of command minus beam (2,) on the sky: cross-elevation, elevation, over the second half."""
    half = len(run.beam_rad) // 2
    error = setup.position_rad[half + 1 :] - run.beam_rad[half:-1]
    error[:, 0] *= np.cos(setup.position_rad[half + 1 :, 1])
    rms: Array = np.sqrt(np.mean(error**2, axis=0))
    return rms


def _batch(setup: ServoRunSetup, seeds: Sequence[int]) -> Array:
    results = np.empty((len(seeds), 2))
    for index, seed in enumerate(seeds):
        results[index] = error_statistics(setup, run_servo(replace(setup, seed=seed)))
    return results


def _compiled_batch(setup: ServoRunSetup) -> Callable[[Sequence[int]], Array]:
    from rf_pointing.papers.compiled_servo import CompiledServo

    servo = CompiledServo(setup)

    def batch(seeds: Sequence[int]) -> Array:
        results = np.empty((len(seeds), 2))
        for index, seed in enumerate(seeds):
            results[index] = error_statistics(setup, ServoRun(*servo.run(seed)))
        return results

    return batch
