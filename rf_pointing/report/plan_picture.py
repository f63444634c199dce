"""Pictures of coming passes (sky, azimuth, rates), a link budget, a known orbit and a scan."""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core.types import Array, BoolArray
from rf_pointing.orbit.study import Knowledge
from rf_pointing.planning import AxisLimits, HorizonMask
from rf_pointing.radiometry.scan_fit import BASE, DRIFT, LEVEL, TILT, WIDTH, Samples, ScanFit
from rf_pointing.report import picture_style as style
from rf_pointing.report.picture_style import AXIS_COLOURS, DASHED, LIMIT_COLOUR, figure
from rf_pointing.station.pointing.certificates import PlannedPass

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#332288", "#882255", "#7f7f7f")
# Samples within this many beamwidths of an axis through the source are on its cut.
CUT_BEAMS = 0.25
FLOOR_DB = -30.0


def draw_plan(planned: list[PlannedPass], limits: AxisLimits, mask: HorizonMask, path: Path) -> None:
    """Write the picture of `planned` to `path`; passes without a branch are dotted, hills grey."""
    with figure(path, 11.0, 6.4) as drawn:
        grid = drawn.add_gridspec(2, 2, width_ratios=[1.0, 1.35])
        _draw_sky(drawn.add_subplot(grid[:, 0], projection="polar"), planned, mask)
        wrap, rates = drawn.add_subplot(grid[0, 1]), drawn.add_subplot(grid[1, 1])
        _draw_wrap(wrap, planned, limits)
        _draw_rates(rates, planned)


def draw_budget(columns: Mapping[str, Array], minutes: Array, title: str, path: Path) -> None:
    """Draw a link budget over the `minutes` of a pass, over elevation without them."""
    x, name = (minutes, "min after AOS") if len(minutes) else (columns["elevation_deg"], "elevation, deg")
    with figure(path, 9.0, 6.4) as drawn:
        noise, level = drawn.subplots(2, 1, sharex=True)
        parts = [key for key in columns if key.endswith("_k") and not key.startswith(("system", "g_over"))]
        noise.stackplot(x, *(columns[key] for key in parts), labels=[key[:-2] for key in parts], colors=COLOURS)
        noise.set_ylabel("noise temperature, K")
        noise.legend(loc="upper right", ncols=4)
        noise.set_title(title)
        level.plot(x, columns["carrier_to_noise_db_hz"], color=AXIS_COLOURS[0], label="C/N0, dB-Hz")
        merit = level.twinx()
        merit.plot(x, columns["g_over_t_db_k"], color=AXIS_COLOURS[1], label="G/T, dB/K")
        merit.set_ylabel("G/T, dB/K", color=AXIS_COLOURS[1])
        level.set_ylabel("C/N0, dB-Hz", color=AXIS_COLOURS[0])
        level.set_xlabel(name)


def _draw_sky(axes: Any, planned: list[PlannedPass], mask: HorizonMask) -> None:
    style.sky_axes(axes)
    style.draw_hills(axes, mask)
    for number, item in enumerate(planned):
        azimuth, elevation = item.profile.position_rad.T
        chosen = item.certificate.chosen
        width, dashes = (1.0, ":") if chosen is None else (2.0, "-")
        axes.plot(azimuth, 90.0 - np.degrees(elevation), color=_colour(number), lw=width, ls=dashes, label=_label(item))
        if chosen is not None and chosen.crossing is not None:
            axes.plot(*style.sky_place(*chosen.crossing.position_rad.T), color="black", lw=0.8)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2, fontsize=8.0)


def _draw_wrap(axes: Any, planned: list[PlannedPass], limits: AxisLimits) -> None:
    """Axis azimuth of every pass, side by side; the other branches that would work are thin."""
    for bound in (limits.azimuth_min_rad, limits.azimuth_max_rad):
        axes.axhline(math.degrees(bound), color=LIMIT_COLOUR, ls=DASHED, lw=1.0)
    for number, (start, item) in enumerate(_in_a_row(planned)):
        minutes = start + (item.profile.t_s - item.profile.t_s[0]) / 60.0
        for branch in item.certificate.branches:
            if branch.works and branch is not item.certificate.chosen and branch.axes_rad is not None:
                axes.plot(minutes, np.degrees(branch.axes_rad[:, 0]), color="#b0b4b8", lw=0.9)
        taken = item.certificate.chosen
        if taken is not None and taken.axes_rad is not None:
            axes.plot(minutes, np.degrees(taken.axes_rad[:, 0]), color=_colour(number), lw=2.0)
        else:
            direct = np.degrees(item.profile.position_rad[:, 0])
            axes.plot(minutes, direct, color=_colour(number), lw=1.0, ls=":")
    axes.set_ylabel(f"axis {planned[0].certificate.mount.axes[0].replace('_', ' ')}, deg")
    _label_passes(axes, planned)


def _draw_rates(axes: Any, planned: list[PlannedPass]) -> None:
    """Draw the rates of the target, thin, and of the axes, thick, against the machine's."""
    labels = [name.replace("_", " ") for name in planned[0].certificate.mount.axes]
    for start, item in _in_a_row(planned):
        minutes = start + (item.profile.t_s - item.profile.t_s[0]) / 60.0
        wanted = np.degrees(np.abs(item.profile.velocity_rad_s))
        for axis in (0, 1):
            axes.plot(minutes, wanted[:, axis], color=AXIS_COLOURS[axis], lw=0.6, alpha=0.6)
            taken = item.certificate.chosen
            if taken is not None and taken.axes_rad is not None:
                given = np.abs(np.gradient(np.degrees(taken.axes_rad[:, axis]), item.profile.t_s))
                axes.plot(minutes, given, color=AXIS_COLOURS[axis], lw=1.8, label=labels[axis])
                labels[axis] = "_"
    if planned:
        limit = math.degrees(planned[0].certificate.machine.rate_limit_rad_s[0])
        axes.axhline(limit, color=LIMIT_COLOUR, ls=DASHED, lw=1.0)
        axes.set_ylim(0.0, 1.5 * limit)
        if any(item.certificate.chosen is not None for item in planned):
            axes.legend(loc="upper right", ncols=2)
    axes.set_ylabel("rate, deg/s (thin: target)")
    _label_passes(axes, planned)


def _in_a_row(planned: list[PlannedPass]) -> list[tuple[float, PlannedPass]]:
    """Return every pass with the minute at which it begins, without the hours between passes."""
    begins, found = 0.0, []
    for item in planned:
        found.append((begins, item))
        begins += item.profile.duration_s / 60.0 + 2.0
    return found


def _label_passes(axes: Any, planned: list[PlannedPass]) -> None:
    places = [(start + item.profile.duration_s / 120.0, _clock(item)) for start, item in _in_a_row(planned)]
    axes.set_xticks([place for place, _ in places], [label for _, label in places], fontsize=8.5)
    axes.grid(axis="x", visible=False)


def _label(item: PlannedPass) -> str:
    chosen = item.certificate.chosen
    peak = math.degrees(item.window.peak_elevation_rad)
    if chosen is None:
        return f"{_clock(item)} {peak:.0f}° refused"
    lost = f", {chosen.lost_s:.0f} s lost" if chosen.lost_s > 0.0 else ""
    return f"{_clock(item)} {peak:.1f}° {chosen.label}{lost}"


def _clock(item: PlannedPass) -> str:
    return f"{datetime.fromtimestamp(item.window.aos_t_s, UTC):%H:%M}"


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


def draw_covariance(
    known: Knowledge, rtn_m: Array, tracked_until_t_s: float, title: str, path: Path
) -> None:  # fmt: skip
    """Write the picture of a covariance to `path`; `rtn_m` (n, 3) are the sigmas of the total."""
    hours = (known.t_s - known.t_s[0]) / 3600.0
    with figure(path, 11.0, 6.0) as drawn:
        sigmas, tracks = drawn.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [4, 1]})
        for name, values in zip(("radial", "along the track", "across"), rtn_m.T, strict=True):
            sigmas.plot(hours, values, label=name)
        sigmas.plot(hours, known.sigma_m(known.formal), "k--", lw=1.0, label="all three, noise alone")
        sigmas.axvline((tracked_until_t_s - known.t_s[0]) / 3600.0, color="0.5", lw=1.0)
        sigmas.set(yscale="log", ylabel="sigma, m")
        sigmas.legend()
        for row, tracked in enumerate(known.tracked):
            tracks.plot(hours[tracked], np.full(int(np.sum(tracked)), row), "|", ms=12.0)
        tracks.set_yticks(range(len(known.names)), known.names)
        tracks.set(ylim=(-0.6, len(known.names) - 0.4), xlabel="hours")
        drawn.suptitle(title)


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


def _draw_cut(axes: Any, along: Array, gain: Array, used: BoolArray, colour: str) -> None:
    level = 10.0 * np.log10(np.maximum(gain, 10.0 ** (0.1 * FLOOR_DB)))
    axes.plot(along[used], level[used], ".", ms=2.5, color=colour)
    axes.plot(along[~used], level[~used], "x", ms=5.0, color=LIMIT_COLOUR)
    axes.set(ylim=(FLOOR_DB - 1.0, 3.0), ylabel="power, dB")


def _draw_map(drawn: Any, axes: Any, x: Array, y: Array, gain: Array, centre: Array) -> None:
    # Points rather than an interpolation: what lies between the lines was not measured.
    shown = axes.scatter(x, y, c=np.clip(gain, -0.05, 1.05), s=9.0, cmap="viridis", linewidths=0.0)
    axes.plot(*centre, "+", ms=14.0, color="#d55e00")
    axes.set(aspect="equal", xlabel="cross-elevation of the beam, deg")
    axes.set_ylabel("elevation of the beam, deg")
    drawn.colorbar(shown, ax=axes, label="share of the peak")
