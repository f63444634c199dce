"""Picture of the graph's timing: how far commands run ahead, and how long each hop takes."""

from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.report.analysis import Analysis
from rf_pointing.report.picture_style import AXIS_COLOURS, MODE_COLOURS, TimeAxis, figure, plain_log_scale
from rf_pointing.report.traffic import latencies

__all__ = ["draw_timing"]


def draw_timing(analysis: Analysis, path: Path) -> None:
    """Command lead over time at the left, latency of each hop (median to 99th percentile) at the right."""
    with figure(path, 10.0, 3.8) as drawn:
        left, right = drawn.subplots(1, 2, width_ratios=(1.0, 1.1))
        _draw_lead(left, analysis)
        _draw_hops(right, analysis)


def _draw_lead(axes: Any, analysis: Analysis) -> None:
    time = TimeAxis(analysis)
    antenna = analysis.recording.get("antenna_status")
    if analysis.modes is not None:
        chosen = analysis.modes.is_tracking_at(analysis.modes.stamp_ns)
        lead = np.where(chosen, analysis.modes.columns["command_lead"], np.nan)
        axes.plot(time.minutes(analysis.modes.stamp_ns), lead, color=AXIS_COLOURS[0], label="sent by the controller")
    if antenna is not None and antenna.stamp_ns is not None:
        lead = np.where(antenna["mode"] == "tracking", antenna["command_lead"], np.nan)
        axes.plot(time.minutes(antenna.stamp_ns), lead, color=AXIS_COLOURS[1], lw=0.8, label="left in the servo")
    axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    axes.set(xlabel=time.label, ylabel="command lead, s")
    if axes.lines:
        axes.legend(loc="lower right")


def _draw_hops(axes: Any, analysis: Analysis) -> None:
    rows = [row for row in latencies(analysis.recording) if row.count]
    for number, row in enumerate(reversed(rows)):
        ends = np.maximum(np.array([row.median_ms, row.p99_ms], dtype=np.float64), 0.01)
        axes.plot(ends, [number, number], color=MODE_COLOURS["monopulse"], lw=5.0, alpha=0.35, solid_capstyle="butt")
        axes.plot(ends[0], number, "o", color=MODE_COLOURS["monopulse"], ms=6.0)
        axes.plot(ends[1], number, "|", color=MODE_COLOURS["monopulse"], ms=12.0, mew=2.0)
    axes.set_yticks(range(len(rows)), [f"{row.cause} → {row.effect}" for row in reversed(rows)], fontsize=8.5)
    axes.set_ylim(-0.6, max(len(rows), 1) - 0.4)
    drawn = [ends for line in axes.lines for ends in line.get_xdata()]
    axes.set_xlim(min([0.1, *drawn]) / 1.5, 1.5 * max([10.0, *drawn]))
    plain_log_scale(axes.xaxis)
    axes.set(xlabel="wall time, ms: median (dot) to 99th percentile (bar)")
    axes.grid(visible=False, axis="y")
