import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import (
    TripulseArrayParams,
    amplitude_taper,
    centred_indices,
    element_weights,
    quantised_phase_rad,
)
from rf_pointing.core import random_stream


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_x": 15}, "n_x=15 must be even"),
        ({"n_y": 3}, "n_y=3 must be even"),
        ({"n_x": 0}, "n_x=0 must be >= 2"),
        ({"n_x": 16.0}, "n_x=16.0 must be a whole number"),
        ({"spacing_x_wavelengths": np.nan}, "spacing_x_wavelengths=nan must be finite"),
        ({"taper_edge": 1.5}, "taper_edge=1.5 must be <= 1.0"),
    ],
)
def test_impossible_arrays_are_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TripulseArrayParams(**changes)


def test_indices_are_symmetric_half_integers() -> None:
    np.testing.assert_array_equal(centred_indices(4), [-1.5, -0.5, 0.5, 1.5])


def test_taper_is_symmetric_and_uniform_at_edge_one() -> None:
    np.testing.assert_array_equal(amplitude_taper(TripulseArrayParams()), np.ones((16, 16)))
    taper = amplitude_taper(TripulseArrayParams(n_x=8, n_y=12, taper_edge=0.2))
    np.testing.assert_allclose(taper, taper[::-1, ::-1])
    assert taper[3, 5] > taper[0, 5] > taper[0, 0] > 0.04


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


def test_failed_elements_have_no_weight_and_an_array_without_any_is_refused() -> None:
    params = TripulseArrayParams(n_x=4, n_y=2)
    failed = np.zeros((4, 2), dtype=bool)
    failed[1, 0] = True
    weights = element_weights(params, [0.1, 0.0], failed=failed)
    assert weights[1, 0] == 0.0
    assert np.count_nonzero(weights) == 7
    with pytest.raises(ValueError, match="all 8 elements"):
        element_weights(params, [0.0, 0.0], failed=np.ones((4, 2), dtype=bool))
    with pytest.raises(ValueError, match="shape"):
        element_weights(params, [0.0, 0.0], failed=np.ones((2, 4), dtype=bool))


def test_steering_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="steering"):
        element_weights(TripulseArrayParams(), [np.nan, 0.0])
