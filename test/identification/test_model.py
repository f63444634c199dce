"""The sampled model against its own impulse response."""

import numpy as np
import pytest

from rf_pointing.identification import StateSpace, modes_of

SAMPLE_S = 0.02


@pytest.fixture
def several() -> StateSpace:
    """Three states, two inputs, two outputs, and a direct way through."""
    random = np.random.default_rng(12)
    a = random.standard_normal((3, 3))
    a *= 0.7 / np.max(np.abs(np.linalg.eigvals(a)))
    return StateSpace(
        a, random.standard_normal((3, 2)), random.standard_normal((2, 3)), random.standard_normal((2, 2)), SAMPLE_S
    )


def test_response_is_the_transform_of_the_impulse_response(several: StateSpace) -> None:
    impulse = [several.d] + [several.c @ np.linalg.matrix_power(several.a, k) @ several.b for k in range(150)]
    for frequency_hz in (0.0, 3.0, 17.0):
        turns = np.exp(-2j * np.pi * frequency_hz * SAMPLE_S * np.arange(len(impulse)))
        expected = np.einsum("k,kqm->qm", turns, impulse)
        np.testing.assert_allclose(several.response([frequency_hz])[0], expected, atol=1e-12)


def test_simulation_is_the_convolution_with_the_impulse_response(several: StateSpace) -> None:
    inputs = np.random.default_rng(3).standard_normal((40, 2))
    impulse = [several.d] + [several.c @ np.linalg.matrix_power(several.a, k) @ several.b for k in range(39)]
    expected = [sum(impulse[k - j] @ inputs[j] for j in range(k + 1)) for k in range(40)]
    np.testing.assert_allclose(several.simulate(inputs), expected, atol=1e-12)


def test_modes_are_frequency_and_damping_lowest_first_and_real_poles_have_none() -> None:
    """A mode of f Hz and damping d has its poles at exp((-d +- i sqrt(1 - d^2)) 2 pi f T)."""
    blocks = np.zeros((5, 5))
    for place, (frequency_hz, damping) in enumerate([(6.0, 0.3), (1.5, 0.02)]):
        pole = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * 2.0 * np.pi * frequency_hz * SAMPLE_S)
        own = slice(2 * place, 2 * place + 2)
        blocks[own, own] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    blocks[4, 4] = 0.9
    found = modes_of(StateSpace(blocks, np.ones((5, 1)), np.ones((1, 5)), np.zeros((1, 1)), SAMPLE_S))
    np.testing.assert_allclose(found.frequency_hz, (1.5, 6.0), rtol=1e-9)
    np.testing.assert_allclose(found.damping, (0.02, 0.3), rtol=1e-9)


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
def test_matrices_that_do_not_fit_are_refused_by_name(several: StateSpace, name: str) -> None:
    matrices = {each: getattr(several, each) for each in "abcd"}
    matrices[name] = np.zeros((4, 4))
    with pytest.raises(ValueError, match="has shape"):
        StateSpace(**matrices, sample_s=SAMPLE_S)
