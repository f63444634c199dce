"""System noise temperature from its parts, and the loss of the clear atmosphere.

Noise is referred to the flange of the antenna, where the chain of cables and amplifiers begins; L
is the loss of the atmosphere:

    T_sys = T_cosmic / L + T_air (1 - 1/L) + T_ground + T_dichroic + T_lna

L in dB = zenith loss * air mass.  The air mass of a homogeneous shell of height H above a sphere R,

    m = sqrt((R/H sin e)^2 + 2R/H + 1) - R/H sin e,

is 1 at the zenith, 1/sin e high up and finite on the horizon.  At 5.5 deg the lines of ITU-R P.676
Annex 1 along bent rays give 0.7 % less (2 GHz) to 1.7 % more (20 GHz); the cosecant of its Annex 2
is 4.8 % more than this.  A chain adds T_1 + T_2/G_1 +
T_3/(G_1 G_2) + ... (Friis); a part that loses L at the temperature T has the noise T (L - 1) and
the gain 1/L, one of the noise figure F has 290 K (F - 1).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, Params, parameter

MEAN_EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, kw_only=True)
class AtmosphereParams(Params):
    """Clear atmosphere as one absorbing layer."""

    zenith_loss_db: float = parameter(0.04, "loss at the zenith", 0.0, 20.0)
    physical_temperature_k: float = parameter(
        275.0, "mean temperature of the absorbing air", 150.0, 330.0
    )
    height_m: float = parameter(
        6000.0, "height of the equivalent homogeneous layer", 500.0, 20000.0
    )


def air_mass(elevation_rad: ArrayLike, height_m: float) -> Array:
    """Return the path through the layer over its height; `elevation_rad` within [0, pi]."""
    elevation = np.asarray(elevation_rad, dtype=np.float64)
    if ((elevation < 0.0) | (elevation > math.pi)).any():
        raise ValueError(f"elevation_rad={elevation} must be >= 0 and <= pi")
    ratio = MEAN_EARTH_RADIUS_M / height_m
    rise = ratio * np.sin(elevation)
    return np.asarray(np.sqrt(rise**2 + 2.0 * ratio + 1.0) - rise)


def atmosphere_loss_db(params: AtmosphereParams, elevation_rad: ArrayLike) -> Array:
    """Return the loss of the signal at this elevation."""
    return params.zenith_loss_db * air_mass(elevation_rad, params.height_m)


BOLTZMANN_J_K = 1.380649e-23
REFERENCE_K = 290.0
"""Temperature at which noise figures are stated (HEMT section II)."""


class Stage(NamedTuple):
    """One part of the chain behind the antenna: noise at its own input, and gain."""

    noise_k: float
    gain_db: float

    @classmethod
    def of_loss(cls, loss_db: float, physical_k: float = REFERENCE_K) -> "Stage":
        """Return a cable, filter or coupler that loses so much at this temperature."""
        return cls(physical_k * (10.0 ** (0.1 * loss_db) - 1.0), -loss_db)


def noise_of_figure_k(figure_db: float) -> float:
    """Return the noise temperature of an amplifier with this noise figure."""
    return float(REFERENCE_K * (10.0 ** (0.1 * figure_db) - 1.0))


def noise_of_plate_k(loss_db: float, physical_k: float = REFERENCE_K) -> float:
    """Return what a plate in the beam adds behind itself: it emits what it does not pass."""
    return float(physical_k * (1.0 - 10.0 ** (-0.1 * loss_db)))


def cascade_k(stages: Sequence[Stage]) -> float:
    """Return the noise temperature of stages in their order, at the input of the first (Friis)."""
    noise_k = 0.0
    for stage in reversed(stages):
        noise_k = stage.noise_k + noise_k / 10.0 ** (0.1 * stage.gain_db)
    return noise_k


def sky_k(frequency_hz: float) -> float:
    """Return the mean noise of the sky behind the air: cosmic, and that of the Galaxy.

    The Galaxy is 24.1 K at 310 MHz and falls with the power 2.599 of the frequency (ARCADE 2,
    Fixsen et al. 2011); single directions differ by a factor of 3.
    """
    return float(2.725 + 24.1 * (310e6 / frequency_hz) ** 2.599)


@dataclass(frozen=True, kw_only=True)
class NoiseParams(Params):
    """Noise temperature of each part of the receiving system.

    The defaults are those of X band: an 8.4-GHz HEMT in liquid helium (HEMT section II).  The
    parameter file of each band has its own, with their sources in docs/math/link.md.
    """

    lna_k: float = parameter(
        5.45, "chain of amplifiers and losses behind the antenna, at its flange", 0.0, 5000.0
    )
    dichroic_k: float = parameter(0.0, "dichroic plate: reflection and ohmic loss", 0.0, 300.0)
    ground_k: float = parameter(8.0, "spillover, mirrors and feed losses", 0.0, 300.0)
    cosmic_k: float = parameter(2.725, "sky behind the atmosphere", 0.0, 10000.0)


def system_noise_k(
    noise: NoiseParams, atmosphere: AtmosphereParams, elevation_rad: ArrayLike
) -> Array:
    """Return the system noise temperature at this elevation."""
    # The air emits what it absorbs, at its own temperature.
    passed = 10.0 ** (-atmosphere_loss_db(atmosphere, elevation_rad) / 10.0)
    sky = noise.cosmic_k * passed + atmosphere.physical_temperature_k * (1.0 - passed)
    return np.asarray(sky + noise.ground_k + noise.dichroic_k + noise.lna_k)
