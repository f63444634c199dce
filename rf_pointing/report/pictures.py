"""The pictures of a pass report: errors, link, sky, beam, axes and timing.

Each is drawn only if the recording has its data.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rf_pointing.core import MDEG, Array, Mode, Pair
from rf_pointing.core.pass_outcome import SIDELOBE_DB, pointing_loss_db, received_power
from rf_pointing.planning.horizon import horizon_from_notes
from rf_pointing.report import picture_style as style
from rf_pointing.report.analysis import Analysis, ErrorSeries, tracking_modes
from rf_pointing.report.statistics import axis_motion, link_series
from rf_pointing.report.summary import Latency
from rf_pointing.report.traffic import latencies

# Half the width of a drawing of errors that are all zero.
_SMALLEST_MDEG = 1e-3
# More are not visible, and take seconds to draw.
_SKY_POINTS = 4_000
_MARK_REACH_NS = 2 * 10**9


def draw_error(analysis: Analysis, path: Path) -> None:
    """Draw the radial error over time by mode: samples light, rms of each second strong."""
    errors = _required(analysis)
    time = style.TimeAxis(analysis)
    with style.figure(path, 10.0, 4.4) as drawn:
        axes = drawn.subplots()
        alone = np.hypot(*errors.alone_rad.T) / MDEG
        # Drawn first, below the others: it is the background to compare with.
        _strong(axes, time, errors, alone, style.ALONE_COLOUR, "program track alone", 1.0)
        radial = errors.radial_rad / MDEG
        for mode, part, first in style.mode_runs(analysis, errors.stamp_ns):
            colour = style.mode_colour(mode)
            axes.plot(time.minutes(errors.stamp_ns[part]), radial[part], color=colour, lw=0.4, alpha=0.35)
            _strong(axes, time, errors, radial, colour, _shown(mode, first), 1.6, part)
        if analysis.modes is None:
            _strong(axes, time, errors, radial, style.LIMIT_COLOUR, f"{errors.source} error", 1.6)
        widths = errors.beamwidth_rad[np.isfinite(errors.beamwidth_rad)] / MDEG
        width = float(np.median(widths)) if len(widths) else 0.0
        if width > 0.0:
            style.marked_level(axes, 0.5 * width, "half power (3 dB)")
            style.marked_level(axes, 0.1 * width, "a tenth of a beamwidth (0.12 dB)")
        axes.set_ylim(*_decades(radial, alone, width))
        style.plain_log_scale(axes.yaxis)
        axes.set(xlabel=time.label, ylabel=f"{errors.source} pointing error, mdeg")
        style.legend_above(axes)


def _strong(
    axes: Any, time: style.TimeAxis, errors: ErrorSeries, values: Array, colour: str, label: str | None,
    width: float, part: slice = slice(None),
) -> None:  # fmt: skip
    # The rms of a second, not its mean: errors of both signs would cancel.
    stamps, mean_square, _ = style.per_second(errors.stamp_ns[part], np.square(values[part]))
    if len(stamps):
        axes.plot(time.minutes(stamps), np.sqrt(mean_square), color=colour, lw=width, label=label)


def _shown(mode: str, first: bool = True) -> str | None:
    """Return the name of a mode in a legend, which has each of them once."""
    return mode.replace("_", " ") if first else None


def _decades(radial: Array, alone: Array, beamwidth_mdeg: float) -> Pair:
    """Return the range of the drawing: that of the tracking modes and of the beam."""
    # A slew's degrees would squeeze the rest.
    tracking = np.isfinite(alone) if np.any(np.isfinite(alone)) else np.isfinite(radial)
    # A percentile: on a logarithmic axis one error of almost 0 would take all the room.
    seen = np.concatenate([radial[tracking], alone[tracking]])
    seen = seen[np.isfinite(seen) & (seen > 0.0)]
    low = 0.5 * float(np.percentile(seen, 1.0)) if len(seen) else 0.1
    high = 3.0 * float(np.max(seen)) if len(seen) else 10.0
    return low, max(high, beamwidth_mdeg)


def draw_link(analysis: Analysis, path: Path) -> None:
    """Draw C/N0, and below it the pointing loss: mean of each second strong, largest light."""
    time, series = style.TimeAxis(analysis), link_series(analysis.recording)
    # Empty axes would look like a fault of the receiver.
    heights = [1.0] * (series is not None) + [1.2] * _has_errors(analysis)
    with style.figure(path, 10.0, 0.6 + 2.0 * sum(heights)) as drawn:
        panels = list(drawn.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0])
        if series is not None:
            name, stamps, values = series
            panels[0].plot(time.minutes(stamps), values, color="black", lw=0.6)
            panels[0].set_title(f"C/N0 measured on {name}", loc="right", fontsize=9.0, color=style.LIMIT_COLOUR)
            panels[0].set(ylabel="C/N0, dB-Hz")
        if _has_errors(analysis):
            _draw_losses(panels[-1], time, analysis)
            panels[-1].set(ylabel="pointing loss, dB")
        panels[-1].set(xlabel=time.label)
        style.legend_above(*panels)


def _draw_losses(axes: Any, time: style.TimeAxis, analysis: Analysis) -> None:
    errors = _required(analysis)
    alone = received_power(np.hypot(*errors.alone_rad.T), errors.beamwidth_rad)
    stamps, mean, _ = style.per_second(errors.stamp_ns, alone)
    axes.plot(time.minutes(stamps), pointing_loss_db(mean), color=style.ALONE_COLOUR, label="program track alone")
    for mode, part, first in style.mode_runs(analysis, errors.stamp_ns):
        if mode in tracking_modes():
            power = received_power(errors.radial_rad[part], errors.beamwidth_rad[part])
            # The loss of the mean power, not the mean of decibels.
            stamps, mean_power, _ = style.per_second(errors.stamp_ns[part], power)
            mean = pointing_loss_db(mean_power)
            largest = style.per_second(errors.stamp_ns[part], errors.loss_db[part])[2]
            minutes, colour = time.minutes(stamps), style.mode_colour(mode)
            axes.fill_between(minutes, mean, largest, color=colour, alpha=0.25, lw=0.0)
            axes.plot(minutes, mean, color=colour, lw=1.6, label=_shown(mode, first))
    for level in (0.1, 3.0):
        style.marked_level(axes, level, f"{level:g} dB")
    axes.set_ylim(1e-4, SIDELOBE_DB)
    style.plain_log_scale(axes.yaxis)


def draw_beam(analysis: Analysis, path: Path) -> None:
    """Draw where in the beam the target was while tracking: the whole beam, and its middle."""
    errors = _required(analysis)
    tracking = np.isin(errors.mode, tracking_modes()) if analysis.modes is not None else np.ones(len(errors.mode), bool)
    width = errors.beamwidth_rad[tracking] / MDEG
    half = 0.5 * float(np.nanmedian(width)) if np.any(np.isfinite(width)) else 0.0
    # With the search in it, the enlarged picture would show a dot.
    settled = tracking & (errors.stamp_ns >= (analysis.acquired_ns or 0))
    with style.figure(path, 10.0, 5.0) as drawn:
        whole, middle = drawn.subplots(1, 2)
        alone = errors.alone_rad[tracking] / MDEG
        whole.plot(*alone.T, ".", color=style.ALONE_COLOUR, ms=1.5, label="program track alone")
        for mode in tracking_modes():
            chosen = errors.error_rad[tracking & (errors.mode == mode)] / MDEG
            if len(chosen):
                whole.plot(*chosen.T, ".", color=style.mode_colour(mode), ms=2.0, label=_shown(mode))
        reach = np.nanmax(np.abs(np.concatenate([alone, errors.error_rad[tracking] / MDEG, [[half, half]]])))
        _frame(whole, half, 1.15 * max(float(reach), _SMALLEST_MDEG), "whole beam")
        # Below the axes: inside it would lie over the points.
        whole.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, markerscale=4.0)
        _draw_middle(middle, errors.error_rad[settled] / MDEG, half, analysis.acquired_ns is not None)


def _draw_middle(axes: Any, error_mdeg: Array, half_mdeg: float, acquired: bool) -> None:
    axes.plot(error_mdeg[:, 0], error_mdeg[:, 1], ".", color=style.mode_colour(Mode.MONOPULSE), ms=1.5, alpha=0.4)
    rms = np.sqrt(np.mean(np.square(error_mdeg), axis=0)) if len(error_mdeg) else np.zeros(2)
    _ellipse(axes, rms[0], rms[1], style.LIMIT_COLOUR, "-", f"rms {rms[0]:.2f}, {rms[1]:.2f} mdeg")
    # Not the largest: a single error would shrink the cloud.
    reach = float(np.percentile(np.abs(error_mdeg), 99.8)) if len(error_mdeg) else 1.0
    over = "after acquisition" if acquired else "tracking"
    _frame(axes, half_mdeg, 1.3 * max(reach, _SMALLEST_MDEG), f"{over}, enlarged")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _frame(axes: Any, half_mdeg: float, reach_mdeg: float, title: str) -> None:
    if half_mdeg > 0.0:
        label = "half power" if half_mdeg < reach_mdeg else None
        _ellipse(axes, half_mdeg, half_mdeg, style.LIMIT_COLOUR, style.DASHED, label)
    axes.axhline(0.0, color="#aaaaaa", lw=0.7)
    axes.axvline(0.0, color="#aaaaaa", lw=0.7)
    reach = -reach_mdeg, reach_mdeg
    axes.set(aspect="equal", xlim=reach, ylim=reach, title=title)
    axes.set(xlabel="cross-elevation error, mdeg", ylabel="elevation error, mdeg")


def _ellipse(axes: Any, x_mdeg: float, y_mdeg: float, colour: str, style: Any, label: str | None) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(x_mdeg * np.cos(turn), y_mdeg * np.sin(turn), color=colour, lw=1.1, ls=style, label=label)


def _required(analysis: Analysis) -> ErrorSeries:
    assert analysis.errors is not None
    return analysis.errors


def draw_sky(analysis: Analysis, path: Path) -> None:
    """Draw the track over the sky, north up: commanded thin, actual coloured by mode."""
    with style.figure(path, 6.0, 6.6) as drawn:
        # The layout does not count the compass letters outside the circle.
        drawn.get_layout_engine().set(rect=(0.0, 0.04, 1.0, 0.92))
        axes = drawn.add_subplot(projection="polar")
        style.sky_axes(axes)
        if (horizon := horizon_from_notes(analysis.recording.notes)) is not None:
            style.draw_hills(axes, horizon)
        _draw_actual(axes, analysis)
        if analysis.modes is not None:
            _draw_commanded(axes, analysis)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=4)


def _draw_actual(axes: Any, analysis: Analysis) -> None:
    recording = analysis.recording
    beam, joints, mount = recording.get("sim/boresight"), recording.get("joint_states"), recording.mount
    if beam is not None and beam.stamp_ns is not None:
        stamp_ns, azimuth, elevation = beam.stamp_ns, beam["azimuth"], beam["elevation"]
    elif joints is not None and joints.stamp_ns is not None and mount is not None:
        stamp_ns, (azimuth, elevation) = joints.stamp_ns, mount.directions(*joints["position"].T)
    else:
        return
    step = max(1, len(stamp_ns) // _SKY_POINTS)
    stamp_ns = stamp_ns[::step]
    theta, radius = style.sky_place(azimuth[::step], elevation[::step])
    if analysis.modes is None:
        axes.plot(theta, radius, color=style.AXIS_COLOURS[0], lw=4.0, alpha=0.6, label="actual")
    for mode, part, first in style.mode_runs(analysis, stamp_ns):
        wide = {"lw": 4.5, "alpha": 0.75, "solid_capstyle": "butt", "label": _shown(mode, first)}
        axes.plot(theta[part], radius[part], color=style.mode_colour(mode), **wide)


def _draw_commanded(axes: Any, analysis: Analysis) -> None:
    assert analysis.modes is not None
    # Before and after tracking a status need not hold a direction in the sky.
    aimed = np.isin(analysis.modes.columns["mode"], tracking_modes())
    stamps = analysis.modes.stamp_ns[aimed]
    azimuth, elevation = (analysis.modes.columns[name][aimed] for name in ("azimuth", "elevation"))
    theta, radius = style.sky_place(azimuth, elevation)
    axes.plot(theta, radius, color="black", lw=0.9, label="commanded")
    found = analysis.target_pass
    if found is None or not len(stamps):
        return
    # To three sides: the marks of a short pass are close together.
    sides = (("AOS", found.aos_ns, "right", (-7, 5)), ("TCA", found.tca_ns, "center", (0, -14)),
             ("LOS", found.los_ns, "left", (7, 5)))  # fmt: skip
    for name, time_ns, side, place in sides:
        index = int(np.argmin(np.abs(stamps - time_ns)))
        # A pass may begin before or end after the recording: a mark then would be at a wrong place.
        if abs(int(stamps[index]) - time_ns) < _MARK_REACH_NS:
            axes.plot(theta[index], radius[index], "o", color="black", ms=5.0)
            at = theta[index], radius[index]
            axes.annotate(name, at, xytext=place, textcoords="offset points", weight="bold", ha=side)


def draw_axes(analysis: Analysis, path: Path) -> None:
    """Rates and accelerations of both axes against their limits; needs joint_states."""
    motion = axis_motion(analysis.recording)
    assert motion is not None
    time = style.TimeAxis(analysis)
    antenna = analysis.recording.get("antenna_status")
    with style.figure(path, 10.0, 4.8) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True)
        for axes, stamps, values, column in (
            (above, motion.stamp_ns, motion.rate_rad_s, "rate_limit"),
            (below, motion.acceleration_stamp_ns, motion.acceleration_rad_s2, "acceleration_limit"),
        ):
            for name, colour, each in zip(
                analysis.recording.axes, style.AXIS_COLOURS, np.degrees(values).T, strict=True
            ):
                axes.plot(time.minutes(stamps), each, color=colour, lw=1.0, label=name)
            limits = np.unique(np.round(np.degrees(antenna[column][-1]), 9)) if antenna is not None else np.zeros(0)
            for level in (sign * limit for limit in limits for sign in (-1.0, 1.0)):
                label = "limit" if level == limits[0] else None
                axes.axhline(level, color=style.LIMIT_COLOUR, lw=1.0, ls=style.DASHED, label=label)
        above.set(ylabel="rate, deg/s")
        below.set(xlabel=time.label, ylabel="acceleration, deg/s²")
        style.legend_above(above)


def draw_timing(analysis: Analysis, path: Path) -> None:
    """Draw the command lead over time, and the latency of each hop (median to 99th percentile)."""
    hops = [row for row in latencies(analysis.recording) if row.count]
    with style.figure(path, 10.0, 3.8) as drawn:
        panels = drawn.subplots(1, 2, width_ratios=(1.0, 1.1))[:] if hops else [drawn.subplots()]
        _draw_lead(panels[0], analysis)
        if hops:
            _draw_hops(panels[1], hops)


def _draw_lead(axes: Any, analysis: Analysis) -> None:
    time, modes = style.TimeAxis(analysis), analysis.modes
    antenna, (sent, left) = analysis.recording.get("antenna_status"), style.AXIS_COLOURS
    if modes is not None:
        stamps = modes.stamp_ns
        lead = np.where(modes.is_tracking_at(stamps), modes.columns["command_lead"], np.nan)
        axes.plot(time.minutes(stamps), lead, color=sent, label="sent by the controller")
    if antenna is not None and antenna.stamp_ns is not None:
        lead = np.where(antenna["mode"] == "tracking", antenna["command_lead"], np.nan)
        axes.plot(time.minutes(antenna.stamp_ns), lead, color=left, lw=0.8, label="left in the servo")
    axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    axes.set(xlabel=time.label, ylabel="command lead, s")
    if axes.lines:
        axes.legend(loc="lower right")


def _draw_hops(axes: Any, rows: Sequence[Latency]) -> None:
    for number, row in enumerate(reversed(rows)):
        # A time can be negative when the effect reached the recorder first.
        ends = np.maximum(np.array([row.median_ms, row.p99_ms], dtype=np.float64), 0.01)
        colour = style.mode_colour(Mode.MONOPULSE)
        axes.plot(ends, [number] * 2, color=colour, lw=5.0, alpha=0.35, solid_capstyle="butt")
        axes.plot(ends[0], number, "o", color=colour, ms=6.0)
        axes.plot(ends[1], number, "|", color=colour, ms=12.0, mew=2.0)
    axes.set_yticks(range(len(rows)), [f"{row.cause} → {row.effect}" for row in reversed(rows)], fontsize=8.5)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    drawn = [ends for line in axes.lines for ends in line.get_xdata()]
    axes.set_xlim(min([0.1, *drawn]) / 1.5, 1.5 * max([10.0, *drawn]))
    style.plain_log_scale(axes.xaxis)
    axes.set(xlabel="wall time, ms: median (dot) to 99th percentile (bar)")
    axes.grid(visible=False, axis="y")


def _has_errors(analysis: Analysis) -> bool:
    return analysis.errors is not None and len(analysis.errors.stamp_ns) > 0


def _has_tracking(analysis: Analysis) -> bool:
    errors = analysis.errors
    return errors is not None and (analysis.modes is None or bool(np.any(np.isin(errors.mode, tracking_modes()))))


def _has_any(*names: str) -> Callable[[Analysis], bool]:
    return lambda analysis: any(analysis.recording.get(name) is not None for name in names)


class Picture(NamedTuple):
    """A picture: how it is drawn, whether a recording allows it; the caption says where to look."""

    name: str
    title: str
    caption: str
    draw: Callable[[Analysis, Path], None]
    possible: Callable[[Analysis], bool]


_PICTURES = (
    Picture(
        "pointing_error", "Pointing error",
        "Angle between target and beam. Light: every sample; strong: rms of each second, coloured by "
        "tracking mode. Grey: what the error would have been without the tracking offset.",
        draw_error, _has_errors,
    ),
    Picture(
        "link", "Link and pointing loss",
        "Loss of a Gaussian beam down to its sidelobes at 40 dB: that of the mean power of each "
        "second, shaded up to the largest.",
        draw_link, lambda of: _has_errors(of) or link_series(of.recording) is not None,
    ),
    Picture(
        "sky_track", "Track over the sky",
        "North up, zenith in the middle. Thin line: commanded; wide line: actual, coloured by mode.",
        draw_sky, _has_any("sim/boresight", "joint_states", "tracking_status"),
    ),
    Picture(
        "beam", "The target in the beam",
        "Position of the target seen from the beam while tracking, with the half-power circle.",
        draw_beam, _has_tracking,
    ),
    Picture(
        "axes", "Axis rates and accelerations",
        "From the encoders; accelerations are means over half a second. Dashed: limits of the drive.",
        draw_axes, _has_any("joint_states"),
    ),
    Picture(
        "timing", "Timing of the graph",
        "Left: how far the commands run ahead of the clock. Right: wall time between linked messages "
        "at the recorder.",
        draw_timing, _has_any("tracking_status", "antenna_status"),
    ),
)  # fmt: skip


def draw_pictures(analysis: Analysis, folder: Path) -> dict[Path, tuple[str, str]]:
    """Draw what the recording allows into `folder`; return titles and captions of the PNG files."""
    # A picture without data would look like a fault of the antenna.
    drawn = [picture for picture in _PICTURES if picture.possible(analysis)]
    for picture in drawn:
        picture.draw(analysis, folder / f"{picture.name}.png")
    return {folder / f"{each.name}.png": (each.title, each.caption) for each in drawn}
