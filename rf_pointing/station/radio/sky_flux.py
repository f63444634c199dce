"""Flux of a body at a time, with the Moon's phase and the Sun as the station states it."""

import math
from functools import lru_cache

from rf_pointing.ephemeris.celestial import moon_phase_rad
from rf_pointing.radiometry.sources import FLUX_SOURCES, MOON, Flux, flux_of

# In this time the Moon's temperature changes by 0.1 K.
RENEWAL_S = 3600.0


def flux_at(name: str, frequency_hz: float, t_s: float, sun_flux_sfu: float | None = None) -> Flux:
    """Return the flux of a body of `FLUX_SOURCES`, as `flux_of`."""
    return _flux(name, frequency_hz, math.floor(t_s / RENEWAL_S), sun_flux_sfu)


@lru_cache(maxsize=64)
def _flux(name: str, frequency_hz: float, hour: int, sun_flux_sfu: float | None) -> Flux:
    t_s = RENEWAL_S * (hour + 0.5)
    phase_rad = moon_phase_rad(t_s) if name == MOON else 0.0
    return flux_of(name, frequency_hz, t_s, moon_phase_rad=phase_rad, sun_flux_sfu=sun_flux_sfu)


def has_flux(name: str, frequency_hz: float, t_s: float) -> bool:
    """Whether a flux of that name is published for this frequency."""
    try:
        return name in FLUX_SOURCES and bool(flux_at(name, frequency_hz, t_s))
    except ValueError:
        return False
