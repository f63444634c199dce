"""A known fourth-order system with an integrator, and sequences of it."""

import numpy as np
import pytest

from rf_pointing.identification import StateSpace

SAMPLE_S = 0.02
MODES = ((2.01, 0.0082, -0.3), (5.22, 0.01, -0.05))
"""Frequency (Hz), damping and weight of the planted modes."""


def planted_model() -> StateSpace:
    """Integrator of the rate plus two lightly damped modes, sampled at 50 Hz."""
    poles, weights = [], []
    for frequency, damping, weight in MODES:
        omega = 2.0 * np.pi * frequency
        poles.append(np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * omega * SAMPLE_S))
        weights.append(weight * SAMPLE_S)
    a, b = np.zeros((5, 5)), np.zeros((5, 1))
    c = np.zeros((1, 5))
    a[0, 0], b[0, 0], c[0, 0] = 1.0, SAMPLE_S, 1.0
    for index, (pole, weight) in enumerate(zip(poles, weights, strict=True)):
        block = slice(1 + 2 * index, 3 + 2 * index)
        a[block, block] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        b[1 + 2 * index, 0] = 1.0
        c[0, 1 + 2 * index] = weight
    return StateSpace(a, b, c, np.zeros((1, 1)), SAMPLE_S)


@pytest.fixture(scope="session")
def planted() -> StateSpace:
    return planted_model()


@pytest.fixture(scope="session")
def sequences(planted: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Four noise-free sequences of 4096 samples of uniform white noise."""
    random = np.random.default_rng(11)
    inputs = random.uniform(-1.0, 1.0, (4, 4096))
    outputs = np.array([planted.simulate(u)[:, 0] for u in inputs])
    return inputs, outputs
