"""From one sequence of wrapped phases to nine ranges and nine path rates, with their covariance.

1. path rates w from the phase rates: omega_ij = (2 pi/c) fT w_ij;
2. phases brought to the epoch with w;
3. visits of the same carrier averaged;
4. cycles resolved.

A range then errs by kappa (w - w_used), which the measurement model knows.

Cycles: the phase difference of carriers 2 and 1 is unambiguous over c/f0.  Each next difference is
nu times finer; its lane is the whole number nearest to (coarse range - fine range)/lane length
(PI83 eqs. 7-14 to 7-25, listings ERD, AMBRES).  The distance of the unrounded lane from a whole
number is kept: near 0.5 the decision is arbitrary.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.interferometer.measurement import (
    InterferometerMeasurement,
    phase_rate_sigma_rad_s,
    phase_variance,
)
from rf_pointing.array_sensors.interferometer.system import (
    CarrierPlan,
    InterferometerSystem,
    range_acceleration_lever_s2,
    range_rate_lever_s,
)
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import Params, parameter

Array = NDArray[np.float64]
# Rows of the reading's vector; the measurement model and the snapshot index with them.
RANGES, RATES, COUPLINGS = slice(0, 9), slice(9, 18), slice(18, 22)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedRanges:
    """Two-way ranges (..., n, n), lane numbers and distances to them in lanes, both (..., K - 2, n,
    n).
    """

    ranges_m: Array
    lanes: Array
    lane_residuals: Array

    @property
    def worst_lane_residual(self) -> Array:
        """Largest |unrounded lane - lane| of all steps and paths (...), at most 0.5."""
        return np.asarray(np.max(np.abs(self.lane_residuals), axis=(-3, -2, -1)))


def resolve_ranges(phases_rad: ArrayLike, plan: CarrierPlan, variant: str = CORRECTED) -> ResolvedRanges:
    """Return the ranges of difference-frequency tracking from carrier phases (..., K, n, n),
    wrapped or not.

    "published": the coarsest phase is taken in [0, 2 pi) and lanes below zero are refused as in the
    listing, so that noise at zero range wraps to c/f0; "corrected": in [-pi/nu, 2 pi - pi/nu),
    which f0 < f_min leaves free.
    """
    phases = np.asarray(phases_rad, dtype=np.float64)
    published = is_published(variant)
    differences = np.mod(phases[..., 1:, :, :] - phases[..., :1, :, :], 2.0 * np.pi)
    fine = differences * plan.ambiguities_m[:, None, None] / (2.0 * np.pi)
    # Noise at zero range would wrap to 240 km: f0 is below f_min, which leaves the room for a
    # negative window.
    window = 0.0 if published else plan.ambiguities_m[0] / (2.0 * plan.ratio)
    ranges = np.mod(fine[..., 0, :, :] + window, plan.ambiguities_m[0]) - window
    lanes, residuals = [], []
    for step in range(1, plan.count - 1):
        unrounded = (ranges - fine[..., step, :, :]) / plan.ambiguities_m[step]
        # The listing refuses negative lanes; near zero range noise needs them.
        lane = np.maximum(np.rint(unrounded), 0.0) if published else np.rint(unrounded)
        ranges = fine[..., step, :, :] + lane * plan.ambiguities_m[step]
        lanes.append(lane)
        residuals.append(unrounded - lane)
    return ResolvedRanges(ranges_m=ranges, lanes=np.stack(lanes, axis=-3), lane_residuals=np.stack(residuals, axis=-3))


@dataclass(frozen=True, kw_only=True)
class ErrorFloor(Params):
    """Errors in addition to receiver noise, which is far below them at short range.

    Sigmas added to the reading's covariance.
    """

    phase_rad: float = parameter(0.002, "hardware phase of a carrier on a path", low=0.0, high=1.0)
    phase_rate_rad_s: float = parameter(0.02, "drift of a path's phase", low=0.0, high=100.0)
    amplitude: float = parameter(0.002, "pattern ripple of a coupling, 0.06 dB is 0.007", low=0.0, high=1.0)
    path_acceleration_m_s2: float = parameter(0.005, "two-way path acceleration in a sequence", low=0.0, high=100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Nine ranges, nine path rates, four couplings (22,) with covariance (22, 22).

    `used_rates_m_s` (3, 3) and `lever_s` say how the ranges depend on the path rates; `worst_lane`
    is the largest distance of a lane decision from a whole number, `visit_agreement` the smallest
    resultant of repeated phases.
    """

    vector: Array
    covariance: Array
    used_rates_m_s: Array
    lever_s: float
    worst_lane: float
    visit_agreement: float

    def standalone_ranges(self) -> tuple[Array, Array]:
        """Return ranges (3, 3) corrected by the measured rates, and their covariance (9, 9)."""
        correction = self.lever_s * (self.vector[RATES] - self.used_rates_m_s.ravel())
        spread = self.covariance[RANGES, RANGES] + self.lever_s**2 * self.covariance[RATES, RATES]
        return (self.vector[RANGES] - correction).reshape(3, 3), spread


def read_ranges(
    measurement: InterferometerMeasurement,
    system: InterferometerSystem,
    floor: ErrorFloor,
    expected_rates_m_s: Array | None = None,
) -> Reading:
    """Return the reading; `expected_rates_m_s` (3, 3) of a filter aid the phases, else the measured
    rates do.
    """
    carriers = system.schedule.carriers(system.plan)
    if len(carriers) != len(measurement.snr_forward):
        raise ValueError(f"phase_rad has {len(measurement.snr_forward)} slots, the schedule has {len(carriers)}")
    rates, rate_covariance = _path_rates(measurement, system, carriers, floor)
    # Predicted rates are quieter than measured ones, as long as the prediction holds.
    used = rates if expected_rates_m_s is None else expected_rates_m_s
    offsets = system.schedule.offsets_s(system.plan)[:, None, None]
    # The phases of one carrier are taken seconds apart: compared without their rates they would be
    # different lanes.
    at_epoch = measurement.phase_rad - offsets * _phase_rates(used, system.plan)[carriers]
    phases, agreement = _folded(at_epoch, carriers, system.plan.count)
    resolved = resolve_ranges(phases, system.plan)
    covariance = np.zeros((22, 22))
    covariance[RANGES, RANGES] = _range_covariance(measurement, system, carriers, floor)
    covariance[RATES, RATES] = rate_covariance
    covariance[COUPLINGS, COUPLINGS] = np.eye(4) * (measurement.amplitude_sigma**2 + floor.amplitude**2)
    return Reading(
        vector=np.concatenate([resolved.ranges_m.ravel(), rates.ravel(), measurement.amplitudes.ravel()]),
        covariance=covariance,
        used_rates_m_s=used,
        lever_s=range_rate_lever_s(system.schedule, system.plan),
        worst_lane=float(resolved.worst_lane_residual),
        visit_agreement=agreement,
    )


def rate_weights(system: InterferometerSystem) -> tuple[float, float]:
    """Return g_F, g_R of w = g_F d rho_00/dt + g_R d rho_ij/dt, the mean over the slots of f/f_T of
    each link.
    """
    carriers = system.schedule.carriers(system.plan)
    forward, back = system.plan.forward_carriers_hz[carriers], system.plan.return_carriers_hz[carriers]
    mean = 0.5 * (forward + back)
    return float(np.mean(forward / mean)), float(np.mean(back / mean))


def _metres_per_radian(plan: CarrierPlan, carriers: NDArray[np.intp]) -> Array:
    mean_wave = 0.5 * (plan.forward_wave_rad_m + plan.return_wave_rad_m)
    return 1.0 / mean_wave[carriers]


def _path_rates(
    measurement: InterferometerMeasurement,
    system: InterferometerSystem,
    carriers: NDArray[np.intp],
    floor: ErrorFloor,
) -> tuple[Array, Array]:
    scale = _metres_per_radian(system.plan, carriers)
    rates = np.mean(scale[:, None, None] * measurement.phase_rate_rad_s, axis=0)
    forward, back = (
        phase_rate_sigma_rad_s(np.sqrt(phase_variance(snr)), system.schedule.dwell_s) ** 2
        for snr in (measurement.snr_forward, measurement.snr_return)
    )
    common = np.sum(scale**2 * forward) / len(carriers) ** 2
    single = np.sum(scale[:, None, None] ** 2 * back, axis=0) / len(carriers) ** 2
    # The same hardware drift stays over the sequence: it does not average down with the slots.
    drift = (np.mean(scale) * floor.phase_rate_rad_s) ** 2
    return rates, np.diag(single.ravel() + drift) + common


def _phase_rates(rates: Array, plan: CarrierPlan) -> Array:
    # Split w into way out and way back: far away the mean return path changes like the way out (sum
    # of elements zero).
    mean_wave = 0.5 * (plan.forward_wave_rad_m + plan.return_wave_rad_m)
    share = np.mean(plan.return_wave_rad_m / mean_wave)
    outward = 0.5 * np.mean(rates)
    back = outward + (rates - np.mean(rates)) / share
    return np.asarray(plan.forward_wave_rad_m[:, None, None] * outward + plan.return_wave_rad_m[:, None, None] * back)


def _folded(phases: Array, carriers: NDArray[np.intp], count: int) -> tuple[Array, float]:
    resultants = np.zeros((count, 3, 3), dtype=np.complex128)
    # Mean of unit phasors: phases near 0 and 2 pi must not average to pi.
    np.add.at(resultants, carriers, np.exp(1j * phases))
    visits = np.bincount(carriers, minlength=count)[:, None, None]
    return np.angle(resultants), float(np.min(np.abs(resultants) / visits))


def _range_covariance(
    measurement: InterferometerMeasurement,
    system: InterferometerSystem,
    carriers: NDArray[np.intp],
    floor: ErrorFloor,
) -> Array:
    visits = np.bincount(carriers)
    forward, back = phase_variance(measurement.snr_forward), phase_variance(measurement.snr_return)
    # Only carriers 1 and K make the fine range; the others resolve its cycles and add no noise.
    common, single = 0.0, np.full((3, 3), 2.0 * floor.phase_rad**2)
    for carrier in (0, system.plan.count - 1):
        mine = carriers == carrier
        common += float(np.sum(forward[mine])) / visits[carrier] ** 2
        single += np.sum(back[mine], axis=0) / visits[carrier] ** 2
    scale = (system.plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
    # An acceleration during the sequence looks like a range offset that no rate removes.
    bent = range_acceleration_lever_s2(system.schedule, system.plan) * floor.path_acceleration_m_s2
    return np.asarray(scale * (np.diag(single.ravel()) + common) + bent**2)
