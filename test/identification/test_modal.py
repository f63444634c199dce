"""Pole and residue form: exact conversion, integrator, refit."""

import numpy as np
import pytest

from rf_pointing.identification import PoleResidue, StateSpace, refit_residues, restore_integrator

FREQUENCY_HZ = np.array([0.05, 0.7, 2.0, 4.0, 11.0])


def test_conversion_and_back_keeps_the_response(planted: StateSpace) -> None:
    back = PoleResidue.from_state_space(planted).to_state_space()
    np.testing.assert_allclose(back.response(FREQUENCY_HZ), planted.response(FREQUENCY_HZ), rtol=1e-9)


@pytest.mark.parametrize("split", [(0.9993, 1.0004), (0.9999 + 2e-4j, 0.9999 - 2e-4j)])
def test_two_small_poles_become_one_exact_integrator(planted: StateSpace, split: tuple[complex, complex]) -> None:
    modal = PoleResidue.from_state_space(planted)
    integrator = int(np.argmin(np.abs(modal.poles - 1.0)))
    half = 0.5 * modal.residues[integrator]
    poles = np.concatenate([split, np.delete(modal.poles, integrator)])
    residues = np.concatenate([[half, half], np.delete(modal.residues, integrator)])
    restored = restore_integrator(PoleResidue(poles, residues, modal.direct, modal.sample_s))
    assert np.count_nonzero(restored.poles == 1.0) == 1
    assert len(restored.poles) == len(modal.poles)
    response = restored.to_state_space().response(FREQUENCY_HZ)
    np.testing.assert_allclose(response, planted.response(FREQUENCY_HZ), rtol=1e-9)


def test_a_model_without_slow_pole_has_no_integrator_to_restore() -> None:
    modal = PoleResidue(np.array([0.5 + 0j]), np.array([1.0 + 0j]), 0.0, 0.02)
    with pytest.raises(ValueError, match=r"no pole that slow, the slowest is 3\.979 Hz"):
        restore_integrator(modal)


def test_refit_recovers_residues_from_sequences_that_start_in_motion(planted: StateSpace) -> None:
    random = np.random.default_rng(3)
    inputs = random.uniform(-1.0, 1.0, (3, 2000))
    starts = random.standard_normal((3, 5))
    outputs = np.array([planted.simulate(u, start)[:, 0] for u, start in zip(inputs, starts, strict=True)])
    truth = PoleResidue.from_state_space(planted)
    spoiled = PoleResidue(truth.poles, np.full(5, 0.3 + 0j), 0.7, truth.sample_s)
    refitted = refit_residues(spoiled, inputs, outputs)
    np.testing.assert_allclose(refitted.residues, truth.residues, atol=1e-9)
    assert refitted.direct == pytest.approx(0.0, abs=1e-9)
