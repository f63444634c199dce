"""Uniform circular array: element places and steering vector.

Model (DOA eq. (21)): a_m = exp(j k r sin(theta) cos(phi - phi_m)), phi_m = 2 pi m / M, k = 2 pi / lambda.
With the direction cosines u = sin(theta) cos(phi), v = sin(theta) sin(phi) the phase is k (x_m u + y_m v): linear, and
regular at theta = 0, which is why everything below searches and differentiates in the unit vector and not in angles.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter, require_finite

__all__ = ["CircularArrayParams", "element_positions_m", "phase_radius_rad", "steering", "steering_taylor"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class CircularArrayParams(Params):
    """Elements evenly spaced on a circle in the x-y plane; boresight is +z (DOA section 4.1)."""

    elements: int = parameter(12, "number of elements; below 5 the accuracy depends on azimuth", low=5, high=512)
    radius_m: float = parameter(0.15, "radius of the circle", low=1e-6, high=1e3)
    wavelength_m: float = parameter(0.15, "wavelength of the received signal", low=1e-6, high=1e3)


def phase_radius_rad(array: CircularArrayParams) -> float:
    """Return k r = 2 pi r / lambda, the phase between centre and rim for a source in the array plane."""
    return 2.0 * math.pi * array.radius_m / array.wavelength_m


def element_positions_m(array: CircularArrayParams) -> Array:
    """Return the x, y places of the elements, shape (M, 2); element 0 lies on +x (DOA eq. (19))."""
    angle = 2.0 * np.pi * np.arange(array.elements) / array.elements
    return array.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def steering(array: CircularArrayParams, direction: Array) -> ComplexArray:
    """Return the steering vectors (..., M) of unit vectors `direction` (..., 3) in the array frame (DOA eq. (21)).

    Raises
    ------
    ValueError
        If a direction is not finite or its length differs from 1 by more than 1e-6.
    """
    require_finite("direction", direction)
    length = np.linalg.norm(direction, axis=-1)
    if np.any(np.abs(length - 1.0) > 1e-6):
        raise ValueError(
            f"|direction|={length[np.unravel_index(np.argmax(np.abs(length - 1.0)), length.shape)]} must be 1"
        )
    wave_number = 2.0 * np.pi / array.wavelength_m
    phase = wave_number * (direction[..., :2] @ element_positions_m(array).T)
    return np.asarray(np.exp(1j * phase), dtype=np.complex128)


def steering_taylor(array: CircularArrayParams) -> ComplexArray:
    """Return T (M, 6): a[:, None] * T are a, a_u, a_v, a_uu, a_uv, a_vv, the derivatives in the direction cosines."""
    scaled = 2.0 * np.pi / array.wavelength_m * element_positions_m(array)
    x, y = scaled.T
    return np.stack([np.ones_like(x), 1j * x, 1j * y, -x * x, -x * y, -y * y], axis=-1).astype(np.complex128)
