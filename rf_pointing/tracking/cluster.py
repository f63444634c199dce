"""What makes a cluster of monopulse samples unusable, in the user's words."""

import math

import numpy as np

from rf_pointing.geometry import MonopulseCluster

__all__ = ["cluster_fault"]

LEVEL_RANGE_DB_HZ = -60.0, 200.0
"""What a receiver can mean by C/N0; its power of ten must be a number."""


def cluster_fault(cluster: MonopulseCluster) -> str:
    """Return why the cluster must be rejected, empty if it may be used."""
    times = np.asarray(cluster.t_s)
    channels = {
        "sum": np.asarray(cluster.sum),
        "difference_cross_elevation": np.asarray(cluster.difference_cross_elevation),
        "difference_elevation": np.asarray(cluster.difference_elevation),
    }
    if times.ndim != 1 or len(times) < 2:
        return f"t_s has shape {times.shape}, must have at least 2 samples"
    for name, samples in channels.items():
        if samples.shape != times.shape:
            return f"{name} has shape {samples.shape}, must be {times.shape}"
        if not math.isfinite(np.vdot(samples, samples).real):
            return f"{name} is too large to be squared" if np.all(np.isfinite(samples)) else f"{name} must be finite"
    if not np.all(np.isfinite(times)) or not np.isfinite(cluster.carrier_to_noise_db_hz):
        return "t_s and carrier_to_noise_db_hz must be finite"
    if np.any(np.diff(times) <= 0.0):
        return "t_s must increase from sample to sample"
    low, high = LEVEL_RANGE_DB_HZ
    if not low <= cluster.carrier_to_noise_db_hz <= high:
        return f"carrier_to_noise_db_hz={cluster.carrier_to_noise_db_hz} must be between {low} and {high}"
    if np.vdot(channels["sum"], channels["sum"]).real <= 0.0:
        return "sum is too small to be squared" if np.any(channels["sum"]) else "sum is zero in every sample"
    return ""
