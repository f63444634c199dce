"""Figures 8-3 and 8-4 of PI83 by their text: rms errors against range and against roll.

Monte Carlo trials of the whole sensor at one relative pose (section 8.3, program FHR-321C): phases
with receiver noise, cycles, sequenced estimators.  Errors: distance, chords |xi - xi_true| and
|eta - eta_true|, roll.  A trial with a two-way range off by more than half the fine lane is counted
and discarded: the listing's 0.72 m accepts a wrong lane of 0.736 m with 16 mm of noise the other
way.  All trials run as one stack.
"""

import math
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
)
from rf_pointing.array_sensors.interferometer.initializer import geometry_from_pose
from rf_pointing.array_sensors.interferometer.measurement import phase_variance
from rf_pointing.array_sensors.interferometer.radio import (
    LOWEST_SNR,
    LinkParams,
    RadioParams,
    amplitude_sigma,
    required_power_w,
    signal_to_noise_ratios,
)
from rf_pointing.array_sensors.interferometer.reading import resolve_ranges
from rf_pointing.array_sensors.interferometer.relative_pose import RelativePose
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams, track
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    CarrierPlan,
    path_lengths,
    two_way_ranges,
)
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, PUBLISHED
from rf_pointing.core import random_stream, require_between, wrap_rad
from rf_pointing.core.types import Array
from rf_pointing.papers.row import Row, near
from rf_pointing.papers.sweeps import sweep

# The listing's 0.72 m would accept a wrong lane of 0.736 m with 16 mm of noise.
_WRONG_LANE_FRACTION = 0.5
LISTING = SequenceParams(range_estimator=PUBLISHED, reverse_attitude=PUBLISHED)
"""The estimator as the report's simulation runs it."""
REPORT_SPEED_OF_LIGHT_M_S = 3.0e8
"""The value that the report computes with."""
# As in the report's figures; an rms of 100 trials is known to 7 %.
_TRIALS = 100
_MANY_TRIALS = 2000
_PLAN = CarrierPlan(speed_of_light_m_s=REPORT_SPEED_OF_LIGHT_M_S)
_DIRECTIONS_DEG = ((0.0, 0.0), (45.0, 0.0), (0.0, 45.0), (26.6, 26.6))
_DISTANCES_M = (10.0, 1e2, 1e3, 1e4, 1e5)
_ROLLS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0)
# The text's powers for carrier differences: 42 and 21 mW at 100 km.
_WEAK = RadioParams(forward_power_w=0.042, return_power_w=0.021)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialErrors:
    """Errors of each good trial (n,), and how many trials had a wrong lane."""

    range_m: Array
    forward_rad: Array
    reverse_rad: Array
    roll_rad: Array
    wrong_lanes: int

    def rms(self) -> tuple[float, float, float, float]:
        """Return root-mean-square errors of range, forward chord, reverse chord and roll."""
        errors = (self.range_m, self.forward_rad, self.reverse_rad, self.roll_rad)
        return tuple(float(np.sqrt(np.mean(error**2))) for error in errors)  # type: ignore[return-value]


def run_trials(
    pose: RelativePose,
    trials: int,
    rng: np.random.Generator,
    arrays: ArrayParams,
    radio: RadioParams,
    plan: CarrierPlan,
    link: LinkParams,
    sequence: SequenceParams,
    amplitude_noise: str = CORRECTED,
    sharpen: bool = False,
) -> TrialErrors:
    """Return the errors of `trials` independent measurements of `pose`, the estimator starting at
    the truth.

    `sharpen` takes the differences between paths from the return carriers, the report's further
    work.  Raises ValueError if every trial has a wrong lane.
    """
    require_between("trials", trials, 1, None)
    phases = simulate_phases(pose.position_m, pose.attitude, arrays, radio, plan, link, rng, trials)
    sigma = amplitude_sigma(pose.range_m, radio, plan, link, amplitude_noise)
    amplitudes = simulate_amplitudes(
        coupling_amplitudes(pose.direction, pose.attitude), float(sigma), rng, trials
    )
    ranges = resolve_ranges(phases, plan).ranges_m
    ranges = sharpened_ranges(phases, ranges, plan)[0] if sharpen else ranges
    # Against the truth: a simulation may know which lanes are wrong, a receiver may not.
    off = np.abs(ranges - two_way_ranges(pose.position_m, pose.attitude, arrays))
    good = np.all(off <= _WRONG_LANE_FRACTION * plan.ambiguities_m[-1], axis=(-2, -1))
    if not np.any(good):
        raise ValueError(f"all {trials} trials resolved a wrong lane, must be fewer")
    truth = geometry_from_pose(
        *(np.array([value] * int(np.sum(good))) for value in (pose.position_m, pose.attitude))
    )
    found = track(truth, ranges[good], amplitudes[good], arrays, sequence).geometry
    return TrialErrors(
        range_m=found.range_m - truth.range_m,
        forward_rad=np.linalg.norm(found.forward - truth.forward, axis=-1),
        reverse_rad=np.linalg.norm(found.reverse - truth.reverse, axis=-1),
        roll_rad=wrap_rad(found.roll_rad - truth.roll_rad),
        wrong_lanes=trials - int(np.sum(good)),
    )


def require_gaussian_regime(snr_forward: ArrayLike, snr_return: ArrayLike) -> None:
    """Raise ValueError if any link is below 10 dB, where the noise model does not hold."""
    for name, snr in (("forward", snr_forward), ("return", snr_return)):
        lowest = float(np.min(snr))
        if lowest < LOWEST_SNR:
            raise ValueError(
                f"{name} link snr={lowest:.4g} must be >= {LOWEST_SNR} for Gaussian phase noise"
            )


def simulate_phases(
    position_m: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    radio: RadioParams,
    plan: CarrierPlan,
    link: LinkParams,
    rng: np.random.Generator,
    trials: int = 1,
) -> Array:
    """Return `trials` sets of phases in [0, 2 pi), (trials, K, 3, 3), of one relative pose."""
    lengths = path_lengths(position_m, attitude, arrays)
    outward, back = lengths[0, 0], lengths[1:, 1:]
    snr = signal_to_noise_ratios(outward, back, radio, plan, link)
    require_gaussian_regime(*snr)
    forward_sigma, return_sigma = (np.sqrt(phase_variance(ratio)) for ratio in snr)
    # One draw per carrier for the way out: the nine paths share it.
    noise = rng.normal(size=(trials, plan.count, 1, 1)) * forward_sigma[:, None, None]
    noise = noise + rng.normal(size=(trials, plan.count, 3, 3)) * return_sigma
    return np.mod(
        carrier_phases(outward + arrays.transponder_delay_m, back, plan) + noise, 2.0 * np.pi
    )


def simulate_amplitudes(
    amplitudes: ArrayLike, sigma: float, rng: np.random.Generator, trials: int = 1
) -> Array:
    """Return `trials` noisy sets (trials, 2, 2) of the four couplings."""
    return np.asarray(amplitudes, dtype=np.float64) + rng.normal(size=(trials, 2, 2)) * sigma


def sharpened_ranges(
    phases_rad: ArrayLike, ranges_m: ArrayLike, plan: CarrierPlan
) -> tuple[Array, Array]:
    """Return the ranges (..., n, n) with their mutual differences taken from the return carriers,
    and residuals.

    Between paths of one carrier the way out is common, so phase differences are exactly (2 pi
    fR/c)(rho_ij - mean): the range-difference direction finding that the report recommends as
    further work.  The mean over the paths stays that of `ranges_m`; the residuals (..., K, n, n)
    are in lanes of the return carrier.
    """
    ranges = np.asarray(ranges_m, dtype=np.float64)
    phases = np.asarray(phases_rad, dtype=np.float64)
    # Differences to path 1-1: the way out is common and cancels in the return carriers.
    reference = ranges[..., None, :1, :1]
    wave = plan.return_wave_rad_m[:, None, None]
    expected = wave * (ranges[..., None, :, :] - reference)
    off = wrap_rad(phases - phases[..., :1, :1] - expected)
    correction = np.mean(off / wave, axis=-3)
    spread = (off - wave * correction[..., None, :, :]) / (2.0 * np.pi)
    return ranges + correction - np.mean(correction, axis=(-2, -1), keepdims=True), spread


def carrier_phases(outward_m: ArrayLike, back_m: ArrayLike, plan: CarrierPlan) -> Array:
    """Return the phases (..., K, n, n), not folded, of the paths out (...) and back (..., n, n)
    (eq. 7-7).
    """
    forward = plan.forward_wave_rad_m * np.asarray(outward_m, dtype=np.float64)[..., None]
    back = (
        plan.return_wave_rad_m[:, None, None]
        * np.asarray(back_m, dtype=np.float64)[..., None, :, :]
    )
    return forward[..., None, None] + back


def _errors(
    name: str,
    seed: int,
    range_m: float,
    angles_deg: tuple[float, float] = (0.0, 0.0),
    roll_deg: float = 0.0,
    corrected: bool = False,
    trials: int = _TRIALS,
    radio: RadioParams | None = None,
    sharpen: bool = False,
) -> TrialErrors:
    direction = direction_from_angles(*np.radians(angles_deg))
    attitude = attitude_from_euler(0.0, 0.0, math.radians(roll_deg))
    sequence, noise = (SequenceParams(), "corrected") if corrected else (LISTING, "published")
    return run_trials(
        RelativePose(position_m=range_m * direction, attitude=attitude),
        trials,
        random_stream(seed, f"interferometer {name} {range_m} {angles_deg} {roll_deg}"),
        ArrayParams(),
        radio or RadioParams(),
        _PLAN,
        LinkParams(),
        sequence,
        noise,
        sharpen,
    )


def simulation_rows(seed: int, executor: Executor | None = None) -> list[Row]:
    """Return the simulation's statements of section 8.3 and what the corrected forms give."""
    return [
        *_range_rows(seed, executor),
        *_roll_rows(seed, executor),
        *_short_range_rows(seed),
        *_power_rows(seed),
    ]


def _row(
    quantity: str,
    paper: float,
    ours: float,
    unit: str,
    remark: str = "",
    bound: str = "<=",
    due: float | None = None,
) -> Row:
    # An rms of 100 trials is known to 7 %.
    return Row(
        quantity, "PI83 section 8.3", paper, ours, unit, 0.0, bound=bound, remark=remark,
        due=near(due, 0.15),
    )  # fmt: skip


def _far_and_near(seed: int, case: tuple[float, tuple[float, float]]) -> TrialErrors:
    return _errors("range", seed, *case)


def _range_rows(seed: int, executor: Executor | None) -> list[Row]:
    # Every direction at every distance: the report's claims name the worst of them.
    cases = [(distance, angles) for distance in _DISTANCES_M for angles in _DIRECTIONS_DEG]
    runs = dict(zip(cases, sweep(partial(_far_and_near, seed), cases, executor), strict=True))
    far = [runs[1e5, a].rms() for a in _DIRECTIONS_DEG]
    steps = [
        max(
            runs[near, a].rms()[k] / runs[away, a].rms()[k]
            for a in _DIRECTIONS_DEG
            for k in (1, 2, 3)
        )
        for near, away in ((1e3, 1e4), (1e4, 1e5))
    ]
    corrected = _errors("roll", seed, 1e5, corrected=True, trials=_MANY_TRIALS).rms()[3]
    meant, listed = (
        float(amplitude_sigma(1e5, RadioParams(), _PLAN, LinkParams(), form))
        for form in (CORRECTED, PUBLISHED)
    )
    return [
        _row("range rms at 100 km, worst direction", 1e-3, max(e[0] for e in far), "m"),
        _row("direction rms at 100 km, worst direction and array", 1e-3, max(max(e[1:3]) for e in far), "rad"),
        _row("roll rms at 100 km, worst direction", 1e-3, max(e[3] for e in far), "rad"),
        _row(
            "roll rms at 100 km on boresight with the noise that the listing meant", 1e-3, corrected, "rad",
            "the listing keeps one of nine draws, divides it by nine and uses the forward power: 3.6 times too good",
            due=runs[1e5, (0.0, 0.0)].rms()[3] * meant / listed,
        ),
        _row("the same against the 10 mrad requirement", 0.01, corrected, "rad"),
        _row("angle errors at 1 km over those at 10 km", 1.0, steps[0], "1"),
        _row("angle errors at 10 km over those at 100 km", 1.0, steps[1], "1"),
        _row("wrong lanes in all 2000 trials", 0.0, float(sum(e.wrong_lanes for e in runs.values())), "1"),
    ]  # fmt: skip


def _against_roll(seed: int, case: tuple[float, float]) -> tuple[float, ...]:
    azimuth, roll = case
    return _errors("against roll", seed, 1e5, (azimuth, 0.0), roll, trials=_MANY_TRIALS).rms()


def _roll_rows(seed: int, executor: Executor | None) -> list[Row]:
    found = []
    for azimuth in (0.0, 45.0):
        errors = sweep(
            partial(_against_roll, seed), [(azimuth, roll) for roll in _ROLLS_DEG], executor
        )
        # Range and both directions must not depend on roll; roll itself may.
        spread = max(max(e[k] for e in errors) / min(e[k] for e in errors) for k in (0, 1, 2))
        # The extremes of five rms values of 2000 trials each differ by less than a tenth by chance.
        found.append(
            _row(
                f"largest over smallest rms against roll, azimuth {azimuth:g} deg", 1.1, spread, "1"
            )
        )
    return found


def _short_range_rows(seed: int) -> list[Row]:
    listing = [_errors("short", seed, 10.0, a).rms() for a in _DIRECTIONS_DEG]
    loud = RadioParams(forward_power_w=1e6, return_power_w=1e6)
    noiseless = [
        _errors("short", seed, 10.0, a, trials=1, radio=loud).rms() for a in _DIRECTIONS_DEG
    ]
    corrected = [_errors("short", seed, 10.0, a, corrected=True).rms() for a in _DIRECTIONS_DEG]
    return [
        _row("range rms at 10 m over range", 0.01, max(e[0] for e in listing) / 10.0, "1"),
        _row(
            "direction rms at 10 m off boresight, sum/18", 3.33e-3, max(max(e[1:3]) for e in listing), "rad",
            "the listing's sum/18 is 50 mm long at 10 m and misses its own goal; the range estimator with true "
            "gradients reaches it (next rows)",
            due=max(max(e[1:3]) for e in noiseless),
        ),
        _row("direction rms at 10 m, true gradients", 3.33e-3, max(max(e[1:3]) for e in corrected), "rad"),
        _row("range rms at 10 m, true gradients", 1e-3, max(e[0] for e in corrected), "m"),
    ]  # fmt: skip


def _power_rows(seed: int) -> list[Row]:
    # The same stream for both estimators: they differ by the method and not by their noise.
    weak = _errors(
        "weak", seed, 1e5, corrected=True, trials=_MANY_TRIALS, radio=_WEAK, sharpen=True
    )
    plain = _errors("weak", seed, 1e5, corrected=True, trials=_MANY_TRIALS, radio=_WEAK)
    needed = float(required_power_w(100.0, 1e5, 3.42e9, LinkParams()))
    return [
        Row(
            "forward power for 20 dB at 100 km against the 42 mW of the text", "PI83 p. 98", 0.042, needed, "W", 1e-3,
            remark="ours is Table 8-2's own 20-dB row; 42 mW is 22.9 dB: cause of the factor unknown",
            due=near(0.02134, 2e-3),
        ),
        _row("direction rms at 42 and 21 mW, carrier differences", 3.33e-3, max(weak.rms()[1:3]), "rad"),
        _row("wrong-lane rate at 42 and 21 mW", 1e-3, weak.wrong_lanes / _MANY_TRIALS, "1"),
        _row(
            "direction rms at 42 and 21 mW, difference frequencies", 3.33e-3, max(plain.rms()[1:3]), "rad", bound=">="
        ),
    ]  # fmt: skip
