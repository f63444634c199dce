"""Bias and spread of both conscan estimators against the pointing error: the picture of docs/math/conscan.md.

Run: python -m rf_pointing.papers.conscan_figure docs/math/conscan.svg
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, MU, random_stream
from rf_pointing.papers.conscan_cases import BEAM_KA_RAD, RADIUS_RAD, circle, mean_power_hz, receiver_powers_hz
from rf_pointing.tracking.beam_fit import PowerWindow, beam_design, fit_beam
from rf_pointing.tracking.conscan_estimate import linear_errors_rad

__all__ = ["EstimatorCurves", "draw", "estimator_curves"]

Array = NDArray[np.float64]

SAMPLES = 32


@dataclass(frozen=True, slots=True)
class EstimatorCurves:
    """Per pointing error (n,): bias and standard deviation along it, all in mdeg, and the Cramer-Rao bound."""

    error_mdeg: Array
    linear_bias: Array
    linear_sigma: Array
    exact_bias: Array
    exact_sigma: Array
    bound: Array


def estimator_curves(level_db_hz: float, runs: int, seed: int, points: int = 12) -> EstimatorCurves:
    """Return both estimators at Ka band on `runs` noisy windows of 32 s, from no error to 0.6 beamwidths."""
    x, y = circle(SAMPLES)
    design = beam_design(x, y, BEAM_KA_RAD)
    rows = np.zeros((SAMPLES, 6))
    rows[:, 2], rows[:, 3], rows[:, 4] = 1.0, x, y
    errors = np.linspace(0.0, 0.6, points) * BEAM_KA_RAD
    found = []
    for error in errors:
        mean = mean_power_hz(level_db_hz, BEAM_KA_RAD, np.array([error, 0.0]), x, y)
        power, noise = receiver_powers_hz(mean, runs, random_stream(seed, f"figure {level_db_hz} {error}"))
        linear = linear_errors_rad(PowerWindow(rows), power, BEAM_KA_RAD, RADIUS_RAD)[:, 0] - error
        exact = fit_beam(design, power, noise).error_rad[:, 0] - error
        found.append((linear.mean(), linear.std(), exact.mean(), exact.std(), _bound_rad(mean, x, y)))
    return EstimatorCurves(errors / MDEG, *(np.array(column) / MDEG for column in zip(*found, strict=True)))


def _bound_rad(mean_hz: Array, x: Array, y: Array) -> float:
    rows = np.stack([np.ones_like(x), 2.0 * MU * x / BEAM_KA_RAD**2, 2.0 * MU * y / BEAM_KA_RAD**2])
    return float(np.sqrt(np.linalg.inv(0.5 * mean_hz * rows @ rows.T)[1, 1]))


def draw(path: Path, runs: int = 40_000, seed: int = 1) -> None:
    """Write the picture, bias left and spread right, for 30 and 40 dB-Hz."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    bias, spread = figure.subplots(1, 2)
    for level, style in ((30.0, "-"), (40.0, "--")):
        curves = estimator_curves(level, runs, seed)
        bias.plot(curves.error_mdeg, curves.linear_bias, style, color="tab:red", label=f"linear, {level:.0f} dB-Hz")
        bias.plot(curves.error_mdeg, curves.exact_bias, style, color="tab:blue", label=f"exact, {level:.0f} dB-Hz")
        spread.plot(curves.error_mdeg, curves.linear_sigma, style, color="tab:red")
        spread.plot(curves.error_mdeg, curves.exact_sigma, style, color="tab:blue")
        spread.plot(curves.error_mdeg, curves.bound, ":", color="black")
    for axes, name in ((bias, "bias, mdeg"), (spread, "standard deviation, mdeg (dotted: bound)")):
        axes.axvline(8.5, color="0.8", linewidth=1.0)
        axes.set_xlabel("pointing error, mdeg")
        axes.set_ylabel(name)
    bias.legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
