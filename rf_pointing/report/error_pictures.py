"""Pictures of the pointing error: over time, its loss, and the place of the target in the beam."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, gaussian_loss_db
from rf_pointing.core.modes import Mode
from rf_pointing.report.analysis import Analysis, ErrorSeries, tracking_modes
from rf_pointing.report.picture_style import (
    ALONE_COLOUR,
    DASHED,
    LIMIT_COLOUR,
    TimeAxis,
    figure,
    legend_above,
    marked_level,
    mode_colour,
    mode_runs,
    per_second,
    plain_log_scale,
)
from rf_pointing.report.statistics import link_series

Floats = NDArray[np.float64]
_SMALLEST_MDEG = 1e-3
"""Half the width of a drawing of errors that are all zero."""


def draw_error(analysis: Analysis, path: Path) -> None:
    """Draw the radial error over time by mode: samples light, rms of each second strong."""
    errors = _required(analysis)
    time = TimeAxis(analysis)
    with figure(path, 10.0, 4.4) as drawn:
        axes = drawn.subplots()
        alone = np.hypot(errors.alone_rad[:, 0], errors.alone_rad[:, 1]) / MDEG
        # Drawn first, below the others: it is the background to compare with.
        _strong(axes, time, errors, alone, ALONE_COLOUR, "program track alone", 1.0)
        radial = errors.radial_rad / MDEG
        for mode, part, first in mode_runs(analysis, errors.stamp_ns):
            colour = mode_colour(mode)
            axes.plot(time.minutes(errors.stamp_ns[part]), radial[part], color=colour, lw=0.4, alpha=0.35)
            _strong(axes, time, errors, radial, colour, mode.replace("_", " ") if first else None, 1.6, part)
        if analysis.modes is None:
            _strong(axes, time, errors, radial, LIMIT_COLOUR, f"{errors.source} error", 1.6)
        _beam_lines(axes, errors)
        axes.set_ylim(*_decades(radial, alone, _median_beamwidth_mdeg(errors)))
        plain_log_scale(axes.yaxis)
        axes.set(xlabel=time.label, ylabel=f"{errors.source} pointing error, mdeg")
        legend_above(axes)


def _strong(
    axes: Any,
    time: TimeAxis,
    errors: ErrorSeries,
    values: Floats,
    colour: str,
    label: str | None,
    width: float,
    part: slice = slice(None),
) -> None:
    # The rms of a second, not its mean: errors of both signs would cancel.
    stamps, mean_square, _ = per_second(errors.stamp_ns[part], np.square(values[part]))
    if len(stamps):
        axes.plot(time.minutes(stamps), np.sqrt(mean_square), color=colour, lw=width, label=label)


def _beam_lines(axes: Any, errors: ErrorSeries) -> None:
    width = _median_beamwidth_mdeg(errors)
    if width is not None:
        marked_level(axes, 0.5 * width, "half power (3 dB)")
        marked_level(axes, 0.1 * width, "a tenth of a beamwidth (0.12 dB)")


def _median_beamwidth_mdeg(errors: ErrorSeries) -> float | None:
    width = errors.beamwidth_rad[np.isfinite(errors.beamwidth_rad)]
    return float(np.median(width)) / MDEG if len(width) else None


def _decades(radial: Floats, alone: Floats, beamwidth_mdeg: float | None) -> tuple[float, float]:
    """Return the range of the drawing: that of the tracking modes and of the beam."""
    # A slew's degrees would squeeze the rest.
    tracking = np.isfinite(alone) if np.any(np.isfinite(alone)) else np.isfinite(radial)
    # A percentile: on a logarithmic axis one error of almost 0 would take all the room.
    seen = np.concatenate([radial[tracking], alone[tracking]])
    seen = seen[np.isfinite(seen) & (seen > 0.0)]
    low = 0.5 * float(np.percentile(seen, 1.0)) if len(seen) else 0.1
    high = 3.0 * float(np.max(seen)) if len(seen) else 10.0
    return low, max(high, beamwidth_mdeg or 0.0)


def draw_link(analysis: Analysis, path: Path) -> None:
    """Draw C/N0, and below it the pointing loss: mean of each second strong, largest light."""
    time = TimeAxis(analysis)
    with figure(path, 10.0, 5.0) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.2))
        series = link_series(analysis.recording)
        if series is not None:
            name, stamps, values = series
            above.plot(time.minutes(stamps), values, color="black", lw=0.6)
            above.set_title(f"C/N0 measured on {name}", loc="right", fontsize=9.0, color=LIMIT_COLOUR)
        above.set(ylabel="C/N0, dB-Hz")
        if analysis.errors is not None:
            _draw_losses(below, time, analysis)
        below.set(xlabel=time.label, ylabel="pointing loss, dB")
        legend_above(above, below)


def _draw_losses(axes: Any, time: TimeAxis, analysis: Analysis) -> None:
    errors = _required(analysis)
    alone = gaussian_loss_db(np.hypot(errors.alone_rad[:, 0], errors.alone_rad[:, 1]), errors.beamwidth_rad)
    stamps, mean, _ = per_second(errors.stamp_ns, alone)
    axes.plot(time.minutes(stamps), mean, color=ALONE_COLOUR, label="program track alone")
    for mode, part, first in mode_runs(analysis, errors.stamp_ns):
        if mode in tracking_modes():
            stamps, mean, largest = per_second(errors.stamp_ns[part], errors.loss_db[part])
            minutes, colour = time.minutes(stamps), mode_colour(mode)
            axes.fill_between(minutes, mean, largest, color=colour, alpha=0.25, lw=0.0)
            axes.plot(minutes, mean, color=colour, lw=1.6, label=mode.replace("_", " ") if first else None)
    for level in (0.1, 3.0):
        marked_level(axes, level, f"{level:g} dB")
    largest = np.nanmax(np.concatenate([alone, errors.loss_db, [10.0]]))
    axes.set_ylim(1e-4, 2.0 * float(largest))
    plain_log_scale(axes.yaxis)


def draw_beam(analysis: Analysis, path: Path) -> None:
    """Draw where in the beam the target was while tracking: the whole beam, and its middle."""
    errors = _required(analysis)
    tracking = np.isin(errors.mode, tracking_modes()) if analysis.modes is not None else np.ones(len(errors.mode), bool)
    width = errors.beamwidth_rad[tracking] / MDEG
    half = 0.5 * float(np.nanmedian(width)) if np.any(np.isfinite(width)) else 0.0
    # With the search in it, the enlarged picture would show a dot.
    settled = tracking & (errors.stamp_ns >= (analysis.acquired_ns or 0))
    with figure(path, 10.0, 5.0) as drawn:
        whole, middle = drawn.subplots(1, 2)
        alone = errors.alone_rad[tracking] / MDEG
        whole.plot(alone[:, 0], alone[:, 1], ".", color=ALONE_COLOUR, ms=1.5, label="program track alone")
        for mode in tracking_modes():
            chosen = errors.error_rad[tracking & (errors.mode == mode)] / MDEG
            if len(chosen):
                label = mode.replace("_", " ")
                whole.plot(chosen[:, 0], chosen[:, 1], ".", color=mode_colour(mode), ms=2.0, label=label)
        reach = np.nanmax(np.abs(np.concatenate([alone, errors.error_rad[tracking] / MDEG, [[half, half]]])))
        _frame(whole, half, 1.15 * max(float(reach), _SMALLEST_MDEG), "whole beam")
        whole.legend(loc="upper right", markerscale=4.0)
        _draw_middle(middle, errors.error_rad[settled] / MDEG, half, analysis.acquired_ns is not None)


def _draw_middle(axes: Any, error_mdeg: Floats, half_mdeg: float, acquired: bool) -> None:
    axes.plot(error_mdeg[:, 0], error_mdeg[:, 1], ".", color=mode_colour(Mode.MONOPULSE), ms=1.5, alpha=0.4)
    rms = np.sqrt(np.mean(np.square(error_mdeg), axis=0)) if len(error_mdeg) else np.zeros(2)
    _ellipse(axes, rms[0], rms[1], LIMIT_COLOUR, "-", f"rms {rms[0]:.2f}, {rms[1]:.2f} mdeg")
    # Not the largest: a single error would shrink the cloud.
    reach = float(np.percentile(np.abs(error_mdeg), 99.8)) if len(error_mdeg) else 1.0
    _frame(
        axes,
        half_mdeg,
        1.3 * max(reach, _SMALLEST_MDEG),
        "after acquisition, enlarged" if acquired else "tracking, enlarged",
    )
    axes.legend(loc="upper right")


def _frame(axes: Any, half_mdeg: float, reach_mdeg: float, title: str) -> None:
    if half_mdeg > 0.0:
        label = "half power" if half_mdeg < reach_mdeg else None
        _ellipse(axes, half_mdeg, half_mdeg, LIMIT_COLOUR, DASHED, label)
    axes.axhline(0.0, color="#aaaaaa", lw=0.7)
    axes.axvline(0.0, color="#aaaaaa", lw=0.7)
    axes.set_aspect("equal")
    axes.set(xlim=(-reach_mdeg, reach_mdeg), ylim=(-reach_mdeg, reach_mdeg), title=title)
    axes.set(xlabel="cross-elevation error, mdeg", ylabel="elevation error, mdeg")


def _ellipse(axes: Any, x_mdeg: float, y_mdeg: float, colour: str, style: Any, label: str | None) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(x_mdeg * np.cos(turn), y_mdeg * np.sin(turn), color=colour, lw=1.1, ls=style, label=label)


def _required(analysis: Analysis) -> ErrorSeries:
    assert analysis.errors is not None
    return analysis.errors
