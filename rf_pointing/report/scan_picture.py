"""Picture of a scan: both cuts of the beam through the source, and the map of the powers."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array
from rf_pointing.radiometry.scan_fit import BASE, DRIFT, LEVEL, TILT, WIDTH, Samples, ScanFit
from rf_pointing.report.picture_style import AXIS_COLOURS, LIMIT_COLOUR, figure

# Samples within this many beamwidths of an axis through the source are on its cut.
CUT_BEAMS = 0.25
FLOOR_DB = -30.0


def draw_scan(samples: Samples, fit: ScanFit, title: str, path: Path) -> None:
    """Write the picture of a scan to `path`; edited powers are crosses."""
    x, y = np.degrees(samples.cross_elevation_rad), np.degrees(samples.elevation_rad)
    base = (fit.values[BASE] + fit.values[DRIFT] * (samples.t_s - samples.t_s.mean())) * samples.sky
    base = base + fit.values[TILT] * samples.elevation_rad
    gain = (samples.power - base) / (fit.on_axis * fit.values[LEVEL] * samples.strength)
    centre = np.degrees(fit.offset_rad)
    with figure(path, 11.0, 5.2) as drawn:
        grid = drawn.add_gridspec(2, 2, width_ratios=[1.0, 1.25])
        off = x - centre[0], y - centre[1]
        for row, name in enumerate(("cross-elevation", "elevation")):
            along, across = off[row], off[1 - row]
            axes = drawn.add_subplot(grid[row, 0])
            near = np.abs(across) < CUT_BEAMS * math.degrees(fit.values[WIDTH])
            _draw_cut(axes, along[near], gain[near], fit.used[near], AXIS_COLOURS[row])
            axes.set_xlabel(f"{name} off the source, deg")
        _draw_map(drawn, drawn.add_subplot(grid[:, 1]), x, y, gain, centre)
        drawn.suptitle(title)


def _draw_cut(axes: Any, along: Array, gain: Array, used: NDArray[np.bool_], colour: str) -> None:
    level = 10.0 * np.log10(np.maximum(gain, 10.0 ** (0.1 * FLOOR_DB)))
    axes.plot(along[used], level[used], ".", ms=2.5, color=colour)
    axes.plot(along[~used], level[~used], "x", ms=5.0, color=LIMIT_COLOUR)
    axes.set_ylim(FLOOR_DB - 1.0, 3.0)
    axes.set_ylabel("power, dB")


def _draw_map(drawn: Any, axes: Any, x: Array, y: Array, gain: Array, centre: Array) -> None:
    # Points rather than an interpolation: what lies between the lines was not measured.
    shown = axes.scatter(x, y, c=np.clip(gain, -0.05, 1.05), s=9.0, cmap="viridis", linewidths=0.0)
    axes.plot(*centre, "+", ms=14.0, color="#d55e00")
    axes.set_aspect("equal")
    axes.set_xlabel("cross-elevation of the beam, deg")
    axes.set_ylabel("elevation of the beam, deg")
    drawn.colorbar(shown, ax=axes, label="share of the peak")
