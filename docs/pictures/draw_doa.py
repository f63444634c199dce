#!/usr/bin/env python3
"""Draw the pictures of docs/math/doa.md: accuracy of MUSIC beside its bound, and convergence of the attitude.

scripts/run-python docs/pictures/draw_doa.py
"""

from pathlib import Path

from rf_pointing.papers.doa_study.accuracy import accuracy_curve, draw_accuracy, draw_convergence
from rf_pointing.papers.doa_study.attitude_runs import RunTask, run
from rf_pointing.papers.doa_study.directions import DirectionCase

FOLDER = Path(__file__).parents[1] / "math"
SNAPSHOTS = 100
SNR_DB = (-14.0, -13.0, -12.0, -11.0, -10.0, -9.0, -8.0, -6.0, -4.0, -2.0, 0.0, 4.0, 8.0, 14.0)
CASES = (
    DirectionCase(snapshots=SNAPSHOTS, snr_db=0.0),
    DirectionCase(snapshots=SNAPSHOTS, snr_db=0.0, refined=False),
    DirectionCase(snapshots=SNAPSHOTS, snr_db=-10.0),
)
CONVERGENCE = RunTask(cases=CASES, trials=8, seed=1, duration_s=1500.0, settled_s=1000.0, pool=4000)


def main() -> None:
    """Write both pictures."""
    draw_accuracy(accuracy_curve(SNAPSHOTS, SNR_DB), SNAPSHOTS, FOLDER / "doa_accuracy.png")
    draw_convergence(run(CONVERGENCE), FOLDER / "doa_convergence.png")


if __name__ == "__main__":
    main()
