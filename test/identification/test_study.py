"""Errors on held-out sequences: closed forms.

A study of planted responses: what was planted comes out, errors are those of sequences that were not fitted.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.identification import Recording, StateSpace, load_models, modes_of, save_models
from rf_pointing.identification.identify import IdentificationParams, identify
from rf_pointing.identification.spectra import frequency_response
from rf_pointing.identification.study import check_cross, check_straight, study

from .conftest import MODES, SAMPLE_S


def test_a_gain_error_shows_as_gain_factor_and_not_as_error(planted: StateSpace) -> None:
    inputs = np.random.default_rng(2).uniform(0.1, 1.3, 2000)
    result = check_straight(planted, inputs, 1.02 * planted.simulate(inputs)[:, 0] + 0.7)
    assert result.gain_factor == pytest.approx(0.02, rel=1e-6)
    assert result.error < 1e-9


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


def test_the_error_of_a_cross_response_is_relative_to_how_far_the_encoder_went_from_its_start(
    planted: StateSpace,
) -> None:
    """Nothing is commanded: all that the encoder shows beyond a bias is error, and its first sample is the start."""
    cross = StateSpace(planted.a[1:, 1:], planted.b[1:], planted.c[:, 1:], planted.d, planted.sample_s)
    shown = np.random.default_rng(5).standard_normal(200)
    shown[0] = 4.0
    drift = planted.simulate(np.ones(200))[:, 0]
    basis = np.linalg.qr(np.column_stack([drift, np.ones(200)]))[0]
    wanted = np.linalg.norm(shown - basis @ (basis.T @ shown)) / np.linalg.norm(shown - 4.0)
    assert check_cross(cross, planted, np.zeros(200), shown).error == pytest.approx(wanted, rel=1e-9)


STRAIGHT = IdentificationParams(order=5, realization_order=7, observer_order=40, markov_count=200)


def recording(axis: str, planted: StateSpace, noise: float = 1e-9, sequences: int = 4) -> Recording:
    """Both encoders show the planted response, the other axis a hundredth of it."""
    random = np.random.default_rng(7)
    inputs = 1e-3 * random.uniform(-1.0, 1.0, (sequences, 2048))
    outputs = np.array([planted.simulate(u)[:, 0] for u in inputs])
    other = np.array([planted.simulate(np.concatenate([[0.0], np.diff(u)]))[:, 0] for u in inputs])
    both = (outputs, other) if axis == "azimuth" else (other, outputs)
    encoder = np.stack(both, axis=2)
    return Recording(axis, SAMPLE_S, inputs, encoder + noise * random.standard_normal(encoder.shape))


def test_one_axis_gives_its_straight_response_with_the_planted_modes(planted: StateSpace) -> None:
    (found,) = study({"elevation": recording("elevation", planted)}, 1, straight=STRAIGHT)
    assert found.driven == found.shown
    assert len(found.checks) == 1
    assert found.worst_error < 1e-3
    modes = modes_of(found.identified.model).frequency_hz
    for frequency, _, _ in MODES:
        assert np.min(np.abs(modes - frequency)) < 1e-3


def test_two_axes_give_four_responses_straight_ones_first(planted: StateSpace) -> None:
    recordings = {axis: recording(axis, planted) for axis in ("azimuth", "elevation")}
    cross = IdentificationParams(
        order=6, realization_order=8, observer_order=40, markov_count=200, integrator=False, high_pass_hz=0.3
    )
    found = study(recordings, 1, straight=STRAIGHT, cross=cross)
    assert [each.driven == each.shown for each in found] == [True, True, False, False]
    assert {(each.driven, each.shown) for each in found} == {
        (a, b) for a in ("azimuth", "elevation") for b in ("azimuth", "elevation")
    }
    assert all(each.worst_error < 0.05 for each in found)


def test_noise_in_the_held_out_sequence_alone_shows_in_the_error(planted: StateSpace) -> None:
    clean = recording("elevation", planted)
    encoder = clean.encoder_rad.copy()
    spoiled_by = 0.1 * np.std(encoder[-1, :, 1])
    encoder[-1, :, 1] += spoiled_by * np.random.default_rng(3).standard_normal(encoder.shape[1])
    spoiled = Recording(clean.axis, clean.sample_s, clean.input_rad_s, encoder)
    before, after = (study({"elevation": each}, 1, straight=STRAIGHT)[0] for each in (clean, spoiled))
    np.testing.assert_array_equal(after.identified.model.a, before.identified.model.a)
    assert after.worst_error > 100.0 * before.worst_error


def test_at_least_one_sequence_must_be_left_to_fit(planted: StateSpace) -> None:
    with pytest.raises(ValueError, match=r"held_out \(elevation\)=4 must be <= 3"):
        study({"elevation": recording("elevation", planted)}, 4)
    assert len(study({"elevation": recording("elevation", planted)}, 3, straight=STRAIGHT)[0].checks) == 3
    with pytest.raises(ValueError, match=r"held_out \(elevation\)=0 must be >= 1$"):
        study({"elevation": recording("elevation", planted)}, 0)


def test_the_fit_uses_the_first_sequences_the_checks_the_last_and_the_measured_response_all(
    planted: StateSpace,
) -> None:
    data = recording("elevation", planted, noise=1e-6)
    (found,) = study({"elevation": data}, 2, straight=STRAIGHT)
    inputs, outputs = data.input_rad_s, data.encoder_rad[:, :, 1]
    fitted = identify(inputs[:2], outputs[:2], SAMPLE_S, STRAIGHT)
    np.testing.assert_array_equal(found.identified.model.a, fitted.model.a)
    assert found.checks == tuple(check_straight(fitted.model, inputs[k], outputs[k]) for k in (2, 3))
    assert found.worst_error == max(check.error for check in found.checks)
    assert found.checks[0].error != found.checks[1].error
    np.testing.assert_array_equal(found.measured.response, frequency_response(inputs, outputs, SAMPLE_S).response)


def test_a_cross_response_is_checked_with_the_straight_model_of_the_axis_that_was_not_driven(
    planted: StateSpace,
) -> None:
    recordings = {axis: recording(axis, planted) for axis in ("azimuth", "elevation")}
    # The axes answer to their rates with different gains.
    recordings["elevation"].encoder_rad[:, :, 1] *= 3.0
    cross = IdentificationParams(
        order=6, realization_order=8, observer_order=40, markov_count=200, integrator=False, high_pass_hz=0.3
    )
    straight = {}
    for each in study(recordings, 1, straight=STRAIGHT, cross=cross):
        data = recordings[each.driven]
        if each.driven == each.shown:
            straight[each.shown] = each.identified.model
            continue
        model, shown = each.identified.model, data.output_rad(each.shown)
        assert model.order == 6
        wanted = check_cross(model, straight[each.shown], data.input_rad_s[-1], shown[-1])
        assert each.checks == (wanted,)


def test_models_are_written_with_what_they_are_of_their_worst_error_and_their_provenance(
    planted: StateSpace, tmp_path: Path
) -> None:
    (found,) = study({"elevation": recording("elevation", planted)}, 2, straight=STRAIGHT)
    path = tmp_path / "models.json"
    save_models(path, [found, found], "planted by a test")
    text = path.read_text()
    kept = json.loads(text)
    assert text == json.dumps(kept, indent=1) + "\n"
    assert kept["format"] == "rf_pointing identified models 2"
    assert len(kept["responses"]) == 2
    first = kept["responses"][0]
    model = found.identified.model
    assert {name: first[name] for name in ("input", "output", "sample_s", "error", "provenance")} == {
        "input": "elevation", "output": "elevation", "sample_s": 0.02, "error": found.worst_error,
        "provenance": "planted by a test",
    }  # fmt: skip
    back = StateSpace(*(np.array(first[name]) for name in "abcd"), sample_s=first["sample_s"])
    np.testing.assert_array_equal(back.response([0.7, 2.0]), model.response([0.7, 2.0]))
    assert first["hankel"] == found.identified.hankel.tolist()
    loaded = load_models(path)["elevation"]
    np.testing.assert_array_equal(loaded.model.a, model.a)
    shown = found.measured.valid() & (found.measured.frequency_hz > 0.0)
    np.testing.assert_array_equal(loaded.measured, found.measured.response[shown])
    assert loaded.error == found.worst_error
