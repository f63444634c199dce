"""Circular array: steering against the printed equation, derivatives against differences, refusals."""

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.circular_array import (
    CircularArrayParams,
    element_positions_m,
    phase_radius_rad,
    steering,
    steering_taylor,
)
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar

ARRAY = CircularArrayParams()


def test_steering_is_the_printed_equation_21() -> None:
    theta, phi = 0.61, 2.37
    m = np.arange(12)
    printed = np.exp(1j * 2 * np.pi / 0.15 * 0.15 * np.sin(theta) * np.cos(phi - 2 * np.pi / 12 * m))
    assert steering(ARRAY, direction_from_polar(theta, phi)) == pytest.approx(printed, abs=1e-12)


def test_published_array_has_radius_of_one_wavelength() -> None:
    assert phase_radius_rad(ARRAY) == pytest.approx(2 * np.pi)
    assert np.linalg.norm(element_positions_m(ARRAY), axis=1) == pytest.approx(0.15)


def test_turning_the_source_by_one_element_shifts_the_steering_vector() -> None:
    first = steering(ARRAY, direction_from_polar(0.4, 0.3))
    turned = steering(ARRAY, direction_from_polar(0.4, 0.3 + 2 * np.pi / 12))
    assert turned == pytest.approx(np.roll(first, 1), abs=1e-12)


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


def test_fewer_than_five_elements_are_refused() -> None:
    with pytest.raises(ValueError, match="elements=4 must be >= 5"):
        CircularArrayParams(elements=4)
