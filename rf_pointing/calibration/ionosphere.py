"""Bending and delay by the ionosphere, which the reference track leaves out.

A thin spherical shell of electron content TEC advances the phase by

    I(E) = 40.3 TEC / f^2 * M(E),    M(E) = 1 / sqrt(1 - (R cos E / (R + h))^2)

The phase gradient along the ground bends the ray by  dE = -I'(E) (1 / rho + 1 / (R sin E)).
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Params, parameter

_EARTH_RADIUS_M = 6.371e6
# Height of the densest part of the F layer, the usual one for a thin shell.
_SHELL_HEIGHT_M = 3.5e5
_RATIO = _EARTH_RADIUS_M / (_EARTH_RADIUS_M + _SHELL_HEIGHT_M)
_DELAY_M3_S2 = 40.3


@dataclass(frozen=True, kw_only=True)
class Ionosphere(Params):
    """Vertical electron content and carrier frequency."""

    electrons_per_m2: float = parameter(
        description="vertical total electron content", low=0.0, high=5e18
    )
    frequency_hz: float = parameter(description="carrier frequency", low=1e8, high=1e11)

    def bending(self, elevation_rad: Array, range_m: Array) -> Array:
        """Return apparent minus true elevation (rad) of a target above the shell, at `range_m`."""
        cosine, sine = np.cos(elevation_rad), np.sin(elevation_rad)
        slope = (
            -self._vertical_m() * _RATIO**2 * sine * cosine / (1.0 - _RATIO**2 * cosine**2) ** 1.5
        )
        # The phase advances with electrons: the gradient bends the ray up as the troposphere does.
        return np.asarray(-slope * (1.0 / range_m + 1.0 / (_EARTH_RADIUS_M * sine)))

    def delay_m(self, elevation_rad: Array) -> Array:
        """Return the group delay in range, m."""
        return self._vertical_m() / np.sqrt(1.0 - (_RATIO * np.cos(elevation_rad)) ** 2)

    def _vertical_m(self) -> float:
        return _DELAY_M3_S2 * self.electrons_per_m2 / self.frequency_hz**2
