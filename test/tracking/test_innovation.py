"""Innovations of beam and error under the bank of filters."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.tracking.innovation import InnovationBank

STEP_S, NOISE, WALK, CHANGE, DRIFT = 0.1, 0.2, 0.3, 0.05, 0.5


def innovations(gain: float, count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Of a target as the model has it, followed by an integrator: (beam + error) (n,) complex, and its variances."""
    random = random_stream(4, f"innovation {gain}")

    def draw(sigma: float) -> complex:
        return sigma * complex(*random.standard_normal(2))

    target, velocity, wind, beam, bank, found = 0j, draw(DRIFT), 0j, 0j, None, []
    for k in range(count):
        error = target + wind - beam + draw(NOISE)
        if bank is None:
            bank = InnovationBank.begin(0.0, beam, error, np.array([NOISE**2]), DRIFT)
        else:
            bank, new = bank.step(k * STEP_S, beam, error, np.array([NOISE**2]), np.array([WALK]), CHANGE)
            found.append((new.beam_rad[0] + new.error_rad[0], new.variance_rad2[0]))
        beam += gain * error
        target, velocity = target + STEP_S * velocity, velocity + draw(CHANGE * math.sqrt(STEP_S))
        wind += draw(WALK * math.sqrt(STEP_S))
    values, variances = zip(*found, strict=True)
    return np.array(values), np.array(variances)


@pytest.mark.parametrize("gain", [0.0, 0.1, 0.5])
def test_innovations_are_white_and_of_the_stated_variance_whatever_the_loop_does(gain: float) -> None:
    """4000 of them on two axes: variance known to 1.6 %, correlation to 0.011."""
    values, variances = innovations(gain)
    scaled = values / np.sqrt(variances)
    assert 0.5 * np.mean(np.abs(scaled) ** 2) == pytest.approx(1.0, abs=0.05)
    for lag in (1, 2, 5):
        assert abs(0.5 * np.mean(scaled[lag:] * np.conj(scaled[:-lag]))) < 0.045


def test_a_steady_drift_is_expected_in_the_end() -> None:
    bank = InnovationBank.begin(0.0, 0j, 0j, np.array([NOISE**2, 2.0 * NOISE**2]), DRIFT)
    for k in range(1, 200):
        bank, new = bank.step(
            k * STEP_S, 0.02j * k, 0.05 * k, np.array([NOISE**2, 2.0 * NOISE**2]), np.array([0.01, 0.02]), CHANGE
        )
    np.testing.assert_allclose(new.beam_rad, 0.0, atol=1e-6)
    np.testing.assert_allclose(new.error_rad, 0.0, atol=1e-6)
