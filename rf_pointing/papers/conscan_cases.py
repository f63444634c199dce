"""The conscan experiments behind the published rows: Monte Carlo runs and small closed loops."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, MU, Sensor
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD, Beam, BeamParams, MonopulseFeed, MonopulseFeedParams, Receiver
from rf_pointing.rf import ReceiverParams as RxParams
from rf_pointing.tracking import (
    Autotrack,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
    MonopulseParams,
    MonopulseTracker,
    SpiralParams,
    SpiralSearch,
)
from rf_pointing.tracking.beam_fit import PowerWindow
from rf_pointing.tracking.conscan import ConscanTracker
from rf_pointing.tracking.conscan_estimate import ConscanParams, linear_errors_rad

__all__ = [
    "BEAM_KA_RAD",
    "BEAM_X_RAD",
    "RADIUS_RAD",
    "circle",
    "conscan_normalised_errors",
    "constant_noise_estimates",
    "mean_power_hz",
    "pull_in_rms_rad",
    "receiver_powers_hz",
    "search_time_s",
    "sigma_after",
]

Array = NDArray[np.float64]

BEAM_KA_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
BEAM_X_RAD = HALF_POWER_BEAMWIDTH_RAD["X"]
RADIUS_RAD = 1.55 * MDEG
"""Scan radius of CONSCAN section VI: 0.1 dB at Ka band."""

CLUSTER_S, SAMPLE_S = 0.1, 0.02


def circle(samples: int, radius_rad: float = RADIUS_RAD) -> tuple[Array, Array]:
    """Return the beam's offsets at the samples of one uniform turn (CONSCAN eq. 9)."""
    angle = 2.0 * np.pi * np.arange(1, samples + 1) / samples
    return radius_rad * np.cos(angle), radius_rad * np.sin(angle)


def mean_power_hz(level_db_hz: float, beamwidth_rad: float, error_rad: Array, x: Array, y: Array) -> Array:
    """Return the carrier power over N0 at the beam offsets for a target at `error_rad` (2,) (CONSCAN eq. 1)."""
    distance2 = (error_rad[0] - x) ** 2 + (error_rad[1] - y) ** 2
    return np.asarray(10.0 ** (level_db_hz / 10.0) * np.exp(-MU * distance2 / beamwidth_rad**2))


def constant_noise_estimates(
    sigma_hz: float, mean_hz: Array, beamwidth_rad: float, runs: int, rng: np.random.Generator
) -> Array:
    """Return the paper's estimates (runs, 2) of one turn whose samples all have the same noise (eqs. 13-15)."""
    samples = len(mean_hz)
    x, y = circle(samples)
    rows = np.zeros((samples, 6))
    rows[:, 2], rows[:, 3], rows[:, 4] = sigma_hz, x, y
    power = mean_hz + sigma_hz * rng.standard_normal((runs, samples))
    return linear_errors_rad(PowerWindow(rows), power, beamwidth_rad, RADIUS_RAD)


def receiver_powers_hz(mean_hz: Array, runs: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return 1-s powers of the Block V receiver (runs, n) over N0, and their variance over the power (B-3)."""
    arm = np.sqrt(mean_hz) + math.sqrt(0.5) * rng.standard_normal((runs, len(mean_hz)))
    power = np.maximum(arm**2 - 0.5, 1e-9)
    return power, (2.0 * power + 0.5) / power


def sigma_after(estimates: Array) -> tuple[Array, Array]:
    """Return the standard deviation of each axis and its standard error, for runs (n, 2)."""
    sigma = np.std(estimates, axis=0, ddof=1)
    return sigma, sigma / math.sqrt(2.0 * (len(estimates) - 1))


def _receiver(beam: BeamParams, rng: np.random.Generator) -> Receiver:
    return Receiver(RxParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), rng)


def _turn(
    tracker: ConscanTracker, receiver: Receiver, start: int, offset: Array, level_db_hz: float
) -> tuple[Array, Array] | None:
    """Run one window; `offset` is target minus scan centre.  Return error and covariance if valid."""
    for k in range(start, start + tracker.params.window_samples):
        scan = tracker.scan_offset(k + 0.5)
        x, y = scan.cross_elevation_rad, scan.elevation_rad
        power = receiver.carrier_power(k + 1.0, 1.0, offset[0] - x, offset[1] - y, level_db_hz)
        error = tracker.add(power, x, y)
    if error is None or not error.valid:
        return None
    return np.array([error.cross_elevation_rad, error.elevation_rad]), error.covariance_rad2


def conscan_normalised_errors(level_db_hz: float, error_rad: Array, runs: int, rng: np.random.Generator) -> Array:
    """Return e^T C^-1 e / 2 of `runs` estimates of the live tracker on the live receiver at Ka band."""
    params = ConscanParams(half_power_beamwidth_rad=BEAM_KA_RAD, radius_rad=RADIUS_RAD, ramp_s=0.0)
    tracker, receiver = ConscanTracker(params), _receiver(BeamParams.for_band("Ka"), rng)
    values = []
    for run in range(runs):
        found = _turn(tracker, receiver, run * params.window_samples, error_rad, level_db_hz)
        if found is not None:
            miss = found[0] - error_rad
            values.append(0.5 * float(miss @ np.linalg.solve(found[1], miss)))
    return np.array(values)


def pull_in_rms_rad(level_db_hz: float, start_rad: Array, periods: int, rng: np.random.Generator) -> float:
    """Return the rms radial error of the scan centre over 30 periods after the first `periods`.

    Ka band, an antenna that follows at once, a target at rest; every estimate moves the scan centre onto the target.
    """
    params = ConscanParams(half_power_beamwidth_rad=BEAM_KA_RAD, radius_rad=RADIUS_RAD)
    tracker, receiver = ConscanTracker(params), _receiver(BeamParams.for_band("Ka"), rng)
    offset, squares = start_rad.copy(), []
    for turn in range(periods + 30):
        found = _turn(tracker, receiver, turn * params.window_samples, offset, level_db_hz)
        if found is not None:
            offset = offset - found[0]
        if turn >= periods - 1:
            squares.append(float(offset @ offset))
    return math.sqrt(float(np.mean(squares)))


def search_time_s(direction_rad: float, level_db_hz: float, rng: np.random.Generator) -> float:
    """Return the time from the start of a search at X band until monopulse holds a target three beamwidths away.

    The live spiral, receiver, tracker and state table; the antenna follows at once; the integrator runs at 0.3 Hz.
    Held: the error is below a tenth of the beamwidth.
    """
    beam = BeamParams.for_band("X")
    target = 3.0 * BEAM_X_RAD * np.array([math.cos(direction_rad), math.sin(direction_rad)])
    spiral = SpiralSearch(SpiralParams(half_power_beamwidth_rad=BEAM_X_RAD, uncertainty_rad=BEAM_X_RAD))
    receiver, table = _receiver(beam, rng), Autotrack(AutotrackParams(sensor="monopulse"))
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_X_RAD))
    state, trim = AutotrackState(mode="search"), np.zeros(2)
    for k in range(600):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(1, 6)
        searching = state.mode == "search"
        scan = [spiral.offset(t - state.entered_s)[:2] for t in times] if searching else np.zeros((5, 2))
        miss = target - trim - np.array(scan)
        error = tracker.measure(receiver.cluster(times, miss[:, 0], miss[:, 1], level_db_hz, SAMPLE_S))
        before = state
        state = table.step(
            state,
            AutotrackInputs(
                t_s=float(times[-1]), request="track", target_available=True, on_target=True,
                carrier_to_noise_db_hz=error.carrier_to_noise_db_hz, axis_db_hz=level_db_hz,
                valid=frozenset({Sensor.MONOPULSE, Sensor.CONSCAN} if error.valid else {Sensor.CONSCAN}),
            ),
        )  # fmt: skip
        if before.mode == "search" and state.mode != "search":
            trim = trim + np.array(scan[-1])
        if state.integrating and error.valid:
            trim = trim + 2.0 * math.pi * 0.3 * CLUSTER_S * np.array([error.cross_elevation_rad, error.elevation_rad])
            if float(np.hypot(*(target - trim))) < 0.1 * BEAM_X_RAD:
                return float(times[-1])
    return math.inf
