"""What averaging a cluster of five samples gains in the whole station: the tracker's errors beside those of single samples.

One flight, the same samples for both: the tracker's error of every cluster, and the tracker's error of its last sample alone,
each less the true error at its time.  White is the receiver's own noise; coloured is a line between 8 and 25 Hz in it.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.reproduce.autotrack_cases import Case, Changes, first_time_s, fly, low_orbit_pass
from rf_pointing.reproduce.monopulse_cases import CLUSTER, SAMPLE_S
from rf_pointing.reproduce.row import Row
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.station.receiver import Reception
from rf_pointing.tracking import MonopulseParams, MonopulseTracker

__all__ = ["averaging_rows", "station_gain_db"]

Array = NDArray[np.float64]
SECONDS, SETTLED_S = 60.0, 10.0
TOLERANCE_DB = 0.7
"""Both axes of 430 clusters know the ratio to 0.3 dB (1 sigma); true errors between two receptions are interpolated, 0.2 dB."""
LINK_45_DB_HZ = {"link.zenith_carrier_to_noise_db_hz": 45.0, "link.reference_range_m": 1.1e6}
"""45 dB-Hz at about the distance of the satellite during the case."""
LINE_HZ, LINE_DB_HZ = 12.0, 27.0
"""10 dB above the noise of a sample; the tracker refuses differences turned against the sum by a line of 32 dB-Hz."""


def averaging_rows(seed: int) -> list[Row]:
    """Return both gains beside the published ones."""
    line = {"interference.level_db_hz": LINE_DB_HZ, "interference.frequency_offset_hz": LINE_HZ}
    white = station_gain_db({"rf_receiver": _signal(LINK_45_DB_HZ), "pointing_controller": LINK_45_DB_HZ}, seed)
    coloured = station_gain_db({"rf_receiver": _signal(line)}, seed)
    x = math.pi * LINE_HZ * SAMPLE_S
    limit = -20.0 * math.log10(abs(math.sin(CLUSTER * x) / (CLUSTER * math.sin(x))))
    return [
        Row(
            quantity="averaging of N = 5 in the whole station, receiver noise, Ka, 45 dB-Hz", source="BWG eq. (17)", paper=7.0,
            ours=white, unit="dB", tolerance=TOLERANCE_DB,
            remark="variance of the errors of last samples over that of the clusters'",
        ),
        Row(
            quantity=f"the same with a line at {LINE_HZ:.0f} Hz", source="BWG Fig. 27", paper=17.0, ours=coloured,
            unit="dB", tolerance=1.0, explained=True,
            remark=f"the mean of five takes out {limit:.1f} dB of a line there; receiver noise and the motion of the structure "
            "stay beside it",
        ),
    ]  # fmt: skip


def station_gain_db(changes: Changes, seed: int) -> float:
    """Return the fall of the error's variance from the last sample of a cluster to the tracker's error of it."""
    heard: list[Reception] = []
    log = fly(Case("Ka", "monopulse", SECONDS, changes, seed), low_orbit_pass(), heard.append)
    begun_s = first_time_s(log, "monopulse") + SETTLED_S
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=HALF_POWER_BEAMWIDTH_RAD["Ka"]))
    true_s, true = np.array(log.t_s), log.errors_rad()
    misses = []
    tracked = np.array(log.mode) == "monopulse"
    for reception in (
        item for item, used in zip(heard, tracked, strict=True) if used and item.cluster.t_s[0] > begun_s
    ):
        cluster = reception.cluster
        last = replace(
            cluster, t_s=cluster.t_s[-2:], sum=cluster.sum[[-1, -1]],
            difference_cross_elevation=cluster.difference_cross_elevation[[-1, -1]],
            difference_elevation=cluster.difference_elevation[[-1, -1]],
        )  # fmt: skip
        rows = []
        for part, t_s in ((last, float(cluster.t_s[-1])), (cluster, float(np.mean(cluster.t_s)))):
            error = tracker.measure(part)
            rows.append([error.cross_elevation_rad, error.elevation_rad] - _at(t_s, true_s, true))
        misses.append(rows)
    single, averaged = np.var(np.array(misses), axis=0).sum(axis=1)
    return 10.0 * math.log10(float(single / averaged))


def _signal(values: dict[str, float]) -> dict[str, object]:
    return {f"signal.{name}": value for name, value in values.items()}


def _at(t_s: float, times: Array, values: Array) -> Array:
    return np.array([np.interp(t_s, times, column) for column in values.T])
