"""The conscan experiments behind the published rows: Monte Carlo runs and small closed loops.

The picture of docs/math/conscan.md shows bias and spread of both estimators against the pointing
error.  Run: python -m rf_pointing.papers.conscan_cases docs/math/conscan.svg
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rf_pointing.core import MDEG, MU, Sensor, random_stream
from rf_pointing.core.types import Array
from rf_pointing.rf import (
    HALF_POWER_BEAMWIDTH_RAD,
    Beam,
    BeamParams,
    MonopulseFeed,
    MonopulseFeedParams,
    Receiver,
)
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
from rf_pointing.tracking.beam_fit import PowerWindow, beam_design, fit_beam
from rf_pointing.tracking.conscan import ConscanTracker
from rf_pointing.tracking.conscan_estimate import ConscanParams, linear_rows

BEAM_KA_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
BEAM_X_RAD = HALF_POWER_BEAMWIDTH_RAD["X"]
RADIUS_RAD = 1.55 * MDEG
"""Scan radius of CONSCAN section VI: 0.1 dB at Ka band."""

# As rf_receiver delivers them: five samples in a cluster.
CLUSTER_S, SAMPLE_S = 0.1, 0.02
SAMPLES = 32


def circle(samples: int, radius_rad: float = RADIUS_RAD) -> tuple[Array, Array]:
    """Return the beam's offsets at the samples of one uniform turn (CONSCAN eq. 9)."""
    angle = 2.0 * np.pi * np.arange(1, samples + 1) / samples
    return radius_rad * np.cos(angle), radius_rad * np.sin(angle)


def mean_power_hz(
    level_db_hz: float, beamwidth_rad: float, error_rad: Array, x: Array, y: Array
) -> Array:
    """Return the carrier power over N0 at the beam offsets for a target at `error_rad` (2,)
    (CONSCAN eq. 1).
    """
    distance2 = (error_rad[0] - x) ** 2 + (error_rad[1] - y) ** 2
    return np.asarray(10.0 ** (level_db_hz / 10.0) * np.exp(-MU * distance2 / beamwidth_rad**2))


def constant_noise_estimates(
    sigma_hz: float, mean_hz: Array, beamwidth_rad: float, runs: int, rng: np.random.Generator
) -> Array:
    """Return the paper's estimates (runs, 2) of one turn whose samples all have the same noise
    (eqs. 13-15).
    """
    samples = len(mean_hz)
    x, y = circle(samples)
    rows = np.zeros((samples, 6))
    # Columns of a scan window: noise, and the offsets of the beam from the scan centre.
    rows[:, 2], rows[:, 3], rows[:, 4] = sigma_hz, x, y
    power = mean_hz + sigma_hz * rng.standard_normal((runs, samples))
    return linear_errors_rad(PowerWindow(rows), power, beamwidth_rad, RADIUS_RAD)


def linear_errors_rad(
    window: PowerWindow, power_w: Array, half_power_beamwidth_rad: float, radius_rad: float
) -> Array:
    """Return the errors (runs, 2) of powers (runs, n) at the positions of one window."""
    rows = linear_rows(window, half_power_beamwidth_rad, radius_rad)
    weighted = rows / window.sigma_w**2
    solution = power_w @ (np.linalg.inv(weighted @ rows.T) @ weighted).T
    scale = half_power_beamwidth_rad**2 / (2.0 * MU * radius_rad)
    return np.asarray(scale * solution[:, 1:] / solution[:, :1])


def receiver_powers_hz(mean_hz: Array, runs: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return 1-s powers of the Block V receiver (runs, n) over N0, and their variance over the
    power (B-3).
    """
    # The Block V receiver estimates amplitude; its square is biased by the noise, which the 0.5
    # removes.
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
    """Run one window; `offset` is target minus scan centre.

    Return error and covariance if valid.
    """
    pattern = tracker.params.scan
    for k in range(start, start + tracker.params.window_samples):
        scan = pattern.offset(k + 0.5)
        x, y = scan.cross_elevation_rad, scan.elevation_rad
        power = receiver.carrier_power(k + 1.0, 1.0, offset[0] - x, offset[1] - y, level_db_hz)
        error = tracker.add(power, x, y)
    if error is None or not error.valid:
        return None
    return np.array([error.cross_elevation_rad, error.elevation_rad]), error.covariance_rad2


def conscan_normalised_errors(
    level_db_hz: float, error_rad: Array, runs: int, rng: np.random.Generator
) -> Array:
    """Return e^T C^-1 e / 2 of `runs` estimates of the live tracker on the live receiver at Ka
    band.
    """
    params = ConscanParams(half_power_beamwidth_rad=BEAM_KA_RAD, radius_rad=RADIUS_RAD, ramp_s=0.0)
    tracker, receiver = ConscanTracker(params), _receiver(BeamParams.for_band("Ka"), rng)
    values = []
    for run in range(runs):
        found = _turn(tracker, receiver, run * params.window_samples, error_rad, level_db_hz)
        if found is not None:
            miss = found[0] - error_rad
            values.append(0.5 * float(miss @ np.linalg.solve(found[1], miss)))
    return np.array(values)


def pull_in_rms_rad(
    level_db_hz: float, start_rad: Array, periods: int, rng: np.random.Generator
) -> float:
    """Return the rms radial error of the scan centre over 30 periods after the first `periods`.

    Ka band, an antenna that follows at once, a target at rest; every estimate moves the scan centre
    onto the target.
    """
    params = ConscanParams(half_power_beamwidth_rad=BEAM_KA_RAD, radius_rad=RADIUS_RAD)
    tracker, receiver = ConscanTracker(params), _receiver(BeamParams.for_band("Ka"), rng)
    offset, squares = start_rad.copy(), []
    for turn in range(periods + 30):
        found = _turn(tracker, receiver, turn * params.window_samples, offset, level_db_hz)
        if found is not None:
            offset = offset - found[0]
        # The estimate of a turn acts at its end, so the settled error begins one turn earlier.
        if turn >= periods - 1:
            squares.append(float(offset @ offset))
    return math.sqrt(float(np.mean(squares)))


def search_time_s(direction_rad: float, level_db_hz: float, rng: np.random.Generator) -> float:
    """Return the time from the start of a search at X band until monopulse holds a target three
    beamwidths away.

    The live spiral, receiver, tracker and state table; the antenna follows at once; the integrator
    runs at 0.3 Hz. Held: the error is below a tenth of the beamwidth.
    """
    beam = BeamParams.for_band("X")
    target = 3.0 * BEAM_X_RAD * np.array([math.cos(direction_rad), math.sin(direction_rad)])
    # A spiral sized for one beamwidth must reach three: the search goes on beyond its sigma.
    spiral = SpiralSearch(
        SpiralParams(half_power_beamwidth_rad=BEAM_X_RAD, uncertainty_rad=BEAM_X_RAD)
    )
    receiver, table = _receiver(beam, rng), Autotrack(AutotrackParams(sensor="monopulse"))
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_X_RAD))
    state, trim = AutotrackState(mode="search"), np.zeros(2)
    # A minute of clusters: twice the required time, so that a slow search still has a number.
    for k in range(600):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(1, 6)
        searching = state.mode == "search"
        scan = (
            [spiral.offset(t - state.entered_s)[:2] for t in times]
            if searching
            else np.zeros((5, 2))
        )
        miss = target - trim - np.array(scan)
        error = tracker.measure(
            receiver.cluster(times, miss[:, 0], miss[:, 1], level_db_hz, SAMPLE_S)
        )
        before = state
        state = table.step(
            state,
            AutotrackInputs(
                t_s=float(times[-1]), request="track", target_available=True, on_target=True,
                carrier_to_noise_db_hz=error.carrier_to_noise_db_hz, axis_db_hz=level_db_hz,
                valid=frozenset({Sensor.MONOPULSE, Sensor.CONSCAN} if error.valid else {Sensor.CONSCAN}),
            ),
        )  # fmt: skip
        # The spiral's offset becomes part of the trim, or the beam would jump back off the target.
        if before.mode == "search" and state.mode != "search":
            trim = trim + np.array(scan[-1])
        if state.integrating and error.valid:
            # Integrator of 0.3 Hz, one step per cluster; the antenna follows at once.
            trim = trim + 2.0 * math.pi * 0.3 * CLUSTER_S * np.array(
                [error.cross_elevation_rad, error.elevation_rad]
            )
            if float(np.hypot(*(target - trim))) < 0.1 * BEAM_X_RAD:
                return float(times[-1])
    return math.inf


@dataclass(frozen=True, slots=True)
class EstimatorCurves:
    """Per pointing error (n,): bias and standard deviation along it, all in mdeg, and the
    Cramer-Rao bound.
    """

    error_mdeg: Array
    linear_bias: Array
    linear_sigma: Array
    exact_bias: Array
    exact_sigma: Array
    bound: Array


def estimator_curves(level_db_hz: float, runs: int, seed: int, points: int = 12) -> EstimatorCurves:
    """Return both estimators at Ka band on `runs` noisy windows of 32 s, from no error to 0.6
    beamwidths.
    """
    x, y = circle(SAMPLES)
    design = beam_design(np.column_stack([x, y]), BEAM_KA_RAD)
    rows = np.zeros((SAMPLES, 6))
    rows[:, 2], rows[:, 3], rows[:, 4] = 1.0, x, y
    errors = np.linspace(0.0, 0.6, points) * BEAM_KA_RAD
    found = []
    for error in errors:
        mean = mean_power_hz(level_db_hz, BEAM_KA_RAD, np.array([error, 0.0]), x, y)
        power, noise = receiver_powers_hz(
            mean, runs, random_stream(seed, f"figure {level_db_hz} {error}")
        )
        linear = linear_errors_rad(PowerWindow(rows), power, BEAM_KA_RAD, RADIUS_RAD)[:, 0] - error
        exact = fit_beam(design, power, noise).error_rad[:, 0] - error
        found.append(
            (linear.mean(), linear.std(), exact.mean(), exact.std(), bound_rad(mean, x, y)[0])
        )
    return EstimatorCurves(
        errors / MDEG, *(np.array(column) / MDEG for column in zip(*found, strict=True))
    )


def bound_rad(mean_hz: Array, x: Array, y: Array) -> Array:
    """Return the Cramer-Rao bound (2,) of both axes.

    Fisher information P / (2 N0) per second in the logarithm of the power.
    """
    rows = np.stack([np.ones_like(x), 2.0 * MU * x / BEAM_KA_RAD**2, 2.0 * MU * y / BEAM_KA_RAD**2])
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(0.5 * mean_hz * rows @ rows.T))[1:]))


def draw(path: Path, runs: int = 40_000, seed: int = 1) -> None:
    """Write the picture, bias left and spread right, for 30 and 40 dB-Hz."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    bias, spread = figure.subplots(1, 2)
    for level, style in ((30.0, "-"), (40.0, "--")):
        curves = estimator_curves(level, runs, seed)
        bias.plot(
            curves.error_mdeg,
            curves.linear_bias,
            style,
            color="tab:red",
            label=f"linear, {level:.0f} dB-Hz",
        )
        bias.plot(
            curves.error_mdeg,
            curves.exact_bias,
            style,
            color="tab:blue",
            label=f"exact, {level:.0f} dB-Hz",
        )
        spread.plot(curves.error_mdeg, curves.linear_sigma, style, color="tab:red")
        spread.plot(curves.error_mdeg, curves.exact_sigma, style, color="tab:blue")
        spread.plot(curves.error_mdeg, curves.bound, ":", color="black")
    for axes, name in ((bias, "bias, mdeg"), (spread, "standard deviation, mdeg (dotted: bound)")):
        axes.axvline(8.5, color="0.8", linewidth=1.0)
        axes.set_xlabel("pointing error, mdeg")
        axes.set_ylabel(name)
    bias.legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
