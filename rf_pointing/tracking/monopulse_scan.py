"""Calibration scan of a monopulse receiver: circle the target, fit the response of both channels.

rho = b + M g(theta0 - u), u the beam's offset from the predicted direction, g the feed's curve:
(h/k) tanh(k x / h) or straight. The target's own offset theta0 comes from the power of the sum, so
b is the shift of the null against the beam's peak.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rf_pointing.core import MDEG, Array, ComplexArray, MonopulseCluster, Params, parameter
from rf_pointing.tracking.beam_fit import beam_design, fit_beam, is_singular, least_spread_rad, rank_reason
from rf_pointing.tracking.monopulse import (
    CURVES,
    MonopulseCalibration,
    cluster_fault,
    difference_ratio,
    sample_period_s,
)
from rf_pointing.tracking.scan import ScanParams

SMALLEST_SPREAD = 0.2  # rms motion of the beam along the weaker axis, in scan radii


@dataclass(frozen=True, kw_only=True)
class MonopulseScanParams(Params):
    """The circle of the calibration and what makes its result good enough."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    slope: float = parameter(1.57, "h d(difference/sum)/dx of the ideal feed", 0.1, 2.5)
    curve: str = parameter("tanh", "difference/sum of the feed: tanh for Gaussian beams, or straight", choices=CURVES)
    radius_beamwidths: float = parameter(0.25, "radius of the circle", 0.02, 0.5)
    period_s: float = parameter(20.0, "time of one turn", 1.0, 600.0)
    ramp_s: float = parameter(3.0, "time over which the radius grows from zero", 0.0, 60.0)
    lock_db_hz: float = parameter(35.0, "smallest C/N0 of a cluster that is used", 0.0, 120.0)
    misfit_limit: float = parameter(4.0, "largest chi squared per degree of freedom", 1.2, 1e6)

    @property
    def scan(self) -> ScanParams:
        """The circle to command."""
        radius = self.radius_beamwidths * self.half_power_beamwidth_rad
        return ScanParams(radius_rad=radius, period_s=self.period_s, ramp_s=self.ramp_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class MonopulseScanState:
    """Per cluster: ratios, their variance, C/N0 and its variance, beam offset; rejections."""

    ratios: tuple[tuple[complex, complex], ...] = ()
    measures: tuple[tuple[float, float, float, float, float], ...] = ()
    rejected: int = 0
    last_rejection: str = ""


class CalibrationFit(NamedTuple):
    """The calibration, the standard deviation (2,) of the columns of M, and the misfit."""

    calibration: MonopulseCalibration
    response_sigma_per_rad: Array
    chi_squared: float


class MonopulseCalibrator:
    """Collects clusters of the scan; `solve` fits the calibration."""

    def __init__(self, params: MonopulseScanParams) -> None:
        self.params = params
        self.state = MonopulseScanState()

    def add(self, cluster: MonopulseCluster, beam_cross_elevation_rad: float, beam_elevation_rad: float) -> None:
        """Take one cluster and the beam's offset from the predicted direction at its mean time."""
        fault = cluster_fault(cluster)
        if not fault and cluster.carrier_to_noise_db_hz < self.params.lock_db_hz:
            fault = (
                f"no lock: C/N0 {cluster.carrier_to_noise_db_hz:.1f} dB-Hz is below {self.params.lock_db_hz:.1f} dB-Hz"
            )
        if fault:
            self.state = replace(self.state, rejected=self.state.rejected + 1, last_rejection=fault)
            return
        sample_s, count = sample_period_s(cluster.t_s), len(cluster.t_s)
        level = 10.0 ** (cluster.carrier_to_noise_db_hz / 10.0)
        snr = level * sample_s
        right, up = difference_ratio(cluster, snr)
        noise = (1.0 + 1.0 / snr) / (count * snr)
        power_noise = (2.0 + 1.0 / snr) / (count * sample_s)
        measure = (noise, level, power_noise, beam_cross_elevation_rad, beam_elevation_rad)
        ratios = (*self.state.ratios, (complex(right), complex(up)))
        self.state = replace(self.state, ratios=ratios, measures=(*self.state.measures, measure))

    def solve(self) -> CalibrationFit:
        """Return the calibration; ValueError names what the scan did not determine."""
        # Three complex unknowns a channel; the other clusters judge the misfit.
        if len(self.state.ratios) < 8:
            raise ValueError(f"the calibration scan has {len(self.state.ratios)} clusters, must have at least 8")
        noise, level, power_noise, x, y = np.array(self.state.measures).T
        h = self.params.half_power_beamwidth_rad
        beam = np.stack([x, y], axis=1)
        design, smallest_rad = beam_design(beam, h), SMALLEST_SPREAD * self.params.scan.radius_rad
        if least_spread_rad(design) < smallest_rad:
            raise ValueError(f"calibration scan: {rank_reason(beam, smallest_rad)}")
        # The target's offset comes from the power: the null is found against the beam's peak.
        target_rad = fit_beam(design, level, power_noise).error_rad
        scale = self.params.slope / h
        offset = target_rad - beam
        curve = offset if self.params.curve == "straight" else np.tanh(scale * offset) / scale
        return self._fit(np.column_stack([np.ones_like(x), curve]), np.array(self.state.ratios), noise)

    def _fit(self, columns: Array, ratios: ComplexArray, noise: Array) -> CalibrationFit:
        weight = 1.0 / (noise[:, None] * (1.0 + np.abs(ratios) ** 2))
        solution, covariances, misfit = np.empty((3, 2), dtype=complex), [], 0.0
        for channel in (0, 1):
            weighted = columns * weight[:, channel, None]
            information = weighted.T @ columns
            if is_singular(information):
                raise ValueError(
                    "calibration scan: one cluster outweighs the others, or all lie beyond the feed's curve"
                )
            covariances.append(np.linalg.inv(information))
            solution[:, channel] = covariances[-1] @ (weighted.T @ ratios[:, channel])
            residual = ratios[:, channel] - columns @ solution[:, channel]
            misfit += float(np.sum(weight[:, channel] * np.abs(residual) ** 2))
        chi_squared = misfit / (2 * (len(columns) - 3))
        if chi_squared > self.params.misfit_limit:
            raise ValueError(
                f"the ratios do not follow the feed: chi squared {chi_squared:.1f} must be <= "
                f"{self.params.misfit_limit}"
            )
        sigma_per_rad = np.sqrt(np.mean([np.diag(covariance)[1:] for covariance in covariances], axis=0))
        calibration = MonopulseCalibration.from_response(solution[1:].T, solution[0])
        return CalibrationFit(calibration, sigma_per_rad, chi_squared)
