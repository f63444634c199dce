"""Flux density, size and stated error of Sun, Moon and strong radio sources over frequency.

Radio sources follow the polynomials of PB17 (Perley and Butler 2017, table 6, epoch 2016.0), whose
scale is good to 3 to 5 %:

    log10 S[Jy] = a0 + a1 g + a2 g^2 + ...,   g = log10 f[GHz]

and above their range the slopes of BAARS (Baars et al. 1977), joined at its end.  Cassiopeia A
fades by 0.67 % a year (Trotter et al. 2017, 1.4 GHz), Taurus A by 0.167 % (Aller and Reynolds
1985).  The Moon's temperature is that of the RATAN-600 handbook (SAO RAS, after Krotikov and
Troitskii) as a function of wavelength and phase, 4 % below 1 cm and 3 % above.  The quiet Sun's
flux is that of `rf/budget.py`; a value of the day replaces it.
"""

import math
from dataclasses import dataclass

from rf_pointing.core import require_between
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.dates import DAY_S
from rf_pointing.rf.budget import DISC_RAD, sun_brightness_k
from rf_pointing.rf.noise import BOLTZMANN_J_K

JANSKY = 1e-26
SOLAR_FLUX_UNIT = 1e-22
SUN, MOON = "Sun", "Moon"
# Error of the quiet Sun (an active one has up to three times as much), and of a day's value.
QUIET_SUN_ERROR, GIVEN_SUN_ERROR = 0.2, 0.05
EPOCH_2016_S = 1451606400.0
YEAR_S = 365.25 * DAY_S
# Wavelengths for which the Moon's temperature is stated.
MOON_CM = 0.1, 30.0


@dataclass(frozen=True, kw_only=True)
class Flux:
    """Flux density of a source outside of the air, its relative error, and its size.

    `radius_rad` is that of a disc of even brightness, 0 for a point.
    """

    name: str
    flux_w_m2_hz: float
    relative_error: float
    radius_rad: float
    source: str


@dataclass(frozen=True)
class _Spectrum:
    coefficients: tuple[float, ...]
    range_ghz: tuple[float, float]
    slope: float
    highest_ghz: float
    fading: float
    diameter_arcmin: float


# The diameters are those of discs with the rms width of the source.
_SPECTRA = {
    "Cassiopeia A": _Spectrum(
        (3.3584, -0.7518, -0.0347, -0.0705), (0.2, 4.0), -0.770, 31.0, 0.0067, 4.3
    ),
    "Cygnus A": _Spectrum(
        (3.3498, -1.0022, -0.2246, 0.0227, 0.0425), (0.05, 12.0), -1.244, 31.0, 0.0, 1.9
    ),
    "Taurus A": _Spectrum(
        (2.9516, -0.2173, -0.0473, -0.0674), (0.05, 4.0), -0.299, 35.0, 0.00167, 4.4
    ),
    "Virgo A": _Spectrum((2.4466, -0.8116, -0.0483), (0.05, 3.0), -0.856, 25.0, 0.0, 1.0),
}
# Names with a flux.
FLUX_SOURCES = (SUN, MOON, *_SPECTRA)


def flux_of(
    name: str,
    frequency_hz: float,
    t_s: float,
    *,
    moon_phase_rad: float = 0.0,
    sun_flux_sfu: float | None = None,
) -> Flux:
    """Return the flux of a source of `FLUX_SOURCES` at a time, UTC in s since 1970.

    `moon_phase_rad` is 0 at the full Moon and grows with time.  `sun_flux_sfu` is the day's value
    at this frequency, in 1e-22 W/m^2/Hz.

    Raises
    ------
    ValueError
        A name without a flux, and a frequency for which none is published.
    """
    wavelength_m = SPEED_OF_LIGHT_M_S / frequency_hz
    if name == SUN:
        if sun_flux_sfu is None:
            require_between("frequency_hz of the quiet Sun", frequency_hz, 1e8, 5e10)
            flux = _of_disc(sun_brightness_k(frequency_hz), wavelength_m)
            return _flux(name, flux, QUIET_SUN_ERROR, DISC_RAD, "the quiet Sun (RSTN)")
        require_between("sun_flux_sfu", sun_flux_sfu, 0.1, 1e6)
        return _flux(
            name, SOLAR_FLUX_UNIT * sun_flux_sfu, GIVEN_SUN_ERROR, DISC_RAD, "the day's value"
        )
    if name == MOON:
        kelvin, error = moon_brightness_k(wavelength_m, moon_phase_rad)
        return _flux(name, _of_disc(kelvin, wavelength_m), error, DISC_RAD, "RATAN-600 handbook")
    if name not in _SPECTRA:
        raise ValueError(
            f"name={name!r} has no published flux here; those that have one: "
            f"{', '.join(FLUX_SOURCES)}"
        )
    one, ghz = _SPECTRA[name], 1e-9 * frequency_hz
    require_between(
        f"frequency_hz of the flux of {name}",
        ghz * 1e9,
        1e9 * one.range_ghz[0],
        1e9 * one.highest_ghz,
    )
    within = min(ghz, one.range_ghz[1])
    log = sum(a * math.log10(within) ** power for power, a in enumerate(one.coefficients))
    log += one.slope * math.log10(ghz / within)
    fading = (1.0 - one.fading) ** ((t_s - EPOCH_2016_S) / YEAR_S)
    error, source = (0.05, "PB17") if ghz <= one.range_ghz[1] else (0.08, "PB17, slope of BAARS")
    return _flux(
        name, 10.0**log * JANSKY * fading, error, math.radians(one.diameter_arcmin / 120.0), source
    )


def moon_brightness_k(wavelength_m: float, phase_rad: float) -> tuple[float, float]:
    """Return the mean brightness temperature of the Moon's disc and its relative error.

    `phase_rad` is 0 at the full Moon and grows with time: the surface warms and cools later, the
    deeper the radiation comes from.
    """
    cm = 100.0 * wavelength_m
    if not MOON_CM[0] <= cm:
        raise ValueError(
            f"wavelength_m={wavelength_m:.4f} must be >= {0.01 * MOON_CM[0]:g} for the Moon"
        )
    # Longer waves come from where the temperature is constant.
    cm = min(cm, MOON_CM[1])
    mean = 206.06 + 1.6308 * cm - 0.043774 * cm**2 + 0.00043042 * cm**3
    # Stated to 12 cm, and 50 beyond 20 cm.
    swing = min(1.2207 + 5.3788 * cm - 0.26528 * cm**2 + 0.0064374 * cm**3, 50.0)
    if cm <= 1.3:
        lag_deg = 42.745 + 1.042 * math.log(cm)
    else:
        lag_deg = 45.0 if cm > 4.0 else 26.402 + 18.625 * cm - 6.3123 * cm**2 + 0.70462 * cm**3
    kelvin = mean * (1.0 + math.cos(phase_rad - math.radians(lag_deg)) / swing)
    return kelvin, 0.04 if cm < 1.0 else 0.03


def _of_disc(brightness_k: float, wavelength_m: float) -> float:
    return 2.0 * BOLTZMANN_J_K * brightness_k * math.pi * DISC_RAD**2 / wavelength_m**2


def _flux(name: str, flux_w_m2_hz: float, error: float, radius_rad: float, source: str) -> Flux:
    return Flux(
        name=name, flux_w_m2_hz=flux_w_m2_hz, relative_error=error, radius_rad=radius_rad,
        source=source,
    )  # fmt: skip
