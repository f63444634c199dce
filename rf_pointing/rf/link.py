"""Carrier-to-noise density along a pass, for a beam that points straight at the target.

C/N0 = C/N0 at the zenith at the reference range - 20 log(range/reference) - extra atmosphere -
extra system noise. The zenith figure comes from a test, or from a link budget: EIRP + G - L_fs -
L_atm - L_pol - 10 log(k T_sys), for a satellite whose antenna looks at the station. The loss of the
beam pattern is not in here: the receiver applies it from where the beam really points.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, Params, parameter
from rf_pointing.rf.noise import AtmosphereParams, NoiseParams, atmosphere_loss_db, system_noise_k

# The reference of every C/N0 here: tests are made at high elevation.
ZENITH_RAD = 0.5 * math.pi


@dataclass(frozen=True, kw_only=True)
class LinkParams(Params):
    """Strength of the signal: C/N0 at the zenith at a reference range, beam on the target."""

    zenith_carrier_to_noise_db_hz: float = parameter(60.0, "C/N0 at the zenith", 0.0, 140.0)
    reference_range_m: float = parameter(500e3, "range at which that C/N0 is received", 1.0, 1e16)

    def level_db_hz(self, range_m: float, satellite_gain_db: float = 0.0) -> float:
        """Return the C/N0 of a beam on the target: that of the zenith over this distance.

        `satellite_gain_db` is that of its antenna towards the station, against the axis.
        """
        spreading_db = 20.0 * math.log10(range_m / self.reference_range_m)
        return self.zenith_carrier_to_noise_db_hz - spreading_db + satellite_gain_db


class Link:
    """C/N0 over range and elevation."""

    def __init__(
        self, params: LinkParams, atmosphere: AtmosphereParams, noise: NoiseParams
    ) -> None:
        self.params = params
        self.atmosphere = atmosphere
        self.noise = noise
        self._zenith_loss_db = float(atmosphere_loss_db(atmosphere, ZENITH_RAD))
        self._zenith_noise_k = float(system_noise_k(noise, atmosphere, ZENITH_RAD))

    def carrier_to_noise_db_hz(self, range_m: ArrayLike, elevation_rad: ArrayLike) -> Array:
        """Return C/N0 in dB-Hz for the beam on the target; elevation within [0, pi], range > 0."""
        distance = np.asarray(range_m, dtype=np.float64)
        if not (distance > 0.0).all():
            raise ValueError(f"range_m={distance} must be > 0")
        # Relative to the reference range, for which the zenith figure holds.
        spreading_db = 20.0 * np.log10(distance / self.params.reference_range_m)
        air_db = atmosphere_loss_db(self.atmosphere, elevation_rad) - self._zenith_loss_db
        noise_k = system_noise_k(self.noise, self.atmosphere, elevation_rad)
        noise_db = 10.0 * np.log10(noise_k / self._zenith_noise_k)
        return np.asarray(
            self.params.zenith_carrier_to_noise_db_hz - spreading_db - air_db - noise_db
        )
