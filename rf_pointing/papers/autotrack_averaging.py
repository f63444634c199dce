"""What averaging a cluster of five samples gains in the whole station: the tracker's errors beside those of single samples.

One flight, the same samples for both: the tracker's error of every cluster, and the tracker's error of each of its samples
alone, each less the true error at its time.  White is the receiver's own noise; coloured is a line between 8 and 25 Hz in it.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rf_pointing.core import MonopulseCluster
from rf_pointing.papers.autotrack_cases import (
    KA_45_DB_HZ,
    LINK_45_DB_HZ,
    Case,
    Changes,
    first_time_s,
    fly,
    low_orbit_pass,
)
from rf_pointing.papers.monopulse_cases import CLUSTER, SAMPLE_S
from rf_pointing.papers.row import Row
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.station.antenna.receiver import Reception
from rf_pointing.tracking import MonopulseParams, MonopulseTracker

__all__ = ["averaging_rows", "station_gain_db"]

Array = NDArray[np.float64]
SECONDS, SETTLED_S = 100.0, 10.0
TOLERANCE_DB = 0.5
"""Three standard errors of the ratio from both axes of 800 clusters."""
LINE_HZ, LINE_DB_HZ = 12.0, 27.0
"""10 dB above the noise of a sample; the tracker refuses differences turned against the sum by a line of 32 dB-Hz."""


def averaging_rows(seed: int) -> list[Row]:
    """Return both gains beside the published ones."""
    line = {"interference.level_db_hz": LINE_DB_HZ, "interference.frequency_offset_hz": LINE_HZ}
    white = station_gain_db({"rf_receiver": KA_45_DB_HZ, "pointing_controller": LINK_45_DB_HZ}, seed)
    coloured = station_gain_db({"rf_receiver": _signal(line)}, seed)
    x = math.pi * LINE_HZ * SAMPLE_S
    limit = -20.0 * math.log10(abs(math.sin(CLUSTER * x) / (CLUSTER * math.sin(x))))
    return [
        Row(
            quantity="averaging of N = 5 in the whole station, receiver noise, Ka, 45 dB-Hz", source="BWG eq. (17)", paper=7.0,
            ours=white, unit="dB", tolerance=TOLERANCE_DB,
            remark="variance of the errors of single samples over that of the clusters'",
        ),
        Row(
            quantity=f"the same with a line at {LINE_HZ:.0f} Hz", source="BWG Fig. 27", paper=17.0, ours=coloured,
            unit="dB", tolerance=1.0, explained=True,
            remark=f"the mean of five takes out {limit:.1f} dB of a line there; receiver noise and the motion of the structure "
            "stay beside it",
        ),
    ]  # fmt: skip


def station_gain_db(changes: Changes, seed: int) -> float:
    """Return the fall of the error's variance from single samples to the tracker's errors of clusters."""
    heard: list[Reception] = []
    log = fly(Case("Ka", "monopulse", SECONDS, changes, seed), low_orbit_pass(), heard.append)
    begun_s = first_time_s(log, "monopulse") + SETTLED_S
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=HALF_POWER_BEAMWIDTH_RAD["Ka"]))
    truth = CubicSpline(log.t_s, log.errors_rad())
    single, averaged = [], []
    for reception, mode in zip(heard, log.mode, strict=True):
        cluster = reception.cluster
        if mode != "monopulse" or cluster.t_s[0] <= begun_s:
            continue
        averaged.append(_measured(tracker, cluster) - truth(cluster.t_s).mean(axis=0))
        single += [_measured(tracker, _alone(cluster, k)) - truth(cluster.t_s[k]) for k in range(len(cluster.t_s))]
    variances = [float(np.var(np.array(misses), axis=0).sum()) for misses in (single, averaged)]
    return 10.0 * math.log10(variances[0] / variances[1])


def _measured(tracker: MonopulseTracker, cluster: MonopulseCluster) -> Array:
    error = tracker.measure(cluster)
    return np.array([error.cross_elevation_rad, error.elevation_rad])


def _alone(cluster: MonopulseCluster, k: int) -> MonopulseCluster:
    """Return a cluster of one sample, given twice: a tracker needs two to know their distance in time."""
    twice = [k, k]
    return replace(
        cluster, t_s=cluster.t_s[k] + np.array([0.0, SAMPLE_S]), sum=cluster.sum[twice],
        difference_cross_elevation=cluster.difference_cross_elevation[twice],
        difference_elevation=cluster.difference_elevation[twice],
    )  # fmt: skip


def _signal(values: dict[str, float]) -> dict[str, object]:
    return {f"signal.{name}": value for name, value in values.items()}
