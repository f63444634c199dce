"""RMSE of MUSIC against the Cramer-Rao bound over SNR, its threshold, and the pictures of both."""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.cramer_rao import effective_snr, polar_sigma_rad
from rf_pointing.core import random_stream
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.directions import (
    GRID_RAD,
    DirectionCase,
    direction_from_polar,
    measure_directions,
    nearest_node,
    polar_errors_rad,
)
from rf_pointing.papers.sweeps import sweep

ARRAY = CircularArrayParams()
OUTLIER_RAD = math.radians(20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyPoint:
    """RMSE (degrees) of refined and 1-deg-grid estimates at one SNR, and the bound.

    All estimates count, outliers too.
    """

    snr_db: float
    effective_snr: float
    theta_deg: float
    phi_deg: float
    theta_bound_deg: float
    phi_bound_deg: float
    grid_theta_deg: float
    grid_phi_deg: float
    outliers: float


def accuracy_point(
    snapshots: int, theta_rad: float, estimates: int, seed: int, snr_db: float
) -> AccuracyPoint:
    """Return the point for sources within half a grid step of `theta_rad`, any azimuth, constant
    modulus.
    """
    stream = random_stream(seed, f"doa_accuracy_{snapshots}_{snr_db}")
    # Spread over one grid step: at a node the 1-deg search would look exact.
    polar = theta_rad + GRID_RAD * stream.uniform(-0.5, 0.5, estimates)
    truth = direction_from_polar(polar, stream.uniform(0.0, 2.0 * np.pi, estimates))
    case = DirectionCase(snapshots=snapshots, snr_db=snr_db)
    refined = measure_directions(ARRAY, case, truth, stream)
    found = [
        float(np.degrees(np.sqrt(np.mean(error**2))))
        for directions in (refined, nearest_node(refined, GRID_RAD))
        for error in polar_errors_rad(directions, truth)[:2]
    ]
    bound = [
        float(np.degrees(sigma)) for sigma in polar_sigma_rad(ARRAY, theta_rad, snapshots, case.snr)
    ]
    return AccuracyPoint(
        snr_db=snr_db,
        effective_snr=effective_snr(ARRAY, snapshots, case.snr),
        theta_deg=found[0],
        phi_deg=found[1],
        theta_bound_deg=bound[0],
        phi_bound_deg=bound[1],
        grid_theta_deg=found[2],
        grid_phi_deg=found[3],
        outliers=float(np.mean(np.sum(refined * truth, axis=-1) < math.cos(OUTLIER_RAD))),
    )


def accuracy_curve(
    snapshots: int,
    snr_db: Sequence[float],
    *,
    theta_rad: float = math.radians(40.0),
    estimates: int = 20_000,
    seed: int = 1,
    executor: Executor | None = None,
) -> list[AccuracyPoint]:
    """Return one point per SNR, in this process or on any `concurrent.futures` executor."""
    return sweep(
        partial(accuracy_point, snapshots, theta_rad, estimates, seed), list(snr_db), executor
    )


def threshold(curve: Sequence[AccuracyPoint], excess: float = 0.05) -> tuple[float, float]:
    """Return SNR (dB) and effective ratio where the RMSE of theta exceeds the bound by `excess`,
    interpolated.

    Raises
    ------
    ValueError
        If the curve does not cross it.
    """
    points = sorted(curve, key=lambda point: point.snr_db)
    ratio = np.array([point.theta_deg / point.theta_bound_deg for point in points])
    # From the strong end: the curve crosses once, outliers only make it steeper.
    above = np.flatnonzero(ratio > 1.0 + excess)
    if not len(above) or above[-1] + 1 >= len(points):
        raise ValueError(
            f"curve from {points[0].snr_db} to {points[-1].snr_db} dB does not cross 1 + excess={excess}"
        )
    low, high = int(above[-1]), int(above[-1]) + 1
    share = (ratio[low] - 1.0 - excess) / (ratio[low] - ratio[high])
    snr_db = points[low].snr_db + share * (points[high].snr_db - points[low].snr_db)
    # Interpolated in the logarithm, like the SNR in decibels.
    snapshots_effective = np.log([points[low].effective_snr, points[high].effective_snr])
    return float(snr_db), float(np.exp(np.interp(share, [0.0, 1.0], snapshots_effective)))


def draw_accuracy(curve: Sequence[AccuracyPoint], snapshots: int, path: Path) -> None:
    """Write theta and phi over SNR: refined, 1-deg grid, bound.

    And the share of outliers, which shows the threshold.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    axes = figure.subplots(1, 3)
    snr_db = [point.snr_db for point in curve]
    for panel, angle in zip(axes[:2], ("theta", "phi"), strict=True):
        panel.semilogy(
            snr_db,
            [getattr(p, f"{angle}_bound_deg") for p in curve],
            "k-",
            label="Cramér-Rao bound",
        )
        panel.semilogy(
            snr_db, [getattr(p, f"{angle}_deg") for p in curve], "o", label="MUSIC, refined peak"
        )
        panel.semilogy(
            snr_db, [getattr(p, f"grid_{angle}_deg") for p in curve], "x", label="MUSIC, 1° grid"
        )
        panel.set(
            xlabel="SNR per element (dB)",
            ylabel=f"RMSE of {angle} (deg)",
            title=f"{angle}, L = {snapshots}",
        )
        panel.grid(visible=True, which="both", alpha=0.3)
    axes[0].legend()
    axes[2].plot(snr_db, [100.0 * p.outliers for p in curve], "o-")
    axes[2].set(
        xlabel="SNR per element (dB)",
        ylabel="errors beyond 20° (%)",
        title="outliers: the threshold",
    )
    axes[2].grid(visible=True, alpha=0.3)
    figure.savefig(path, dpi=110)


def draw_convergence(results: Sequence[CaseResult], path: Path) -> None:
    """Write the total attitude error of every trial over time, one panel per case."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(results), squeeze=False)[0]
    for panel, result in zip(axes, results, strict=True):
        panel.semilogy(np.arange(len(result.history_deg)), result.history_deg, lw=0.8)
        found = "refined" if result.case.refined else "1° grid"
        panel.set(
            title=f"L = {result.case.snapshots}, {result.case.snr_db:g} dB, {found}",
            xlabel="time (s)",
        )
        panel.set_ylabel("total attitude error (deg)")
        panel.grid(visible=True, which="both", alpha=0.3)
    figure.savefig(path, dpi=110)
