"""Pictures of the DOA study: RMSE of theta and phi beside the Cramer-Rao bound, and the convergence of the attitude."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rf_pointing.papers.doa_study.accuracy import AccuracyPoint
from rf_pointing.papers.doa_study.attitude_runs import CaseResult

__all__ = ["draw_accuracy", "draw_convergence"]


def draw_accuracy(curve: Sequence[AccuracyPoint], snapshots: int, path: Path) -> None:
    """Write theta and phi over SNR: refined, 1-deg grid, bound; and the share of outliers, which shows the threshold."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    axes = figure.subplots(1, 3)
    snr_db = [point.snr_db for point in curve]
    for panel, angle in zip(axes[:2], ("theta", "phi"), strict=True):
        panel.semilogy(snr_db, [getattr(p, f"{angle}_bound_deg") for p in curve], "k-", label="Cramér-Rao bound")
        panel.semilogy(snr_db, [getattr(p, f"{angle}_deg") for p in curve], "o", label="MUSIC, refined peak")
        panel.semilogy(snr_db, [getattr(p, f"grid_{angle}_deg") for p in curve], "x", label="MUSIC, 1° grid")
        panel.set(xlabel="SNR per element (dB)", ylabel=f"RMSE of {angle} (deg)", title=f"{angle}, L = {snapshots}")
        panel.grid(visible=True, which="both", alpha=0.3)
    axes[0].legend()
    axes[2].plot(snr_db, [100.0 * p.outliers for p in curve], "o-")
    axes[2].set(xlabel="SNR per element (dB)", ylabel="errors beyond 20° (%)", title="outliers: the threshold")
    axes[2].grid(visible=True, alpha=0.3)
    figure.savefig(path, dpi=110)


def draw_convergence(results: Sequence[CaseResult], path: Path) -> None:
    """Write the total attitude error of every trial over time, one panel per case."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(results), squeeze=False)[0]
    for panel, result in zip(axes, results, strict=True):
        panel.semilogy(np.arange(len(result.history_deg)), result.history_deg, lw=0.8)
        found = "refined" if result.case.refined else "1° grid"
        panel.set(title=f"L = {result.case.snapshots}, {result.case.snr_db:g} dB, {found}", xlabel="time (s)")
        panel.set_ylabel("total attitude error (deg)")
        panel.grid(visible=True, which="both", alpha=0.3)
    figure.savefig(path, dpi=110)
