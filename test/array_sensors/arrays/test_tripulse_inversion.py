import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.arrays.tripulse_beams import beam_signals, monopulse_ratios
from rf_pointing.array_sensors.arrays.tripulse_inversion import (
    direction_projections,
    invert_ratios,
    invert_with_weights,
    polar_angles_rad,
)
from rf_pointing.core import random_stream

EXACT = 1e-12


@pytest.mark.parametrize(("n_x", "n_y"), [(2, 4), (16, 16), (18, 6)])
def test_uniform_aperture_is_inverted_exactly_up_to_lambda_over_n_d(n_x: int, n_y: int) -> None:
    params = TripulseArrayParams(n_x=n_x, n_y=n_y, spacing_y_wavelengths=2.2)
    steering = np.array([0.03, -0.04])
    error = random_stream(1, "inversion").uniform(-0.98, 0.98, size=(300, 2)) * params.unambiguous_projection
    signals = beam_signals(params, element_weights(params, steering), steering + error)
    np.testing.assert_allclose(invert_ratios(params, monopulse_ratios(signals)), error, atol=EXACT)


def test_error_beyond_lambda_over_n_d_aliases_into_the_main_lobe() -> None:
    params = TripulseArrayParams()
    error = 1.2 * params.unambiguous_projection
    signals = beam_signals(params, element_weights(params, [0.0, 0.0]), error)
    found = invert_ratios(params, monopulse_ratios(signals))
    np.testing.assert_allclose(found, error - 2.0 * params.unambiguous_projection, atol=EXACT)


@pytest.mark.parametrize("taper_edge", [0.0, 0.3, 1.0])
def test_any_known_aperture_is_inverted_exactly(taper_edge: float) -> None:
    params = TripulseArrayParams(n_x=12, n_y=16, taper_edge=taper_edge, phase_bits=4)
    rng = random_stream(1, "known aperture")
    steering = np.array([0.0213, -0.0447])
    weights = element_weights(params, steering, failed=rng.uniform(size=(12, 16)) < 0.1)
    error = rng.uniform(-0.6, 0.6, size=(50, 2)) * params.unambiguous_projection
    ratios = monopulse_ratios(beam_signals(params, weights, steering + error))
    np.testing.assert_allclose(invert_with_weights(params, weights, steering, ratios), error, atol=EXACT)


def test_newton_refuses_ratios_outside_the_aperture() -> None:
    params = TripulseArrayParams(n_x=4, n_y=4)
    with pytest.raises(ValueError, match="ratios"):
        invert_with_weights(params, element_weights(params, [0.0, 0.0]), [0.0, 0.0], [np.nan, 0.0])
    weights = element_weights(params, [0.0, 0.0])
    weights[:, 1:] = 0.0
    with pytest.raises(ValueError, match="half of it is dead"):
        invert_with_weights(params, weights, [0.0, 0.0], [0.5, 0.5])


@pytest.mark.parametrize("phi_deg", [-179.0, -100.0, -10.0, 0.0, 45.0, 91.0, 180.0])
@pytest.mark.parametrize("theta_deg", [0.001, 5.0, 60.0, 89.9])
def test_polar_angles_keep_their_quadrant(theta_deg: float, phi_deg: float) -> None:
    theta, phi = np.radians([theta_deg, phi_deg])
    projections = np.sin(theta) * np.array([np.cos(phi), np.sin(phi)])
    found_theta, found_phi = polar_angles_rad(projections)
    assert found_theta == pytest.approx(theta, rel=1e-9)
    assert found_phi == pytest.approx(phi, abs=1e-12)


def test_projections_longer_than_one_are_no_direction() -> None:
    with pytest.raises(ValueError, match="not a direction"):
        direction_projections([0.9, 0.4], [0.0, 0.1])
