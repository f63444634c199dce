"""The report of a calibration: one HTML file with numbers, pictures, tables and doubts."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rf_pointing.calibration import (
    EXTENSION_TERMS,
    TERMS,
    FitResult,
    Observations,
    SectorRule,
    StageReport,
    doubts_of,
)
from rf_pointing.core import MDEG
from rf_pointing.core.dates import to_utc_text
from rf_pointing.core.whole_file import write_whole
from rf_pointing.report.calibration_pictures import draw_correlation, draw_coverage, draw_histogram, draw_residuals
from rf_pointing.report.html import Cell, document, figure, number, table, text

# People read millidegrees and milliseconds: in rad and s all coefficients are 0.00.
_UNITS = {"rad": ("mdeg", 1.0 / MDEG), "s": ("ms", 1e3), "s^2": ("10⁻³ s²", 1e3), "rad/K": ("mdeg/K", 1.0 / MDEG)}
_MOST_REJECTED = 20


def write_calibration_report(
    folder: Path | str,
    points: Observations,
    fit: FitResult,
    *,
    name: str,
    rule: SectorRule | None = None,
    stages: Sequence[StageReport] = (),
    notes: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> Path:
    """Write `report.html` and its pictures into `folder`, and return the file.

    `points` are the observations of `fit`, in the same order; `stages` are the reports of the
    pipeline, `notes` what was left out, `remarks` how the model did on passes it was not fitted to.
    """
    if len(points) != len(fit.used):
        raise ValueError(f"points={len(points)} must be the {len(fit.used)} observations of the fit")
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    chosen = rule or SectorRule()
    pictures = (
        (
            "coverage",
            "Sky coverage",
            "Observations in each of the sectors; zenith in the middle. Tinted sectors are thin.",
        ),
        ("residuals", "Residuals", "Observed minus ephemeris above, what the fit leaves over below."),
        ("histogram", "Distribution", "Used observations only; the curves have the rms of the residuals."),
        ("correlation", "Correlation of the terms", "These data do not separate terms beyond 0.95."),
    )
    draw_coverage(points, fit.used, chosen, place / "coverage.png")
    draw_residuals(points, fit, place / "residuals.png")
    draw_histogram(points, fit, place / "histogram.png")
    draw_correlation(fit, place / "correlation.png")
    parts = [
        f"<h1>Pointing model {text(name)}</h1>",
        f'<p class="soft">{text(fit.station)}, {text(fit.band)} band; {text(_span(fit))}. '
        f"{text(fit.form.capitalize())} form.</p>",
        _tiles(points, fit, chosen),
        *(f"<p>{text(remark)}.</p>" for remark in remarks),
        _notice(fit, points, chosen, notes),
        *(
            figure(place / f"{stem}.png", title, caption, narrow=stem in ("coverage", "correlation"))
            for stem, title, caption in pictures
        ),
        _coefficients(fit),
        _stages(stages),
        _pass_errors(fit),
        _rejected(fit),
    ]
    target = place / "report.html"
    write_whole(target, document(f"Pointing model {name}", parts))
    return target


def _span(fit: FitResult) -> str:
    first, last = (to_utc_text(t_s)[:19].replace("T", " ") for t_s in (fit.first_t_s, fit.last_t_s))
    return f"data from {first} to {last} UTC"


def _tiles(points: Observations, fit: FitResult, rule: SectorRule) -> str:
    before = np.stack([points.residual_azimuth_rad * fit.cos_elevation, points.residual_elevation_rad])[:, fit.used]
    rms_before = np.sqrt(np.mean(before**2, axis=1)) / MDEG
    rms_after = [value / MDEG for value in fit.rms_rad()]
    coverage = rule.coverage(points.true_azimuth_rad, points.true_elevation_rad)
    full = rule.count - len(coverage.thin)
    tiles = [
        (f"{number(rms_before[0])} / {number(rms_before[1])} mdeg", "rms before, cross-elevation / elevation", ""),
        (f"{number(rms_after[0])} / {number(rms_after[1])} mdeg", "rms after, cross-elevation / elevation", ""),
        (f"{int(np.sum(fit.used))} of {len(fit.used)}", f"observations used, of {fit.passes} passes", ""),
        (f"{full} of {rule.count}", "sectors filled", "good" if full == rule.count else "bad"),
        (number(fit.condition), "condition number", ""),
        (f"{fit.variance_azimuth:.2f} / {fit.variance_elevation:.2f}", "mean squared residual over stated noise", ""),
    ]
    return f'<div class="tiles">{"".join(_tile(*tile) for tile in tiles)}</div>'


def _tile(value: str, label: str, kind: str) -> str:
    return f'<div class="tile {kind}"><b>{value}</b><span>{text(label)}</span></div>'


def _notice(fit: FitResult, points: Observations, rule: SectorRule, notes: Sequence[str]) -> str:
    coverage = rule.coverage(points.true_azimuth_rad, points.true_elevation_rad)
    # Before the pictures: a low rms is no reason to trust terms that these data do not determine.
    items = [*notes, *doubts_of(fit, points), *fit.separation_advice()]
    if coverage.thin:
        thin = ", ".join(f"{rule.name(k)} ({coverage.counts[k]})" for k in coverage.thin[:6])
        more = f" and {len(coverage.thin) - 6} more" if len(coverage.thin) > 6 else ""
        items.append(f"sectors with fewer than {rule.fewest} observations: {thin}{more}")
    if not items:
        return ""
    listed = "".join(f"<li>{text(item)}</li>" for item in items)
    return f'<div class="notice"><b>What these data do not tell</b><ul>{listed}</ul></div>'


def _coefficients(fit: FitResult) -> str:
    known = {term.name: term for term in (*TERMS, *EXTENSION_TERMS)}
    rows: list[Sequence[Cell]] = []
    for term_name, value in fit.coefficients.items():
        unit, scale = _UNITS[known[term_name].unit]
        sigma = fit.sigma_of(term_name) if term_name in fit.names else None
        ratio = abs(value) / sigma if sigma else None
        rows.append(
            (
                term_name.replace("_", " "),
                unit,
                f"{value * scale:.2f}",
                "fixed" if sigma is None else f"{sigma * scale:.2f}",
                None if ratio is None else f"{ratio:.1f}",
            )
        )
    head = ("term", "unit", "value", "σ", "value / σ")
    return f"<h2>Coefficients</h2><p>Observed = true + model(true).</p>{table(head, rows, words=(0, 1))}"


def _stages(stages: Sequence[StageReport]) -> str:
    if not stages:
        return ""
    rows = [
        (one.stage, one.before, one.after, ", ".join(f"{n} {why}" for why, n in one.dropped.items() if n), one.note)
        for one in stages
    ]
    return f"<h2>From samples to observations</h2>{table(('stage', 'in', 'out', 'dropped', 'note'), rows, words=(0, 3, 4))}"


def _pass_errors(fit: FitResult) -> str:
    if not fit.pass_errors:
        return ""
    names = tuple(fit.pass_errors[0].values)
    rows = [
        (str(one.pass_id), *(f"{one.values[name]:.3g} ± {one.sigma[name]:.2g}" for name in names))
        for one in fit.pass_errors
    ]
    head = ("pass", *(name.replace("_", " ") for name in names))
    return f"<h2>Orbit and clock errors of the passes</h2>{table(head, rows)}"


def _rejected(fit: FitResult) -> str:
    if not fit.rejected:
        return ""
    rows = [(str(one.row), str(one.pass_id), one.reason) for one in fit.rejected[:_MOST_REJECTED]]
    more = len(fit.rejected) - len(rows)
    rest = f"<p>and {more} more.</p>" if more > 0 else ""
    share = 100.0 * len(fit.rejected) / len(fit.used)
    return f"<h2>Edited out: {share:.1f} %</h2>{table(('row', 'pass', 'why'), rows, words=(0, 1, 2))}{rest}"
