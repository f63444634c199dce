"""Errors on held-out sequences: closed forms."""

import numpy as np
import pytest

from rf_pointing.identification import StateSpace, check_cross, check_straight


def test_a_gain_error_shows_as_gain_factor_and_not_as_error(planted: StateSpace) -> None:
    inputs = np.random.default_rng(2).uniform(0.1, 1.3, 2000)
    result = check_straight(planted, inputs, 1.02 * planted.simulate(inputs)[:, 0] + 0.7)
    assert result.gain_factor == pytest.approx(0.02, rel=1e-6)
    assert result.error < 1e-9
    assert result.error_at_unit_gain == pytest.approx(0.02 / 1.02, rel=1e-6)


def test_error_is_relative_to_the_measured_output(planted: StateSpace) -> None:
    random = np.random.default_rng(2)
    inputs = random.uniform(0.1, 1.3, 2000)
    clean = planted.simulate(inputs)[:, 0]
    noise = random.standard_normal(2000)
    noise -= clean * (noise @ clean) / (clean @ clean)
    noise *= 0.003 * np.linalg.norm(clean) / np.linalg.norm(noise)
    noise -= noise[0]
    assert check_straight(planted, inputs, clean + noise).error == pytest.approx(0.003, rel=0.02)


def test_cross_check_finds_the_bias_at_the_other_input(planted: StateSpace) -> None:
    cross = StateSpace(planted.a[1:, 1:], planted.b[1:], planted.c[:, 1:], planted.d, planted.sample_s)
    inputs = np.random.default_rng(2).uniform(0.1, 1.3, 2000)
    outputs = cross.simulate(inputs)[:, 0] + planted.simulate(np.full(2000, 0.0014))[:, 0] + 0.3
    result = check_cross(cross, planted, inputs, outputs)
    assert result.bias == pytest.approx(0.0014, rel=1e-6)
    assert result.error < 1e-9
