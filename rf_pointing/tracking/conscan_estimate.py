"""One conscan estimate from one window, by either estimator, with the reason where it must not be used."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MU
from rf_pointing.tracking.conscan_likelihood import (
    BeamDesign,
    LikelihoodFit,
    beam_design,
    columns_independent,
    fit_beam,
    least_spread_rad,
)
from rf_pointing.tracking.conscan_linear import linear_estimate
from rf_pointing.tracking.conscan_parameters import ConscanParams
from rf_pointing.tracking.conscan_window import ConscanWindow, rank_reason
from rf_pointing.tracking.spin import spin_columns

__all__ = ["WindowEstimate", "estimate_window"]

Array = NDArray[np.float64]

SMALLEST_SPREAD = 0.05  # rms motion along the weaker axis, in scan radii
WORST_SPIN_INFLATION = 10.0
LEFT_OVER = 0.5
"""Of the misfit without the one sample that is to blame for it; no single one is for a power that fades."""


class WindowEstimate(NamedTuple):
    """Target minus origin (2,), covariance (2, 2); `reason` is why it must not be used, empty if it may.

    `left_out` is the row of the one sample without which the others follow the beam, None if all were used.
    """

    error_rad: Array
    covariance_rad2: Array
    reason: str
    left_out: int | None = None


def estimate_window(params: ConscanParams, window: ConscanWindow) -> WindowEstimate:
    """Return the direction of the target from the samples of one window."""
    x, y = window.beam_cross_elevation_rad, window.beam_elevation_rad
    design = beam_design(x, y, params.half_power_beamwidth_rad, _nuisance_columns(params, window))
    smallest_rad = SMALLEST_SPREAD * params.radius_rad
    if least_spread_rad(design) < smallest_rad:
        return _unknown(params, rank_reason(window.beam_rad, smallest_rad))
    try:
        return _linear(params, window) if params.estimator == "linear" else _likelihood(params, window, design)
    except np.linalg.LinAlgError:
        return _unknown(params, _singular_reason(params, window, design))


def _linear(params: ConscanParams, window: ConscanWindow) -> WindowEstimate:
    found = linear_estimate(window, params.half_power_beamwidth_rad, params.radius_rad)
    if found.power_w <= 0.0:
        return _unknown(params, f"mean carrier power {found.power_w:.3g} W must be > 0")
    return WindowEstimate(found.error_rad, found.covariance_rad2, _range_doubt(params, found.error_rad))


def _likelihood(params: ConscanParams, window: ConscanWindow, design: BeamDesign) -> WindowEstimate:
    power = window.power_w
    noise = window.sigma_w**2 / power
    if params.unmodelled_rad > 0.0:
        start = fit_beam(design, power, noise + _flutter(params, window, np.zeros(2)))
        if not start.converged:
            return _unknown(params, "the likelihood did not converge")
        noise = noise + _flutter(params, window, start.error_rad)
    found = fit_beam(design, power, noise)
    if not found.converged:
        return _unknown(params, "the likelihood did not converge")
    if found.chi_squared > params.misfit_limit and not params.spin_periods_s:
        worst = _farthest_off(params, window, found, noise)
        others = fit_beam(_without(design, worst), np.delete(power, worst), np.delete(noise, worst))
        explained = min(params.misfit_limit, LEFT_OVER * float(found.chi_squared))
        if others.converged and others.chi_squared <= explained:
            return WindowEstimate(
                others.error_rad, others.covariance_rad2, _range_doubt(params, others.error_rad), worst
            )
    if params.spin_periods_s:
        inflation = _spin_inflation(params, window, found, noise)
        if not 0.0 < inflation < WORST_SPIN_INFLATION:
            return _unknown(
                params, f"the spin cannot be told from the scan: it raises the variance {inflation:.0f} times"
            )
    doubt = _range_doubt(params, found.error_rad) or _misfit_doubt(params, float(found.chi_squared))
    return WindowEstimate(found.error_rad, found.covariance_rad2, doubt)


def _nuisance_columns(params: ConscanParams, window: ConscanWindow) -> Array | None:
    """Return what else may change the logarithm of the power: its drift over the window, the spin."""
    columns = []
    if params.drift:
        columns.append(np.linspace(-1.0, 1.0, len(window))[:, None])
    if params.spin_periods_s:
        columns.append(spin_columns(window.t_s, params.spin_periods_s))
    return np.concatenate(columns, axis=1) if columns else None


def _flutter(params: ConscanParams, window: ConscanWindow, target_rad: Array) -> Array:
    """Return what unseen motion of the beam adds to each variance over its power: P (2 mu |u - theta| sigma / h^2)^2.

    At least the slope at the scan radius counts.
    """
    away = np.maximum(np.hypot(*(window.beam_rad - target_rad).T), params.radius_rad)
    relative = 2.0 * MU * away * params.unmodelled_rad / params.half_power_beamwidth_rad**2
    return np.asarray(float(np.mean(window.power_w)) * relative**2)


def _farthest_off(params: ConscanParams, window: ConscanWindow, found: LikelihoodFit, noise_w: Array) -> int:
    """Return the row whose power is farthest, in its own sigmas, from the beam at that direction; the median is its level."""
    away = np.sum((window.beam_rad - found.error_rad) ** 2, axis=1)
    shape = np.exp(-MU * away / params.half_power_beamwidth_rad**2)
    expected = shape * float(np.median(window.power_w / shape))
    return int(np.argmax((window.power_w - expected) ** 2 / (noise_w * expected)))


def _without(design: BeamDesign, row: int) -> BeamDesign:
    columns, products, loss = (np.delete(part, row, axis=0) for part in design[:3])
    return BeamDesign(columns, products, loss, design.half_power_beamwidth_rad)


def _spin_inflation(params: ConscanParams, window: ConscanWindow, found: LikelihoodFit, noise_w: Array) -> float:
    """Return how many times the spin terms raise the variance of the worse axis."""
    x, y = window.beam_cross_elevation_rad, window.beam_elevation_rad
    without = fit_beam(beam_design(x, y, params.half_power_beamwidth_rad), window.power_w, noise_w)
    return float(np.max(np.diag(found.covariance_rad2) / np.diag(without.covariance_rad2)))


def _singular_reason(params: ConscanParams, window: ConscanWindow, design: BeamDesign) -> str:
    """Return why the estimate has no solution although the beam moved in both axes."""
    if not columns_independent(design):
        if not params.spin_periods_s:
            return "the drift of the power cannot be separated from the motion of the beam"
        return f"the spin cannot be told from the scan: spin_periods_s={params.spin_periods_s}"
    least, most = float(np.min(window.sigma_w)), float(np.max(window.sigma_w))
    return f"sigma_w from {least:.3g} to {most:.3g} W in one window: the samples outweigh each other"


def _unknown(params: ConscanParams, reason: str) -> WindowEstimate:
    return WindowEstimate(np.zeros(2), np.eye(2) * params.half_power_beamwidth_rad**2, reason)


def _range_doubt(params: ConscanParams, error_rad: Array) -> str:
    beamwidths = math.hypot(*error_rad.tolist()) / params.half_power_beamwidth_rad
    if beamwidths > params.valid_range_beamwidths:
        return f"error of {beamwidths:.2f} beamwidths is outside {params.valid_range_beamwidths:.2f} beamwidths"
    return ""


def _misfit_doubt(params: ConscanParams, chi_squared: float) -> str:
    if chi_squared > params.misfit_limit:
        return f"the power does not follow the beam: chi squared {chi_squared:.1f} is above {params.misfit_limit:.1f}"
    return ""
