"""Frequency plan of the nine carriers and the phases that the paths give them.

f_1, f_1 + f0, f_1 + nu f0, ... f_1 + nu^(K-2) f0 on both links, shifted by the transponder's fixed offset (PI83
eq. 7-1, listing FCOMP).  Phase back at the active array: phi = (2 pi/c)(fF rho_00 + fR rho_ij), eq. (7-7); of a
difference against carrier 1 it is exactly (2 pi/c) f_n1 R_ij, because both links are shifted alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, VARIANTS, is_published
from rf_pointing.core import Params, parameter, require_between
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S

__all__ = ["REPORT_SPEED_OF_LIGHT_M_S", "CarrierPlan", "carrier_phases", "frequency_ratio"]

Array = NDArray[np.float64]
REPORT_SPEED_OF_LIGHT_M_S = 3.0e8
"""The value that the report computes with."""


@dataclass(frozen=True, kw_only=True)
class CarrierPlan(Params):
    """Carriers of both links; the defaults are the report's simulation (listing FCOMP)."""

    count: int = parameter(9, "number of carriers K", low=3, high=25)
    minimum_difference_hz: float = parameter(1250.0, "f0, carrier 2 minus carrier 1", low=1.0, high=1e9)
    ratio: float = parameter(6.1324, "nu, cycles resolved per step", low=1.01, high=1e4)
    forward_hz: float = parameter(3.0e9, "carrier 1 from active to passive", low=1e6, high=1e12)
    return_hz: float = parameter(2.0e9, "carrier 1 from passive to active", low=1e6, high=1e12)
    speed_of_light_m_s: float = parameter(SPEED_OF_LIGHT_M_S, "speed of light", low=2.9e8, high=3.1e8)
    exponents: str = parameter(CORRECTED, "published: first difference nu f0, as (7-1) reads", choices=VARIANTS)

    @property
    def offsets_hz(self) -> Array:
        """Carrier n minus carrier 1, (K,)."""
        first = 1 if is_published(self.exponents) else 0
        powers = self.ratio ** np.arange(first, first + self.count - 1)
        return np.concatenate([[0.0], self.minimum_difference_hz * powers])

    @property
    def ambiguities_m(self) -> Array:
        """Two-way length of one cycle of each difference against carrier 1, longest first, (K - 1,) (eq. 7-17)."""
        return self.speed_of_light_m_s / self.offsets_hz[1:]

    @property
    def forward_carriers_hz(self) -> Array:
        """Carriers of the forward link, (K,)."""
        return self.forward_hz + self.offsets_hz

    @property
    def return_carriers_hz(self) -> Array:
        """Carriers of the return link, (K,)."""
        return self.return_hz + self.offsets_hz

    @property
    def forward_wave_rad_m(self) -> Array:
        """Phase per metre of forward path, (K,) (eq. 7-6)."""
        return 2.0 * np.pi * self.forward_carriers_hz / self.speed_of_light_m_s

    @property
    def return_wave_rad_m(self) -> Array:
        """Phase per metre of return path, (K,) (eq. 7-6)."""
        return 2.0 * np.pi * self.return_carriers_hz / self.speed_of_light_m_s


def carrier_phases(outward_m: ArrayLike, back_m: ArrayLike, plan: CarrierPlan) -> Array:
    """Return the phases (..., K, n, n), not folded, of the paths out (...) and back (..., n, n) (eq. 7-7)."""
    forward = plan.forward_wave_rad_m * np.asarray(outward_m, dtype=np.float64)[..., None]
    back = plan.return_wave_rad_m[:, None, None] * np.asarray(back_m, dtype=np.float64)[..., None, :, :]
    return forward[..., None, None] + back


def frequency_ratio(highest_hz: float, lowest_hz: float, steps: int) -> float:
    """Return nu that climbs from the lowest to the highest difference in `steps` equal ratios (Table 8-1)."""
    require_between("steps", steps, 1, None)
    require_between("lowest_hz", lowest_hz, 1e-6, highest_hz)
    return float((highest_hz / lowest_hz) ** (1.0 / steps))
