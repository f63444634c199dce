"""Rows made from many fitted campaigns: coefficients, honesty of their sigma, residuals (SATCAL Tables 1, 3, 5)."""

import math

import numpy as np

from rf_pointing.calibration import Observations, terms_by_name
from rf_pointing.papers.row import Row
from rf_pointing.papers.satcal_campaign import Runs
from rf_pointing.papers.satcal_data import PCMC_DEG, model_of

__all__ = ["RADAR_SIGMA_DEG", "coefficient_rows", "honesty_rows", "limit_row", "order_row", "residual_rows"]

RADAR_SIGMA_DEG = 0.0057
"""Angular accuracy of the PCMC radars (SATCAL 4.2), taken as the noise of a point."""


def coefficient_rows(source: str, runs: Runs, remark: str) -> list[Row]:
    found = []
    for k, term in enumerate(terms_by_name(runs.names)):
        scale, unit = (math.degrees(1.0), "deg") if term.unit == "rad" else (1.0, "s")
        found.append(
            Row(
                quantity=f"x{term.number} {term.name.replace('_', ' ')}",
                source=source,
                paper=float(runs.truth[k]) * scale,
                ours=float(runs.first.values[k]) * scale,
                unit=unit,
                tolerance=3.0 * float(runs.first.sigma[k]) * scale,
                remark=remark if k == 0 else "",
            )
        )
    return found


def honesty_rows(source: str, runs: Runs, white: Runs | None) -> list[Row]:
    """Return the rows that say whether the stated sigma is honest, and not so large that everything lies within it."""
    inside = runs.within_three_sigma()
    angles = np.array([term.unit == "rad" for term in terms_by_name(runs.names)])
    sigma = np.sqrt(np.mean(runs.sigma**2, axis=0))
    spread = runs.spread_over_sigma()
    pairs = ", ".join(f"{_short(a)}-{_short(b)} {c:+.2f}" for a, b, c in runs.first.inseparable(0.9)) or "none"
    remark = ""
    if white is not None:
        ratio = white.spread_over_sigma()
        remark = (
            f"without orbit parameters: sigma {np.min(ratio):.1f} to {np.max(ratio):.1f} times too small, "
            f"{100.0 * np.mean(np.all(white.within_three_sigma(), axis=1)):.0f} % of {len(white.values)} runs within"
            " 3 sigma"
        )
    worst = int(np.argmax(np.abs(spread - 1.0)))
    count = len(runs.values)
    return [
        Row(
            quantity=f"share of {count} runs with all {len(runs.names)} terms within 3 sigma",
            source=source,
            paper=0.95,
            ours=float(np.mean(np.all(inside, axis=1))),
            unit="1",
            tolerance=0.0,
            bound=">=",
            remark=remark,
        ),
        Row(
            quantity=f"actual spread over stated sigma, worst term ({_short(runs.names[worst])})",
            source=source,
            paper=1.0,
            ours=float(spread[worst]),
            unit="1",
            tolerance=0.2,
        ),
        Row(
            quantity="largest sigma of an angle term",
            source=f"{source}, radar accuracy",
            paper=0.0057,
            ours=math.degrees(float(np.max(sigma[angles]))),
            unit="deg",
            tolerance=0.0,
            bound="<=",
            remark=f"term pairs with |correlation| >= 0.9: {pairs}",
        ),
        Row(
            quantity="largest sigma of a lag over the smallest planted lag",
            source=f"{source}, our limit",
            paper=0.05,
            ours=float(np.max(sigma[~angles]) / np.min(np.abs(runs.truth[~angles]))),
            unit="1",
            tolerance=0.0,
            bound="<=",
            remark="a timing error common to all passes is no part of this sigma: it is the lags",
        ),
    ]


def _short(name: str) -> str:
    return f"x{terms_by_name([name])[0].number}"


_TABLE_5 = {"PCMC-1": (-0.49, 0.17, 0.023, 0.016), "PCMC-2": (0.73, 0.05, 0.033, 0.011)}
"""Mean of azimuth and elevation uncorrected, rms of both corrected, degrees."""


def residual_rows(name: str, points: Observations, runs: Runs) -> list[Row]:
    first = runs.first
    left = (
        np.degrees(first.residual_azimuth_rad + first.pass_azimuth_rad),
        np.degrees(first.residual_elevation_rad + first.pass_elevation_rad),
    )
    raw = [np.degrees(part) for part in model_of(PCMC_DEG[name]).offset_rad(*points.motion())]
    found = []
    for k, axis in enumerate(("azimuth", "elevation")):
        found += [
            Row(
                quantity=f"{name} {axis} mean, uncorrected",
                source="Table 5",
                paper=_TABLE_5[name][k],
                ours=float(np.mean(raw[k])),
                unit="deg",
                tolerance=0.1,
                remark="" if k else "the paper's four passes are not given: ours peak at 35, 40, 67 and 43 deg",
            ),
            Row(
                quantity=f"{name} {axis} |mean|, corrected",
                source="Table 5",
                paper=0.0057,
                ours=abs(float(np.mean(left[k]))),
                unit="deg",
                tolerance=0.0,
                bound="<=",
            ),
            Row(
                quantity=f"{name} {axis} rms, corrected",
                source="Table 5",
                paper=_TABLE_5[name][2 + k],
                ours=float(np.sqrt(np.mean(left[k] ** 2))),
                unit="deg",
                tolerance=0.0,
                bound="<=",
                remark=f"noise {RADAR_SIGMA_DEG} deg plus the 200-m orbit; the paper saw second-order terms on top",
            ),
        ]
    return found


def order_row(quantity: str, paper: float, ours: float, unit: str, remark: str) -> Row:
    """Return a row that asks for the same order of magnitude: within a factor of 3."""
    return Row(
        quantity=f"{quantity}, decades from the paper's {paper:g} {unit} (ours {ours:.3g} {unit})",
        source="Table 2",
        paper=0.0,
        ours=math.log10(ours / paper),
        unit="1",
        tolerance=math.log10(3.0),
        remark=remark,
    )


def limit_row(quantity: str, source: str, paper: float, ours: float, unit: str, remark: str) -> Row:
    return Row(
        quantity=quantity,
        source=source,
        paper=paper,
        ours=ours,
        unit=unit,
        tolerance=0.0,
        bound="<=",
        remark=remark,
    )
