"""Kalman tracker of amplitude, phase and frequency on the sum segments (TRIPULSE section 1).

State (A, phi, omega), random walks on all three.  A sum segment y = A exp(j phi) + n is turned by
the predicted phase: its real part measures A, its imaginary part A times the phase error.  Between
sum segments the state is predicted, which gives the delta segments their reference.  A segment that
does not fit is left out and counted.  Several in a row are a lost lock, which ends the filter.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Params, parameter, require_finite
from rf_pointing.core.types import Array


@dataclass(frozen=True, kw_only=True)
class TrackerParams(Params):
    """How fast amplitude, phase and frequency wander, and what counts as lost lock."""

    # Two clocks of 10 Hz linewidth: 2 pi times 20 Hz is 126 rad^2/s.
    phase_walk_rad2_s: float = parameter(
        130.0, "phase variance per second, 2 pi times the linewidth", low=0.0, high=1e7
    )
    frequency_walk_rad2_s3: float = parameter(
        1e6, "variance of the angular frequency per second", low=0.0, high=1e15
    )
    amplitude_walk_s: float = parameter(
        1.0, "relative amplitude variance per second", low=0.0, high=1e6
    )
    frequency_sigma_hz: float = parameter(
        1000.0, "uncertainty of the frequency at the start", low=0.0, high=1e7
    )
    # 25 is exceeded by noise once in 270 000 segments; a slip of half a turn is far above at 10 dB.
    gate: float = parameter(
        25.0, "largest normalised innovation squared (2 degrees of freedom)", low=4.0, high=1e4
    )
    # One miss may be interference; with two the phase in between is unknown to more than a turn.
    misses_allowed: int = parameter(1, "segments in a row that may miss the gate", low=0, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerState:
    """Estimate (amplitude, phase, angular frequency) (3,) at `t_s` with covariance (3, 3), and the
    state of lock.
    """

    t_s: float
    estimate: Array
    covariance: Array
    misses: int
    lost: str


def start(params: TrackerParams, t_s: float, value: complex, noise_variance: float) -> TrackerState:
    """Return the state after the first sum segment, at zero frequency.

    Refuse one without signal.
    """
    require_finite("value", value)
    amplitude = abs(value)
    if amplitude == 0.0:
        raise ValueError("value=0: the first sum segment holds no signal")
    half = 0.5 * noise_variance
    spread = [half, half / amplitude**2, (2.0 * math.pi * params.frequency_sigma_hz) ** 2]
    return TrackerState(
        t_s=t_s,
        estimate=np.array([amplitude, math.atan2(value.imag, value.real), 0.0]),
        covariance=np.diag(spread),
        misses=0,
        lost="",
    )


def predict(params: TrackerParams, state: TrackerState, t_s: float) -> TrackerState:
    """Return the state carried on to `t_s`."""
    dt_s = t_s - state.t_s
    if not dt_s >= 0.0:
        raise ValueError(f"t_s={t_s} must be >= the state's {state.t_s}")
    move = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, dt_s], [0.0, 0.0, 1.0]])
    q = params.frequency_walk_rad2_s3
    walk = np.array(
        [
            [params.amplitude_walk_s * float(state.estimate[0]) ** 2 * dt_s, 0.0, 0.0],
            [0.0, params.phase_walk_rad2_s * dt_s + q * dt_s**3 / 3.0, q * dt_s**2 / 2.0],
            [0.0, q * dt_s**2 / 2.0, q * dt_s],
        ]
    )
    return TrackerState(
        t_s=t_s,
        estimate=move @ state.estimate,
        covariance=move @ state.covariance @ move.T + walk,
        misses=state.misses,
        lost=state.lost,
    )


def update(
    params: TrackerParams, state: TrackerState, value: complex, noise_variance: float
) -> TrackerState:
    """Return the state after the sum segment `value` at the state's own time.

    Raises
    ------
    ValueError : if the value is not finite, or lock was lost before (start anew).
    """
    require_finite("value", value)
    if state.lost:
        raise ValueError(f"the tracker has {state.lost}: start it anew")
    amplitude, phase = float(state.estimate[0]), float(state.estimate[1])
    # In the frame of the predicted phasor amplitude and phase separate: real part and imaginary
    # part.
    turned = value * complex(math.cos(phase), -math.sin(phase))
    innovation = np.array([turned.real - amplitude, turned.imag])
    measure = np.array([[1.0, 0.0, 0.0], [0.0, amplitude, 0.0]])
    spread = measure @ state.covariance @ measure.T + 0.5 * noise_variance * np.eye(2)
    surprise = float(innovation @ np.linalg.solve(spread, innovation))
    if not surprise <= params.gate:
        return _missed(params, state, surprise)
    gain = np.linalg.solve(spread, measure @ state.covariance).T
    # Joseph form: stays positive although amplitude, phase and frequency differ by orders of
    # magnitude.
    keep = np.eye(3) - gain @ measure
    covariance = keep @ state.covariance @ keep.T + 0.5 * noise_variance * gain @ gain.T
    return TrackerState(
        t_s=state.t_s,
        estimate=state.estimate + gain @ innovation,
        covariance=covariance,
        misses=0,
        lost="",
    )


def _missed(params: TrackerParams, state: TrackerState, surprise: float) -> TrackerState:
    misses = state.misses + 1
    lost = ""
    if misses > params.misses_allowed:
        lost = f"lost lock at {state.t_s} s: innovation {surprise} > gate {params.gate} in {misses} segments in a row"
    return TrackerState(
        t_s=state.t_s,
        estimate=state.estimate,
        covariance=state.covariance,
        misses=misses,
        lost=lost,
    )
