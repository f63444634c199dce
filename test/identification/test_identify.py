"""Pole and residue form: exact conversion, integrator, refit.

The whole chain on planted systems with noise, drift and an unmeasured rate at the input.
"""

import numpy as np
import pytest

from rf_pointing.identification import StateSpace, modes_of
from rf_pointing.identification.identify import (
    IdentificationParams,
    PoleResidue,
    high_pass,
    identify,
    refit_residues,
    restore_integrator,
    summed,
)
from rf_pointing.identification.study import check_straight

FREQUENCY_HZ = np.array([0.05, 0.7, 2.0, 4.0, 11.0])


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


def test_the_summed_model_gives_the_sums_of_the_outputs(planted: StateSpace) -> None:
    rates = PoleResidue.from_state_space(without_integrator(planted))
    u = np.random.default_rng(5).standard_normal(400)
    sums = np.cumsum(rates.to_state_space().simulate(u)[:, 0])
    assert summed(rates).to_state_space().simulate(u)[:, 0] == pytest.approx(sums, rel=1e-9, abs=1e-12)


def test_an_integrator_that_wind_hides_is_found_by_the_rates(planted: StateSpace) -> None:
    """No pole is below 10 uHz in 20 s: the model of the rates, summed, is as good."""
    random = np.random.default_rng(2)
    inputs = random.normal(2.0, 1.0, (5, 1000))
    wind = SAMPLE_S * np.cumsum(0.1 * random.standard_normal(inputs.shape), axis=1)
    outputs = np.array([planted.simulate(u)[:, 0] for u in inputs]) + wind
    few = IdentificationParams(order=5, realization_order=8, observer_order=60, integrator_below_hz=1e-5)
    found = identify(inputs[:4], outputs[:4], SAMPLE_S, few)
    assert 1.0 in PoleResidue.from_state_space(found.model).poles
    assert check_straight(found.model, inputs[4], outputs[4]).error < 0.002


def test_refit_recovers_residues_from_sequences_that_start_in_motion(planted: StateSpace) -> None:
    random = np.random.default_rng(3)
    # What came before the first sample is not known to the fit.
    driven = random.uniform(-1.0, 1.0, (3, 2200))
    inputs = driven[:, 200:]
    outputs = np.array([planted.simulate(u)[200:, 0] for u in driven])
    truth = PoleResidue.from_state_space(planted)
    spoiled = PoleResidue(truth.poles, np.full(5, 0.3 + 0j), 0.7, truth.sample_s)
    refitted = refit_residues(spoiled, inputs, outputs)
    np.testing.assert_allclose(refitted.residues, truth.residues, atol=1e-9)
    assert refitted.direct == pytest.approx(0.0, abs=1e-9)


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
    poles = np.linalg.eigvals(found.model.a)
    np.testing.assert_allclose(poles[np.abs(poles.imag) <= 1e-9].real, (1.0,), atol=1e-12)
    band = np.array([0.1, 0.5, 1.0, 3.0, 8.0])
    truth = planted.response(band)
    np.testing.assert_allclose(np.abs(found.model.response(band)), np.abs(truth), rtol=0.01)


def test_cross_response_is_found_behind_a_high_pass(planted: StateSpace) -> None:
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 4096))
    outputs = disturbed(without_integrator(planted), inputs) + 0.05 * SAMPLE_S * np.arange(4096)
    params = IdentificationParams(order=4, realization_order=8, observer_order=80, integrator=False, high_pass_hz=0.3)
    modes = modes_of(identify(inputs, outputs, SAMPLE_S, params).model)
    np.testing.assert_allclose(modes.frequency_hz[:2], (2.01, 5.22), rtol=0.005)


@pytest.mark.parametrize(("inputs", "outputs"), [(2, 1), (1, 2), (2, 2)])
def test_poles_and_residues_are_those_of_one_input_and_one_output(inputs: int, outputs: int) -> None:
    model = StateSpace(
        np.diag([0.5, 0.8]), np.ones((2, inputs)), np.ones((outputs, 2)), np.zeros((outputs, inputs)), 0.02
    )
    with pytest.raises(ValueError, match=f"model has {inputs} inputs and {outputs} outputs, must have 1 and 1"):
        PoleResidue.from_state_space(model)


def test_a_pole_is_an_integrator_below_its_frequency_and_none_above() -> None:
    """A pole of f Hz is 2 pi f T from z = 1; `below_hz` goes to half the sampling rate and no further."""
    at_hz = 0.05
    poles = np.array([1.0 - 2.0 * np.pi * at_hz * 0.02, 0.3], dtype=np.complex128)
    model = PoleResidue(poles, np.array([2.0, 1.0], dtype=np.complex128), 0.0, 0.02)
    assert 1.0 in restore_integrator(model, 1.02 * at_hz).poles
    with pytest.raises(ValueError, match=r"no pole that slow, the slowest is 0\.050 Hz"):
        restore_integrator(model, 0.98 * at_hz)
    assert 1.0 in restore_integrator(model, 25.0).poles
    with pytest.raises(ValueError, match=r"below_hz=25\.1 must be <= 25\.0"):
        restore_integrator(model, 25.1)


def test_refit_projects_out_the_start_of_real_poles_as_well() -> None:
    """Poles that decay over the sequences, in motion before them: residues and direct term come out exactly."""
    poles = np.array([0.995, 0.9, -0.4], dtype=np.complex128)
    truth = PoleResidue(poles, np.array([0.2, -0.5, 1.5], dtype=np.complex128), 0.25, 0.02)
    driven = np.random.default_rng(6).uniform(-1.0, 1.0, (2, 500))
    outputs = np.array([truth.to_state_space().simulate(u)[300:, 0] for u in driven]) + 3.0
    spoiled = PoleResidue(poles, np.ones(3, dtype=np.complex128), 0.0, 0.02)
    found = refit_residues(spoiled, driven[:, 300:], outputs)
    np.testing.assert_allclose(found.residues, truth.residues, atol=1e-9)
    assert found.direct == pytest.approx(0.25, abs=1e-9)
    np.testing.assert_array_equal(found.poles, poles)


@pytest.mark.parametrize(("frequency_hz", "gain"), [(0.5, 0.5**0.5), (0.05, 0.01), (5.0, 1.0)])
def test_the_high_pass_is_a_butterworth_of_second_order(frequency_hz: float, gain: float) -> None:
    """|H|^2 = 1 / (1 + (corner / f)^4): half the power at the corner, a hundredth of the amplitude a decade below."""
    times = np.arange(6000) * SAMPLE_S
    wave = np.stack([np.sin(2.0 * np.pi * frequency_hz * times), np.cos(2.0 * np.pi * frequency_hz * times)]) + 5.0
    passed = high_pass(wave, SAMPLE_S, 0.5, 20.0)
    assert passed.shape == (2, 5000)
    assert np.hypot(*passed) == pytest.approx(np.full(5000, gain), rel=0.01)


def test_the_high_pass_counts_from_the_first_sample_of_each_sequence() -> None:
    np.testing.assert_array_equal(high_pass([[5.0] * 200, [-3.0] * 200], SAMPLE_S, 0.1, 0.0), 0.0)


def test_a_realization_needs_more_than_twice_its_order_of_markov_parameters_and_holds_its_model() -> None:
    assert IdentificationParams(markov_count=29).realization_order == 14
    with pytest.raises(ValueError, match="realization_order=14 must be < 14"):
        IdentificationParams(markov_count=28)
    assert IdentificationParams(order=14).order == 14
    with pytest.raises(ValueError, match="order=20 must be <= realization_order=14"):
        IdentificationParams(order=20)


def test_an_exact_integrator_is_one_at_the_lowest_bound_and_no_bound_is_lower() -> None:
    model = PoleResidue(np.array([1.0 + 0j, 0.3 + 0j]), np.array([2.0 + 0j, 1.0 + 0j]), 0.0, 0.02)
    assert restore_integrator(model, 1e-6).poles.tolist() == [1.0, 0.3]
    with pytest.raises(ValueError, match="below_hz=9e-07 must be >= 1e-06"):
        restore_integrator(model, 9e-7)


@pytest.mark.parametrize(("at_hz", "slow"), [(0.029, True), (0.031, False)])
def test_poles_below_thirty_millihertz_are_the_integrator_unless_said_otherwise(at_hz: float, slow: bool) -> None:
    poles = np.array([1.0, 1.0 - 2.0 * np.pi * at_hz * SAMPLE_S, 0.3], dtype=np.complex128)
    restored = restore_integrator(PoleResidue(poles, np.array([2.0 + 0j, 5.0 + 0j, 7.0 + 0j]), 0.25, SAMPLE_S))
    assert len(restored.poles) == (2 if slow else 3)
    assert restored.residues[0] == (7.0 if slow else 2.0)
    assert restored.residues[-1] == 7.0
    assert (restored.direct, restored.sample_s) == (0.25, SAMPLE_S)


def without_integrator(planted: StateSpace) -> StateSpace:
    return StateSpace(planted.a[1:, 1:], planted.b[1:], planted.c[:, 1:], planted.d, SAMPLE_S)


def test_a_swell_far_below_the_high_pass_does_not_take_the_place_of_the_modes(planted: StateSpace) -> None:
    """At 0.02 Hz, a thousand times the response: without the high-pass it is the model."""
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 4096))
    swell = 10.0 * np.sin(2.0 * np.pi * 0.02 * SAMPLE_S * np.arange(4096) + 1.0)
    outputs = np.array([without_integrator(planted).simulate(u)[:, 0] for u in inputs]) + swell
    outputs = outputs + 1e-4 * np.random.default_rng(3).standard_normal(outputs.shape)
    params = IdentificationParams(order=4, realization_order=8, observer_order=80, integrator=False, high_pass_hz=0.3)
    modes = modes_of(identify(inputs, outputs, SAMPLE_S, params).model)
    np.testing.assert_allclose(modes.frequency_hz, (2.01, 5.22), rtol=1e-3)


def test_a_pole_outside_the_unit_circle_is_left_out_of_the_model(planted: StateSpace) -> None:
    """A response that grows by a factor of e in ten seconds beside the modes, which stay what they are."""
    still = without_integrator(planted)
    a = np.block([[still.a, np.zeros((4, 1))], [np.zeros((1, 4)), np.array([[1.002]])]])
    b, c = np.vstack([still.b, [[0.02]]]), np.hstack([still.c, [[0.05]]])
    growing = StateSpace(a, b, c, np.zeros((1, 1)), SAMPLE_S)
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 1500))
    outputs = np.array([growing.simulate(u)[:, 0] for u in inputs])
    outputs = outputs + 1e-5 * np.random.default_rng(3).standard_normal(outputs.shape)
    params = IdentificationParams(order=5, realization_order=5, observer_order=20, markov_count=300, integrator=False)
    found = identify(inputs, outputs, SAMPLE_S, params)
    assert found.model.order == 4
    np.testing.assert_allclose(modes_of(found.model).frequency_hz, (2.01, 5.22), rtol=1e-3)
    # The observer saw all five.
    assert found.hankel[4] > 10.0 * found.hankel[5]
    assert found.condition > 1.0
