"""Tunes 20 random antennas and holds each loop against the best that brute force finds.

Dishes of 3 to 70 m, flexible or stiff, modes from 0.5 to 8 Hz, drives that are up to 0.1 s late.
Brute force is differential evolution over the eight numbers of the PI loop with the same cost, 19 000
evaluations, from bounds alone.  An antenna counts as met if the loop is stable, its peak is at most 2 with
the modes 10 % and the residues 30 % off, and its beam error at most 1.2 times that of brute force.
Run from the repository: `scripts/run-python -m benchmarks.tuning_trials > benchmarks/tuning_trials.txt`.
"""

import argparse
import math
import time

import numpy as np
from scipy.optimize import differential_evolution

from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.tuning import MOST_SENSITIVE, RESERVE, Problem, judged, plant_axis, tuned_axis
from rf_pointing.station.derive.plants import MountAxis, plant_of

WIND_M_S, TICK_S = 8.0, 0.02
BOUNDS = ((-4.0, 3.9), (-8.0, 6.2), *((-1.0, 2.7), (-6.9, 0.6)) * 3)
"""Logarithms of gains, then frequency (Hz) and damping of notch, zero and pole."""


def random_plant(random: np.random.Generator) -> tuple[str, PlantParams]:
    """Return a plant and its description."""
    structure = str(random.choice(["flexible", "stiff"]))
    diameter_m = float(np.exp(random.uniform(math.log(3.0), math.log(70.0))))
    axis = MountAxis(
        rate_rad_s=math.radians(random.uniform(0.5, 10.0)),
        acceleration_rad_s2=math.radians(random.uniform(0.5, 10.0)),
        stop_rad=(-8.0, 8.0), encoder_bits=int(random.integers(16, 25)), backlash_rad=None,
    )  # fmt: skip
    plant = plant_of(structure, diameter_m, (axis, axis), 25.0)
    first_hz = float(np.exp(random.uniform(math.log(0.5), math.log(8.0))))
    late_s = float(random.choice([0.0, 0.04, 0.1]))
    changed = {}
    for name in ("azimuth", "elevation"):
        own = getattr(plant, name)
        share = 1.0 if structure == "flexible" else 0.2
        shares = 1.0, random.uniform(1.4, 2.2), random.uniform(2.3, 3.5)
        modes = tuple(min(first_hz * each, 60.0) for each in shares)
        changed[name] = own.replace(
            mode_frequency_hz=modes, drive_delay_s=late_s,
            mode_damping=tuple(random.uniform(0.005, 0.04, 3).tolist()),
            mode_encoder_residue=tuple(share * each for each in random.uniform(0.02, 0.35, 3).tolist()),
            mode_beam_residue=tuple(share * each for each in random.uniform(0.02, 0.5, 3).tolist()),
        )  # fmt: skip
    text = f"{structure:<9}{diameter_m:5.1f} m {first_hz:5.2f} Hz {late_s:4.2f} s late"
    return text, plant.replace(**changed)


def best_by_force(problem: Problem, seed: int, generations: int) -> float:
    """Return the smallest rms that differential evolution finds, NaN where its law is unstable."""
    found = differential_evolution(
        lambda values: problem.cost("pi", values), BOUNDS, seed=seed, maxiter=generations, popsize=20, tol=1e-8,
        polish=False,
    )  # fmt: skip
    law = judged(problem.axis, problem.law("pi", found.x), WIND_M_S)
    return law.rms_s2_per_m_s if math.isfinite(law.worst_peak) else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--antennas", type=int, default=20)
    parser.add_argument("--generations", type=int, default=120)
    parser.add_argument("--law", nargs="+", default=["pi"])
    args = parser.parse_args()
    random, met = np.random.default_rng(41), 0
    for number in range(args.antennas):
        text, plant = random_plant(random)
        axis = plant_axis(plant, number % 2, TICK_S)
        for law in args.law:
            started = time.perf_counter()
            try:
                tuned = tuned_axis(axis, law, WIND_M_S)
            except ValueError as error:
                print(f"{number:2} {text} {law}: {error}", flush=True)
                continue
            taken_s = time.perf_counter() - started
            problem = Problem(axis, WIND_M_S, MOST_SENSITIVE * RESERVE, (tuned.worst,))
            best = best_by_force(problem, number, args.generations) if law == "pi" else math.nan
            ratio = tuned.rms_s2_per_m_s / best
            kept = tuned.worst_peak <= MOST_SENSITIVE and not ratio > 1.2
            met += kept
            print(
                f"{number:2} {text} {law}: |S| {tuned.margins.peak_sensitivity:.2f}, worst {tuned.worst_peak:.2f}, "
                f"{tuned.margins.gain_margin_db:.1f} dB, {math.degrees(tuned.margins.phase_margin_rad):.0f} deg, "
                f"{tuned.rms_s2_per_m_s:.3g} s^2/(m/s), {ratio:.3f} of brute force, {taken_s:.1f} s"
                f"{'' if kept else '  NOT MET'}", flush=True,
            )  # fmt: skip
    print(f"{met} of {args.antennas * len(args.law)} met")


if __name__ == "__main__":
    main()
