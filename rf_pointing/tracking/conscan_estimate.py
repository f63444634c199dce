"""One conscan estimate from one window: parameters, two estimators, and when not to use it.

The likelihood is that of `beam_fit`.  The linear estimator is the paper's weighted least squares on
the linearised power (CONSCAN eqs. 8-18):

    P_i = g_i (C1 + C2 x_i/r + C3 y_i/r),  error = h C_{2,3} / (k_s C1)

(x, y) is the beam's offset from the scan centre; g_i = exp(-mu (x^2 + y^2 - r^2) / h^2) is 1 on the
circle and lets the beam leave it.  The covariance follows from the Jacobian of that ratio.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rf_pointing.core import MDEG, MU, Array, Params, parameter
from rf_pointing.tracking.beam_fit import (
    BeamDesign,
    LikelihoodFit,
    PowerWindow,
    beam_design,
    columns_independent,
    fit_beam,
    is_singular,
    least_spread_rad,
    rank_reason,
    spin_columns,
)
from rf_pointing.tracking.scan import ONCE_A_ROUND, LoopRate, Pattern, ScanParams

SMALLEST_SPREAD = 0.05  # rms motion along the weaker axis, in scan radii
# Mean power in sigmas of one sample below which errors come out too small: each sample's weight is
# made of its own noise.  It is that of C/N0 times integration time of about 10.5 dB.
LEAST_POWER_SIGMAS = 2.3
# A spin close to the scan's period leaves a variance so large that nothing is measured.
WORST_SPIN_INFLATION = 10.0
# Reject one sample only if removing it reduces the misfit by this factor; a fading power has no
# single sample to blame.
LEFT_OVER = 0.5
# Least power of the linear model, as a share of the mean power.
LEAST_LEVEL = 0.1


@dataclass(frozen=True, kw_only=True)
class ConscanParams(Params):
    """Beam, scan and window of the estimate."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    radius_rad: float = parameter(5.93 * MDEG, "scan radius", 1e-8, 0.1)
    period_s: float = parameter(32.0, "time of one turn of the scan", 0.1, 3600.0)
    ramp_s: float = parameter(4.0, "time over which the radius grows from zero", 0.0, 600.0)
    estimator: str = parameter(
        "likelihood", "exact beam, or the paper's weighted least squares", choices=("likelihood", "linear")
    )
    window_samples: int = parameter(32, "carrier power samples of one estimate", 4, 10000)
    updates: str = parameter(
        "window", "one estimate per separate window, or one per sample (sliding)", choices=("window", "sample")
    )
    fewest_samples: int = parameter(32, "samples from which a sliding window gives estimates", 4, 10000)
    sample_s: float = parameter(1.0, "time between two carrier powers", 1e-3, 60.0)
    bandwidth_hz: float = parameter(0.05, "bandwidth of the loop on the estimates of a sliding window", 0.0, 5.0)
    drift: bool = parameter(False, "whether a steady change of the power is estimated along")
    unmodelled_rad: float = parameter(0.0, "motion of the beam that the encoders do not see, rms", 0.0, 0.01)
    max_age_s: float = parameter(120.0, "age at which samples leave the window", 0.1, 36000.0)
    delay_s: float = parameter(0.0, "time from the beam's position to the power it gives", -60.0, 60.0)
    spin_periods_s: tuple[float, ...] = parameter(
        (), "periods of power modulation to take out, harmonics included", 0.01, 36000.0
    )
    valid_range_beamwidths: float = parameter(1.0, "largest error that is believed", 0.05, 2.0)
    lock_db_hz: float = parameter(15.0, "smallest C/N0 of a sample that is used", 0.0, 120.0)
    misfit_limit: float = parameter(
        6.0, "largest chi squared per degree of freedom of the power about the beam", 1.5, 1e6
    )

    def check_together(self) -> None:
        """Refuse a scan that leaves the beam, and windows that cannot be filled or solved."""
        if self.radius_rad > 0.5 * self.half_power_beamwidth_rad:
            raise ValueError(
                f"radius_rad={self.radius_rad} must be <= {0.5 * self.half_power_beamwidth_rad}, half of "
                "half_power_beamwidth_rad: the scan leaves the beam"
            )
        if self.spin_periods_s and self.estimator == "linear":
            raise ValueError(f"spin_periods_s={self.spin_periods_s} needs estimator=likelihood, not linear")
        ordered = sorted(self.spin_periods_s)
        if any(later < 1.01 * earlier for earlier, later in pairwise(ordered)):
            raise ValueError(f"spin_periods_s={self.spin_periods_s} must differ by at least 1 %")
        if self.drift and self.estimator == "linear":
            raise ValueError("drift=True needs estimator=likelihood, not linear")
        unknowns = 3 + self.drift + 2 * len(self.spin_periods_s)
        for name in ("window_samples", "fewest_samples"):
            if getattr(self, name) <= unknowns:
                raise ValueError(f"{name}={getattr(self, name)} must be > {unknowns}, the number of unknowns")

    @property
    def age_s(self) -> float:
        """How long before the newest sample those of a full window lie on average."""
        return 0.5 * self.window_samples * self.sample_s

    @property
    def loop(self) -> LoopRate:
        """How the tracking loop follows the estimates."""
        return LoopRate(self.bandwidth_hz) if self.updates == "sample" else ONCE_A_ROUND

    def pattern(self) -> Pattern:
        """Return the motion of the beam."""
        return self.scan.pattern()

    @property
    def scan(self) -> ScanParams:
        """The circle to command."""
        return ScanParams(radius_rad=self.radius_rad, period_s=self.period_s, ramp_s=self.ramp_s)


def linear_rows(window: PowerWindow, half_power_beamwidth_rad: float, radius_rad: float) -> Array:
    """Return dP/dC (3, n), the regressors of the linearised power (CONSCAN eq. 8)."""
    x, y = window.beam_rad.T / radius_rad
    shape = MU * (radius_rad / half_power_beamwidth_rad) ** 2
    return np.asarray(np.exp(-shape * (x**2 + y**2 - 1.0)) * np.stack([np.ones_like(x), x, y]))


class WindowEstimate(NamedTuple):
    """Target minus origin (2,), covariance (2, 2); `reason` why not to use it, or empty.

    `left_out` is the row of the one sample without which the others follow the beam, None if all
    were used.
    """

    error_rad: Array
    covariance_rad2: Array
    reason: str
    left_out: int | None = None


def estimate_window(params: ConscanParams, window: PowerWindow) -> WindowEstimate:
    """Return the direction of the target from the samples of one window."""
    design = beam_design(window.beam_rad, params.half_power_beamwidth_rad, _nuisance_columns(params, window))
    smallest_rad = SMALLEST_SPREAD * params.radius_rad
    if least_spread_rad(design) < smallest_rad:
        return _unknown(params, rank_reason(window.beam_rad, smallest_rad))
    try:
        found = _linear(params, window) if params.estimator == "linear" else _likelihood(params, window, design)
    except np.linalg.LinAlgError:
        return _unknown(params, _singular_reason(params, window, design))
    faint = _faint_doubt(window)
    return found._replace(reason=faint) if faint and not found.reason else found


def _faint_doubt(window: PowerWindow) -> str:
    """Return why the samples are too noisy one by one, however many they are; empty if not."""
    sigmas = float(np.mean(window.power_w)) / math.sqrt(float(np.mean(window.sigma_w**2)))
    if sigmas >= LEAST_POWER_SIGMAS:
        return ""
    level_db_hz = float(np.mean(window.carrier_to_noise_db_hz))
    return (
        f"C/N0 {level_db_hz:.1f} dB-Hz is too low for samples this short: power of {sigmas:.1f} sigmas must be >= "
        f"{LEAST_POWER_SIGMAS}, or errors come out too small"
    )


def _linear(params: ConscanParams, window: PowerWindow) -> WindowEstimate:
    """Return the weighted least-squares estimate of eqs. (13)-(18).

    A sample's noise is stated from its own power: taken as it is, it gives weight to those that are
    low by chance.  So a first solution says what the power is.
    """
    rows = linear_rows(window, params.half_power_beamwidth_rad, params.radius_rad)
    level, _ = _weighted(rows, window.power_w, window.sigma_w**2)
    expected_w = np.maximum(level @ rows, LEAST_LEVEL * np.mean(window.power_w))
    (mean, right, up), variance = _weighted(rows, window.power_w, window.sigma_w**2 * expected_w / window.power_w)
    if mean <= 0.0:
        return _unknown(params, f"mean carrier power {mean:.3g} W must be > 0")
    scale = params.half_power_beamwidth_rad**2 / (2.0 * MU * params.radius_rad)
    jacobian = scale / mean * np.array([[-right / mean, 1.0, 0.0], [-up / mean, 0.0, 1.0]])
    error_rad = scale / mean * np.array([right, up])
    return WindowEstimate(error_rad, jacobian @ variance @ jacobian.T, _range_doubt(params, error_rad))


def _weighted(rows: Array, power_w: Array, variance_w2: Array) -> tuple[Array, Array]:
    """Return the weighted least-squares coefficients of `rows` and their covariance."""
    weighted = rows / variance_w2
    information = weighted @ rows.T
    if is_singular(information):
        raise np.linalg.LinAlgError("the samples do not determine the direction: one outweighs the others")
    covariance: Array = np.asarray(np.linalg.inv(information))
    return covariance @ (weighted @ power_w), covariance


def _likelihood(params: ConscanParams, window: PowerWindow, design: BeamDesign) -> WindowEstimate:
    power = window.power_w
    noise = window.sigma_w**2 / power
    # The noise of unseen motion depends on the error, so a first fit without it must give that.
    if params.unmodelled_rad > 0.0:
        start = fit_beam(design, power, noise + _flutter(params, window, np.zeros(2)))
        if not start.converged:
            return _unknown(params, "the likelihood did not converge")
        noise = noise + _flutter(params, window, start.error_rad)
    found = fit_beam(design, power, noise)
    if not found.converged:
        return _unknown(params, "the likelihood did not converge")
    # One sample that does not fit, as from a burst of interference, is left out.
    if found.chi_squared > params.misfit_limit and not params.spin_periods_s:
        worst = _farthest_off(params, window, found, noise)
        others = fit_beam(_without(design, worst), np.delete(power, worst), np.delete(noise, worst))
        explained = min(params.misfit_limit, LEFT_OVER * float(found.chi_squared))
        if others.converged and others.chi_squared <= explained:
            doubt = _range_doubt(params, others.error_rad)
            return WindowEstimate(others.error_rad, others.covariance_rad2, doubt, worst)
    if params.spin_periods_s:
        alone = fit_beam(beam_design(window.beam_rad, params.half_power_beamwidth_rad), power, noise)
        # How many times the spin terms raise the variance of the worse axis.
        inflation = float(np.max(np.diag(found.covariance_rad2) / np.diag(alone.covariance_rad2)))
        # Not a number fails the comparison too.
        if not inflation < WORST_SPIN_INFLATION:
            reason = f"the spin cannot be separated from the scan: it raises the variance {inflation:.0f} times"
            return _unknown(params, reason)
    doubt, misfit = _range_doubt(params, found.error_rad), float(found.chi_squared)
    if not doubt and misfit > params.misfit_limit:
        doubt = f"the power does not follow the beam: chi squared {misfit:.1f} is above {params.misfit_limit:.1f}"
    return WindowEstimate(found.error_rad, found.covariance_rad2, doubt)


def _nuisance_columns(params: ConscanParams, window: PowerWindow) -> Array | None:
    """Return columns for the drift of the power over the window, and for the spin."""
    columns = []
    if params.drift:
        columns.append(np.linspace(-1.0, 1.0, len(window))[:, None])
    if params.spin_periods_s:
        columns.append(spin_columns(window.t_s, params.spin_periods_s))
    return np.concatenate(columns, axis=1) if columns else None


def _flutter(params: ConscanParams, window: PowerWindow, target_rad: Array) -> Array:
    """Return what unseen motion adds to variance / power: P (2 mu |u - theta| sigma / h^2)^2."""
    # At least the slope at the scan radius counts.
    away = np.maximum(np.hypot(*(window.beam_rad - target_rad).T), params.radius_rad)
    relative = 2.0 * MU * away * params.unmodelled_rad / params.half_power_beamwidth_rad**2
    return np.asarray(float(np.mean(window.power_w)) * relative**2)


def _farthest_off(params: ConscanParams, window: PowerWindow, found: LikelihoodFit, noise_w: Array) -> int:
    """Return the row farthest, in its own sigmas, from the beam at that direction."""
    away = np.sum((window.beam_rad - found.error_rad) ** 2, axis=1)
    shape = np.exp(-MU * away / params.half_power_beamwidth_rad**2)
    expected = shape * float(np.median(window.power_w / shape))
    return int(np.argmax((window.power_w - expected) ** 2 / (noise_w * expected)))


def _without(design: BeamDesign, row: int) -> BeamDesign:
    columns, products, loss = (np.delete(part, row, axis=0) for part in design[:3])
    return BeamDesign(columns, products, loss, design.half_power_beamwidth_rad)


def _singular_reason(params: ConscanParams, window: PowerWindow, design: BeamDesign) -> str:
    """Return why the estimate has no solution although the beam moved in both axes."""
    if not columns_independent(design):
        if not params.spin_periods_s:
            return "the drift of the power cannot be separated from the motion of the beam"
        return f"the spin cannot be separated from the scan: spin_periods_s={params.spin_periods_s}"
    least, most = float(np.min(window.sigma_w)), float(np.max(window.sigma_w))
    return f"sigma_w from {least:.3g} to {most:.3g} W in one window: the samples outweigh each other"


def _unknown(params: ConscanParams, reason: str) -> WindowEstimate:
    return WindowEstimate(np.zeros(2), np.eye(2) * params.half_power_beamwidth_rad**2, reason)


def _range_doubt(params: ConscanParams, error_rad: Array) -> str:
    beamwidths = math.hypot(*error_rad.tolist()) / params.half_power_beamwidth_rad
    if beamwidths > params.valid_range_beamwidths:
        return f"error of {beamwidths:.2f} beamwidths is outside {params.valid_range_beamwidths:.2f} beamwidths"
    return ""
