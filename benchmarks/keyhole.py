"""Predicted against simulated loss on passes near the zenith; `scripts/run-python benchmarks/keyhole.py --passes N`.

Every pass is another one: lasting low orbits of the verification set and generated ones, over the stations of the
catalogue, on seven days.  Each is planned, then flown: the controller of the graph on program track, the simulated antenna
with its loops, drives and structure in calm air.  Loss is counted from where the beam really was.
"""

import argparse
import dataclasses
import math

import numpy as np

from rf_pointing.core.dates import utc_text
from rf_pointing.papers.keyhole import KeyholeRun, fly
from rf_pointing.papers.keyhole_passes import high_passes, station_mount
from rf_pointing.station.antenna.mount import MountParams

LOSSES = {"signal_s": "signal lost, s", "below_s": "below half power, s", "db_s": "loss, dB s"}


def main() -> None:
    """Fly the passes, print each, and the errors of the prediction."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=int, default=100, help="passes to certify")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--mount", action="store_true", help="with the errors of a real mount, lags included")
    parser.add_argument("--over", action="store_true", help="the dish may go over the top")
    options = parser.parse_args()
    mount = station_mount() if options.mount else MountParams()
    print(f"{'orbit':<16}{'station':<20}{'AOS':<21}{'peak':>6}{'beam':>7}{'keyhole':>8}       predicted / simulated: "
          + "; ".join(LOSSES.values()))  # fmt: skip
    runs: list[KeyholeRun] = []
    easy = 0
    for case in high_passes(options.passes, options.seed):
        run = fly(dataclasses.replace(case, mount=mount, over=options.over))
        if run is None:
            easy += 1
            continue
        runs.append(run)
        print(row(run), flush=True)
    print(f"{len(runs)} passes flown through the zenith, {easy} that the axes can follow")
    for name, text in LOSSES.items():
        print(f"{text}: {errors(runs, name)}")


def row(run: KeyholeRun) -> str:
    """Return one pass in words."""
    way = " over" if run.over else "     "
    pairs = "; ".join(f"{getattr(run.predicted, name):.2f} / {getattr(run.simulated, name):.2f}" for name in LOSSES)
    return (f"{run.name[:15]:<16}{run.station[:19]:<20}{utc_text(run.aos_t_s)[:19]:<21}{math.degrees(run.peak_rad):>6.2f}"
            f"{math.degrees(run.beamwidth_rad):>7.3f}{run.keyhole_s:>8.1f}{way}  {pairs}")  # fmt: skip


def errors(runs: list[KeyholeRun], name: str) -> str:
    """Return simulated minus predicted in words, in units and relative to the prediction."""
    predicted, simulated = (
        np.array([getattr(getattr(r, side), name) for r in runs]) for side in ("predicted", "simulated")
    )
    error = simulated - predicted
    return (f"{predicted.min():.1f} to {predicted.max():.1f} predicted; simulated minus predicted {error.mean():+.3f} mean, "
            f"{error.std():.3f} standard deviation, {np.abs(error).max():.3f} largest")  # fmt: skip


if __name__ == "__main__":
    main()
