"""The transmitting array of Tripulse: elements, taper, steering, phase quantiser, dead elements.

Element (m, n) sits at (c(m) d_x, c(n) d_y) with c(m) = m - (N_x + 1)/2 (TRIPULSE (5)); x runs with
m and y with n.  With "(1, 1) in the upper left corner" y points down and z = x x y away from the
reader.  A direction is its pair of projections T = (sin(theta) cos(phi), sin(theta) sin(phi)) on x
and y (TRIPULSE (2)).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter, require_finite
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class TripulseArrayParams(Params):
    """Rectangular array of N_x x N_y elements, both even.

    The defaults are the paper's Ku-band example.
    """

    n_x: int = parameter(16, "elements along x, even", low=2, high=512)
    n_y: int = parameter(16, "elements along y, even", low=2, high=512)
    spacing_x_wavelengths: float = parameter(
        3.0, "element spacing along x over the wavelength", low=0.1, high=100.0
    )
    spacing_y_wavelengths: float = parameter(
        3.0, "element spacing along y over the wavelength", low=0.1, high=100.0
    )
    taper_edge: float = parameter(
        1.0, "amplitude at the aperture's edge, 1 for a uniform aperture", low=0.0, high=1.0
    )
    phase_bits: int = parameter(0, "bits of the phase shifters, 0 for exact phases", low=0, high=16)
    failed: str = parameter(
        "", "dead elements as column:row from 1:1, separated by commas, such as 3:16, 4:16"
    )

    def check_together(self) -> None:
        """Refuse odd element counts: the halves of a difference beam must be equal."""
        for name in ("n_x", "n_y", "phase_bits"):
            if not isinstance(getattr(self, name), int):
                raise ValueError(f"{name}={getattr(self, name)} must be a whole number")
        for name in ("n_x", "n_y"):
            if getattr(self, name) % 2:
                raise ValueError(f"{name}={getattr(self, name)} must be even")
        dead = self.dead_elements()
        # An array without any beam measures no attitude; zero weights would divide by zero
        # later.
        if dead is not None and np.all(dead):
            raise ValueError(f"failed marks all {self.n_total} elements: the array has no beam")

    def dead_elements(self) -> NDArray[np.bool_] | None:
        """Return True (N_x, N_y) where `failed` names an element, None where it names none."""
        words = [word.strip() for word in self.failed.split(",") if word.strip()]
        if not words:
            return None
        dead = np.zeros((self.n_x, self.n_y), dtype=bool)
        for word in words:
            numbers = word.split(":")
            if len(numbers) != 2 or not all(number.strip().isdecimal() for number in numbers):
                raise ValueError(
                    f"failed={self.failed!r} must be pairs such as 3:16, separated by commas"
                )
            m, n = (int(number) for number in numbers)
            if not (1 <= m <= self.n_x and 1 <= n <= self.n_y):
                raise ValueError(f"failed element {word} must be from 1:1 to {self.n_x}:{self.n_y}")
            dead[m - 1, n - 1] = True
        return dead

    @property
    def n_total(self) -> int:
        """Number of elements N_tot = N_x N_y."""
        return self.n_x * self.n_y

    @property
    def kd(self) -> Array:
        """Wave number times spacing along x and y, radians per unit projection, shape (2,)."""
        spacings = [self.spacing_x_wavelengths, self.spacing_y_wavelengths]
        return np.asarray([2.0 * math.pi * spacing for spacing in spacings], dtype=np.float64)

    @property
    def unambiguous_projection(self) -> Array:
        """Largest projection error lambda/(N d) that (9) inverts, along x and y, shape (2,)."""
        apertures = np.array(
            [self.spacing_x_wavelengths * self.n_x, self.spacing_y_wavelengths * self.n_y]
        )
        return np.asarray(1.0 / apertures)


def centred_indices(count: int) -> Array:
    """Return c(m) = m - (N + 1)/2 for m = 1..N (TRIPULSE (5))."""
    return np.asarray(np.arange(1, count + 1) - (count + 1) / 2.0, dtype=np.float64)


def amplitude_taper(params: TripulseArrayParams) -> Array:
    """Return element amplitudes (N_x, N_y).

    A cosine-squared arch on a pedestal along both axes, one at the centre.
    """

    def along(count: int) -> Array:
        # The arch reaches zero one half spacing outside of the last element, so every element
        # radiates.
        arch = np.cos(np.pi * centred_indices(count) / count) ** 2
        return params.taper_edge + (1.0 - params.taper_edge) * arch

    return np.outer(along(params.n_x), along(params.n_y))


def steering_phase_rad(params: TripulseArrayParams, steering: ArrayLike) -> Array:
    """Return the phases (..., N_x, N_y) that steer to the projections `steering` (..., 2),
    unquantised.
    """
    t = np.asarray(steering, dtype=np.float64)
    require_finite("steering", t)
    phase_x = params.kd[0] * t[..., 0, None] * centred_indices(params.n_x)
    phase_y = params.kd[1] * t[..., 1, None] * centred_indices(params.n_y)
    return np.asarray(phase_x[..., :, None] + phase_y[..., None, :])


def quantised_phase_rad(phase_rad: ArrayLike, bits: int) -> Array:
    """Return each phase rounded to the nearest of the 2^bits states; bits = 0 leaves it exact."""
    phase = np.asarray(phase_rad, dtype=np.float64)
    if bits < 0:
        raise ValueError(f"bits={bits} must be >= 0")
    if bits == 0:
        return phase
    step_rad = 2.0 * math.pi / 2**bits
    # Rounding to multiples of the step: pi stays a state, so the three beams share their phase
    # errors.
    return np.asarray(step_rad * np.round(phase / step_rad))


def element_weights(
    params: TripulseArrayParams,
    steering: ArrayLike,
    *,
    failed: NDArray[np.bool_] | None = None,
    phase_errors_rad: ArrayLike | None = None,
    common_phase_rad: float = 0.0,
) -> ComplexArray:
    """Return the complex element weights (..., N_x, N_y) of the sum beam.

    Parameters
    ----------
    steering : projections (..., 2) the beam is steered to
    failed : True where an element is dead besides those of `params`, shape (..., N_x, N_y)
    phase_errors_rad : added after the quantiser, shape (..., N_x, N_y)
    common_phase_rad : added to all phases before the quantiser.  Steering phases are odd in the
        element's position, so without it the rounding errors of mirrored elements are equal and
        opposite and add up in the delta beams.

    Raises
    ------
    ValueError : if every element of an array failed.
    """
    phase = quantised_phase_rad(
        steering_phase_rad(params, steering) + common_phase_rad, params.phase_bits
    )
    if phase_errors_rad is not None:
        require_finite("phase_errors_rad", phase_errors_rad)
        phase = phase + np.asarray(phase_errors_rad, dtype=np.float64)
    weights = amplitude_taper(params) * np.exp(1j * phase)
    known = params.dead_elements()
    if failed is None:
        return np.asarray(weights if known is None else np.where(known, 0.0, weights))
    if failed.shape[-2:] != (params.n_x, params.n_y):
        raise ValueError(
            f"failed has shape {failed.shape}, must be (..., {params.n_x}, {params.n_y})"
        )
    failed = failed if known is None else failed | known
    if np.any(np.all(failed, axis=(-2, -1))):
        raise ValueError(f"failed marks all {params.n_total} elements: the array has no beam")
    return np.where(failed, 0.0, weights)
