import numpy as np
import pytest
from scipy.linalg import expm

from rf_pointing.array_sensors.tripulse.tracker import TrackerParams, TrackerState, predict, start, update
from rf_pointing.core import random_stream

PARAMS = TrackerParams()
STEP_S = 2e-5


def planted(
    rng: np.random.Generator, count: int, snr: float, frequency_hz: float, linewidth_hz: float = 20.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return noisy sum segments of amplitude 1 and their true phases."""
    steps = np.sqrt(2.0 * np.pi * linewidth_hz * STEP_S) * rng.normal(size=count)
    phase = 0.7 + 2.0 * np.pi * frequency_hz * STEP_S * np.arange(count) + np.cumsum(steps)
    noise = np.sqrt(0.5 / snr) * (rng.normal(size=(count, 2)) @ [1.0, 1j])
    return np.exp(1j * phase) + noise, phase


def run(values: np.ndarray, snr: float, params: TrackerParams = PARAMS) -> list[TrackerState]:
    states = [start(params, 0.0, complex(values[0]), 1.0 / snr)]
    for index, value in enumerate(values[1:], 1):
        states.append(update(params, predict(params, states[-1], index * STEP_S), complex(value), 1.0 / snr))
        if states[-1].lost:
            break
    return states


def test_planted_amplitude_phase_and_frequency_are_recovered_with_honest_covariance() -> None:
    rng, snr, frequency_hz = random_stream(1, "tracker"), 100.0, 600.0
    scores = []
    for _ in range(200):
        values, phase = planted(rng, 60, snr, frequency_hz)
        last = run(values, snr)[-1]
        error = last.estimate[:2] - [1.0, phase[-1]]
        scores.append(error @ np.linalg.solve(last.covariance[:2, :2], error))
        assert last.estimate[2] / (2.0 * np.pi) == pytest.approx(frequency_hz, abs=500.0)
    # Mean of 200 chi-square values of two degrees of freedom: 2 +- 0.14.
    assert np.mean(scores) == pytest.approx(2.0, abs=0.6)


def test_amplitude_follows_an_unstable_atmosphere() -> None:
    rng, snr = random_stream(1, "tracker amplitude"), 1000.0
    values, _ = planted(rng, 500, snr, 0.0)
    fade = 1.0 + 0.3 * np.sin(np.arange(500) / 80.0)
    params = PARAMS.replace(amplitude_walk_s=20.0)
    states = run(values * fade, snr, params)
    found = np.array([state.estimate[0] for state in states])
    np.testing.assert_allclose(found[50:], fade[50:], atol=0.1)


def test_one_bad_segment_is_left_out_and_two_in_a_row_are_a_lost_lock() -> None:
    values, _ = planted(random_stream(1, "tracker loss"), 60, 1000.0, 50.0)
    once = values.copy()
    once[30] *= -1.0
    assert run(once, 1000.0)[-1].lost == ""
    slipped = values.copy()
    slipped[30:] *= -1.0
    states = run(slipped, 1000.0)
    assert len(states) == 32
    assert "lost lock" in states[-1].lost
    with pytest.raises(ValueError, match="start it anew"):
        update(PARAMS, states[-1], 1.0 + 0j, 1e-3)


def test_bad_input_is_refused() -> None:
    state = start(PARAMS, 0.0, 1.0 + 0j, 0.01)
    with pytest.raises(ValueError, match="finite"):
        update(PARAMS, state, complex(np.nan, 0.0), 0.01)
    with pytest.raises(ValueError, match="t_s"):
        predict(PARAMS, state, -1.0)
    with pytest.raises(ValueError, match="no signal"):
        start(PARAMS, 0.0, 0j, 0.01)


def test_a_state_carried_on_walks_as_the_exact_discretisation_of_three_random_walks() -> None:
    """Van Loan's matrix exponential, for times far longer than a frame, where all of its terms count."""
    state = TrackerState(
        t_s=3.0, estimate=np.array([2.0, 0.3, 500.0]), covariance=np.diag([0.1, 0.2, 300.0]) + 0.05, misses=1, lost=""
    )
    params = PARAMS.replace(amplitude_walk_s=0.7, phase_walk_rad2_s=5.0, frequency_walk_rad2_s3=40.0)
    for dt_s in (0.0, 0.01, 0.8):
        drift, walk = np.zeros((3, 3)), np.diag([0.7 * 2.0**2, 5.0, 40.0])
        drift[1, 2] = 1.0
        whole = expm(np.block([[-drift, walk], [np.zeros((3, 3)), drift.T]]) * dt_s)
        move = whole[3:, 3:].T
        found = predict(params, state, 3.0 + dt_s)
        np.testing.assert_allclose(found.estimate, move @ state.estimate, rtol=1e-12)
        np.testing.assert_allclose(found.covariance, move @ state.covariance @ move.T + move @ whole[:3, 3:], rtol=1e-9)
        assert (found.t_s, found.misses, found.lost) == (3.0 + dt_s, 1, "")


def test_the_first_segment_gives_amplitude_and_phase_with_half_the_noise_each() -> None:
    first = start(PARAMS, 7.0, 3.0 * np.exp(-2.0j), 0.18)
    assert first.t_s == 7.0
    np.testing.assert_allclose(first.estimate, [3.0, -2.0, 0.0], atol=1e-12)
    spread = [0.09, 0.01, (2.0 * np.pi * PARAMS.frequency_sigma_hz) ** 2]
    np.testing.assert_allclose(first.covariance, np.diag(spread), rtol=1e-12)
    assert (first.misses, first.lost) == (0, "")
