"""Simulated tracking receiver: complex sum and difference samples, and carrier power.

Samples integrate over `sample_s`: s = A v(offset) exp(j phase) + n, E|n|^2 = N0 / sample_s,
independent on each of the three channels; A^2 = C.  One AGC gain serves all three.  Internally N0 =
1, so A^2 is C/N0 in hertz. Carrier power follows CONSCAN appendix B: the in-phase arm gives (A +
n_I)^2, whose variance is 2 (Pc/N0) / T (B-3).
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import (
    CarrierPower,
    MonopulseCluster,
    Params,
    as_finite_array,
    parameter,
    require_between,
)
from rf_pointing.core.types import Array, ComplexArray, Pair
from rf_pointing.rf.beam import Beam
from rf_pointing.rf.disturbances import InterferenceParams, interference_volts
from rf_pointing.rf.feed import MonopulseFeed
from rf_pointing.rf.noise import BOLTZMANN_J_K

# Orders of the beam's motion within a cluster that are removed as motion: steady, vibrating.
STEADY, VIBRATING = 1, 3
# Clusters of which the lower quartile of the noise counts: a beam that sweeps across its nulls, as
# in a search, may spoil three quarters of them.  After the fewest, chance does not double it.
MOST_CLUSTERS, FEWEST_CLUSTERS, QUARTILE_SIGMAS = 100, 20, -0.6745
LARGEST_EXCESS = 2.0


@dataclass(frozen=True, kw_only=True)
class ReceiverParams(Params):
    """Noise, gain control and carrier loop of the tracking receiver."""

    system_noise_k: float = parameter(
        25.0, "system noise temperature for powers in watts", 1.0, 1e4
    )
    noise_bandwidth_hz: float = parameter(4e4, "bandwidth of the noise power measurement", 1.0, 1e9)
    difference_noise_db: float = parameter(
        0.0, "noise of the differences above the sum's", -10.0, 20.0
    )
    agc_time_constant_s: float = parameter(0.5, "time constant of the gain control", 0.01, 100.0)
    noise_time_constant_s: float = parameter(
        10.0, "averaging time of the noise estimate", 0.1, 1000.0
    )
    frequency_offset_hz: float = parameter(0.02, "residual carrier frequency", -10.0, 10.0)
    phase_noise_rad: float = parameter(
        0.05, "random walk of the carrier phase over 1 s, rms", 0.0, 3.0
    )
    floor_db_hz: float = parameter(0.0, "smallest C/N0 the receiver reports", -20.0, 40.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverState:
    """Everything the receiver carries from one cluster to the next."""

    t_s: float | None = None
    phase_rad: float = 0.0
    agc_gain: float | None = None
    noise_density: float = 1.0
    still_densities: tuple[float, ...] = ()
    clusters: int = 0


class Receiver:
    """Sum and difference channels behind `feed`, carrier power behind `beam`; noise from `rng`."""

    def __init__(
        self, params: ReceiverParams, beam: Beam | MonopulseFeed, feed: MonopulseFeed,
        rng: "np.random.Generator", interference: InterferenceParams | None = None,
    ) -> None:  # fmt: skip
        self.params = params
        self.beam = beam
        self.feed = feed
        self.rng = rng
        self.interference = interference
        self.state = ReceiverState()

    def cluster(
        self, t_s: ArrayLike, offset_cross_elevation_rad: ArrayLike,
        offset_elevation_rad: ArrayLike, carrier_to_noise_db_hz: ArrayLike, sample_s: float,
    ) -> MonopulseCluster:  # fmt: skip
        """Return the samples of one cluster.

        Offsets (n,) are target minus beam at the times `t_s` (n,), n >= 3; the C/N0 (scalar or
        (n,)) is that of a beam on the target, -inf for no carrier.  The pattern loss is applied
        here.
        """
        times = as_finite_array("t_s", t_s, (None,))
        if len(times) < 3:
            raise ValueError(
                f"t_s has {len(times)} samples, must have at least 3 to tell noise from carrier"
            )
        x = as_finite_array("offset_cross_elevation_rad", offset_cross_elevation_rad, (len(times),))
        y = as_finite_array("offset_elevation_rad", offset_elevation_rad, (len(times),))
        require_between("sample_s", sample_s, 1e-6, None)
        phase = self._advance_phase(times)
        carrier = _amplitude(carrier_to_noise_db_hz) * np.exp(1j * phase)
        channels = carrier * np.array(self.feed.voltages(x, y)) + self._channel_noise(
            len(times), sample_s
        )
        if self.interference is not None:
            channels += interference_volts(self.interference, times, sample_s)
        gain, next_gain = self._advance_gain(channels[0], sample_s)
        density, still, measured_db_hz = self._measure_carrier_to_noise(channels, sample_s)
        self.state = ReceiverState(
            t_s=float(times[-1]), phase_rad=float(np.mod(phase[-1], 2.0 * math.pi)), agc_gain=next_gain,
            noise_density=density, still_densities=still, clusters=self.state.clusters + 1,
        )  # fmt: skip
        total, right, up = gain * channels
        return MonopulseCluster(
            t_s=times, sum=total, difference_cross_elevation=right, difference_elevation=up,
            carrier_to_noise_db_hz=measured_db_hz,
        )  # fmt: skip

    def carrier_power(
        self, t_s: float, integration_s: float, offset_cross_elevation_rad: ArrayLike,
        offset_elevation_rad: ArrayLike, carrier_to_noise_db_hz: ArrayLike,
    ) -> CarrierPower:  # fmt: skip
        """Return the carrier power over `integration_s` ending at `t_s` (CONSCAN B-1 to B-5).

        The offsets (scalar or (n,)) and C/N0 are those during the integration; the carrier
        integrates coherently.
        """
        require_between("integration_s", integration_s, 1e-6, None)
        pattern = np.sqrt(self.beam.power_gain(offset_cross_elevation_rad, offset_elevation_rad))
        amplitude = float(np.mean(_amplitude(carrier_to_noise_db_hz) * pattern))
        if self.interference is not None:
            amplitude += float(
                interference_volts(self.interference, np.array([t_s]), integration_s)[0, 0].real
            )
        arm = amplitude + self.rng.standard_normal() * math.sqrt(0.5 / integration_s)
        # The square of the arm contains its own noise power; a power meter never reads below zero.
        ratio_hz = max(arm**2 - 0.5 / integration_s, 0.0)
        noise_w_hz = BOLTZMANN_J_K * self.params.system_noise_k
        noise_sigma = noise_w_hz / math.sqrt(self.params.noise_bandwidth_hz * integration_s)
        measured_noise = noise_w_hz + noise_sigma * self.rng.standard_normal()
        return CarrierPower(
            t_s=t_s, integration_s=integration_s, power_w=ratio_hz * measured_noise,
            sigma_w=_power_sigma_w(ratio_hz, measured_noise, noise_sigma, integration_s),
            carrier_to_noise_db_hz=max(_db(ratio_hz), self.params.floor_db_hz),
        )  # fmt: skip

    def _advance_phase(self, times: Array) -> Array:
        previous = times[0] if self.state.t_s is None else self.state.t_s
        steps = times - np.concatenate(([previous], times[:-1]))
        if not (steps[0] >= 0.0 and (steps[1:] > 0.0).all()):
            raise ValueError("t_s must increase from sample to sample and from cluster to cluster")
        # A random walk: its variance grows with the time between samples, gaps included.
        walk = self.params.phase_noise_rad * np.sqrt(steps) * self.rng.standard_normal(len(times))
        turned = np.add.accumulate(2.0 * math.pi * self.params.frequency_offset_hz * steps + walk)
        return np.asarray(self.state.phase_rad + turned)

    def _channel_noise(self, count: int, sample_s: float) -> ComplexArray:
        parts = self.rng.standard_normal((2, 3, count)) * math.sqrt(0.5 / sample_s)
        noise = parts[0] + 1j * parts[1]
        # The differences have amplifiers of their own.
        noise[1:] *= 10.0 ** (self.params.difference_noise_db / 20.0)
        return np.asarray(noise)

    def _advance_gain(self, total: ComplexArray, sample_s: float) -> Pair:
        """Return the gain of this cluster and that of the next one."""
        power = _mean(np.abs(total) ** 2)
        wanted = 1.0 / math.sqrt(power)
        # The first cluster sets the gain; later ones move it by the loop's time constant.
        gain = wanted if self.state.agc_gain is None else self.state.agc_gain
        share = 1.0 - math.exp(-len(total) * sample_s / self.params.agc_time_constant_s)
        return gain, gain * (wanted / gain) ** share

    def _measure_carrier_to_noise(
        self, channels: ComplexArray, sample_s: float
    ) -> tuple[float, tuple[float, ...], float]:
        """Estimate C/N0 of the sum: power per cluster over a noise density of many clusters.

        Return the density, those of the clusters that stand still, and the C/N0 in dB-Hz.
        """
        scaled = channels.copy()
        # Back to the noise of the sum, whose density is wanted.
        scaled[1:] *= 10.0 ** (-self.params.difference_noise_db / 20.0)
        density = noise_variance(scaled, STEADY) * sample_s
        still = (
            *self.state.still_densities[1 - MOST_CLUSTERS :],
            noise_variance(scaled, VIBRATING) * sample_s,
        )
        count = self.state.clusters + 1
        share = 1.0 - math.exp(-channels.shape[1] * sample_s / self.params.noise_time_constant_s)
        average = self.state.noise_density
        # Until the average has filled, every cluster counts the same, the first one whole.
        average += max(share, 1.0 / count) * (density - average)
        density = average
        # The average is more precise, but under a strong carrier mostly the motion of the beam.
        if len(still) >= FEWEST_CLUSTERS:
            quiet = _mean_from_quartile(still, 4.0 * (channels.shape[1] - VIBRATING - 1))
            average = quiet if average > LARGEST_EXCESS * quiet else average
        carrier = _mean(np.abs(channels[0]) ** 2) - average / sample_s
        return density, still, max(_db(carrier / average), self.params.floor_db_hz)


def _mean_from_quartile(values: tuple[float, ...], freedom: float) -> float:
    """Return the mean of values spread as chi squared of `freedom`, from their lower quartile."""
    # Wilson and Hilferty 1931: the cube root of chi squared is nearly normal.
    spread = 2.0 / (9.0 * max(freedom, 4.0))
    quartile = (1.0 - spread + QUARTILE_SIGMAS * math.sqrt(spread)) ** 3
    return float(np.partition(values, len(values) // 4)[len(values) // 4]) / quartile


def noise_variance(channels: ComplexArray, order: int) -> float:
    """Return the noise variance of the samples (3, n), from the part not shared with the sum.

    Each difference is fitted with the sum times polynomials of time to `order` (as far as n - 2):
    carrier phase and amplitude are common to all channels and drop out, and so does a motion of the
    beam of that order.  What is left is noise of the difference and |ratio|^2 of the sum's.
    """
    total, differences = channels[0], channels[1:].T
    count = len(total)
    order = min(order, count - 2)
    basis = total[:, None] * _polynomials(count, order)
    # The columns are nearly orthogonal, so the normal equations lose nothing.
    adjoint = basis.conj().T
    fit = np.linalg.solve(adjoint @ basis, adjoint @ differences)
    residual = np.add.reduce(np.abs(differences - basis @ fit) ** 2, axis=0) / (count - order - 1)
    signal_share = max(1.0 - _mean(residual) / _mean(np.abs(total) ** 2), 0.0)
    return _mean(residual / (1.0 + signal_share * np.abs(fit[0]) ** 2))


@lru_cache(maxsize=64)
def _polynomials(count: int, order: int) -> Array:
    """Return the Legendre polynomials (count, order + 1) at even times."""
    return np.asarray(
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), order), dtype=np.float64
    )


def _mean(values: Array) -> float:
    # np.mean looks at its arguments for longer than it adds a cluster.
    return float(np.add.reduce(values)) / len(values)


def _amplitude(carrier_to_noise_db_hz: ArrayLike) -> Array:
    level = np.asarray(carrier_to_noise_db_hz, dtype=np.float64)
    if not (level <= 200.0).all():
        raise ValueError(f"carrier_to_noise_db_hz={level} must be <= 200, -inf for no carrier")
    return np.asarray(10.0 ** (level / 20.0))


def _db(ratio: float) -> float:
    return 10.0 * math.log10(ratio) if ratio > 0.0 else -math.inf


def _power_sigma_w(
    ratio_hz: float, noise_w_hz: float, noise_sigma: float, integration_s: float
) -> float:
    """CONSCAN B-2 with B-3 scaled from 1 s; the last term keeps the variance of noise alone."""
    ratio_variance = 2.0 * ratio_hz / integration_s + 0.5 / integration_s**2
    return math.sqrt(
        noise_sigma**2 * ratio_hz**2
        + ratio_variance * noise_w_hz**2
        + noise_sigma**2 * ratio_variance
    )
