"""Block simulation against the step-by-step recursion and scipy."""

import numpy as np
import pytest
import scipy.signal

from rf_pointing.servo import BlockSimulator, discretise, dss13_plant, linear_model


@pytest.fixture(scope="module")
def sampled() -> tuple[np.ndarray, ...]:
    model = linear_model(dss13_plant())
    step = discretise(model.a, model.b_command, 0.001)
    c = np.vstack([model.encoder, model.beam])
    return step[:, : len(model.a)], step[:, len(model.a) :], c, np.zeros((4, 2))


@pytest.mark.parametrize(("samples", "block"), [(1000, 32), (997, 64), (5, 16), (64, 64)])
def test_outputs_are_those_of_scipys_dlsim(sampled: tuple[np.ndarray, ...], samples: int, block: int) -> None:
    random = np.random.default_rng(3)
    inputs, start = 1e-3 * random.standard_normal((samples, 2)), 1e-3 * random.standard_normal(22)
    ours, _ = BlockSimulator(*sampled, block=block).run(inputs, start)
    _, theirs, _ = scipy.signal.dlsim((*sampled, 1.0), inputs, x0=start)
    np.testing.assert_allclose(ours, theirs, atol=1e-13)


def test_the_final_state_carries_on(sampled: tuple[np.ndarray, ...]) -> None:
    inputs = 1e-3 * np.random.default_rng(3).standard_normal((300, 2))
    simulator = BlockSimulator(*sampled)
    whole, _ = simulator.run(inputs, np.zeros(22))
    _, middle = simulator.run(inputs[:131], np.zeros(22))
    rest, _ = simulator.run(inputs[131:], middle)
    np.testing.assert_allclose(rest, whole[131:], atol=1e-13)


def test_non_finite_inputs_are_refused(sampled: tuple[np.ndarray, ...]) -> None:
    with pytest.raises(ValueError, match="inputs"):
        BlockSimulator(*sampled).run(np.full((4, 2), np.nan), np.zeros(22))
