"""How fast the memory of each node grows during a pass of the live graph.

    scripts/run-python benchmarks/memory_growth.py [--settle S] [--seconds S] [--station NAME] [--satellite N] [--speed X]

Runs the executable `track` as a user would and reads the anonymous resident memory of its nodes
from the kernel.  After `--settle` seconds a straight line is fitted to means over 20 s.  Prints its
slope and standard error in MB per hour of wall time, and the pages of 4 kB by which a node grew:
growth that comes in a few steps is no line yet, and its standard error is too small.
"""

import argparse
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from ament_index_python.packages import get_package_prefix
from numpy.typing import NDArray

PERIOD_S = 1.0
MEAN_S = 20.0
HOUR_S = 3600.0
PAGE_KB = 4


def anonymous_kb(parent: int) -> dict[str, int]:
    """Return the anonymous resident memory in kB of each child of `parent`, by executable."""
    found = {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
            words = (folder / "cmdline").read_text().split("\0")
        except OSError:
            # It has ended in the meantime.
            continue
        if int(status["PPid"]) == parent and "RssAnon" in status:
            executable = next((word for word in words if f"{os.sep}rf_pointing{os.sep}" in word), words[0])
            found[Path(executable).name] = int(status["RssAnon"].split()[0])
    return found


def slope(times_s: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Return slope and standard error of a line through means over `MEAN_S`."""
    block = (times_s // MEAN_S).astype(int)
    # Neighbouring samples agree, so each of them counts for less than one: means nearly do not.
    chosen = [block == number for number in np.unique(block)]
    t_s = np.array([times_s[rows].mean() for rows in chosen])
    means = np.array([values[rows].mean() for rows in chosen])
    (gradient, _), covariance = np.polyfit(t_s, means, 1, cov=True)
    return float(gradient), float(np.sqrt(covariance[0, 0]))


def main() -> None:
    """Run a pass and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--settle", type=float, default=180.0, help="seconds from the start left out")
    parser.add_argument("--seconds", type=float, default=600.0, help="seconds that are measured after that")
    parser.add_argument("--station", default="dss13", help="station of `track`")
    parser.add_argument("--satellite", default="8195", help="satellite of `track`; the default is up for hours")
    parser.add_argument("--speed", default="1", help="speed of the clock: 1 or faster")
    options = parser.parse_args()
    executable = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / "track"
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [
                str(executable), "--models", "", "--output", f"{folder}/run",
                "--station", options.station, "--satellite", options.satellite, "--speed", options.speed,
            ],
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        begun_s, rows = time.monotonic(), []
        while (t_s := time.monotonic() - begun_s) < options.settle + options.seconds and process.poll() is None:
            if t_s >= options.settle:
                rows.append((t_s, anonymous_kb(process.pid)))
            time.sleep(PERIOD_S)
        process.terminate()
        process.wait()
    times_s = np.array([t_s for t_s, _ in rows])
    if not times_s.size or np.ptp(times_s) < 4 * MEAN_S:
        parser.error(f"the pass ended {options.settle:.0f} s after its start or soon after: nothing to measure")
    print(f"measured for {np.ptp(times_s):.0f} s at speed {options.speed}")
    print("| node | MB | MB/h | standard error | grew by pages |\n|---|---|---|---|---|")
    # Nodes that lived all the time: one that was started again has another memory.
    for name in sorted(set.intersection(*(set(sizes) for _, sizes in rows))):
        kb = np.array([sizes[name] for _, sizes in rows], dtype=float)
        rate, error = np.multiply(slope(times_s, kb), HOUR_S / 1024.0)
        print(f"| {name} | {kb[-1] / 1024:.1f} | {rate:+.2f} | {error:.2f} | {(kb[-1] - kb[0]) / PAGE_KB:+.0f} |")


if __name__ == "__main__":
    main()
