"""Markov parameters and realization recover a planted system."""

import control
import numpy as np
import pytest

from rf_pointing.identification import StateSpace, modes_of, observer_markov, realize, suggested_order, system_markov

SAMPLE_S = 0.02


def planted_markov(planted: StateSpace, count: int) -> np.ndarray:
    impulse = np.zeros(count)
    impulse[0] = 1.0
    return planted.simulate(impulse)[:, 0]


def test_markov_parameters_are_the_impulse_response(
    planted: StateSpace, sequences: tuple[np.ndarray, np.ndarray]
) -> None:
    observer = observer_markov(*sequences, 5)
    np.testing.assert_allclose(system_markov(observer, 300), planted_markov(planted, 300), atol=1e-9)


def test_realization_has_the_planted_modes(sequences: tuple[np.ndarray, np.ndarray]) -> None:
    found = modes_of(realize(system_markov(observer_markov(*sequences, 5), 400), 5, SAMPLE_S).model)
    np.testing.assert_allclose(found.frequency_hz, (2.01, 5.22), rtol=1e-6)
    np.testing.assert_allclose(found.damping, (0.0082, 0.01), rtol=1e-4)
    np.testing.assert_allclose(found.real_poles, (1.0,), atol=1e-9)


def test_realization_agrees_with_python_controls_era(planted: StateSpace) -> None:
    markov = planted_markov(planted, 201)
    ours = realize(markov, 5, SAMPLE_S)
    theirs, _ = control.eigensys_realization(markov, r=5, dt=SAMPLE_S)
    frequency = np.array([0.3, 1.0, 2.5, 7.0])
    per_sample = theirs(np.exp(2j * np.pi * frequency * SAMPLE_S)) / SAMPLE_S
    np.testing.assert_allclose(ours.model.response(frequency)[:, 0, 0], per_sample, rtol=1e-6)


def test_hankel_singular_values_show_the_order(planted: StateSpace) -> None:
    hankel = realize(planted_markov(planted, 301), 5, SAMPLE_S).hankel
    assert suggested_order(hankel, 1e-6) == 5


def test_noise_leaves_the_frequencies_within_a_fifth_of_a_percent(
    sequences: tuple[np.ndarray, np.ndarray],
) -> None:
    inputs, outputs = sequences
    noisy = outputs + 2e-3 * np.random.default_rng(2).standard_normal(outputs.shape)
    found = modes_of(realize(system_markov(observer_markov(inputs, noisy, 80), 600), 5, SAMPLE_S).model)
    np.testing.assert_allclose(found.frequency_hz[:2], (2.01, 5.22), rtol=0.002)


def test_input_that_does_not_excite_is_refused() -> None:
    inputs = np.ones((1, 400))
    inputs[0, 0] = 0.0
    with pytest.raises(ValueError, match="order=20 needs 41 independent regressors, the data excite"):
        observer_markov(inputs, np.cumsum(inputs, axis=1), 20)


def test_silent_data_are_refused() -> None:
    with pytest.raises(ValueError, match=r"inputs have rms 0\.0"):
        observer_markov(np.zeros((1, 400)), np.zeros((1, 400)), 4)


def test_an_order_beyond_the_rank_is_refused() -> None:
    with pytest.raises(ValueError, match="order=20 exceeds the rank"):
        realize(1e3 * np.ones(101), 20, SAMPLE_S)
