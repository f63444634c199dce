"""The whole chain on planted systems with noise, drift and an unmeasured rate at the input."""

import numpy as np
import pytest

from rf_pointing.identification import IdentificationParams, StateSpace, identify, modes_of

SAMPLE_S = 0.02


def disturbed(planted: StateSpace, inputs: np.ndarray) -> np.ndarray:
    random = np.random.default_rng(7)
    outputs = []
    for sequence in inputs:
        wind = np.cumsum(1e-3 * random.standard_normal(len(sequence))) * SAMPLE_S
        clean = planted.simulate(sequence + 0.02)[:, 0]
        outputs.append(clean + wind + 1e-3 * random.standard_normal(len(sequence)))
    return np.array(outputs)


def test_modes_and_gain_survive_noise_wind_and_bias(planted: StateSpace) -> None:
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 4096))
    params = IdentificationParams(order=5, realization_order=9, observer_order=60)
    found = identify(inputs, disturbed(planted, inputs), SAMPLE_S, params)
    modes = modes_of(found.model)
    np.testing.assert_allclose(modes.frequency_hz, (2.01, 5.22), rtol=0.002)
    np.testing.assert_allclose(modes.real_poles, (1.0,), atol=1e-12)
    band = np.array([0.1, 0.5, 1.0, 3.0, 8.0])
    truth = planted.response(band)
    np.testing.assert_allclose(np.abs(found.model.response(band)), np.abs(truth), rtol=0.01)


def test_cross_response_is_found_behind_a_high_pass(planted: StateSpace) -> None:
    cross = StateSpace(planted.a[1:, 1:], planted.b[1:], planted.c[:, 1:], planted.d, SAMPLE_S)
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 4096))
    outputs = disturbed(cross, inputs) + 0.05 * SAMPLE_S * np.arange(4096)
    params = IdentificationParams(order=4, realization_order=8, observer_order=80, integrator=False, high_pass_hz=0.3)
    modes = modes_of(identify(inputs, outputs, SAMPLE_S, params).model)
    np.testing.assert_allclose(modes.frequency_hz[:2], (2.01, 5.22), rtol=0.005)


def test_a_model_larger_than_its_realization_is_refused() -> None:
    with pytest.raises(ValueError, match="order=20 must be <= realization_order=14"):
        IdentificationParams(order=20)
    with pytest.raises(ValueError, match="realization_order=14 must be < 10"):
        IdentificationParams(markov_count=20)
