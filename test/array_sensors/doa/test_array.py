"""Circular array: steering against the printed equation, derivatives against differences, refusals.

Mutual coupling: the symmetric model, the planted response recovered, and what an uncalibrated array costs.
"""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import (
    ArrayResponse,
    CircularArrayParams,
    ResponseParams,
    coupling_matrix,
    element_positions_m,
    phase_radius_rad,
    steering,
    steering_taylor,
)
from rf_pointing.array_sensors.doa.several_sources import estimate_several
from rf_pointing.array_sensors.doa.snapshots import complex_normal
from rf_pointing.papers.doa_study.directions import direction_from_polar

ARRAY = CircularArrayParams()
COUPLING = np.array([0.25 * np.exp(1.1j), 0.12 * np.exp(-2j), 0.06 * np.exp(0.4j), 0.04, 0.02j, 0.02])


def test_steering_is_the_printed_equation_21() -> None:
    theta, phi = 0.61, 2.37
    m = np.arange(12)
    printed = np.exp(1j * 2 * np.pi / 0.15 * 0.15 * np.sin(theta) * np.cos(phi - 2 * np.pi / 12 * m))
    assert steering(ARRAY, direction_from_polar(theta, phi)) == pytest.approx(printed, abs=1e-12)


def test_published_array_has_radius_of_one_wavelength() -> None:
    assert phase_radius_rad(ARRAY) == pytest.approx(2 * np.pi)
    assert np.linalg.norm(element_positions_m(ARRAY), axis=1) == pytest.approx(0.15)


def test_taylor_columns_are_the_derivatives_in_the_direction_cosines() -> None:
    array = CircularArrayParams(elements=7, radius_m=0.21, wavelength_m=0.13)
    h = 1e-4

    def at(u: float, v: float) -> np.ndarray:
        return steering(array, np.array([u, v, np.sqrt(1 - u * u - v * v)]))

    u, v = 0.23, -0.41
    a = at(u, v)[:, None] * steering_taylor(array)
    assert a[:, 1] == pytest.approx((at(u + h, v) - at(u - h, v)) / (2 * h), rel=1e-5, abs=1e-4)
    assert a[:, 2] == pytest.approx((at(u, v + h) - at(u, v - h)) / (2 * h), rel=1e-5, abs=1e-4)
    mixed = (at(u + h, v + h) - at(u + h, v - h) - at(u - h, v + h) + at(u - h, v - h)) / (4 * h * h)
    assert a[:, 4] == pytest.approx(mixed, rel=1e-4, abs=1e-2)
    assert a[:, 5] == pytest.approx((at(u, v + h) - 2 * at(u, v) + at(u, v - h)) / h**2, rel=1e-4, abs=1e-2)


@pytest.mark.parametrize("direction", [[0.0, 0.0, 1.1], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])
def test_direction_that_is_no_unit_vector_is_refused(direction: list[float]) -> None:
    with pytest.raises(ValueError, match="direction"):
        steering(ARRAY, np.array(direction))


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(1102)


@pytest.fixture
def response(stream: np.random.Generator) -> ArrayResponse:
    gain = 1 + 0.1 * complex_normal(stream, (12,))
    return ArrayResponse(gain=gain / gain[0], coupling=COUPLING)


def test_coupling_depends_on_the_distance_round_the_circle() -> None:
    c = coupling_matrix(12, COUPLING)
    assert c == pytest.approx(c.T)
    assert c == pytest.approx(np.roll(np.roll(c, 5, axis=0), 5, axis=1))
    assert (c[0, 0], c[0, 1], c[0, 11], c[3, 9]) == (1.0, COUPLING[0], COUPLING[0], COUPLING[5])


def test_several_sources_are_found_through_a_coupled_array(response: ArrayResponse) -> None:
    truth = direction_from_polar([0.5, 0.8], [0.3, 2.0])
    a = response.matrix @ steering(ARRAY, truth).T
    found = estimate_several(ARRAY, a @ a.conj().T + 0.01 * np.eye(12), 2, response.matrix)
    assert np.linalg.norm(found.direction[:, None] - truth[None], axis=-1).min(axis=0).max() < 1e-8


@pytest.mark.parametrize(
    ("gain", "coupling", "words"),
    [
        (np.zeros(12, complex), COUPLING, "failed element"),
        (np.ones(12, complex), COUPLING[:5], "must be \\(6,\\)"),
        (np.ones(12, complex), COUPLING * np.nan, "coupling=.* must be finite"),
    ],
)
def test_response_that_no_array_has_is_refused(gain: np.ndarray, coupling: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ArrayResponse(gain=gain, coupling=coupling)


def test_response_is_built_from_levels_and_phases() -> None:
    found = ResponseParams(
        gain_db=(6.0,) + (0.0,) * 11, gain_phase_rad=(0.0, 0.5) + (0.0,) * 10,
        coupling_db=(-20.0,) * 6, coupling_phase_rad=(0.3,) * 6,
    ).response(12)  # fmt: skip
    assert found is not None
    assert abs(found.gain[0]) == pytest.approx(10.0**0.3)
    assert np.angle(found.gain[1]) == pytest.approx(0.5)
    assert found.coupling == pytest.approx(0.1 * np.exp(0.3j) * np.ones(6))


def test_empty_lists_are_an_ideal_array_and_no_level_is_no_coupling() -> None:
    assert ResponseParams().response(12) is None
    found = ResponseParams(gain_db=(1.0,) * 12).response(12)
    assert found is not None
    assert np.all(found.coupling == 0.0)


def test_lists_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match="gain_db has 11 values, must be 12 or none"):
        ResponseParams(gain_db=(0.0,) * 11).response(12)
