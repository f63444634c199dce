"""Speed of the calibrator: `scripts/run-python benchmarks/calibration.py [--runs N]`.

Times of the fits are processor time of one thread, the least of several repeats, so that other work on the machine
does not count; the Monte Carlo is timed by the clock on one and on two processes.
"""

import argparse
import os
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from rf_pointing.calibration import (  # noqa: E402
    BiasModel,
    FitOptions,
    Observations,
    PriorKnowledge,
    RawPasses,
    RawTracking,
    ReferenceTrack,
    TrackedPass,
    fit_bias_model,
    held_at_zero,
)
from rf_pointing.core import random_stream  # noqa: E402
from rf_pointing.papers.satcal_campaign import APRIL_T_S, IRS_P3_APRIL, ORBIT_PRIORS, PCMC_DEG, SITES, model_of  # noqa: E402
from rf_pointing.papers.satcal_looks import look, visits  # noqa: E402
from rf_pointing.papers.satcal_motion import Gravity, propagate  # noqa: E402

TERMS = tuple(PCMC_DEG["PCMC-1"])
MODEL = model_of(PCMC_DEG["PCMC-1"])
NOISE_RAD = np.radians(0.02)
ALL_ROWS = FitOptions(edit_sigma=0.0, fewest_passes=1)


def random_observations(count: int) -> Observations:
    """Return points all over the sky in one long pass."""
    random = random_stream(1, "benchmark points")
    motion = [random.uniform(0.0, 6.28, count), random.uniform(0.17, 1.4, count)]
    motion += [random.uniform(-size, size, count) for size in (5e-3, 5e-3, 1e-4, 1e-4)]
    offset = MODEL.offset_rad(*motion)
    sigma = np.full(count, 1e-4)
    return Observations(
        station="benchmark",
        band="S",
        t_s=np.arange(count, dtype=np.float64),
        pass_id=np.zeros(count, dtype=np.int64),
        observed_azimuth_rad=motion[0] + offset[0] + 1e-4 * random.standard_normal(count),
        observed_elevation_rad=motion[1] + offset[1] + 1e-4 * random.standard_normal(count),
        true_azimuth_rad=motion[0],
        true_elevation_rad=motion[1],
        azimuth_rate_rad_s=motion[2],
        elevation_rate_rad_s=motion[3],
        azimuth_acceleration_rad_s2=motion[4],
        elevation_acceleration_rad_s2=motion[5],
        sigma_azimuth_rad=sigma,
        sigma_elevation_rad=sigma,
    )


def least_time_s(action: Callable[[], object], repeats: int) -> float:
    """Return the shortest of `repeats` runs."""
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        action()
        times.append(time.thread_time() - start)
    return min(times)


def tracks() -> list[ReferenceTrack]:
    """Return four passes over Sriharikota, sampled every 5 s."""
    site, gravity = SITES["Sriharikota"], Gravity()
    found = visits(site, IRS_P3_APRIL, APRIL_T_S, 2.5, gravity, step_s=5.0, lowest_rad=np.radians(9.0))
    chosen = []
    for k in (0, 3, 6, 8):
        times = found[k].t_s
        states = propagate(APRIL_T_S, IRS_P3_APRIL.state(), times, gravity).states
        chosen.append(ReferenceTrack(**vars(look(times, states, site, gravity))))
    return chosen


def one_campaign(seed: int, references: list[ReferenceTrack]) -> float:
    """Simulate four raw passes, run the whole pipeline and the fit; return the largest pull of a term."""
    random = random_stream(seed, "benchmark campaign")
    passes = []
    for reference in references:
        times = np.arange(reference.t_s[0] + 1.0, reference.t_s[-1], 0.125)
        seen = reference.at(times)
        offset = MODEL.offset_rad(*seen.motion())
        raw = RawTracking(
            station="benchmark",
            band="C",
            target="IRS-P3",
            t_s=times,
            azimuth_rad=seen.azimuth_rad + offset[0] + NOISE_RAD * random.standard_normal(len(times)),
            elevation_rad=seen.elevation_rad + offset[1] + NOISE_RAD * random.standard_normal(len(times)),
            range_m=seen.range_m + 10.0 * random.standard_normal(len(times)),
            range_rate_m_s=seen.range_rate_m_s + 0.05 * random.standard_normal(len(times)),
            good=np.ones(len(times), dtype=bool),
        )
        passes.append(TrackedPass(raw, reference))
    together = RawPasses(passes, 0).process(PriorKnowledge(model=BiasModel.zero(), form="printed")).points
    result = fit_bias_model(together, terms=TERMS, held=held_at_zero(TERMS), pass_priors=ORBIT_PRIORS)
    truth = np.array([MODEL.coefficients[name] for name in TERMS])
    return float(np.max(np.abs(result.values - truth) / result.sigma))


def many_campaigns(seeds: range) -> list[float]:
    """Return the largest pull of each run."""
    references = tracks()
    return [one_campaign(seed, references) for seed in seeds]


def monte_carlo(runs: int, processes: int) -> tuple[float, float]:
    """Return seconds and the median pull of `runs` campaigns on `processes`."""
    shares = [range(k, runs, processes) for k in range(processes)]
    start = time.perf_counter()
    with ProcessPoolExecutor(processes) as pool:
        pulls = [pull for share in pool.map(many_campaigns, shares) for pull in share]
    return time.perf_counter() - start, float(np.median(pulls))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="Monte Carlo runs of the whole pipeline")
    options = parser.parse_args()
    runs = options.runs
    for count, repeats in ((1_000_000, 3), (400, 100)):
        points = random_observations(count)
        seconds = least_time_s(partial(fit_bias_model, points, options=ALL_ROWS), repeats)
        print(f"{count} observations x 14 terms: {1e3 * seconds:.1f} ms")
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"memory, data included: {most:.0f} MB")
    many_campaigns(range(1))
    one, _ = monte_carlo(max(runs // 5, 1), 1)
    two, pull = monte_carlo(runs, 2)
    per_run = one / max(runs // 5, 1)
    print(f"whole pipeline, 4 passes at 8 samples/s: {1e3 * per_run:.0f} ms per run on one process")
    print(f"{runs} runs on two processes: {two:.1f} s, {per_run * runs / two:.2f} times one process")
    print(f"median over runs of the largest pull of 9 terms: {pull:.2f}")


if __name__ == "__main__":
    main()
