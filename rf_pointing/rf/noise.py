"""System noise temperature from its parts, referred to the input of the low-noise amplifier.

T_sys = T_cosmic / L + T_air (1 - 1/L) + T_ground + T_dichroic + T_lna, L the loss of the atmosphere
there.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter, require_choice
from rf_pointing.rf.atmosphere import AtmosphereParams, atmosphere_loss_db

__all__ = ["BOLTZMANN_J_K", "NOISE_PRESETS", "NoiseParams", "system_noise_k"]

BOLTZMANN_J_K = 1.380649e-23

NOISE_PRESETS = {
    # 8.4-GHz HEMT in liquid helium 5.45 K (HEMT section II); S band scaled from it, noise falling with frequency.
    "S": {"lna_k": 4.0, "dichroic_k": 0.0},
    "X": {"lna_k": 5.45, "dichroic_k": 0.0},
    # Four-stage radiometer at 32 GHz 45 K (HEMT section VII); dichroic plate 1.34 K calculated (dichroic section V).
    "Ka": {"lna_k": 45.0, "dichroic_k": 1.34},
    # The same amplifier at 33.7 GHz; plate measured in DSS-13: 11 K (dichroic table 3).
    "KABLE": {"lna_k": 45.0, "dichroic_k": 11.0},
}


@dataclass(frozen=True, kw_only=True)
class NoiseParams(Params):
    """Noise temperature of each part of the receiving system."""

    lna_k: float = parameter(5.45, "low-noise amplifier at its input flange", low=0.0, high=5000.0)
    dichroic_k: float = parameter(0.0, "dichroic plate: reflection and ohmic loss", low=0.0, high=300.0)
    ground_k: float = parameter(8.0, "spillover, mirrors and feed losses", low=0.0, high=300.0)
    cosmic_k: float = parameter(2.725, "sky behind the atmosphere", low=0.0, high=10000.0)

    @classmethod
    def for_band(cls, band: str) -> Self:
        """Return a cryogenic front end in band S, X, Ka or KABLE (Ka at 33.7 GHz)."""
        require_choice("band", band, NOISE_PRESETS)
        return cls(**NOISE_PRESETS[band])


def system_noise_k(noise: NoiseParams, atmosphere: AtmosphereParams, elevation_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the system noise temperature at this elevation."""
    passed = 10.0 ** (-atmosphere_loss_db(atmosphere, elevation_rad) / 10.0)
    sky = noise.cosmic_k * passed + atmosphere.physical_temperature_k * (1.0 - passed)
    return np.asarray(sky + noise.ground_k + noise.dichroic_k + noise.lna_k)
