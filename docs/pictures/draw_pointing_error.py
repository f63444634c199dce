#!/usr/bin/env python3
"""Draw the true pointing error of one pass, with monopulse and with the prediction alone.

    scripts/run-python docs/pictures/draw_pointing_error.py

It flies the pass of `scripts/track` twice without ROS, one minute of processor time in all.
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from rf_pointing.core import MDEG, Mode, Sensor
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass

FOLDER = Path(__file__).parent
HALF_POWER_MDEG = 32.5
CLUSTERS = 10
COLOURS = {Mode.SLEW: "#56b4e9", Mode.PROGRAM_TRACK: "#e69f00", Mode.SEARCH: "#cc79a7", Mode.MONOPULSE: "#0072b2"}
STYLE: Any = {"font.size": 10.0, "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#888888"}


def fly(sensor: Sensor) -> tuple[PassLog, float]:
    """Return the log of the pass, and the time of its rise."""
    source = SourceParams(satellite="28057")
    track, epoch_t_s = load_track(source), load_elements(source).epoch_t_s
    window = first_pass_above(track, epoch_t_s, math.radians(40.0), math.radians(5.0), 86400.0)
    setup = StationSetup("dss13", "X")
    return simulate_pass(setup, window, math.floor(window.aos_t_s) - 150.0, sensor), window.aos_t_s


def drawn_into(axes: Any, log: PassLog, aos_t_s: float, alone: bool) -> None:
    """Draw the radial error in minutes from the rise, one colour for each mode."""
    minutes = (np.array(log.t_s) - aos_t_s) / 60.0
    radial = np.hypot(*log.errors_rad().T) / MDEG
    # The thin line is every cluster; the strong one is the rms of a second, which the eye can follow.
    second = np.ones(CLUSTERS)
    count = np.convolve(np.ones_like(radial), second, mode="same")
    steady = np.sqrt(np.convolve(radial**2, second, mode="same") / count)
    modes = np.array(log.mode)
    edges = [0, *(np.flatnonzero(modes[1:] != modes[:-1]) + 1), len(modes)]
    named = set()
    for first, after in pairwise(edges):
        mode, part = modes[first], slice(first, min(after + 1, len(modes)))
        if alone and mode != Mode.PROGRAM_TRACK:
            continue
        label = "program track alone" if alone else str(mode).replace("_", " ")
        colour = "#8a8a8a" if alone else COLOURS.get(Mode(mode), "#4a4a4a")
        axes.plot(minutes[part], radial[part], color=colour, lw=0.4, alpha=0.35)
        axes.plot(minutes[part], steady[part], color=colour, lw=1.6, label=None if label in named else label)
        named.add(label)


def main() -> None:
    """Write the picture."""
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.5), layout="constrained")
        axes = figure.subplots()
        for sensor in (Sensor.PROGRAM, Sensor.MONOPULSE):
            drawn_into(axes, *fly(sensor), alone=sensor is Sensor.PROGRAM)
        for level, text in (
            (HALF_POWER_MDEG, "half power (3 dB)"),
            (HALF_POWER_MDEG / 5.0, "a tenth of a beamwidth (0.12 dB)"),
        ):
            axes.axhline(level, color="#333333", ls=(0, (5, 3)), lw=1.2)
            axes.text(11.9, 1.05 * level, text, ha="right", va="bottom", fontsize=9.0)
        axes.set(yscale="log", ylim=(0.03, 1000.0), xlim=(-0.5, 12.1))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set(xlabel="minutes from acquisition of signal", ylabel="true pointing error, mdeg")
        axes.grid(color="#e3e3e3", lw=0.7)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, frameon=False)
        figure.savefig(FOLDER / "pointing_error.png", dpi=130)


if __name__ == "__main__":
    main()
