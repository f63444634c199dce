"""Loss and noise of the clear atmosphere along the line of sight.

Loss in dB = zenith loss * air mass; the air mass of a homogeneous spherical shell of height H above
a sphere R is m = sqrt((R/H sin e)^2 + 2R/H + 1) - R/H sin e: 1 at the zenith, 1/sin e high up,
finite on the horizon.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter, require_choice

__all__ = ["AtmosphereParams", "air_mass", "atmosphere_loss_db"]

MEAN_EARTH_RADIUS_M = 6_371_000.0

# Clear dry sky at the zenith, about what Goldstone sees.
ZENITH_LOSS_DB = {"S": 0.035, "X": 0.04, "Ka": 0.14}


@dataclass(frozen=True, kw_only=True)
class AtmosphereParams(Params):
    """Clear atmosphere as one absorbing layer."""

    zenith_loss_db: float = parameter(0.04, "loss at the zenith", low=0.0, high=20.0)
    physical_temperature_k: float = parameter(275.0, "mean temperature of the absorbing air", low=150.0, high=330.0)
    height_m: float = parameter(6000.0, "height of the equivalent homogeneous layer", low=500.0, high=20000.0)

    @classmethod
    def for_band(cls, band: str) -> Self:
        """Return a clear dry sky in band S, X or Ka."""
        require_choice("band", band, ZENITH_LOSS_DB)
        return cls(zenith_loss_db=ZENITH_LOSS_DB[band])


def air_mass(elevation_rad: ArrayLike, height_m: float) -> NDArray[np.float64]:
    """Return the path through the layer over its height; `elevation_rad` within [0, pi]."""
    elevation = np.asarray(elevation_rad, dtype=np.float64)
    if np.any(elevation < 0.0) or np.any(elevation > math.pi):
        raise ValueError(f"elevation_rad={elevation} must be >= 0 and <= pi")
    ratio = MEAN_EARTH_RADIUS_M / height_m
    rise = ratio * np.sin(elevation)
    return np.asarray(np.sqrt(rise**2 + 2.0 * ratio + 1.0) - rise)


def atmosphere_loss_db(params: AtmosphereParams, elevation_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the loss of the signal at this elevation."""
    return params.zenith_loss_db * air_mass(elevation_rad, params.height_m)
