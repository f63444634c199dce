"""Speed of the radio tracking core.  Run: scripts/run-python benchmarks/tracking.py

Prints, for each task, the least processor time of several runs, which a busy machine does not stretch; the first four
have limits, and the exit status says whether they are kept.
"""

import itertools
import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rf_pointing.core import MDEG, MU, CarrierPower, MonopulseCluster, random_stream
from rf_pointing.rf import Beam, BeamParams, MonopulseFeed, MonopulseFeedParams, Receiver, ReceiverParams
from rf_pointing.tracking import (
    Autotrack,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
    LockWatch,
    LockWatchParams,
    MonopulseParams,
    MonopulseTracker,
    SkyMotion,
    TrimFilter,
    TrimParams,
)
from rf_pointing.tracking.beam_fit import beam_design, fit_beam
from rf_pointing.tracking.conscan import ConscanTracker
from rf_pointing.tracking.conscan_estimate import ConscanParams

UPDATE_LIMIT_S = 100e-6
MONTE_CARLO_LIMIT_S = 5.0
H, RADIUS = 17.0 * MDEG, 1.55 * MDEG
RUNS = 10_000


def best_s(task: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of `repeats` runs, all threads together."""
    times = []
    for _ in range(repeats):
        start = time.process_time_ns()
        task()
        times.append(1e-9 * (time.process_time_ns() - start))
    return min(times)


def conscan_update() -> Callable[[], object]:
    """Return the task of one sample and one estimate of a full 32-sample window."""
    tracker = ConscanTracker(ConscanParams(half_power_beamwidth_rad=H, radius_rad=RADIUS, updates="sample"))
    rng, samples = random_stream(1, "benchmark"), []
    for k in range(33):
        x, y = RADIUS * math.cos(0.2 * k), RADIUS * math.sin(0.2 * k)
        mean = 1000.0 * math.exp(-MU * ((3.0 * MDEG - x) ** 2 + y**2) / H**2)
        power = mean + math.sqrt(2.0 * mean) * rng.standard_normal()
        carrier = CarrierPower(
            t_s=float(k), integration_s=1.0, power_w=power, sigma_w=math.sqrt(2.0 * power), carrier_to_noise_db_hz=30.0
        )
        samples.append((carrier, x, y))
    for sample in samples[:-1]:
        tracker.add(*sample)
    full = tracker.state

    def update() -> object:
        tracker.state = full
        return tracker.add(*samples[-1])

    return update


def monte_carlo() -> object:
    """10 000 estimates of the exact estimator in one batch, noise included."""
    angle = 2.0 * np.pi * np.arange(1, 33) / 32
    x, y = RADIUS * np.cos(angle), RADIUS * np.sin(angle)
    mean = 1000.0 * np.exp(-MU * ((3.0 * MDEG - x) ** 2 + y**2) / H**2)
    power = mean + np.sqrt(2.0 * mean) * random_stream(1, "batch").standard_normal((RUNS, 32))
    return fit_beam(beam_design(np.column_stack([x, y]), H), power, np.full(32, 2.0))


def monopulse_monte_carlo(tracker: MonopulseTracker, clusters: list[MonopulseCluster]) -> object:
    """One error for each of the clusters, as the live tracker measures them."""
    return [tracker.measure(cluster) for cluster in clusters]


def main() -> int:
    """Print the table; return 1 if a limit is missed."""
    beam = BeamParams.for_band("Ka")
    receiver = Receiver(
        ReceiverParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), random_stream(1, "receiver")
    )
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=H))
    offset, clock = np.full(5, 2.0 * MDEG), [0.1 * RUNS + 1.0]

    def receive() -> object:
        clock[0] += 0.1
        return receiver.cluster(clock[0] + 0.02 * np.arange(5), offset, offset, 45.0, 0.02)

    cluster = receiver.cluster(-1.0 + 0.02 * np.arange(5), offset, offset, 45.0, 0.02)
    error = tracker.measure(cluster)
    watch, trim, table = LockWatch(LockWatchParams()), TrimFilter(TrimParams()), Autotrack(AutotrackParams())
    sky = SkyMotion(0.005, 0.003, 1e6)
    inputs = AutotrackInputs(
        t_s=1.0, request="track", target_available=True, on_target=True, carrier_to_noise_db_hz=45.0
    )
    later = itertools.count(1)

    def observe() -> object:
        return watch.add(replace(error, t_s=0.1 * next(later)), 0.0, 0.0)

    update_s, batch_s = best_s(conscan_update(), 3000), best_s(monte_carlo, 3)
    noisy = [receiver.cluster(0.1 * k + 0.02 * np.arange(5), offset, offset, 45.0, 0.02) for k in range(1, RUNS + 1)]
    error_s, errors_s = (
        best_s(lambda: tracker.measure(cluster), 1000),
        best_s(lambda: monopulse_monte_carlo(tracker, noisy), 3),
    )
    rows = [
        (f"conscan update, window of 32, limit {UPDATE_LIMIT_S * 1e6:.0f} us", update_s),
        (f"{RUNS} conscan estimates in one batch, limit {MONTE_CARLO_LIMIT_S:.0f} s", batch_s),
        (f"monopulse error of a cluster of 5, limit {UPDATE_LIMIT_S * 1e6:.0f} us", error_s),
        (f"{RUNS} monopulse errors, limit {MONTE_CARLO_LIMIT_S:.0f} s", errors_s),
        ("cluster of 5 from the simulated receiver", best_s(receive, 1000)),
        ("watch on one error", best_s(observe, 1000)),
        ("trim update", best_s(lambda: trim.update(1.0, np.zeros(2), error.covariance_rad2, sky), 1000)),
        ("autotrack tick", best_s(lambda: table.step(AutotrackState(mode="monopulse"), inputs), 1000)),
    ]
    for name, seconds in rows:
        print(f"{seconds * 1e6:12.1f} us  {name}")
    return int(max(update_s, error_s) > UPDATE_LIMIT_S or max(batch_s, errors_s) > MONTE_CARLO_LIMIT_S)


if __name__ == "__main__":
    sys.exit(main())
