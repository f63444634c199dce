"""Uniform circular array: places of the elements, steering vector, gain and coupling errors.

Steering (DOA eq. (21)): a_m = exp(j k r sin(theta) cos(phi - phi_m)), phi_m = 2 pi m / M,
k = 2 pi / lambda.  With the direction cosines u = sin(theta) cos(phi), v = sin(theta) sin(phi) the
phase is k (x_m u + y_m v): linear, and regular at theta = 0.  This is why the estimators search and
differentiate in the unit vector and not in angles.

Errors: measured response = diag(gain) C a(s).  By symmetry C is circulant and symmetric: C_ij
depends on the distance min(|i - j|, M - |i - j|) round the circle only, with C_ii = 1.  DOA assumes
it away by calibration (after eq. (11)); here every estimator accepts the response matrix.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter, require_finite
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class CircularArrayParams(Params):
    """Elements evenly spaced on a circle in the x-y plane; boresight is +z (DOA section 4.1)."""

    # Below five elements the second moments of the circle depend on azimuth, and so does the bound.
    elements: int = parameter(
        12, "number of elements; below 5 the accuracy depends on azimuth", low=5, high=512
    )
    radius_m: float = parameter(0.15, "radius of the circle", low=1e-6, high=1e3)
    wavelength_m: float = parameter(0.15, "wavelength of the received signal", low=1e-6, high=1e3)


def phase_radius_rad(array: CircularArrayParams) -> float:
    """Return k r = 2 pi r / lambda, the phase between centre and rim for a source in the array
    plane.
    """
    return 2.0 * math.pi * array.radius_m / array.wavelength_m


def element_positions_m(array: CircularArrayParams) -> Array:
    """Return the x, y places of the elements, shape (M, 2); element 0 lies on +x (DOA eq. (19))."""
    angle = 2.0 * np.pi * np.arange(array.elements) / array.elements
    return array.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def steering(array: CircularArrayParams, direction: Array) -> ComplexArray:
    """Return the steering vectors (..., M) of unit vectors `direction` (..., 3) in the array frame
    (DOA eq. (21)).

    Raises
    ------
    ValueError
        If a direction is not finite or its length differs from 1 by more than 1e-6.
    """
    require_finite("direction", direction)
    length = np.linalg.norm(direction, axis=-1)
    # Directions come over the wire or from angles; a length off by more is a wrong frame, not
    # rounding.
    if np.any(np.abs(length - 1.0) > 1e-6):
        raise ValueError(
            f"|direction|={length[np.unravel_index(np.argmax(np.abs(length - 1.0)), length.shape)]} must be 1"
        )
    wave_number = 2.0 * np.pi / array.wavelength_m
    phase = wave_number * (direction[..., :2] @ element_positions_m(array).T)
    return np.asarray(np.exp(1j * phase), dtype=np.complex128)


def steering_taylor(array: CircularArrayParams) -> ComplexArray:
    """Return T (M, 6): a[:, None] * T are a, a_u, a_v, a_uu, a_uv, a_vv, the derivatives in the
    direction cosines.
    """
    scaled = 2.0 * np.pi / array.wavelength_m * element_positions_m(array)
    x, y = scaled.T
    return np.stack([np.ones_like(x), 1j * x, 1j * y, -x * x, -x * y, -y * y], axis=-1).astype(
        np.complex128
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayResponse:
    """Gains (M,) of the elements and coupling coefficients (M // 2,) to the 1st, 2nd ... neighbour
    on the circle.
    """

    gain: ComplexArray
    coupling: ComplexArray

    def __post_init__(self) -> None:
        for name in ("gain", "coupling"):
            require_finite(name, getattr(self, name))
        if self.gain.ndim != 1 or self.coupling.shape != (len(self.gain) // 2,):
            raise ValueError(
                f"coupling has shape {self.coupling.shape}, must be ({len(self.gain) // 2},) for the gains"
            )
        # A zero gain makes the response singular: the estimators would invert it without noticing.
        dead = np.flatnonzero(np.abs(self.gain) < 1e-6)
        if len(dead):
            raise ValueError(
                f"gain[{dead[0]}]={self.gain[dead[0]]} must not be zero: a failed element"
            )

    @property
    def matrix(self) -> ComplexArray:
        """The response matrix (M, M) that multiplies the ideal steering vector."""
        return np.asarray(
            self.gain[:, None] * coupling_matrix(len(self.gain), self.coupling), dtype=np.complex128
        )


@dataclass(frozen=True, kw_only=True)
class ResponseParams(Params):
    """The response of the array as calibrated; empty lists are an ideal array."""

    gain_db: tuple[float, ...] = parameter((), "gain of each element", low=-60.0, high=60.0)
    gain_phase_rad: tuple[float, ...] = parameter(
        (), "phase of each element", low=-2.0 * math.pi, high=2.0 * math.pi
    )
    coupling_db: tuple[float, ...] = parameter(
        (), "coupling to the 1st, 2nd ... neighbour on the circle", low=-200.0, high=0.0
    )
    coupling_phase_rad: tuple[float, ...] = parameter(
        (), "phase of the coupling to each neighbour", low=-2.0 * math.pi, high=2.0 * math.pi
    )

    def response(self, elements: int) -> ArrayResponse | None:
        """Return the response of an array of `elements`, None where all lists are empty.

        ValueError if a list has neither the length of the array's nor none.
        """
        lists = {"gain_db": elements, "gain_phase_rad": elements}
        lists |= {"coupling_db": elements // 2, "coupling_phase_rad": elements // 2}
        values = {}
        for name, count in lists.items():
            given = getattr(self, name)
            if len(given) not in (0, count):
                raise ValueError(f"{name} has {len(given)} values, must be {count} or none")
            # Without a level there is no coupling, whatever its phase.
            values[name] = np.array(given or [-math.inf if name == "coupling_db" else 0.0] * count)
        if not any(getattr(self, name) for name in lists):
            return None
        gain = 10.0 ** (values["gain_db"] / 20.0) * np.exp(1j * values["gain_phase_rad"])
        coupling = 10.0 ** (values["coupling_db"] / 20.0) * np.exp(
            1j * values["coupling_phase_rad"]
        )
        return ArrayResponse(
            gain=gain.astype(np.complex128), coupling=coupling.astype(np.complex128)
        )


def coupling_basis(elements: int) -> NDArray[np.float64]:
    """Return B (M // 2 + 1, M, M).

    Ones where two elements are d places apart on the circle, for d = 0, 1 ...
    """
    apart = np.abs(np.subtract.outer(np.arange(elements), np.arange(elements)))
    # Neighbours round the circle: element 0 is next to element M - 1.
    apart = np.minimum(apart, elements - apart)
    return np.asarray(apart == np.arange(elements // 2 + 1)[:, None, None], dtype=np.float64)


def coupling_matrix(elements: int, coupling: ArrayLike) -> ComplexArray:
    """Return C (M, M) from the coefficients (M // 2,) of the 1st, 2nd ... neighbour.

    Its diagonal is one.
    """
    coefficients = np.concatenate([[1.0 + 0.0j], np.asarray(coupling, dtype=np.complex128)])
    if coefficients.shape != (elements // 2 + 1,):
        raise ValueError(
            f"coupling has {len(coefficients) - 1} coefficients, must be {elements // 2}"
        )
    require_finite("coupling", coefficients)
    return np.asarray(
        np.einsum("d,dij->ij", coefficients, coupling_basis(elements)), dtype=np.complex128
    )
