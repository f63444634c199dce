"""What makes a cluster of monopulse samples unusable, in the user's words."""

import math
import operator

import numpy as np

from rf_pointing.core import MonopulseCluster

__all__ = ["cluster_fault", "level_known"]

CHANNELS = ("difference_cross_elevation", "difference_elevation", "sum")
LEVEL_RANGE_DB_HZ = -60.0, 200.0
"""What a receiver can mean by C/N0; its power of ten must be a number."""


def cluster_fault(cluster: MonopulseCluster) -> str:
    """Return why the cluster must be rejected, empty if it may be used."""
    times = np.asarray(cluster.t_s)
    if times.ndim != 1 or len(times) < 2:
        return f"t_s has shape {times.shape}, must have at least 2 samples"
    for name in CHANNELS:
        samples = np.asarray(getattr(cluster, name))
        if samples.shape != times.shape:
            return f"{name} has shape {samples.shape}, must be {times.shape}"
        size = np.vdot(samples, samples).real
        if not math.isfinite(size):
            return f"{name} is too large to be squared" if np.all(np.isfinite(samples)) else f"{name} must be finite"
        if name == "sum" and size <= 0.0:
            return "sum is too small to be squared" if np.any(samples) else "sum is zero in every sample"
    clock = times.tolist()
    if not all(map(math.isfinite, (*clock, cluster.carrier_to_noise_db_hz))):
        return "t_s and carrier_to_noise_db_hz must be finite"
    if not all(map(operator.lt, clock, clock[1:])):
        return "t_s must increase from sample to sample"
    if not level_known(cluster.carrier_to_noise_db_hz):
        low, high = LEVEL_RANGE_DB_HZ
        return f"carrier_to_noise_db_hz={cluster.carrier_to_noise_db_hz} must be between {low} and {high}"
    return ""


def level_known(carrier_to_noise_db_hz: float) -> bool:
    """Return whether that is a C/N0 at all."""
    low, high = LEVEL_RANGE_DB_HZ
    return low <= carrier_to_noise_db_hz <= high
