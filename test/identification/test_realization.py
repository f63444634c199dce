"""Markov parameters and realization recover a planted system.

Balanced reduction against the definition of the singular values and its own error bound.
"""

import control
import numpy as np
import pytest

from rf_pointing.identification import StateSpace, modes_of
from rf_pointing.identification.realization import balanced_reduction, observer_markov, realize, system_markov

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


def test_realization_agrees_with_python_controls_era(planted: StateSpace) -> None:
    markov = planted_markov(planted, 201)
    ours = realize(markov, 5, SAMPLE_S)
    theirs, _ = control.eigensys_realization(markov, r=5, dt=SAMPLE_S)
    frequency = np.array([0.3, 1.0, 2.5, 7.0])
    per_sample = theirs(np.exp(2j * np.pi * frequency * SAMPLE_S)) / SAMPLE_S
    np.testing.assert_allclose(ours.model.response(frequency)[:, 0, 0], per_sample, rtol=1e-6)


def test_the_fewest_parameters_that_can_tell_a_model_are_enough() -> None:
    """Two poles and their residues: four numbers after the direct term, and no fewer."""
    poles, residues = np.array([0.9, -0.5]), np.array([0.3, 0.7])
    markov = np.concatenate([[0.1], (residues * poles ** np.arange(5)[:, None]).sum(axis=1)])
    model = realize(markov[:5], 2, SAMPLE_S).model
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(model.a)), np.sort(poles), atol=1e-12)
    impulse = np.eye(1, 20)[0]
    expected = np.concatenate([[0.1], (residues * poles ** np.arange(19)[:, None]).sum(axis=1)])
    np.testing.assert_allclose(model.simulate(impulse)[:, 0], expected, atol=1e-12)
    with pytest.raises(ValueError, match="order=2"):
        realize(markov[:4], 2, SAMPLE_S)


def test_the_condition_is_that_of_the_regression() -> None:
    """Inputs and outputs that are white and independent: their shifted copies are nearly orthogonal; a slow input's not."""
    random = np.random.default_rng(8)
    white, output = random.standard_normal((2, 4000))
    assert 1.0 < observer_markov(white, output, 2).condition < 1.15
    # Neighbours of an average over two samples correlate to 0.5: eigenvalues 1 + sqrt(0.5) and 1 - sqrt(0.5) for three.
    slow = np.convolve(white, [1.0, 1.0], mode="same")
    wanted = np.sqrt((1.0 + np.sqrt(0.5)) / (1.0 - np.sqrt(0.5)))
    assert observer_markov(slow, output, 2).condition == pytest.approx(wanted, rel=0.05)


def test_hankel_singular_values_show_the_order(planted: StateSpace) -> None:
    hankel = realize(planted_markov(planted, 301), 5, SAMPLE_S).hankel
    assert np.count_nonzero(hankel > 1e-6 * hankel[1]) == 5


def test_noise_leaves_the_frequencies_within_a_fifth_of_a_percent(sequences: tuple[np.ndarray, np.ndarray]) -> None:
    inputs, outputs = sequences
    noisy = outputs + 2e-3 * np.random.default_rng(2).standard_normal(outputs.shape)
    found = modes_of(realize(system_markov(observer_markov(inputs, noisy, 80), 600), 5, SAMPLE_S).model)
    np.testing.assert_allclose(found.frequency_hz[:2], (2.01, 5.22), rtol=0.002)


def test_input_that_does_not_excite_is_refused() -> None:
    inputs = np.ones((1, 400))
    inputs[0, 0] = 0.0
    with pytest.raises(ValueError, match="order=20 needs 41 independent regressors, the data excite"):
        observer_markov(inputs, np.cumsum(inputs, axis=1), 20)


def test_an_order_beyond_the_rank_is_refused() -> None:
    with pytest.raises(ValueError, match="order=20 exceeds the rank"):
        realize(1e3 * np.ones(101), 20, SAMPLE_S)


FREQUENCY_HZ = np.geomspace(0.05, 24.0, 200)


@pytest.fixture
def stable() -> StateSpace:
    random = np.random.default_rng(6)
    a = random.standard_normal((7, 7))
    a *= 0.93 / np.max(np.abs(np.linalg.eigvals(a)))
    return StateSpace(a, random.standard_normal((7, 1)), random.standard_normal((1, 7)), np.ones((1, 1)), 0.02)


def test_an_order_beyond_the_states_that_respond_and_show_is_refused(stable: StateSpace) -> None:
    """Two states that the input does not reach: their singular values are rounding."""
    a = np.block([[stable.a, np.ones((7, 2))], [np.zeros((2, 7)), 0.5 * np.eye(2)]])
    b, c = np.vstack([stable.b, np.zeros((2, 1))]), np.hstack([stable.c, np.ones((1, 2))])
    turn, _ = np.linalg.qr(np.random.default_rng(7).standard_normal((9, 9)))
    idle = StateSpace(turn @ a @ turn.T, turn @ b, c @ turn.T, stable.d, stable.sample_s)
    assert balanced_reduction(idle, 7).order == 7
    with pytest.raises(ValueError, match="order=8 must be <= 7"):
        balanced_reduction(idle, 8)


def test_an_unstable_pole_is_refused(stable: StateSpace) -> None:
    unstable = StateSpace(1.2 * stable.a / 0.93, stable.b, stable.c, stable.d, 0.02)
    with pytest.raises(ValueError, match=r"largest pole magnitude 1\.2 must be <= 1"):
        balanced_reduction(unstable, 3)


def test_data_of_rms_one_are_like_any_other(planted: StateSpace) -> None:
    """A random binary input is +1 as often as -1: its rms is 1 exactly."""
    signs = np.where(np.random.default_rng(4).permutation(1200) % 2 == 0, 1.0, -1.0)
    assert np.std(signs) == 1.0
    response = planted.simulate(signs)[:, 0]
    wanted = planted_markov(planted, 100)
    np.testing.assert_allclose(system_markov(observer_markov(signs, response, 5), 100), wanted, atol=1e-8)
    # Outputs of rms 1: the response scales with them.
    scale = float(np.std(response))
    assert np.std(response / scale) == pytest.approx(1.0, abs=1e-15)
    found = system_markov(observer_markov(signs, response / scale, 5), 100)
    np.testing.assert_allclose(found * scale, wanted, atol=1e-8)


def test_a_constant_input_is_refused() -> None:
    wave = np.sin(np.arange(400.0))
    for inputs, outputs in ((np.full(400, 2.0), wave), (wave, np.zeros(400))):
        with pytest.raises(ValueError, match=r"both must be > 0"):
            observer_markov(inputs, outputs, 5)


def test_the_size_of_a_response_does_not_decide_its_order(planted: StateSpace) -> None:
    faint = StateSpace(planted.a, planted.b, 1e-9 * planted.c, planted.d, SAMPLE_S)
    same = balanced_reduction(faint, 5)
    np.testing.assert_allclose(same.response(FREQUENCY_HZ), 1e-9 * planted.response(FREQUENCY_HZ), rtol=1e-6)


def test_an_integrator_with_one_more_pole_is_reduced_to_either_order() -> None:
    a, b, c = np.diag([1.0, 0.6]), np.array([[0.02], [0.5]]), np.array([[1.0, 0.3]])
    model = StateSpace(a, b, c, np.zeros((1, 1)), SAMPLE_S)
    np.testing.assert_allclose(balanced_reduction(model, 2).response([1.0]), model.response([1.0]), rtol=1e-9)
    alone = balanced_reduction(model, 1)
    np.testing.assert_allclose((alone.a, alone.c @ alone.b), ([[1.0]], [[0.02]]), atol=1e-12)
    with pytest.raises(ValueError, match="order=0 must be >= 1"):
        balanced_reduction(model, 0)
    with pytest.raises(ValueError, match="order=3 must be <= 2"):
        balanced_reduction(model, 3)


def test_few_markov_parameters_are_the_first_of_many(sequences: tuple[np.ndarray, np.ndarray]) -> None:
    observer = observer_markov(*sequences, 5)
    many = system_markov(observer, 40)
    for count in (1, 2, 5, 6, 7):
        np.testing.assert_array_equal(system_markov(observer, count), many[:count])


def test_orders_from_one_to_a_quarter_of_the_samples_are_tried_and_no_others(
    sequences: tuple[np.ndarray, np.ndarray],
) -> None:
    u, y = (data[:, :48] for data in sequences)
    assert len(observer_markov(u, y, 1).inputs) == 1
    noisy = y + np.random.default_rng(3).standard_normal(y.shape)
    assert len(observer_markov(u, noisy, 12).inputs) == 12
    for order, words in ((0, "order=0 must be >= 1"), (13, "order=13 must be <= 12")):
        with pytest.raises(ValueError, match=words):
            observer_markov(u, noisy, order)
    for order, words in ((0, "order=0 must be >= 1"), (25, "order=25 must be <= 24")):
        with pytest.raises(ValueError, match=words):
            realize(np.random.default_rng(3).standard_normal(49), order, SAMPLE_S)
    with pytest.raises(ValueError, match=r"inputs has shape \(4, 48\), outputs has \(3, 48\): must be equal"):
        observer_markov(u, y[:3], 2)


def test_markov_parameters_carry_the_units_of_output_over_input(planted: StateSpace) -> None:
    """With a direct way through, an input of thousands and an output of thousandths."""
    inputs = np.random.default_rng(5).uniform(-1.0, 1.0, (2, 1500))
    through = StateSpace(planted.a, planted.b, planted.c, np.array([[0.3]]), SAMPLE_S)
    outputs = np.array([through.simulate(u)[:, 0] for u in inputs])
    found = observer_markov(4e3 * inputs, 5e-3 * outputs, 5)
    assert found.direct == pytest.approx(0.3 * 1.25e-6, rel=1e-6)
    wanted = 1.25e-6 * np.concatenate([[0.3], planted_markov(planted, 60)[1:]])
    np.testing.assert_allclose(system_markov(found, 60), wanted, rtol=0.0, atol=1e-14)
