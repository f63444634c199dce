import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights, quantised_phase_rad
from rf_pointing.core import random_stream


@pytest.mark.parametrize(
    ("changes", "message"), [({"n_x": 15}, "n_x=15 must be even"), ({"n_y": 3}, "n_y=3 must be even")]
)
def test_impossible_arrays_are_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TripulseArrayParams(**changes)


def test_quantiser_errs_by_at_most_half_a_step_and_keeps_its_states() -> None:
    phase = random_stream(1, "quantiser").uniform(-20.0, 20.0, size=10_000)
    step = 2.0 * np.pi / 32
    error = quantised_phase_rad(phase, 5) - phase
    assert np.max(np.abs(error)) <= step / 2.0 * (1.0 + 1e-12)
    assert np.std(error) == pytest.approx(step / np.sqrt(12.0), rel=0.02)
    states = quantised_phase_rad(phase, 5)
    np.testing.assert_allclose(quantised_phase_rad(states, 5), states)
    np.testing.assert_array_equal(quantised_phase_rad(phase, 0), phase)


def test_pi_is_a_state_of_every_quantiser_so_delta_beams_add_no_error() -> None:
    phase = random_stream(1, "quantiser").uniform(-20.0, 20.0, size=1000)
    for bits in (1, 3, 5):
        np.testing.assert_allclose(quantised_phase_rad(phase + np.pi, bits), quantised_phase_rad(phase, bits) + np.pi)


@pytest.mark.parametrize("bits", [0, 2, 3])
def test_weights_are_those_of_each_element_by_itself(bits: int) -> None:
    """Taper, steering, common phase, quantiser, errors and dead elements, written out for each element."""
    array = TripulseArrayParams(
        n_x=4, n_y=6, spacing_x_wavelengths=0.7, spacing_y_wavelengths=1.3, taper_edge=0.25,
        phase_bits=bits, failed="2:3",
    )  # fmt: skip
    rng = np.random.default_rng(8)
    errors, dead = 0.1 * rng.standard_normal((4, 6)), rng.uniform(size=(4, 6)) < 0.2
    found = element_weights(array, [0.21, -0.13], failed=dead, phase_errors_rad=errors, common_phase_rad=0.4)
    for m in range(4):
        for n in range(6):
            x, y = m - 1.5, n - 2.5
            phase = 2.0 * np.pi * (0.7 * x * 0.21 - 1.3 * y * 0.13) + 0.4
            if bits:
                state = 2.0 * np.pi / 2**bits
                phase = state * round(phase / state)
            amplitude = np.prod([0.25 + 0.75 * np.cos(np.pi * c / count) ** 2 for c, count in ((x, 4), (y, 6))])
            expected = 0.0 if dead[m, n] or (m, n) == (1, 2) else amplitude * np.exp(1j * (phase + errors[m, n]))
            assert found[m, n] == pytest.approx(expected, abs=1e-12)
    assert np.any(dead)
    only_named = element_weights(array, [0.21, -0.13])
    assert only_named[1, 2] == 0.0
    assert np.count_nonzero(only_named) == 23


@pytest.mark.parametrize(
    ("steering", "given", "words"),
    [
        ([np.nan, 0.0], {}, "steering"),
        ([0.0, 0.0], {"failed": np.ones((4, 2), dtype=bool)}, "all 8 elements"),
        ([0.0, 0.0], {"failed": np.ones((2, 4), dtype=bool)}, "shape"),
        ([0.0, 0.0], {"phase_errors_rad": np.full((4, 2), np.nan)}, "phase_errors_rad"),
    ],
)
def test_weights_of_no_array_are_refused(steering: list[float], given: dict[str, np.ndarray], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        element_weights(TripulseArrayParams(n_x=4, n_y=2), steering, **given)


@pytest.mark.parametrize("word", ["1:2:3", "3", "3:", ":3", "-1:2", "1.0:2", "1:x"])
def test_a_dead_element_that_is_no_pair_is_refused(word: str) -> None:
    with pytest.raises(ValueError, match="must be pairs such as 3:16, separated by commas"):
        TripulseArrayParams(failed=f"2:2, {word}")


@pytest.mark.parametrize("word", ["0:1", "1:0", "5:6", "4:7"])
def test_a_dead_element_outside_the_array_is_refused(word: str) -> None:
    with pytest.raises(ValueError, match=f"failed element {word} must be from 1:1 to 4:6"):
        TripulseArrayParams(n_x=4, n_y=6, failed=word)


def test_the_corners_of_the_array_can_be_dead() -> None:
    dead = TripulseArrayParams(n_x=4, n_y=6, failed="1:1,, 4 : 6 ,4:1,").dead_elements()
    assert dead is not None
    np.testing.assert_array_equal(np.argwhere(dead), [[0, 0], [3, 0], [3, 5]])
    assert TripulseArrayParams(failed=" , ").dead_elements() is None


def test_wave_numbers_and_periods_belong_to_their_own_axis() -> None:
    array = TripulseArrayParams(n_x=4, n_y=10, spacing_x_wavelengths=0.5, spacing_y_wavelengths=2.0)
    np.testing.assert_allclose(array.kd, [np.pi, 4.0 * np.pi], rtol=1e-12)
    np.testing.assert_allclose(array.unambiguous_projection, [0.5, 0.05], rtol=1e-12)
    assert array.n_total == 40


def test_a_number_of_bits_below_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="bits=-1 must be >= 0"):
        quantised_phase_rad(0.3, -1)
    np.testing.assert_allclose(quantised_phase_rad([1.5, 1.6, -1.6], 1), [0.0, np.pi, -np.pi])
