"""Monopulse: the pointing error from the ratio difference/sum of one cluster.

rho = offset + M theta: the columns of the calibrated complex response M are what 1 rad of
cross-elevation and of elevation do to the two ratios.  Slope and phase of each channel are its
diagonal, cross-talk the rest, `offset` the shift of the null.  theta is the least-squares solution
over the real and imaginary parts of both channels, straightened with atanh, the inverse of the
squinted Gaussian feed (`curve`).
"""

import math
import operator
from dataclasses import dataclass
from typing import Self

import numpy as np

from rf_pointing.core import MDEG, MonopulseCluster, Params, PointingError, Sensor, parameter
from rf_pointing.core.types import Array, ComplexArray, Pair

CURVES = ("tanh", "straight")
UNITY = np.eye(2)
# The feed is ill calibrated if one axis acts so much less than the other.
WORST_CONDITION_NUMBER = 20.0
CHANNELS = ("difference_cross_elevation", "difference_elevation", "sum")
# What a receiver can mean by C/N0; its power of ten must be a number.
LEVEL_RANGE_DB_HZ = -60.0, 200.0
# Difference over sum up to which atanh straightens it; beyond, noise would be all that it gives.
STRAIGHTENED = 0.9
# Difference over sum that no feed gives, even next to a null of the sum.
LARGEST_RATIO = 1e3


def cluster_fault(cluster: MonopulseCluster) -> str:
    """Return why the cluster must be rejected, empty if it may be used."""
    times = np.asarray(cluster.t_s)
    if times.ndim != 1 or len(times) < 2:
        return f"t_s has shape {times.shape}, must have at least 2 samples"
    for name in CHANNELS:
        samples = np.asarray(getattr(cluster, name))
        if samples.shape != times.shape:
            return f"{name} has shape {samples.shape}, must be {times.shape}"
        size = np.vdot(samples, samples).real
        if not math.isfinite(size):
            return f"{name} is too large to be squared" if np.all(np.isfinite(samples)) else f"{name} must be finite"
        if name == "sum" and size <= 0.0:
            return "sum is too small to be squared" if np.any(samples) else "sum is zero in every sample"
    clock = times.tolist()
    if not all(map(math.isfinite, (*clock, cluster.carrier_to_noise_db_hz))):
        return "t_s and carrier_to_noise_db_hz must be finite"
    if not all(map(operator.lt, clock, clock[1:])):
        return "t_s must increase from sample to sample"
    low, high = LEVEL_RANGE_DB_HZ
    if not low <= cluster.carrier_to_noise_db_hz <= high:
        return f"carrier_to_noise_db_hz={cluster.carrier_to_noise_db_hz} must be between {low} and {high}"
    return ""


@dataclass(frozen=True, kw_only=True)
class MonopulseCalibration(Params):
    """Rows: the two channels; columns: cross-elevation and elevation, per radian."""

    response_real: tuple[float, float, float, float] = parameter(description="real part of M, row by row, per radian")
    response_imaginary: tuple[float, float, float, float] = parameter(
        description="imaginary part of M, row by row, per radian"
    )
    offset_real: Pair = parameter((0.0, 0.0), "real part of the ratios on the beam axis")
    offset_imaginary: Pair = parameter((0.0, 0.0), "imaginary part of the ratios on the beam axis")

    @classmethod
    def ideal(cls, half_power_beamwidth_rad: float, slope: float) -> Self:
        """Return the response of a feed without imbalance or cross-talk."""
        per_rad = slope / half_power_beamwidth_rad
        return cls(response_real=(per_rad, 0.0, 0.0, per_rad), response_imaginary=(0.0,) * 4)

    @classmethod
    def from_response(cls, response_per_rad: ComplexArray, offset: ComplexArray) -> Self:
        """Build from M (2, 2) and offset (2,); the inverse is `response_per_rad` and `offset`."""
        a, b, c, d = np.asarray(response_per_rad).ravel().tolist()
        e, f = np.asarray(offset).tolist()
        return cls(
            response_real=(a.real, b.real, c.real, d.real),
            response_imaginary=(a.imag, b.imag, c.imag, d.imag),
            offset_real=(e.real, f.real),
            offset_imaginary=(e.imag, f.imag),
        )

    def response_per_rad(self) -> ComplexArray:
        """Return M, shape (2, 2)."""
        return (np.array(self.response_real) + 1j * np.array(self.response_imaginary)).reshape(2, 2)

    def offset(self) -> ComplexArray:
        """Return the ratios on the beam axis, shape (2,)."""
        return np.array(self.offset_real) + 1j * np.array(self.offset_imaginary)

    def check_together(self) -> None:
        """Refuse a response from which the two axes cannot be separated."""
        response = self.response_per_rad()
        values = np.linalg.svd(np.vstack([response.real, response.imag]), compute_uv=False)
        condition = float(values[0] / values[1]) if values[1] > 0.0 else math.inf
        if condition > WORST_CONDITION_NUMBER:
            raise ValueError(
                f"the calibration does not separate cross-elevation from elevation: condition number {condition:.1f} "
                f"must be <= {WORST_CONDITION_NUMBER:.0f}"
            )


@dataclass(frozen=True, kw_only=True)
class MonopulseParams(Params):
    """Beam, feed slope and the limits within which an error is believed."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth of the sum", 1e-6, 1.4)
    slope: float = parameter(1.57, "h d(difference/sum)/dx of the ideal feed", 0.1, 2.5)
    curve: str = parameter("tanh", "difference/sum of the feed: tanh for Gaussian beams, or straight", choices=CURVES)
    valid_range_beamwidths: float = parameter(0.75, "largest error per axis that is believed", 0.05, 0.9)
    lock_db_hz: float = parameter(30.0, "smallest C/N0 at which an error is believed", 0.0, 120.0)
    quadrature_limit: float = parameter(
        30.0, "largest quadrature residual, chi squared with 2 degrees of freedom", 5.0, 1e6
    )
    quadrature_floor: float = parameter(0.05, "quadrature ratio that imperfect phase calibration leaves", 0.0, 1.0)

    def check_together(self) -> None:
        """Refuse a range beyond which the curve of the feed is not straightened any more."""
        straightened = math.atanh(STRAIGHTENED) / self.slope
        if self.curve == "tanh" and self.valid_range_beamwidths > straightened:
            raise ValueError(
                f"valid_range_beamwidths={self.valid_range_beamwidths} must be <= {straightened:.2f}, to which the curve of a "
                f"feed with slope={self.slope} is straightened"
            )


class MonopulseTracker:
    """Measures the error of a cluster with `calibration` (default: the ideal feed)."""

    def __init__(self, params: MonopulseParams, calibration: MonopulseCalibration | None = None) -> None:
        self.params = params
        self.calibration = calibration or MonopulseCalibration.ideal(params.half_power_beamwidth_rad, params.slope)
        self._response = self.calibration.response_per_rad()
        self._offset = self.calibration.offset()
        # Real and imaginary parts of both channels have equal noise near the axis: plain least
        # squares, theta = Re(W rho).
        inverse = np.linalg.pinv(np.vstack([self._response.real, self._response.imag]))
        self._inverse = inverse[:, :2] - 1j * inverse[:, 2:]

    def measure(self, cluster: MonopulseCluster) -> PointingError:
        """Return target minus beam at the cluster's mean time; if invalid, with its reason."""
        fault = cluster_fault(cluster)
        if fault:
            return self._rejected(cluster, fault)
        samples = len(cluster.t_s)
        snr = 10.0 ** (cluster.carrier_to_noise_db_hz / 10.0) * sample_period_s(cluster.t_s)
        ratio = difference_ratio(cluster, snr)
        largest = max(abs(value) for value in ratio.tolist())
        if largest > LARGEST_RATIO:
            fault = f"a difference of {largest:.3g} times the sum must be <= {LARGEST_RATIO:.0f}"
            return self._rejected(cluster, fault)
        # E d_rho d_rho^H = (I + rho rho^H) (1 + 1/snr) / (n snr): the sum's noise is in both.
        noise = (1.0 + 1.0 / snr) / (samples * snr) * (UNITY + ratio[:, None] * np.conj(ratio))
        linear = (self._inverse @ (ratio - self._offset)).real
        error, stretch = self._straighten(linear)
        inverse = stretch[:, None] * self._inverse
        covariance = 0.5 * (inverse @ noise @ np.conj(inverse.T)).real
        reason = self._doubt(cluster.carrier_to_noise_db_hz, error, ratio, linear, noise.diagonal().real)
        return PointingError(
            t_s=float(np.mean(cluster.t_s)), sensor=Sensor.MONOPULSE,
            cross_elevation_rad=float(error[0]), elevation_rad=float(error[1]),
            covariance_rad2=covariance, carrier_to_noise_db_hz=cluster.carrier_to_noise_db_hz,
            valid=not reason, reason=reason,
        )  # fmt: skip

    def _straighten(self, linear: Array) -> tuple[Array, Array]:
        """Return the error and d(error)/d(linear); past the curve's range it stays linear."""
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
        """Return an invalid error; the C/N0 stays the receiver's, the carrier may be there."""
        times = np.asarray(cluster.t_s, dtype=np.float64).ravel()
        # Broken samples are not a loss of the carrier: the receiver's own C/N0 stands.
        known = times[np.isfinite(times)]
        low, high = LEVEL_RANGE_DB_HZ
        level_db_hz = cluster.carrier_to_noise_db_hz
        return PointingError(
            t_s=float(known[-1]) if len(known) else 0.0, sensor=Sensor.MONOPULSE,
            cross_elevation_rad=0.0, elevation_rad=0.0,
            covariance_rad2=np.eye(2) * self.params.half_power_beamwidth_rad**2,
            carrier_to_noise_db_hz=level_db_hz if low <= level_db_hz <= high else 0.0, valid=False,
            reason=reason,
        )  # fmt: skip


def sample_period_s(t_s: Array) -> float:
    """Return the mean time between the samples of a cluster."""
    return float(t_s[-1] - t_s[0]) / (len(t_s) - 1)


def difference_ratio(cluster: MonopulseCluster, snr: float) -> ComplexArray:
    """Return both difference/sum ratios (2,), averaged coherently, free of noise power."""
    # Without the noise power in the sum the ratio would shrink at a low C/N0.
    signal = float(np.vdot(cluster.sum, cluster.sum).real) * snr / (1.0 + snr)
    differences = np.array([cluster.difference_cross_elevation, cluster.difference_elevation])
    return np.asarray(differences @ np.conj(cluster.sum) / signal)
