"""Monopulse: the pointing error from the ratio difference/sum of one cluster.

Ratio: rho = sum_k d_k conj(s_k) / (sum_k |s_k|^2 - noise), coherent, so noise in the sum does not shrink it. Inverse:
rho = offset + M theta with the calibrated complex 2 x 2 response M; theta is the least-squares solution over the real
and imaginary parts of both channels, then straightened with atanh, the inverse of the squinted Gaussian feed
(`curve`). Covariance: E d_rho d_rho^H = (I + rho rho^H) (1 + 1/snr) / (n snr), snr = C/N0 * sample time as the
receiver measured it; the noise of the sum channel is common to both ratios.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, MonopulseCluster, Params, PointingError, Sensor, parameter
from rf_pointing.tracking.cluster import cluster_fault, level_known
from rf_pointing.tracking.monopulse_calibration import MonopulseCalibration

__all__ = ["CURVES", "MonopulseParams", "MonopulseTracker"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

CURVES = ("tanh", "straight")
UNITY = np.eye(2)
STRAIGHTENED = 0.9
"""Difference over sum up to which atanh straightens it; beyond, noise would be all that it gives."""
LARGEST_RATIO = 1e3
"""Difference over sum that no feed gives, even beside a null of the sum."""


@dataclass(frozen=True, kw_only=True)
class MonopulseParams(Params):
    """Beam, feed slope and the limits within which an error is believed."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth of the sum", low=1e-6, high=0.5)
    slope: float = parameter(1.57, "h d(difference/sum)/dx of the ideal feed", low=0.1, high=2.5)
    curve: str = parameter("tanh", "difference/sum of the feed: tanh for Gaussian beams, or straight", choices=CURVES)
    valid_range_beamwidths: float = parameter(0.75, "largest error per axis that is believed", low=0.05, high=0.9)
    lock_db_hz: float = parameter(30.0, "smallest C/N0 at which an error is believed", low=0.0, high=120.0)
    quadrature_limit: float = parameter(
        30.0, "largest quadrature residual, chi squared with 2 degrees of freedom", low=5.0, high=1e6
    )
    quadrature_floor: float = parameter(
        0.05, "quadrature ratio that imperfect phase calibration leaves", low=0.0, high=1.0
    )

    def check_together(self) -> None:
        """Refuse a range beyond which the curve of the feed is not straightened any more."""
        straightened = math.atanh(STRAIGHTENED) / self.slope
        if self.curve == "tanh" and self.valid_range_beamwidths > straightened:
            raise ValueError(
                f"valid_range_beamwidths={self.valid_range_beamwidths} must be <= {straightened:.2f}, to which the curve of a "
                f"feed with slope={self.slope} is straightened"
            )


class MonopulseTracker:
    """Measures the pointing error of a cluster with `calibration` (default: the ideal feed of `params`)."""

    def __init__(self, params: MonopulseParams, calibration: MonopulseCalibration | None = None) -> None:
        self.params = params
        self.calibration = calibration or MonopulseCalibration.ideal(params.half_power_beamwidth_rad, params.slope)
        self._response = self.calibration.response_per_rad()
        self._offset = self.calibration.offset()
        # Real and imaginary parts of both channels have equal noise near the axis: plain least squares, theta = Re(W rho).
        inverse = np.linalg.pinv(np.vstack([self._response.real, self._response.imag]))
        self._inverse = inverse[:, :2] - 1j * inverse[:, 2:]

    def measure(self, cluster: MonopulseCluster) -> PointingError:
        """Return target minus beam at the mean time of the cluster; invalid with a reason where it must not be used."""
        fault = cluster_fault(cluster)
        if fault:
            return self._rejected(cluster, fault)
        samples = len(cluster.t_s)
        snr = 10.0 ** (cluster.carrier_to_noise_db_hz / 10.0) * sample_period_s(cluster.t_s)
        ratio = difference_ratio(cluster, snr)
        largest = max(abs(value) for value in ratio.tolist())
        if largest > LARGEST_RATIO:
            return self._rejected(
                cluster, f"a difference of {largest:.3g} times the sum must be <= {LARGEST_RATIO:.0f}"
            )
        noise = (1.0 + 1.0 / snr) / (samples * snr) * (UNITY + ratio[:, None] * np.conj(ratio))
        linear = (self._inverse @ (ratio - self._offset)).real
        error, stretch = self._straighten(linear)
        inverse = stretch[:, None] * self._inverse
        covariance = 0.5 * (inverse @ noise @ np.conj(inverse.T)).real
        reason = self._doubt(cluster.carrier_to_noise_db_hz, error, ratio, linear, noise.diagonal().real)
        return PointingError(
            t_s=float(np.mean(cluster.t_s)),
            sensor=Sensor.MONOPULSE,
            cross_elevation_rad=float(error[0]),
            elevation_rad=float(error[1]),
            covariance_rad2=covariance,
            carrier_to_noise_db_hz=cluster.carrier_to_noise_db_hz,
            valid=not reason,
            reason=reason,
        )

    def _straighten(self, linear: Array) -> tuple[Array, Array]:
        """Return the error and d(error)/d(linear); past the straightened range it stays linear and is never valid."""
        if self.params.curve == "straight":
            return linear, np.ones(2)
        scale = self.params.slope / self.params.half_power_beamwidth_rad
        shape = np.minimum(np.maximum(scale * linear, -STRAIGHTENED), STRAIGHTENED)
        error = np.arctanh(shape) / scale + (linear - shape / scale)
        return error, 1.0 / (1.0 - shape**2)

    def _doubt(self, level_db_hz: float, error: Array, ratio: ComplexArray, linear: Array, variance: Array) -> str:
        """Return why the error must not be used, empty if it may."""
        if level_db_hz < self.params.lock_db_hz:
            return f"no lock: C/N0 {level_db_hz:.1f} dB-Hz is below {self.params.lock_db_hz:.1f} dB-Hz"
        beamwidths = max(map(abs, error.tolist())) / self.params.half_power_beamwidth_rad
        if beamwidths > self.params.valid_range_beamwidths:
            return (
                f"error of {beamwidths:.2f} beamwidths is outside {self.params.valid_range_beamwidths:.2f} beamwidths"
            )
        residual = (ratio - self._offset - self._response @ linear).tolist()
        floor = self.params.quadrature_floor**2
        chi_squared = sum(
            abs(left) ** 2 / (0.5 * noise + floor * max(abs(value) ** 2, 1e-4))
            for left, noise, value in zip(residual, variance.tolist(), ratio.tolist(), strict=True)
        )
        if chi_squared > self.params.quadrature_limit:
            return f"quadrature: chi squared {chi_squared:.0f} is above {self.params.quadrature_limit:.0f}"
        return ""

    def _rejected(self, cluster: MonopulseCluster, reason: str) -> PointingError:
        """Return no error; the receiver's own C/N0 stands, for broken samples are no loss of the carrier."""
        times = np.asarray(cluster.t_s, dtype=np.float64).ravel()
        known = times[np.isfinite(times)]
        level_db_hz = cluster.carrier_to_noise_db_hz
        return PointingError(
            t_s=float(known[-1]) if len(known) else 0.0,
            sensor=Sensor.MONOPULSE,
            cross_elevation_rad=0.0,
            elevation_rad=0.0,
            covariance_rad2=np.eye(2) * self.params.half_power_beamwidth_rad**2,
            carrier_to_noise_db_hz=level_db_hz if level_known(level_db_hz) else 0.0,
            valid=False,
            reason=reason,
        )


def sample_period_s(t_s: Array) -> float:
    """Return the mean time between the samples of a cluster."""
    return float(t_s[-1] - t_s[0]) / (len(t_s) - 1)


def difference_ratio(cluster: MonopulseCluster, snr: float) -> ComplexArray:
    """Return both difference/sum ratios of a cluster, (2,), averaged coherently and free of the sum's noise power."""
    signal = float(np.vdot(cluster.sum, cluster.sum).real) * snr / (1.0 + snr)
    differences = np.array([cluster.difference_cross_elevation, cluster.difference_elevation])
    return np.asarray(differences @ np.conj(cluster.sum) / signal)
