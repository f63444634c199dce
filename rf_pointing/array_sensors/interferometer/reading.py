"""From one sequence of wrapped phases to nine ranges and nine path rates, with their covariance.

1. path rates w and accelerations from the phase rates: omega_ij = (2 pi/c) fT w_ij;
2. phases brought to the epoch with both;
3. visits of the same carrier averaged;
4. cycles resolved.

A range then errs by kappa (w - w_used), which the measurement model knows.  A path that is crossed
at v has the acceleration v^2/rho: 1.5 m/s at 200 m bend the phases of one sequence by a third of a
radian, a third of a lane.

Cycles: the phase difference of carriers 2 and 1 is unambiguous over c/f0.  Each next difference is
nu times finer; its lane is the whole number nearest to (coarse range - fine range)/lane length
(PI83 eqs. 7-14 to 7-25, listings ERD, AMBRES).  The distance of the unrounded lane from a whole
number is kept, with its expected sigma: near 0.5 the decision is arbitrary, and one that is many
sigma off is wrong, because the distance of a wrong lane is anything up to 0.5.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.measurement import (
    InterferometerMeasurement,
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
from rf_pointing.core.types import Array

# Steps of a search must not jump over the lane that is right.
_LANES_APART = 0.1
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


def resolve_ranges(
    phases_rad: ArrayLike, plan: CarrierPlan, variant: str = CORRECTED
) -> ResolvedRanges:
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
    return ResolvedRanges(
        ranges_m=ranges, lanes=np.stack(lanes, axis=-3), lane_residuals=np.stack(residuals, axis=-3)
    )


@dataclass(frozen=True, kw_only=True)
class ErrorFloor(Params):
    """Errors in addition to receiver noise, which is far below them at short range.

    Sigmas.  Those of the hardware (`phase_rad`, `phase_rate_rad_s`, `amplitude`) are fixed over an
    approach: many readings do not average them.
    """

    phase_noise_rad: float = parameter(
        1e-4, "noise of a phase besides that of the receiver", low=0.0, high=1.0
    )
    phase_rad: float = parameter(0.002, "hardware phase of a carrier on a path", low=0.0, high=1.0)
    phase_rate_rad_s: float = parameter(
        0.02, "fixed error of a path's phase rate", low=0.0, high=100.0
    )
    amplitude: float = parameter(
        0.002, "pattern ripple of a coupling, 0.06 dB is 0.007", low=0.0, high=1.0
    )
    path_acceleration_m_s2: float = parameter(
        0.005,
        "two-way path acceleration in a sequence that the prediction does not know",
        low=0.0,
        high=100.0,
    )
    first_path_acceleration_m_s2: float = parameter(
        0.3, "two-way acceleration of all paths possible at acquisition", low=0.0, high=100.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PathMotion:
    """Two-way path rates and accelerations (3, 3) that bring the phases to the epoch."""

    rates_m_s: Array
    accelerations_m_s2: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Nine ranges, nine path rates, four couplings (22,) with covariance (22, 22) of their noise.

    `hardware` (22,) are the variances of the errors that stay from reading to reading.
    `used_rates_m_s` (3, 3) and `lever_s` say how the ranges depend on the path rates; `worst_lane`
    is the largest distance of a lane decision from a whole number, `lane_sigma` the largest sigma
    of one and `lane_deviation` the largest distance in its own sigma; `lane_margin` is by how many
    sigma the next set of lanes is worse, at another acceleration; `visit_agreement` is the smallest
    resultant of repeated phases.
    """

    vector: Array
    noise: Array
    hardware: Array
    used_rates_m_s: Array
    lever_s: float
    worst_lane: float
    lane_sigma: float
    lane_deviation: float
    lane_margin: float
    visit_agreement: float

    @property
    def covariance(self) -> Array:
        """Covariance (22, 22) of one reading alone."""
        return self.noise + np.diag(self.hardware)

    def standalone_ranges(self) -> tuple[Array, Array]:
        """Return ranges (3, 3) corrected by the measured rates, and their covariance (9, 9)."""
        covariance = self.covariance
        correction = self.lever_s * (self.vector[RATES] - self.used_rates_m_s.ravel())
        spread = covariance[RANGES, RANGES] + self.lever_s**2 * covariance[RATES, RATES]
        return (self.vector[RANGES] - correction).reshape(3, 3), spread


def read_ranges(
    measurement: InterferometerMeasurement,
    system: InterferometerSystem,
    floor: ErrorFloor,
    expected: PathMotion | None = None,
) -> Reading:
    """Return the reading; `expected` of a filter aids the phases, else the measured rates do."""
    slots = _Slots(measurement, system, floor.phase_noise_rad)
    rates, rate_noise, slopes, slope_noise = slots.path_motion()
    rate_drift = (float(np.mean(slots.metres_per_radian)) * floor.phase_rate_rad_s) ** 2
    # Predicted rates are quieter than measured ones, as long as the prediction holds.
    used = rates if expected is None else expected.rates_m_s
    known = np.zeros(9) if expected is None else expected.accelerations_m_s2.ravel()
    common_m_s2 = (
        floor.first_path_acceleration_m_s2 if expected is None else floor.path_acceleration_m_s2
    )
    # Far away all paths bend alike; what differs is the turning of the arrays.
    prior = np.full((9, 9), common_m_s2**2) + floor.path_acceleration_m_s2**2 * np.eye(9)
    accelerations, left = known, np.zeros((9, 9))
    # All at once, nothing bends.
    if np.any(slope_noise):
        gain = np.linalg.solve(prior + slope_noise, prior).T
        accelerations = known + gain @ (slopes.ravel() - known)
        left = prior - gain @ prior
    phases, agreement = slots.at_epoch(used, accelerations.reshape(3, 3))
    margin = math.inf
    if expected is None and np.any(left):
        more_m_s2, left, margin = slots.bend(phases, left)
        phases, agreement = slots.at_epoch(used, accelerations.reshape(3, 3) + more_m_s2)
    resolved = resolve_ranges(phases, system.plan)
    lane_sigma = slots.lane_sigma(floor.phase_rad, np.diag(rate_noise) + rate_drift, np.diag(left))
    noise = np.zeros((22, 22))
    # An acceleration during the sequence looks like a range offset that no rate removes.
    bent = range_acceleration_lever_s2(system.schedule, system.plan) ** 2 * left
    noise[RANGES, RANGES] = slots.range_noise() + bent
    noise[RATES, RATES] = rate_noise
    noise[COUPLINGS, COUPLINGS] = np.eye(4) * measurement.amplitude_sigma**2
    # Only carriers 1 and K make the fine range.
    lane = 2.0 * (floor.phase_rad * system.plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
    return Reading(
        vector=np.concatenate(
            [resolved.ranges_m.ravel(), rates.ravel(), measurement.amplitudes.ravel()]
        ),
        noise=noise,
        hardware=np.repeat([lane, rate_drift, floor.amplitude**2], [9, 9, 4]),
        used_rates_m_s=used,
        lever_s=range_rate_lever_s(system.schedule, system.plan),
        worst_lane=float(resolved.worst_lane_residual),
        lane_sigma=float(np.max(lane_sigma)),
        lane_deviation=float(np.max(np.abs(resolved.lane_residuals) / lane_sigma)),
        lane_margin=math.sqrt(margin),
        visit_agreement=agreement,
    )


class _Slots:
    """The slots of one measurement: their carriers, times and phase variances."""

    def __init__(
        self,
        measurement: InterferometerMeasurement,
        system: InterferometerSystem,
        phase_noise_rad: float,
    ) -> None:
        self.carriers = system.schedule.carriers(system.plan)
        if len(self.carriers) != len(measurement.snr_forward):
            raise ValueError(
                f"phase_rad has {len(measurement.snr_forward)} slots, the schedule has {len(self.carriers)}"
            )
        self._measurement, self._plan = measurement, system.plan
        self._offsets_s = system.schedule.offsets_s(system.plan)
        self._dwell_s = system.schedule.dwell_s
        self._visits = np.bincount(self.carriers, minlength=system.plan.count)
        self._forward = phase_variance(measurement.snr_forward)
        self._back = phase_variance(measurement.snr_return) + phase_noise_rad**2
        self._mean_wave = 0.5 * (system.plan.forward_wave_rad_m + system.plan.return_wave_rad_m)
        self.metres_per_radian = 1.0 / self._mean_wave[self.carriers]
        self._moments = {
            power: system.schedule.mean_offset_powers(system.plan, power) for power in (1, 2)
        }

    def path_motion(self) -> tuple[Array, Array, Array, Array]:
        """Return path rates (3, 3) at the epoch and accelerations (3, 3), each with the covariance
        (9, 9) of its noise.

        Without a duration there is nothing to bend: accelerations and covariance are zero.
        """
        rates = self.metres_per_radian[:, None, None] * self._measurement.phase_rate_rad_s
        level = np.full(len(self.carriers), 1.0 / len(self.carriers))
        spread = float(np.sum(self._offsets_s**2))
        slope = self._offsets_s / spread if spread > 0.0 else np.zeros_like(level)
        found: list[Array] = []
        for weights in (level, slope):
            squares = (weights * self.metres_per_radian) ** 2 * 12.0 / self._dwell_s**2
            common, single = (
                np.sum(squares * self._forward),
                np.einsum("s,sij->ij", squares, self._back),
            )
            found += [np.einsum("s,sij->ij", weights, rates), np.diag(single.ravel()) + common]
        return found[0], found[1], found[2], found[3]

    def at_epoch(self, rates: Array, accelerations: Array) -> tuple[Array, float]:
        """Return the phases (K, 3, 3) at the epoch, and the smallest resultant of repeated ones."""
        offsets = self._offsets_s[:, None, None]
        # The phases of one carrier are taken seconds apart: compared without their rates they would
        # be different lanes.
        change = offsets * self._in_phase(rates) + 0.5 * offsets**2 * self._in_phase(accelerations)
        resultants = np.zeros((self._plan.count, 3, 3), dtype=np.complex128)
        # Mean of unit phasors: phases near 0 and 2 pi must not average to pi.
        np.add.at(resultants, self.carriers, np.exp(1j * (self._measurement.phase_rad - change)))
        return np.angle(resultants), float(np.min(np.abs(resultants) / self._visits[:, None, None]))

    def _in_phase(self, rates: Array) -> Array:
        # Split w into way out and way back: far away the mean return path changes like the way out
        # (sum of elements zero).
        plan = self._plan
        share = np.mean(plan.return_wave_rad_m / self._mean_wave)
        outward = 0.5 * np.mean(rates)
        back = outward + (rates - np.mean(rates)) / share
        turns = (
            plan.forward_wave_rad_m[:, None, None] * outward
            + plan.return_wave_rad_m[:, None, None] * back
        )
        return np.asarray(turns[self.carriers])

    def bend(self, phases: Array, prior: Array) -> tuple[float, Array, float]:
        """Return the acceleration common to all paths that the phases (K, 3, 3) still have, the
        covariance (9, 9) of the accelerations after it from `prior`, and how much worse the next
        set of lanes is, in chi-square.

        The phases themselves know it ten times better than their rates: a wrong one moves every
        unrounded lane, each by another amount.  All within four sigma are tried.
        """
        plan, steps = self._plan, np.arange(self._plan.count - 2)
        ratio = plan.ambiguities_m[:-1] / plan.ambiguities_m[1:]
        lanes_of = np.zeros((len(steps), plan.count))
        lanes_of[:, 0], lanes_of[steps, steps + 1], lanes_of[steps, steps + 2] = (
            1.0 - ratio,
            ratio,
            -1.0,
        )
        lanes_of /= 2.0 * np.pi
        forward, back = self._carrier_variance()
        # Noise of the mean over the paths, which share that of the way out.
        weight = np.linalg.inv(lanes_of * (forward + np.mean(back, axis=(1, 2)) / 9.0) @ lanes_of.T)
        turned = 0.5 * self._moments[2] * self._mean_wave
        slope = lanes_of @ turned
        mean = np.full(9, 1.0 / 9.0)
        variance = float(mean @ prior @ mean)
        count = 1 + 2 * int(
            np.ceil(4.0 * math.sqrt(variance) * np.max(np.abs(slope)) / _LANES_APART)
        )
        tried = np.linspace(-4.0, 4.0, count) * math.sqrt(variance)
        resolved = resolve_ranges(phases - (tried[:, None] * turned)[..., None, None], plan)
        off = np.mean(resolved.lane_residuals, axis=(-2, -1))
        # The best of each set of lanes: a parabola about the acceleration that was tried.
        information = float(slope @ weight @ slope)
        step = (off @ weight @ slope - tried / variance) / (information + 1.0 / variance)
        best = tried + step
        left = off - step[:, None] * slope
        cost = np.einsum("nk,kl,nl->n", left, weight, left) + best**2 / variance
        first = int(np.argmin(cost))
        # Other lanes are another range of most paths; a single path the snapshot rejects.  Far from
        # its own minimum a parabola is that of other lanes.
        apart = np.abs(resolved.ranges_m - resolved.ranges_m[first]) > 0.5 * plan.ambiguities_m[-1]
        others = (np.mean(apart, axis=(-2, -1)) > 0.5) & (
            np.abs(step) * np.max(np.abs(slope)) < _LANES_APART
        )
        margin = float(np.min(cost[others]) - cost[first]) if np.any(others) else math.inf
        gain = prior @ mean / (variance + 1.0 / information)
        return float(best[first]), prior - np.outer(gain, mean @ prior), max(margin, 0.0)

    def _carrier_variance(self) -> tuple[Array, Array]:
        """Return the variance of each carrier's mean phase: of the way out (K,), back (K, 3, 3)."""
        forward, back = np.zeros(self._plan.count), np.zeros((self._plan.count, 3, 3))
        np.add.at(forward, self.carriers, self._forward)
        np.add.at(back, self.carriers, self._back)
        return forward / self._visits**2, back / self._visits[:, None, None] ** 2

    def range_noise(self) -> Array:
        """Return the covariance (9, 9) of the fine ranges: carriers 1 and K make them."""
        forward, back = self._carrier_variance()
        scale = (self._plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
        return np.asarray(
            scale * (np.diag((back[0] + back[-1]).ravel()) + forward[0] + forward[-1])
        )

    def lane_sigma(
        self, phase_rad: float, rate_variance: Array, acceleration_variance: Array
    ) -> Array:
        """Return the sigma (K - 2, 3, 3) of the unrounded lanes, (nu phi_n - phi_n+1)/2 pi with phi
        against carrier 1.

        `phase_rad` is the sigma of each phase besides noise; `rate_variance` and
        `acceleration_variance` (9,) are those of the motion that brought the phases to the epoch.
        """
        forward, back = self._carrier_variance()
        phase = forward[:, None, None] + back + phase_rad**2
        ratio = self._plan.ambiguities_m[:-1] / self._plan.ambiguities_m[1:]
        square = ratio[:, None, None] ** 2
        total = square * phase[1:-1] + phase[2:] + (ratio[:, None, None] - 1.0) ** 2 * phase[0]
        for power, factor, variance in ((1, 1.0, rate_variance), (2, 0.5, acceleration_variance)):
            turned = factor * self._moments[power] * self._mean_wave
            moved = ratio * (turned[1:-1] - turned[0]) - (turned[2:] - turned[0])
            total = total + moved[:, None, None] ** 2 * variance.reshape(3, 3)
        return np.asarray(np.sqrt(total) / (2.0 * np.pi))


def rate_weights(system: InterferometerSystem) -> tuple[float, float]:
    """Return g_F, g_R of w = g_F d rho_00/dt + g_R d rho_ij/dt, the mean over the slots of f/f_T of
    each link.
    """
    carriers = system.schedule.carriers(system.plan)
    forward, back = (
        system.plan.forward_carriers_hz[carriers],
        system.plan.return_carriers_hz[carriers],
    )
    mean = 0.5 * (forward + back)
    return float(np.mean(forward / mean)), float(np.mean(back / mean))
