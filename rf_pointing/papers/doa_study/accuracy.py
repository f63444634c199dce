"""RMSE of MUSIC against the Cramer-Rao bound over SNR: where it follows, and where its threshold lies."""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams
from rf_pointing.array_sensors.arrays.cramer_rao import effective_snr, polar_sigma_rad
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar, polar_errors_rad
from rf_pointing.array_sensors.arrays.search_grid import nearest_node
from rf_pointing.array_sensors.arrays.sweeps import sweep
from rf_pointing.core import random_stream
from rf_pointing.papers.doa_study.direction_errors import GRID_RAD, DirectionCase, measure_directions

__all__ = ["AccuracyPoint", "accuracy_curve", "accuracy_point", "threshold"]

ARRAY = CircularArrayParams()
OUTLIER_RAD = math.radians(20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyPoint:
    """RMSE (degrees) of refined and 1-deg-grid estimates at one SNR, all estimates counted, beside the bound."""

    snr_db: float
    effective_snr: float
    theta_deg: float
    phi_deg: float
    theta_bound_deg: float
    phi_bound_deg: float
    grid_theta_deg: float
    grid_phi_deg: float
    outliers: float


def accuracy_point(snapshots: int, theta_rad: float, estimates: int, seed: int, snr_db: float) -> AccuracyPoint:
    """Return the point for sources within half a grid step of `theta_rad`, any azimuth, constant modulus."""
    stream = random_stream(seed, f"doa_accuracy_{snapshots}_{snr_db}")
    polar = theta_rad + GRID_RAD * stream.uniform(-0.5, 0.5, estimates)
    truth = direction_from_polar(polar, stream.uniform(0.0, 2.0 * np.pi, estimates))
    case = DirectionCase(snapshots=snapshots, snr_db=snr_db)
    refined = measure_directions(ARRAY, case, truth, stream)
    found = [
        float(np.degrees(np.sqrt(np.mean(error**2))))
        for directions in (refined, nearest_node(refined, GRID_RAD))
        for error in polar_errors_rad(directions, truth)[:2]
    ]
    bound = [float(np.degrees(sigma)) for sigma in polar_sigma_rad(ARRAY, theta_rad, snapshots, case.snr)]
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
    return sweep(partial(accuracy_point, snapshots, theta_rad, estimates, seed), list(snr_db), executor)


def threshold(curve: Sequence[AccuracyPoint], excess: float = 0.05) -> tuple[float, float]:
    """Return SNR (dB) and effective ratio where the RMSE of theta exceeds the bound by `excess`, interpolated.

    Raises
    ------
    ValueError
        If the curve does not cross it.
    """
    points = sorted(curve, key=lambda point: point.snr_db)
    ratio = np.array([point.theta_deg / point.theta_bound_deg for point in points])
    above = np.flatnonzero(ratio > 1.0 + excess)
    if not len(above) or above[-1] + 1 >= len(points):
        raise ValueError(f"curve from {points[0].snr_db} to {points[-1].snr_db} dB does not cross 1 + excess={excess}")
    low, high = int(above[-1]), int(above[-1]) + 1
    share = (ratio[low] - 1.0 - excess) / (ratio[low] - ratio[high])
    snr_db = points[low].snr_db + share * (points[high].snr_db - points[low].snr_db)
    snapshots_effective = np.log([points[low].effective_snr, points[high].effective_snr])
    return float(snr_db), float(np.exp(np.interp(share, [0.0, 1.0], snapshots_effective)))
