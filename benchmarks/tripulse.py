"""Speed of the Tripulse core.  Run: python benchmarks/tripulse.py [--workers N]

Prints, for each task, the best of three runs; the first has a limit (5 s), and the exit status says whether it is kept.
"""

import argparse
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from rf_pointing.arrays.tripulse_array import TripulseArrayParams
from rf_pointing.arrays.tripulse_beams import closed_form_signals
from rf_pointing.arrays.tripulse_montecarlo import failed_element_errors
from rf_pointing.arrays.tripulse_receiver import TripulseReceiver
from rf_pointing.arrays.tripulse_robust import posterior_projection_error, signal_matrix
from rf_pointing.arrays.tripulse_signal import TripulseSignalParams
from rf_pointing.arrays.tripulse_source import StationLine, TripulseSource, TripulseSourceParams
from rf_pointing.attitude.two_station import bisector_rotation
from rf_pointing.attitude.wahba import fit_rotation
from rf_pointing.geometry import random_stream
from rf_pointing.reproduce.tripulse import failed_share_at_limit

FAILURE_LIMIT_S = 5.0
ARRAY = TripulseArrayParams()


def best_of_three_s(task: Callable[[], object]) -> float:
    """Return the shortest of three runs."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


def failures() -> object:
    """20 000 arrangements of 38 dead elements among 256."""
    return failed_element_errors(ARRAY, 38, (0.0, 0.0), (np.radians(0.1), 0.0), 20_000)


def posteriors() -> object:
    """1000 weak-signal estimates."""
    signals = closed_form_signals(ARRAY, np.full((1000, 2), 3e-4))[:, None, :]
    noises = np.full(3, float(ARRAY.n_total**2))
    return posterior_projection_error(ARRAY, signal_matrix(signals, noises), 1, noises, (5.8e-4, 5.8e-4))


def frame_receiver() -> Callable[[], object]:
    """Return the task of measuring 100 frames of samples."""
    signal = TripulseSignalParams()
    line = StationLine(name="a", direction=np.array([0.0, 0.6, 0.8]), range_rate_m_s=10.0, elevation_rad=1.0)
    (frame,) = TripulseSource(ARRAY, signal, TripulseSourceParams(), seed=1).step(0.0, np.eye(3), [line])
    receiver = TripulseReceiver(array=ARRAY, signal=signal)
    return lambda: [receiver.measure(frame) for _ in range(100)]


def main() -> int:
    """Print the table; return 1 if the failed-element trials miss their limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=0, help="also run the sweep of dead elements on N processes")
    workers = parser.parse_args().workers
    pairs = random_stream(1, "benchmark").normal(size=(2, 10_000, 2, 3))
    reference, measured = pairs / np.linalg.norm(pairs, axis=-1, keepdims=True)
    failure_s = best_of_three_s(failures)
    table = [
        (f"20 000 trials of dead elements, limit {FAILURE_LIMIT_S} s", failure_s, 1),
        ("frame of 960 samples to line of sight", best_of_three_s(frame_receiver()), 100),
        ("weak-signal posterior", best_of_three_s(posteriors), 1000),
        ("attitude of two stations, SVD", best_of_three_s(lambda: fit_rotation(reference, measured)), 10_000),
        ("attitude of two stations, bisector", best_of_three_s(lambda: bisector_rotation(reference, measured)), 10_000),
        ("sweep over dead elements, 9 x 20 000, this process", best_of_three_s(failed_share_at_limit), 1),
    ]
    if workers > 0:
        with ProcessPoolExecutor(workers) as executor:
            shared_s = best_of_three_s(lambda: failed_share_at_limit(1, executor))
        table.append((f"the same sweep, {workers} processes", shared_s, 1))
    for name, seconds, count in table:
        print(f"{seconds / count * 1e3:12.4f} ms  {name}")
    return int(failure_s > FAILURE_LIMIT_S)


if __name__ == "__main__":
    sys.exit(main())
