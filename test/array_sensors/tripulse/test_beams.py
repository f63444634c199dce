"""Sum and difference beams: the sums over elements, the closed form, and the direction from the ratios."""

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import (
    beam_signals,
    beam_signs,
    closed_form_signals,
    direction_projections,
    invert_ratios,
    invert_with_weights,
    monopulse_ratios,
    polar_angles_rad,
    ratio_and_slope,
    shared_projection_sigma,
)
from rf_pointing.core import random_stream

ROUNDING = 1e-11
EXACT = 1e-12


def arrays() -> list[TripulseArrayParams]:
    return [
        TripulseArrayParams(n_x=n_x, n_y=n_y, spacing_x_wavelengths=d_x, spacing_y_wavelengths=d_y)
        for n_x, n_y, d_x, d_y in [(2, 2, 0.5, 0.5), (4, 6, 0.7, 3.0), (16, 16, 3.0, 3.0), (18, 10, 2.3, 1.1)]
    ]


@pytest.mark.parametrize("params", arrays(), ids=str)
def test_quadrant_sums_equal_the_closed_form_8(params: TripulseArrayParams) -> None:
    rng = random_stream(1, "beams")
    steering = rng.uniform(-0.3, 0.3, size=(200, 2))
    direction = rng.uniform(-0.6, 0.6, size=(200, 2))
    signals = beam_signals(params, element_weights(params, steering), direction)
    np.testing.assert_allclose(signals, closed_form_signals(params, direction - steering), atol=ROUNDING * 256)


@pytest.mark.parametrize("params", arrays(), ids=str)
def test_closed_form_has_its_limits_on_the_axes_and_in_the_grating_lobes(params: TripulseArrayParams) -> None:
    lobe_x, lobe_y = 2.0 * np.pi / params.kd
    for error in ([0.0, 0.0], [0.0, 0.01], [0.01, 0.0], [lobe_x, 0.0], [lobe_x, 0.01], [-3 * lobe_x, 2 * lobe_y]):
        expected = beam_signals(params, element_weights(params, [0.0, 0.0]), error)
        np.testing.assert_allclose(closed_form_signals(params, error), expected, atol=ROUNDING * 256)


@pytest.mark.parametrize("params", arrays(), ids=str)
def test_ratios_are_the_tangents_of_9_inside_the_main_lobe(params: TripulseArrayParams) -> None:
    error = random_stream(1, "ratios").uniform(-0.95, 0.95, size=(200, 2)) * params.unambiguous_projection
    ratios = monopulse_ratios(closed_form_signals(params, error))
    quarter_phase = error * params.kd * np.array([params.n_x, params.n_y]) / 4.0
    np.testing.assert_allclose(ratios, np.tan(quarter_phase), rtol=1e-10)


def test_beam_signs_split_the_array_into_equal_halves() -> None:
    signs = beam_signs(TripulseArrayParams(n_x=4, n_y=6))
    np.testing.assert_array_equal(np.sum(signs, axis=(1, 2)), [24.0, 0.0, 0.0])
    assert signs[1, 0, 0] == signs[2, 0, 0] == 1.0
    assert signs[1, -1, 0] == signs[2, 0, -1] == -1.0


def test_engineers_time_convention_gives_the_same_ratios_from_conjugate_signals() -> None:
    signals = closed_form_signals(TripulseArrayParams(), [1e-3, -2e-3])
    ratios = monopulse_ratios(signals)
    np.testing.assert_allclose(monopulse_ratios(signals.conj(), "exp(+jwt)"), ratios)
    np.testing.assert_allclose(monopulse_ratios(signals.conj(), "exp(-jwt)"), -ratios)


@pytest.mark.parametrize(("signals", "message"), [([0.0, 1.0, 1.0], "sum signal is 0"), ([1.0, np.nan, 0.0], "finite")])
def test_signals_without_a_ratio_are_refused(signals: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        monopulse_ratios(signals)


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


def test_the_slope_of_the_ratios_is_their_derivative_by_the_direction() -> None:
    params = TripulseArrayParams(n_x=8, n_y=6, spacing_x_wavelengths=3.0, spacing_y_wavelengths=2.0)
    rng = random_stream(4, "slope")
    weights = element_weights(params, [0.0, 0.0]) * (
        1.0 + 0.1 * rng.normal(size=(8, 6)) + 0.1j * rng.normal(size=(8, 6))
    )
    direction, step = np.array([2e-3, -3e-3]), 1e-6
    ratio, slope = ratio_and_slope(params, weights, direction)
    signals = beam_signals(params, weights, direction)
    np.testing.assert_allclose(ratio, (signals[1:] / signals[0]).imag, rtol=1e-12)
    for axis in (0, 1):
        moved = step * np.eye(2)[axis]
        after, before = (ratio_and_slope(params, weights, direction + sign * moved)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(slope[:, axis], (after - before) / (2.0 * step), rtol=1e-5, atol=1e-6)


def test_an_aperture_whose_sum_has_its_null_in_the_direction_sought_is_refused() -> None:
    params = TripulseArrayParams(n_x=4, n_y=4)
    # On the axis the differences are zero, which is no reason to refuse.
    ratio_and_slope(params, np.ones((4, 4)), [0.0, 0.0])
    halves = np.repeat([[1.0], [1.0], [-1.0], [-1.0]], 4, axis=1)
    with pytest.raises(ValueError, match="the sum beam of this aperture has a null"):
        ratio_and_slope(params, halves, [0.0, 0.0])


@pytest.mark.parametrize("taper_edge", [0.0, 0.05])
def test_a_tapered_aperture_is_inverted_up_to_one_and_a_half_periods_and_refused_beyond(taper_edge: float) -> None:
    """Its main lobe is wider than that of the uniform one, and its ratios rise on."""
    params = TripulseArrayParams(n_x=12, n_y=8, taper_edge=taper_edge)
    weights = element_weights(params, [0.0, 0.0])
    for share in ([1.45, -0.2], [-1.45, 0.3], [0.2, -1.45]):
        error = np.array(share) * params.unambiguous_projection
        ratios = monopulse_ratios(beam_signals(params, weights, error))
        np.testing.assert_allclose(invert_with_weights(params, weights, [0.0, 0.0], ratios), error, atol=EXACT)
        beyond = error * np.where(np.abs(share) > 1.0, 1.55 / 1.45, 1.0)
        ratios = monopulse_ratios(beam_signals(params, weights, beyond))
        with pytest.raises(ValueError, match="lie outside the unambiguous region of this aperture"):
            invert_with_weights(params, weights, [0.0, 0.0], ratios)


def test_a_direction_may_lie_in_the_plane_of_the_array() -> None:
    np.testing.assert_allclose(direction_projections([0.5, 0.8], [0.1, 0.0]), [0.6, 0.8])
    theta, phi = polar_angles_rad([[-1.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(theta, [np.pi / 2.0, 0.0])
    np.testing.assert_allclose(phi, [np.pi, 0.0])
    with pytest.raises(ValueError, match="not a direction"):
        direction_projections([np.nan, 0.0], [0.0, 0.0])


@pytest.mark.parametrize(("taper_edge", "failed"), [(1.0, ""), (0.4, ""), (0.0, ""), (0.4, "3:5, 12:14, 1:1")])
def test_phases_of_the_quadrants_move_the_projections_by_their_sigma(taper_edge: float, failed: str) -> None:
    """Planted phases, inverted as if there were none; a uniform aperture has 2 p/(N k d)."""
    params = TripulseArrayParams(n_x=16, n_y=14, taper_edge=taper_edge, failed=failed)
    weights, phase = element_weights(params, [0.0, 0.0]), 0.02
    off = phase * random_stream(3, "quadrants").standard_normal((4000, 2, 2))
    turned = weights * np.exp(1j * np.kron(off, np.ones((8, 7))))
    seen = invert_with_weights(params, weights, [0.0, 0.0], monopulse_ratios(beam_signals(params, turned, [0.0, 0.0])))
    sigma = shared_projection_sigma(params, phase)
    np.testing.assert_allclose(np.std(seen, axis=0), sigma, rtol=0.035)
    uniform = 2.0 * phase / (params.kd * [16, 14])
    assert np.all(sigma >= uniform * (1.0 - 1e-9))
    if taper_edge == 1.0:
        np.testing.assert_allclose(sigma, uniform, rtol=1e-9)
