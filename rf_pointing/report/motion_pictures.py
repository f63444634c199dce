"""Pictures of antenna and graph at work: track over the sky, axes and their limits, timing."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import AXES, azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.core.modes import Mode
from rf_pointing.report.analysis import Analysis, tracking_modes
from rf_pointing.report.picture_style import (
    AXIS_COLOURS,
    DASHED,
    LIMIT_COLOUR,
    TimeAxis,
    figure,
    legend_above,
    mode_colour,
    mode_runs,
    plain_log_scale,
)
from rf_pointing.report.statistics import axis_motion
from rf_pointing.report.traffic import latencies

Floats = NDArray[np.float64]
_SKY_POINTS = 4_000
"""More are not visible, and take seconds to draw."""
_MARK_REACH_NS = 2 * 10**9


def draw_sky(analysis: Analysis, path: Path) -> None:
    """Draw the track over the sky, north up: commanded thin, actual coloured by mode."""
    with figure(path, 6.0, 6.6) as drawn:
        # The layout does not count the compass letters outside the circle.
        drawn.get_layout_engine().set(rect=(0.0, 0.04, 1.0, 0.92))
        axes = drawn.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
        axes.set_rlim(0.0, 90.0)
        axes.set_rgrids(
            [0.0, 30.0, 60.0, 90.0], ["90°", "60°", "30°", "0°"], angle=112.5, fontsize=8.5, color="#666666"
        )
        axes.set_thetagrids(range(0, 360, 45), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])
        _draw_actual(axes, analysis)
        if analysis.modes is not None:
            _draw_commanded(axes, analysis)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=4)


def _draw_actual(axes: Any, analysis: Analysis) -> None:
    recording = analysis.recording
    beam, joints = recording.get("sim/boresight"), recording.get("joint_states")
    if beam is not None and beam.stamp_ns is not None:
        stamp_ns, azimuth, elevation = beam.stamp_ns, beam["azimuth"], beam["elevation"]
    elif joints is not None and joints.stamp_ns is not None:
        stamp_ns, (azimuth, elevation) = joints.stamp_ns, joints["position"].T
    else:
        return
    # More points are not visible, and take seconds to draw.
    step = max(1, len(stamp_ns) // _SKY_POINTS)
    stamp_ns = stamp_ns[::step]
    theta, radius = _polar(azimuth[::step], elevation[::step])
    if analysis.modes is None:
        axes.plot(theta, radius, color=AXIS_COLOURS[0], lw=4.0, alpha=0.6, label="actual")
    for mode, part, first in mode_runs(analysis, stamp_ns):
        colour = mode_colour(mode)
        label = mode.replace("_", " ") if first else None
        axes.plot(theta[part], radius[part], color=colour, lw=4.5, alpha=0.75, solid_capstyle="butt", label=label)


def _draw_commanded(axes: Any, analysis: Analysis) -> None:
    assert analysis.modes is not None
    # Before and after tracking a status need not hold a direction in the sky.
    aimed = np.isin(analysis.modes.columns["mode"], tracking_modes())
    stamps = analysis.modes.stamp_ns[aimed]
    azimuth, elevation = (analysis.modes.columns[name][aimed] for name in ("azimuth", "elevation"))
    theta, radius = _polar(azimuth, elevation)
    axes.plot(theta, radius, color="black", lw=0.9, label="commanded")
    found = analysis.target_pass
    if found is None or not len(stamps):
        return
    for name, time_ns in (("AOS", found.aos_ns), ("TCA", found.tca_ns), ("LOS", found.los_ns)):
        index = int(np.argmin(np.abs(stamps - time_ns)))
        # A pass may begin before or end after the recording: a mark then would be at a wrong place.
        if abs(int(stamps[index]) - time_ns) < _MARK_REACH_NS:
            axes.plot(theta[index], radius[index], "o", color="black", ms=5.0)
            axes.annotate(name, (theta[index], radius[index]), xytext=(7, 5), textcoords="offset points", weight="bold")


def _polar(azimuth_rad: Floats, elevation_rad: Floats) -> tuple[Floats, Floats]:
    """Return angle and zenith distance in degrees, also of elevations beyond the zenith."""
    # By way of the vector: past the zenith the antenna looks to the other side.
    theta, elevation = azel_from_unit_vector(unit_vector_from_azel(azimuth_rad, elevation_rad))
    return np.unwrap(theta), 90.0 - np.degrees(elevation)


def draw_axes(analysis: Analysis, path: Path) -> None:
    """Rates and accelerations of both axes against their limits; needs joint_states."""
    motion = axis_motion(analysis.recording)
    assert motion is not None
    time = TimeAxis(analysis)
    with figure(path, 10.0, 4.8) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True)
        _draw_motion(above, time.minutes(motion.stamp_ns), motion.rate_rad_s)
        _draw_motion(below, time.minutes(motion.acceleration_stamp_ns), motion.acceleration_rad_s2)
        for axes, column in ((above, "rate_limit"), (below, "acceleration_limit")):
            _draw_limits(axes, analysis, column)
        above.set(ylabel="rate, deg/s")
        below.set(xlabel=time.label, ylabel="acceleration, deg/s²")
        legend_above(above)


def _draw_motion(axes: Any, minutes: Floats, values: Floats) -> None:
    for index, name in enumerate(AXES):
        axes.plot(minutes, np.degrees(values[:, index]), color=AXIS_COLOURS[index], lw=1.0, label=name)


def _draw_limits(axes: Any, analysis: Analysis, column: str) -> None:
    antenna = analysis.recording.get("antenna_status")
    if antenna is None:
        return
    limits = np.unique(np.round(np.degrees(antenna[column][-1]), 9))
    for number, limit in enumerate(limits):
        for sign in (-1.0, 1.0):
            label = "limit" if number == 0 and sign > 0.0 else None
            axes.axhline(sign * limit, color=LIMIT_COLOUR, lw=1.0, ls=DASHED, label=label)


def draw_timing(analysis: Analysis, path: Path) -> None:
    """Draw the command lead over time, and the latency of each hop (median to 99th percentile)."""
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
    # A hop that nothing passed has no place on a logarithmic axis.
    rows = [row for row in latencies(analysis.recording) if row.count]
    for number, row in enumerate(reversed(rows)):
        # A time can be negative when the effect reached the recorder first.
        ends = np.maximum(np.array([row.median_ms, row.p99_ms], dtype=np.float64), 0.01)
        axes.plot(ends, [number, number], color=mode_colour(Mode.MONOPULSE), lw=5.0, alpha=0.35, solid_capstyle="butt")
        axes.plot(ends[0], number, "o", color=mode_colour(Mode.MONOPULSE), ms=6.0)
        axes.plot(ends[1], number, "|", color=mode_colour(Mode.MONOPULSE), ms=12.0, mew=2.0)
    axes.set_yticks(range(len(rows)), [f"{row.cause} → {row.effect}" for row in reversed(rows)], fontsize=8.5)
    axes.set_ylim(-0.6, max(len(rows), 1) - 0.4)
    drawn = [ends for line in axes.lines for ends in line.get_xdata()]
    axes.set_xlim(min([0.1, *drawn]) / 1.5, 1.5 * max([10.0, *drawn]))
    plain_log_scale(axes.xaxis)
    axes.set(xlabel="wall time, ms: median (dot) to 99th percentile (bar)")
    axes.grid(visible=False, axis="y")
