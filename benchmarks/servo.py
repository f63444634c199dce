"""Speed of the servo.  Run: python -m benchmarks.servo [--runs N] [--workers N]

Prints each figure with the ratio asked for, all measured in this run; the exit status says whether every ratio that
could be measured is kept.  Without numba (extra [fast]) the compiled figures are left out and named.
"""

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable

import numpy as np

from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams, PositionLoop, dss13_loops
from rf_pointing.geometry import random_stream
from rf_pointing.reproduce.servo_trajectory import LowOrbitPass
from rf_pointing.servo import (
    AntennaPlant,
    BlockSimulator,
    Wind,
    WindParams,
    discretise,
    dss13_plant,
    linear_model,
)
from rf_pointing.simulation.headless_servo import ServoRunSetup, run_servo, servo_monte_carlo

TICK_S, STEP_S = 0.02, 0.001
PLAIN_RATIO, COMPILED_RATIO, LINEAR_RATIO, TICK_SHARE = 25.0, 1000.0, 10.0, 0.10
SAME_RAD = 1e-12


def seconds(task: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of some runs."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


def setup(duration_s: float) -> ServoRunSetup:
    """All effects, 1-kHz plant steps, 50-Hz loops, 8 m/s of wind, on a pass."""
    motion = LowOrbitPass().at(-60.0 + TICK_S * np.arange(round(duration_s / TICK_S)))
    return ServoRunSetup(
        position_rad=motion.position_rad,
        velocity_rad_s=motion.velocity_rad_s,
        acceleration_rad_s2=motion.acceleration_rad_s2,
        plant=dss13_plant().replace(substep_s=STEP_S),
        loops=dss13_loops("tuned"),
        wind=WindParams(mean_speed_m_s=8.0),
    )


def line(name: str, value: float, asked: float | None, unit: str) -> bool:
    """Print one figure; return whether it is at least what is asked (None: for information)."""
    kept = asked is None or value >= asked
    wish = "" if asked is None else f"   asked >= {asked:g}   {'kept' if kept else 'MISSED'}"
    print(f"{name:<68} {value:10.4g} {unit}{wish}", flush=True)
    return kept


def closed_loop(compiled: bool) -> bool:
    """Headless two-axis closed loop against real time, plain and compiled."""
    case = setup(40.0)
    plain = run_servo(case)
    kept = line(
        "closed loop, 1-kHz plant, plain numpy", 40.0 / seconds(lambda: run_servo(case)), PLAIN_RATIO, "x real time"
    )
    if not compiled:
        print("closed loop, compiled: numba is not installed (extra [fast])")
        return kept
    fast = run_servo(case, compiled=True)
    spent = seconds(lambda: run_servo(case, compiled=True))
    kept &= line("closed loop, 1-kHz plant, compiled", 40.0 / spent, COMPILED_RATIO, "x real time")
    apart = float(np.max(np.abs(fast.beam_rad - plain.beam_rad)))
    return line("largest difference of the two, below 1e-12 rad", SAME_RAD / max(apart, 1e-300), 1.0, "1") and kept


def linear() -> bool:
    """The linear plant against python-control and scipy on the same sampled model."""
    import control
    import scipy.signal

    model = linear_model(dss13_plant())
    step, size = discretise(model.a, model.b_command, STEP_S), len(model.a)
    matrices = (step[:, :size], step[:, size:], np.vstack([model.encoder, model.beam]), np.zeros((4, 2)))
    inputs = 1e-3 * np.random.default_rng(1).standard_normal((20_000, 2))
    simulator, system = BlockSimulator(*matrices, block=16), control.ss(*matrices, STEP_S)
    ours = seconds(lambda: simulator.run(inputs, np.zeros(size)))
    line("linear plant, 22 states", ours / len(inputs) * 1e6, None, "us per step")
    forced = seconds(lambda: control.forced_response(system, inputs=inputs.T))
    sampled = seconds(lambda: scipy.signal.dlsim((*matrices, STEP_S), inputs))
    kept = line("  faster than control.forced_response", forced / ours, LINEAR_RATIO, "x")
    return line("  faster than scipy.signal.dlsim", sampled / ours, LINEAR_RATIO, "x") and kept


def monte_carlo(runs: int, workers: int, compiled: bool) -> bool:
    """Batched runs on one and on several processes."""
    case = setup(10.0)
    if not compiled:
        runs = min(runs, 40)
    alone = seconds(lambda: servo_monte_carlo(case, range(runs // 4), compiled=compiled, workers=1), 1) * 4.0
    together = seconds(lambda: servo_monte_carlo(case, range(runs), compiled=compiled, workers=workers), 1)
    line(f"Monte Carlo, {runs} runs of 10 s, one process (from a quarter of them)", alone, None, "s")
    line(f"Monte Carlo, {runs} runs of 10 s, {workers} processes", together, None, "s")
    return line("  gained by the processes", alone / together, None, "x")


def tick() -> bool:
    """What a node spends per 50-Hz tick: preprocessor, wind, plant with 5-ms substeps, both loops."""
    plant, wind = (
        AntennaPlant(dss13_plant(), random_stream(1, "encoder")),
        Wind(WindParams(mean_speed_m_s=8.0), random_stream(1, "wind")),
    )
    shaper, loops = CommandPreprocessor(CommandPreprocessorParams()), [PositionLoop(p) for p in dss13_loops("tuned")]
    shaper.reset((0.0, 0.8))
    times = []
    for k in range(5000):
        start = time.perf_counter()
        command = shaper.step((1e-4 * k, 0.8), (5e-3, 0.0), (0.0, 0.0), TICK_S)
        measured = plant.encoder_rad
        position, velocity, acceleration = (part.tolist() for part in command)
        rates = [loop.output(position[i], velocity[i], measured[i], acceleration[i]) for i, loop in enumerate(loops)]
        plant.step(rates, wind.step(TICK_S, measured[0], measured[1]), TICK_S)
        for loop, rate in zip(loops, rates, strict=True):
            loop.update(TICK_S, rate)
        times.append(time.perf_counter() - start)
    line("50-Hz tick, median", 1e3 * float(np.median(times)), None, "ms")
    slow = float(np.percentile(times, 99.0))
    line("50-Hz tick, 99th percentile", 1e3 * slow, None, "ms")
    return line(
        "  of its period left by the 99th percentile, over 90 %", (1.0 - slow / TICK_S) / (1.0 - TICK_SHARE), 1.0, "1"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    compiled = importlib.util.find_spec("numba") is not None
    kept = [closed_loop(compiled), linear(), tick(), monte_carlo(options.runs, options.workers, compiled)]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
