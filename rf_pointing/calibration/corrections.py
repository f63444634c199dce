"""Propagation and delays between the geometric direction and the measured one.

The ionosphere, a thin spherical shell of electron content TEC, advances the phase by

    I(E) = 40.3 TEC / f^2 * M(E),    M(E) = 1 / sqrt(1 - (R cos E / (R + h))^2)

The phase gradient along the ground bends the ray by  dE = -I'(E) (1 / rho + 1 / (R sin E)).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter
from rf_pointing.core.refraction import RadioRefraction

Array = NDArray[np.float64]

_EARTH_RADIUS_M = 6.371e6
# Height of the densest part of the F layer, the usual one for a thin shell.
_SHELL_HEIGHT_M = 3.5e5
_DELAY_M3_S2 = 40.3


@dataclass(frozen=True, kw_only=True)
class Ionosphere(Params):
    """Vertical electron content and carrier frequency."""

    electrons_per_m2: float = parameter(description="vertical total electron content", low=0.0, high=5e18)
    frequency_hz: float = parameter(description="carrier frequency", low=1e8, high=1e11)

    def bending(self, elevation_rad: Array, range_m: Array) -> Array:
        """Return apparent minus true elevation (rad) of a target above the shell, at `range_m`."""
        # The phase advances with electrons, so that the gradient bends the ray up as the
        # troposphere does.
        sine = np.sin(elevation_rad)
        return -self._slope(elevation_rad) * (1.0 / range_m + 1.0 / (_EARTH_RADIUS_M * sine))

    def delay_m(self, elevation_rad: Array) -> Array:
        """Return the group delay in range, m."""
        return self._vertical_m() / np.sqrt(1.0 - (self._ratio() * np.cos(elevation_rad)) ** 2)

    def _slope(self, elevation_rad: Array) -> Array:
        ratio2 = self._ratio() ** 2
        cosine, sine = np.cos(elevation_rad), np.sin(elevation_rad)
        return np.asarray(-self._vertical_m() * ratio2 * sine * cosine / (1.0 - ratio2 * cosine**2) ** 1.5)

    def _vertical_m(self) -> float:
        return _DELAY_M3_S2 * self.electrons_per_m2 / self.frequency_hz**2

    def _ratio(self) -> float:
        return _EARTH_RADIUS_M / (_EARTH_RADIUS_M + _SHELL_HEIGHT_M)


@dataclass(frozen=True, kw_only=True)
class Corrections:
    """What is taken off the observations so that they compare with the reference.

    None switches a correction off: where the reference is apparent, or the data are corrected.
    """

    light_time: bool
    troposphere: RadioRefraction | None
    ionosphere: Ionosphere | None
    range_delay_m: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.range_delay_m):
            raise ValueError(f"range_delay_m={self.range_delay_m} must be finite")

    def apparent_elevation(self, elevation_rad: Array, range_m: Array) -> Array:
        """Return where a target at a geometric elevation appears."""
        # The ray meets the ionosphere first, above the air: the troposphere bends what arrives from
        # there.
        seen = elevation_rad
        if self.ionosphere is not None:
            seen = seen + self.ionosphere.bending(elevation_rad, range_m)
        return np.asarray(seen if self.troposphere is None else self.troposphere.apply(seen))

    def bending(self, elevation_rad: Array, range_m: Array) -> Array:
        """Return what to subtract from observed elevations (rad), at a geometric elevation."""
        return self.apparent_elevation(elevation_rad, range_m) - elevation_rad

    def extra_range_m(self, elevation_rad: Array) -> Array:
        """Return what to subtract from observed ranges, m."""
        ionosphere = np.zeros_like(elevation_rad) if self.ionosphere is None else self.ionosphere.delay_m(elevation_rad)
        return ionosphere + self.range_delay_m

    def text(self) -> str:
        """Return what is switched on."""
        parts = [
            "light time" if self.light_time else "",
            "troposphere" if self.troposphere else "",
            "ionosphere" if self.ionosphere else "",
            f"range delay {self.range_delay_m:g} m" if self.range_delay_m else "",
        ]
        return ", ".join(part for part in parts if part) or "none"
