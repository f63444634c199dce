"""Predicted against simulated loss on real passes near the zenith; `scripts/run-python benchmarks/keyhole.py --passes N`.

Each pass is planned, then flown: the controller of the graph on program track, the simulated antenna with its loops,
drives and structure in calm air.  Loss is counted from where the beam really was.
"""

import argparse
import math

import numpy as np

from rf_pointing.simulation.keyhole import KeyholeRun, fly, high_passes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(f"{'peak deg':>9}{'beam mdeg':>11}{'keyhole s':>11}{'lost signal s: predicted':>26}{'simulated':>11}"
          f"{'below half power s: predicted':>31}{'simulated':>11}")  # fmt: skip
    runs: list[KeyholeRun] = []
    for case in high_passes(options.passes, options.seed):
        run = fly(case)
        runs.append(run)
        print(f"{math.degrees(run.peak_rad):>9.2f}{1000.0 * math.degrees(run.beamwidth_rad):>11.0f}{run.keyhole_s:>11.1f}"
              f"{run.predicted_lost_s:>26.2f}{run.simulated_lost_s:>11.2f}"
              f"{run.predicted_below_s:>31.1f}{run.simulated_below_s:>11.1f}")  # fmt: skip
    for name in ("lost", "below"):
        error = np.array([getattr(r, f"simulated_{name}_s") - getattr(r, f"predicted_{name}_s") for r in runs])
        print(f"{name}: simulated minus predicted {error.mean():+.3f} s mean, {error.std():.3f} s standard deviation, "
              f"{np.abs(error).max():.3f} s largest")  # fmt: skip


if __name__ == "__main__":
    main()
