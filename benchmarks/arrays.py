"""Speed of the direction-of-arrival core.  Run: python benchmarks/arrays.py [--tables] [--workers N] [--music-inside]

Times MUSIC for the 12-element array, refined to better than 1e-4 deg, per estimate in a batch (limit 150 us), beside a
1-deg grid search by pyargus on the same covariances where it is installed (limit: 20 times faster, RMSE not worse) and
beside our own 1-deg grid search.  doatools has no release on PyPI and is not compared; pyargus 1.1 needs
numpy < 2.4.  `--tables` runs Tables 1 and 2
completely: 14 rows, 200 trials, 20 000 steps, refined and on the grid (limits: 10 min on 2 workers, 4 GB).
The exit status says whether the limits are kept.
"""

import argparse
import importlib
import resource
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from numpy.typing import NDArray

from rf_pointing.arrays.circular_array import CircularArrayParams, steering
from rf_pointing.arrays.covariance import sample_covariance
from rf_pointing.arrays.music import estimate_directions
from rf_pointing.arrays.polar_direction import direction_from_polar, polar_errors_rad
from rf_pointing.arrays.search_grid import grid_search
from rf_pointing.arrays.snapshots import draw_covariances, draw_snapshots
from rf_pointing.geometry import random_stream
from rf_pointing.reproduce.doa import run_tables

ARRAY = CircularArrayParams()
LIMIT_US, RATIO, TABLES_S, TABLES_GB = 150.0, 20.0, 600.0, 4.0
SNR, SNAPSHOTS, STEP_RAD = 1.0, 100, np.radians(1.0)
REFINED_RAD = np.radians(1e-4)


def main() -> None:
    """Print the times; exit with 1 where a limit is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", action="store_true", help="run Tables 1 and 2 in full")
    parser.add_argument("--music-inside", action="store_true", help="with --tables: MUSIC at every step and trial")
    parser.add_argument("--workers", type=int, default=2, help="processes for --tables (default: 2)")
    options = parser.parse_args()
    kept = music()
    if options.tables:
        kept = tables(options.workers, options.music_inside) and kept
    sys.exit(0 if kept else 1)


def music() -> bool:
    """Time MUSIC in batches and against grid searches; return whether the limits are kept."""
    stream = random_stream(1, "benchmark")
    count = 4000
    polar = np.radians(stream.uniform(10.0, 60.0, count))
    truth = direction_from_polar(polar, stream.uniform(0.0, 2.0 * np.pi, count))
    covariance = draw_covariances(ARRAY, truth, SNR, SNAPSHOTS, stream)
    ours_us, refined = best_us(lambda: estimate_directions(ARRAY, covariance).direction, count)
    snapshots = draw_snapshots(ARRAY, truth[:, None], np.array([[SNR + 0j]]), SNAPSHOTS, stream)
    whole_us, _ = best_us(lambda: estimate_directions(ARRAY, sample_covariance(snapshots)).direction, count)
    print(f"MUSIC, refined, from covariances   {ours_us:9.1f} us   limit {LIMIT_US:.0f} us")
    print(f"MUSIC, refined, from 100 snapshots {whole_us:9.1f} us   limit {LIMIT_US:.0f} us")
    repeat = np.degrees(residual_rad(covariance, refined))
    print(f"left to the exact peak             {repeat:9.1e} deg  limit {np.degrees(REFINED_RAD):.0e} deg")
    own_us, own = best_us(lambda: grid_search(ARRAY, covariance[:300], STEP_RAD), 300)
    rmse = [np.degrees(rmse_rad(found, truth[: len(found)])) for found in (refined, own)]
    print(f"our 1-deg grid search              {own_us:9.1f} us   {own_us / ours_us:.0f} times ours")
    print(f"RMSE on the sky                    {rmse[0]:9.3f} deg refined, {rmse[1]:.3f} deg on the grid")
    kept = max(ours_us, whole_us) <= LIMIT_US and np.radians(repeat) <= REFINED_RAD
    return against_pyargus(covariance, truth, refined, ours_us) and kept


def against_pyargus(
    covariance: NDArray[np.complex128], truth: NDArray[np.float64], refined: NDArray[np.float64], ours_us: float
) -> bool:
    """Time pyargus on a 1-deg grid over the first covariances; return whether ours is 20 times faster and not worse."""
    try:
        estimation = importlib.import_module("pyargus.directionEstimation")
    except ImportError:
        print("pyargus                                  not installed: not compared")
        return True
    theta, phi = np.meshgrid(np.radians(np.arange(0.0, 62.0)), np.radians(np.arange(360.0)), indexing="ij")
    nodes = direction_from_polar(theta.ravel(), phi.ravel())
    vectors = steering(ARRAY, nodes).T
    count = 6

    def search() -> NDArray[np.float64]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            spectra = [estimation.DOA_MUSIC(each, vectors, 1) for each in covariance[:count]]
        return nodes[[int(np.argmax(np.abs(spectrum))) for spectrum in spectra]]

    try:
        peer_us, found = best_us(search, count, runs=1)
    except TypeError as error:
        print(f"pyargus                                  fails with numpy {np.__version__} ({error}): not compared")
        return True
    ratio = peer_us / ours_us
    peer, ours = (np.degrees(rmse_rad(each[:count], truth[:count])) for each in (found, refined))
    print(f"pyargus, 1-deg grid                {peer_us:9.0f} us   {ratio:.0f} times ours, limit {RATIO:.0f}")
    print(f"same {count} covariances                 {ours:9.3f} deg ours, {peer:.3f} deg pyargus")
    return bool(ratio >= RATIO and ours <= 1.2 * peer)


def tables(workers: int, music_inside: bool) -> bool:
    """Time Tables 1 and 2 in full; return whether the limits are kept."""
    start = time.perf_counter()
    with ProcessPoolExecutor(workers) as executor:
        results = run_tables(1, 200, executor, music_inside=music_inside).rows
    elapsed = time.perf_counter() - start
    peak = [resource.getrusage(who).ru_maxrss / 1e6 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    memory = peak[0] + workers * peak[1]
    print("   L     SNR   search   theta     phi     yaw    roll   pitch  (deg)  locked wrong")
    for case, found in results.items():
        angles = "".join(
            f"{value:8.3f}"
            for value in (found.theta_deg, found.phi_deg, found.yaw_deg, found.roll_deg, found.pitch_deg)
        )
        lost = int(np.sum(found.history_deg[-1] > 10.0))
        search = "refined" if case.refined else "1 deg  "
        print(f"{case.snapshots:5d} {case.snr_db:6.0f}   {search}{angles}           {lost:3d} of 200")
    print(f"Tables 1 and 2, {workers} workers: {elapsed:.0f} s (limit {TABLES_S:.0f} s), {memory:.1f} GB (limit 4 GB)")
    return music_inside or (elapsed <= TABLES_S and memory <= TABLES_GB)


def best_us(task, count: int, runs: int = 3) -> tuple[float, NDArray[np.float64]]:  # type: ignore[no-untyped-def]
    """Return the shortest time per item of `runs` calls, in microseconds, and the result."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = task()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times) / count, result


def residual_rad(covariance: NDArray[np.complex128], found: NDArray[np.float64]) -> float:
    """Return the largest step that one more refinement would take."""
    from rf_pointing.arrays.music import principal_eigenvectors
    from rf_pointing.arrays.peak_refinement import refine_peaks

    again = refine_peaks(ARRAY, principal_eigenvectors(covariance, ARRAY.elements)[:, :, None], found)
    return float(np.max(np.linalg.norm(again.direction - found, axis=-1)))


def rmse_rad(found: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the root mean square angle on the sky."""
    polar, _, cross = polar_errors_rad(found, truth)
    return float(np.sqrt(np.mean(polar**2 + cross**2)))


if __name__ == "__main__":
    main()
