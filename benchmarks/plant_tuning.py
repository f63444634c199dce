"""Fits the free parameters of the DSS-13 plant to the published monopulse limits, and shows what fixes what.

Published: f_m limits without notch (0.060 to 0.067 Hz), with notch (0.5 Hz), with beta = 0.33 ("similar": 0.47 Hz
taken), and the errors of the pinion table, whose ratios are limits over each other.  Free: damping, encoder and beam
residue of the bending mode, beam residue of the 3.15-Hz mode, drive bandwidth, pinion floor.  More parameters than
numbers: the fit stays near its start by a weak prior of 30 %.  Run from the repository, a few minutes:
`scripts/run-python -m benchmarks.plant_tuning > benchmarks/plant_tuning.txt`.
"""

import math

import numpy as np
from scipy.optimize import least_squares

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.papers.servo_linear import stability_limit_hz
from rf_pointing.servo import PlantParams, dss13_plant

PLAIN, NOTCH = PositionLoopParams(notch_enabled=False), PositionLoopParams()
NAMES = (
    "bending damping",
    "bending encoder residue",
    "bending beam residue",
    "3.15-Hz beam residue",
    "drive rad/s",
    "floor",
)
LIMITS = ("no notch (Hz)", "notch (Hz)", "beta 0.33 (Hz)", "pinion 0/60 deg", "pinion 0/90 deg")
PUBLISHED = np.array([0.0635, 0.5, 0.47, 0.76 / 1.43, 0.35 / 1.43])
START = np.array([0.01, 0.3, 0.5, 0.2, 20.0, 0.25])
PRESET = np.array([0.0082, 0.316, 0.5, 0.249, 20.0, 0.28])
PRIOR = 0.3


def plant(values: np.ndarray, *, beta: float = 1.0, pinion_deg: float = 0.0) -> PlantParams:
    damping, encoder, beam, second, bandwidth, floor = values.tolist()
    params = dss13_plant(ideal=True, pinion_angle_rad=math.radians(pinion_deg)).replace(pinion_floor=floor)
    axis = params.elevation
    changed = axis.replace(
        mode_damping=(damping, *axis.mode_damping[1:]),
        mode_encoder_residue=(encoder, *axis.mode_encoder_residue[1:]),
        mode_beam_residue=(beam, second, axis.mode_beam_residue[2]),
        drive_bandwidth_per_gain_hz=bandwidth / (2.0 * math.pi) / axis.amplifier_gain,
        amplifier_gain=beta * axis.amplifier_gain,
    )
    return params.replace(elevation=changed)


def limits(values: np.ndarray) -> np.ndarray:
    def limit(loop: PositionLoopParams, **options: float) -> float:
        return stability_limit_hz(plant(values, **options), (loop, loop), 1)

    none = limit(PLAIN)
    pinion = [none / limit(PLAIN, pinion_deg=angle) for angle in (60.0, 90.0)]
    return np.array([none, limit(NOTCH), limit(PLAIN, beta=0.33), *pinion])


def residuals(logarithms: np.ndarray) -> np.ndarray:
    misfit = np.log(limits(np.exp(logarithms)) / PUBLISHED)
    return np.concatenate([misfit / 0.05, (logarithms - np.log(START)) / PRIOR])


def table(title: str, values: np.ndarray) -> None:
    print(title)
    print("   ", ", ".join(f"{name} {value:.4g}" for name, value in zip(NAMES, values, strict=True)))
    for name, published, ours in zip(LIMITS, PUBLISHED, limits(values), strict=True):
        print(f"    {name:<16} published {published:.4f}   model {ours:.4f}")


def main() -> None:
    table("start", START)
    fit = least_squares(residuals, np.log(START), diff_step=0.01, max_nfev=12)
    table("fitted", np.exp(fit.x))
    table("preset in use (an earlier fit, rounded)", PRESET)
    print("relative change of each limit per relative change of each parameter, at the preset")
    base = limits(PRESET)
    for index, name in enumerate(NAMES):
        moved = PRESET.copy()
        moved[index] *= 1.02
        slope = np.log(limits(moved) / base) / math.log(1.02)
        print(f"    {name:<24}", "  ".join(f"{what} {value:+.2f}" for what, value in zip(LIMITS, slope, strict=True)))


if __name__ == "__main__":
    main()
