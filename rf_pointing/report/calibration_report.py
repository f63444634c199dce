"""The report of a calibration: one HTML file with numbers, pictures, tables and warnings."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration import FitResult, Observations, SectorRule, StageReport, warnings_of
from rf_pointing.calibration.coverage import on_the_sky
from rf_pointing.calibration.terms import ALL_TERMS
from rf_pointing.core import MDEG, Array, BoolArray, to_utc_text, write_whole
from rf_pointing.report.html import Cell, render
from rf_pointing.report.picture_style import AXIS_COLOURS, LIMIT_COLOUR, figure, legend_above

AXIS_NAMES = ("cross-elevation", "elevation")
THIN_COLOUR = "#f4c9b8"
# People read millidegrees and milliseconds: in rad and s all coefficients are 0.00.
_UNITS = {"rad": ("mdeg", 1.0 / MDEG), "s": ("ms", 1e3), "s^2": ("10⁻³ s²", 1e3), "rad/K": ("mdeg/K", 1.0 / MDEG)}


def write_calibration_report(
    folder: Path | str, points: Observations, fit: FitResult, *, name: str,
    stages: Sequence[StageReport] = (), notes: Sequence[str] = (), remarks: Sequence[str] = (),
) -> Path:  # fmt: skip
    """Write `report.html` and its pictures into `folder`, and return the file.

    `points` are the observations of `fit`, in the same order; `stages` are the reports of the
    pipeline, `notes` what was left out, `remarks` how the model did on passes it was not fitted to.
    """
    if len(points) != len(fit.used):
        raise ValueError(f"points={len(points)} must be the {len(fit.used)} observations of the fit")
    place, rule = Path(folder), SectorRule()
    place.mkdir(parents=True, exist_ok=True)
    coverage = rule.coverage(*points.sky_rad())
    warnings = [*notes, *warnings_of(fit, points), *fit.separation_advice()]
    if coverage.thin:
        thin = ", ".join(f"{rule.name(k)} ({coverage.counts[k]})" for k in coverage.thin[:6])
        more = f" and {len(coverage.thin) - 6} more" if len(coverage.thin) > 6 else ""
        warnings.append(f"sectors with fewer than {rule.fewest} observations: {thin}{more}")
    draw_coverage(points, fit.used, rule, place / "coverage.png")
    draw_residuals(points, fit, place / "residuals.png")
    draw_histogram(points, fit, place / "histogram.png")
    draw_correlation(fit, place / "correlation.png")
    return _written(
        place, "calibration.html", title=f"Pointing model {name}", fit=fit,
        first_utc=to_utc_text(fit.first_t_s), last_utc=to_utc_text(fit.last_t_s),
        rms_before_mdeg=np.sqrt(np.mean(_before(points)[:, fit.used] ** 2, axis=1)) / MDEG,
        rms_after_mdeg=np.array(fit.rms_rad()) / MDEG, sectors=rule.count,
        filled=rule.count - len(coverage.thin), remarks=remarks, warnings=warnings,
        coefficients=_coefficients(fit), pass_errors=_pass_errors(fit),
        stages=[
            (i.stage, i.before, i.after, ", ".join(f"{n} {why}" for why, n in i.dropped.items() if n), i.note)
            for i in stages
        ],
        rejected=[(str(one.row), str(one.pass_id), one.reason) for one in fit.rejected],
    )  # fmt: skip


def _written(place: Path, template: str, **values: Any) -> Path:
    write_whole(place / "report.html", render(template, folder=place, **values))
    return place / "report.html"


def write_campaign_report(folder: Path | str, points: Observations | None, why: Sequence[str]) -> Path:
    """Write `report.html` of a campaign that has given no model, and return the file.

    `why` are the reasons, one sentence each; `points` what was observed, None for nothing.
    """
    place, rule = Path(folder), SectorRule()
    place.mkdir(parents=True, exist_ok=True)
    filled, passes, times = 0, 0, (0.0, 0.0)
    if points is not None:
        filled = rule.count - len(rule.coverage(*points.sky_rad()).thin)
        passes, times = len(points.passes), (float(np.min(points.t_s)), float(np.max(points.t_s)))
        draw_coverage(points, np.ones(len(points), dtype=bool), rule, place / "coverage.png")
    return _written(
        place, "campaign.html", title="Campaign without a model", points=points,
        why=[*why] or ["it was broken off before its first pass had ended"],
        first_utc=to_utc_text(times[0]), last_utc=to_utc_text(times[1]), passes=passes,
        sectors=rule.count, filled=filled,
    )  # fmt: skip


def _coefficients(fit: FitResult) -> list[Sequence[Cell]]:
    rows: list[Sequence[Cell]] = []
    for name, value in fit.coefficients.items():
        unit, scale = _UNITS[ALL_TERMS[name].unit]
        sigma = fit.sigma_of(name) if name in fit.names else None
        shown = "fixed" if sigma is None else f"{sigma * scale:.2f}"
        ratio = f"{abs(value) / sigma:.1f}" if sigma else None
        rows.append((name.replace("_", " "), unit, f"{value * scale:.2f}", shown, ratio))
    return rows


def _pass_errors(fit: FitResult) -> list[Sequence[str]]:
    """Return the head and the rows of the table, nothing where no pass error was estimated."""
    if not fit.pass_errors:
        return []
    names = tuple(fit.pass_errors[0].values)
    return [
        ("pass", *(name.replace("_", " ") for name in names)),
        *((str(i.pass_id), *(f"{i.values[n]:.3g} ± {i.sigma[n]:.2g}" for n in names)) for i in fit.pass_errors),
    ]


def draw_coverage(points: Observations, used: BoolArray, rule: SectorRule, path: Path) -> None:
    """Sky with zenith in the middle: sectors with their counts, thin ones tinted, and points."""
    coverage = rule.coverage(*points.sky_rad())
    with figure(path, 7.0, 7.0) as drawn:
        axes = drawn.add_subplot(projection="polar")
        axes.set(theta_zero_location="N", theta_direction=-1, ylim=(0.0, 90.0), yticks=(10, 30, 60, 80))
        axes.set_yticklabels(["80°", "60°", "30°", "10°"], fontsize=8.0, color=LIMIT_COLOUR)
        width = 2.0 * np.pi / rule.azimuth_sectors
        for sector, count in enumerate(coverage.counts.tolist()):
            band, column = divmod(sector, rule.azimuth_sectors)
            low, high = (90.0 - np.degrees(edge) for edge in rule.elevation_edges_rad[band : band + 2])
            colour = THIN_COLOUR if sector in coverage.thin else "none"
            place = (column + 0.5) * width
            axes.bar(place, low - high, width, bottom=high, color=colour, edgecolor="#888888", lw=0.7, zorder=0.5)
            axes.text(place, 0.5 * (low + high), str(count), ha="center", va="center", fontsize=8.0, zorder=4.0,
                      bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8})  # fmt: skip
        for rows, colour, label in ((used, AXIS_COLOURS[0], "used"), (~used, AXIS_COLOURS[1], "edited out")):
            if np.any(rows):
                azimuth, elevation = on_the_sky(*points.select(rows).sky_rad())
                zenith = 90.0 - np.degrees(elevation)
                # Above the bars: points under them would look like missing data.
                axes.plot(azimuth, zenith, ".", ms=2.0, color=colour, label=label, zorder=3.0)
        axes.legend(loc="lower left", bbox_to_anchor=(-0.05, -0.05), markerscale=4.0)


def draw_residuals(points: Observations, fit: FitResult, path: Path) -> None:
    """Residuals before the fit above, after it below, over azimuth, elevation and time."""
    hours = (points.t_s - points.t_s.min()) / 3600.0
    over = (
        (np.degrees(np.mod(points.true_azimuth_rad, 2.0 * np.pi)), f"{points.mount.axes[0]}, deg"),
        (np.degrees(points.true_elevation_rad), f"{points.mount.axes[1]}, deg"),
        (hours if hours.max() > 2.0 else 60.0 * hours, f"time, {'h' if hours.max() > 2.0 else 'min'}"),
    )
    with figure(path, 11.0, 6.0) as drawn:
        grid = drawn.subplots(2, 3, sharex="col", sharey="row")
        for row, (values, name) in enumerate(((_before(points), "before"), (_after(fit), "after"))):
            for column, (x, label) in enumerate(over):
                axes = grid[row][column]
                for axis in (0, 1):
                    axes.plot(x, values[axis] / MDEG, ".", ms=2.5, color=AXIS_COLOURS[axis], label=AXIS_NAMES[axis])
                axes.axhline(0.0, color="#888888", lw=0.7)
                if row == 1:
                    axes.set_xlabel(label)
            # Used rows only: one outlier of degrees would flatten all others to a line.
            limit = 1.15 * float(np.max(np.abs(values[:, fit.used]))) / MDEG
            grid[row][0].set(ylabel=f"{name}, mdeg on the sky", ylim=(-limit, limit))
        legend_above(grid[0][0])
        for handle in grid[0][0].get_legend().get_lines():
            handle.set_markersize(7.0)


def draw_histogram(points: Observations, fit: FitResult, path: Path) -> None:
    """Distribution of the residuals before and after, with the normal curve of that rms."""
    with figure(path, 10.0, 3.8) as drawn:
        left, right = drawn.subplots(1, 2)
        for axes, values, name in ((left, _before(points), "before"), (right, _after(fit), "after")):
            used = values[:, fit.used] / MDEG
            edges = np.linspace(float(used.min()), float(used.max()), 41)
            for axis, label in enumerate(AXIS_NAMES if axes is left else ("_", "_")):
                filled = {"histtype": "stepfilled", "alpha": 0.45, "color": AXIS_COLOURS[axis]}
                axes.hist(used[axis], edges, label=label, **filled)
            axes.set(xlabel=f"{name}, mdeg on the sky", ylabel="observations")
        _normal(right, _after(fit)[:, fit.used] / MDEG)
        legend_above(left)
        legend_above(right)


def draw_correlation(fit: FitResult, path: Path) -> None:
    """Correlation matrix of the fitted terms; values of 0.5 and more are written."""
    names = [name.replace("_", " ") for name in fit.names]
    size = 2.8 + 0.42 * len(names)
    with figure(path, size + 1.0, size) as drawn:
        axes = drawn.add_subplot()
        image = axes.imshow(fit.correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axes.set_xticks(range(len(names)), names, rotation=90, fontsize=8.5)
        axes.set_yticks(range(len(names)), names, fontsize=8.5)
        axes.grid(visible=False)
        for i, j in np.argwhere(np.abs(fit.correlation) >= 0.5):
            if i != j:
                value = fit.correlation[i, j]
                colour = "white" if abs(value) > 0.75 else "black"
                axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7.5, color=colour)
        drawn.colorbar(image, ax=axes, label="correlation", shrink=0.8)


def _before(points: Observations) -> Array:
    across = points.residual_azimuth_rad * np.cos(points.true_elevation_rad)
    return np.stack([across, points.residual_elevation_rad])


def _after(fit: FitResult) -> Array:
    return np.stack([fit.residual_azimuth_rad * fit.cos_elevation, fit.residual_elevation_rad])


def _normal(axes: Any, values: Array) -> None:
    low, high = axes.get_xlim()
    x = np.linspace(low, high, 201)
    step = (float(values.max()) - float(values.min())) / 40.0
    for axis in (0, 1):
        rms = float(np.sqrt(np.mean(values[axis] ** 2)))
        curve = values.shape[1] * step / (rms * np.sqrt(2.0 * np.pi)) * np.exp(-0.5 * (x / rms) ** 2)
        axes.plot(x, curve, color=AXIS_COLOURS[axis], lw=1.4, label=f"normal, {rms:.2f} mdeg rms")
