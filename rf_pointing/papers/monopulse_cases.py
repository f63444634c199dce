"""The monopulse experiments behind the published rows: averaging in the tracker, honesty, false locks."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, MonopulseCluster
from rf_pointing.rf import (
    HALF_POWER_BEAMWIDTH_RAD,
    Beam,
    BeamParams,
    MonopulseFeed,
    MonopulseFeedParams,
    Receiver,
    ReceiverParams,
)
from rf_pointing.tracking import LockWatch, LockWatchParams, MonopulseParams, MonopulseTracker

__all__ = ["averaging_gain_db", "averaging_limit_db", "monopulse_normalised_errors", "sidelobe_lock_s"]

Array = NDArray[np.float64]

BEAM_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
SAMPLE_S = 0.02
CLUSTER = 5
CLUSTER_S = CLUSTER * SAMPLE_S


def averaging_gain_db(cutoff_hz: float, clusters: int, rng: np.random.Generator) -> float:
    """Return the fall of the error's variance from the last sample of a cluster to the tracker's average of it.

    The noise is flat from `cutoff_hz` to the Nyquist frequency of 25 Hz (BWG Fig. 25); 20 dB below the sum.
    """
    count = clusters * CLUSTER
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum[np.fft.rfftfreq(count, SAMPLE_S) < cutoff_hz] = 0.0
    noise = np.fft.irfft(spectrum, count)
    noise *= 0.1 / np.std(noise)
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    errors = [tracker.measure(_clean_cluster(part)).cross_elevation_rad for part in noise.reshape(clusters, CLUSTER)]
    last = noise[CLUSTER - 1 :: CLUSTER] * BEAM_RAD / tracker.params.slope
    return 10.0 * math.log10(float(np.var(last) / np.var(errors)))


def averaging_limit_db(cutoff_hz: float) -> float:
    """Return that gain in closed form: 1 / mean |sin(5 x) / (5 sin x)|^2, x = pi f T, over the band of the noise."""
    x = math.pi * SAMPLE_S * np.linspace(max(cutoff_hz, 1e-3), 0.5 / SAMPLE_S, 20001)
    passed = (np.sin(CLUSTER * x) / (CLUSTER * np.sin(x))) ** 2
    return -10.0 * math.log10(float(np.mean(passed)))


def _clean_cluster(difference: Array) -> MonopulseCluster:
    return MonopulseCluster(
        t_s=SAMPLE_S * np.arange(CLUSTER, dtype=np.float64),
        sum=np.ones(CLUSTER, dtype=np.complex128),
        difference_cross_elevation=difference.astype(np.complex128),
        difference_elevation=np.zeros(CLUSTER, dtype=np.complex128),
        carrier_to_noise_db_hz=60.0,
    )


def monopulse_normalised_errors(level_db_hz: float, error_rad: Array, runs: int, rng: np.random.Generator) -> Array:
    """Return e^T C^-1 e / 2 of `runs` clusters of the live receiver and tracker, after 20 s for its noise estimate."""
    beam = BeamParams.for_band("Ka")
    receiver = Receiver(ReceiverParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), rng)
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    settling, values = 200, []
    for k in range(settling + runs):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(CLUSTER)
        x, y = np.repeat(error_rad[:, None], CLUSTER, axis=1)
        error = tracker.measure(receiver.cluster(times, x, y, level_db_hz, SAMPLE_S))
        if k >= settling and error.valid:
            miss = np.array([error.cross_elevation_rad, error.elevation_rad]) - error_rad
            values.append(0.5 * float(miss @ np.linalg.solve(error.covariance_rad2, miss)))
    return np.array(values)


def false_null_rad() -> float:
    """Return the offset of the first false null of a uniform aperture: difference zero, sum a sidelobe."""
    feed = MonopulseFeed(MonopulseFeedParams(), BeamParams.for_band("Ka", "uniform"))
    angle = np.linspace(1.05, 1.8, 3001) * BEAM_RAD
    volts = feed.voltages(angle, np.zeros_like(angle))
    ratio = (volts.difference_cross_elevation / volts.sum).real
    rising = (ratio[:-1] < 0.0) & (ratio[1:] > 0.0) & (np.diff(ratio) < 0.1)
    return float(angle[:-1][rising][0])


def sidelobe_lock_s(rng: np.random.Generator) -> tuple[str, float]:
    """Return what the watch says of a loop that sits on the sidelobe of a uniform aperture, and when.

    Ka band, 60 dB-Hz on the main beam, integrator of 0.1 Hz, starting 0.5 mdeg from the false null; an antenna that
    follows at once.  The watch compares C/N0 with the link's: the false null is so steep that the beam hardly moves.
    """
    beam = BeamParams.for_band("Ka", "uniform")
    receiver = Receiver(ReceiverParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), rng)
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=BEAM_RAD))
    target, beam_at = np.array([false_null_rad() + 0.5 * MDEG, 0.0]), np.zeros(2)
    for k in range(100):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(1, CLUSTER + 1)
        x, y = np.repeat((target - beam_at)[:, None], CLUSTER, axis=1)
        error = tracker.measure(receiver.cluster(times, x, y, 60.0, SAMPLE_S))
        fault = watch.add(error, float(beam_at[0]), float(beam_at[1]), 60.0)
        if fault:
            return fault, float(times[-1])
        if error.valid:
            step = np.array([error.cross_elevation_rad, error.elevation_rad])
            beam_at = beam_at + 2.0 * math.pi * 0.1 * CLUSTER_S * step
    return "nothing found", math.inf
