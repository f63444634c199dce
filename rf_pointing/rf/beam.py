"""Power pattern of the antenna's beam: Gaussian, or a circular aperture with its true sidelobes.

Gaussian: P/P_nom = exp(-mu eps^2 / h^2), mu = 4 ln 2, h the half-power beamwidth (CONSCAN eq. 1).
Aperture: voltage C L_1(u) + (1-C)/(p+1) L_{p+1}(u), normalised, with L_v(u) = 2^v v! J_v(u) / u^v,
for the illumination C + (1-C)(1-rho^2)^p; u is scaled so that the pattern has the same half-power
beamwidth h.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import MDEG, MU, Array, Params, bracketed_root, parameter, require_choice

# Half-power beamwidths of a 34-m dish (CONSCAN section IV for X and Ka).
HALF_POWER_BEAMWIDTH_RAD = {"S": 264.0 * MDEG, "X": 65.0 * MDEG, "Ka": 17.0 * MDEG}

# Below this argument the series 1 - u^2/(4(v+1)) is exact to rounding, and u^-v would overflow.
SMALL_U = 1e-4
# Half power of every illumination lies between: the first null of the uniform one is at 3.83.
HALF_POWER_BETWEEN = 0.5, 3.83

PATTERNS = ("gaussian", "uniform", "tapered")


@dataclass(frozen=True, kw_only=True)
class BeamParams(Params):
    """Shape of the beam; every pattern has the same half-power beamwidth."""

    half_power_beamwidth_rad: float = parameter(
        HALF_POWER_BEAMWIDTH_RAD["X"], "full width of the beam at half power", 1e-6, 1.4
    )
    pattern: str = parameter("gaussian", "shape of the pattern", choices=PATTERNS)
    edge_taper_db: float = parameter(
        12.0, "illumination at the rim below the centre (tapered)", 0.0, 60.0
    )
    taper_exponent: int = parameter(1, "exponent p of the illumination taper (tapered)", 1, 4)

    @classmethod
    def for_band(cls, band: str, pattern: str = "gaussian") -> Self:
        """Return the beam of a 34-m dish in band S, X or Ka."""
        require_choice("band", band, HALF_POWER_BEAMWIDTH_RAD)
        return cls(half_power_beamwidth_rad=HALF_POWER_BEAMWIDTH_RAD[band], pattern=pattern)


class Beam:
    """The pattern of `params`, relative to its peak."""

    def __init__(self, params: BeamParams) -> None:
        self.params = params

    def voltage(self, cross_elevation_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
        """Return the signed voltage at this offset from the beam axis, 1 on the axis."""
        angle = np.hypot(
            np.asarray(cross_elevation_rad, dtype=np.float64),
            np.asarray(elevation_rad, dtype=np.float64),
        )
        return normalised_voltage(self.params, angle / self.params.half_power_beamwidth_rad)

    def power_gain(self, cross_elevation_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
        """Return the power relative to the target on the axis (CONSCAN eq. 1 for the Gaussian)."""
        return self.voltage(cross_elevation_rad, elevation_rad) ** 2


def normalised_voltage(params: BeamParams, angle_beamwidths: Array) -> Array:
    """Return the voltage at `angle_beamwidths` half-power beamwidths from the axis."""
    if params.pattern == "gaussian":
        return np.exp(-0.5 * MU * angle_beamwidths**2)
    pedestal = 1.0 if params.pattern == "uniform" else 10.0 ** (-params.edge_taper_db / 20.0)
    exponent = params.taper_exponent
    return _aperture_voltage(
        angle_beamwidths * _u_per_beamwidth(pedestal, exponent), pedestal, exponent
    )


def _aperture_voltage(u: Array, pedestal: float, exponent: int) -> Array:
    share = (1.0 - pedestal) / (exponent + 1.0)
    value = pedestal * _lambda(1, u) + share * _lambda(exponent + 1, u)
    return np.asarray(value / (pedestal + share))


def _lambda(order: int, u: Array) -> Array:
    # Imported here: only patterns other than the Gaussian need it, and it costs half a second.
    from scipy.special import jv

    small = np.abs(u) < SMALL_U
    safe = np.where(small, 1.0, u)
    value = 2.0**order * math.factorial(order) * jv(order, safe) / safe**order
    return np.where(small, 1.0 - u**2 / (4.0 * (order + 1.0)), value)


# The root is the same for every sample of a pass.
@lru_cache(maxsize=64)
def _u_per_beamwidth(pedestal: float, exponent: int) -> float:
    half = bracketed_root(
        lambda u: float(_aperture_voltage(np.asarray(u), pedestal, exponent)) ** 2 - 0.5,
        *HALF_POWER_BETWEEN,
    )
    return 2.0 * half
