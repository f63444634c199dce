"""Link budget of a station: gain, system noise with Sun and Moon in the beam, G/T and C/N0.

    G = 26 000 deg^2 / h^2              (0.6 of the aperture where h = 66 deg wavelength / diameter)
    C/N0 = EIRP + G - 20 log(4 pi range / wavelength) - A - L_pol - 10 log(k T_sys)

A body of the brightness T_b and the radius R, d away from the axis of a beam with the pattern p:

    T = T_b G/(4 pi) int p(x) 2 pi x f(x) dx,   f: share of the circle x that lies in the disc

Seen by a beam far wider than the disc that is flux times effective area over 2 k.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import SPEED_OF_LIGHT_M_S, Array
from rf_pointing.rf.beam import Beam, BeamParams
from rf_pointing.rf.link import Link
from rf_pointing.rf.noise import BOLTZMANN_J_K, atmosphere_loss_db

GAIN_DEG2 = 26_000.0
"""Gain times the square of the beamwidth: typical of dishes and Yagis."""
DISC_RAD = math.radians(0.266)
"""Mean radius of the Sun and of the Moon."""
MOON_K = 225.0
"""Mean of the new (140 K) and the full (280 K) Moon (ITU-R P.372)."""
# Quiet Sun at the frequencies of the Radio Solar Telescope Network: flux density in 1e-22 W/m^2/Hz
# at solar minimum.  An active Sun has up to three times as much below 3 GHz.
_SUN_MHZ = (100.0, 245.0, 410.0, 610.0, 1415.0, 2695.0, 4995.0, 8800.0, 15400.0, 35000.0)
_SUN_SFU = (2.0, 10.0, 22.0, 33.0, 52.0, 66.0, 110.0, 225.0, 510.0, 2480.0)
STEPS = 2000


def gain_of_beam_dbi(half_power_beamwidth_deg: float) -> float:
    """Return the gain of an antenna with a beam of this width."""
    return 10.0 * math.log10(GAIN_DEG2 / half_power_beamwidth_deg**2)


def zenith_level_db_hz(
    eirp_dbw: float, gain_dbi: float, frequency_hz: float, range_m: float, loss_db: float,
    noise_k: float,
) -> float:  # fmt: skip
    """Return the C/N0 of a satellite that sends `eirp_dbw`; `loss_db` is of air, polarisation."""
    spreading_db = 20.0 * math.log10(4.0 * math.pi * range_m * frequency_hz / SPEED_OF_LIGHT_M_S)
    density_dbw_hz = 10.0 * math.log10(BOLTZMANN_J_K * noise_k)
    return eirp_dbw + gain_dbi - spreading_db - loss_db - density_dbw_hz


def sun_brightness_k(frequency_hz: float) -> float:
    """Return the brightness temperature of the quiet Sun's disc, 100 MHz to 35 GHz and beyond."""
    level = np.interp(math.log(1e-6 * frequency_hz), np.log(_SUN_MHZ), np.log(_SUN_SFU))
    wavelength_m = SPEED_OF_LIGHT_M_S / frequency_hz
    solid_angle = math.pi * DISC_RAD**2
    flux_w_m2_hz = 1e-22 * math.exp(float(level))
    return flux_w_m2_hz * wavelength_m**2 / (2.0 * BOLTZMANN_J_K * solid_angle)


def disc_noise_k(
    brightness_k: float, gain_dbi: float, beam: Beam, distance_rad: ArrayLike
) -> Array:
    """Return the noise (n,) of a disc of the Sun's size, (n,) away from the axis of the beam."""
    # Farther than a half turn, as where nobody looks, is the other side of the sky.
    apart = np.minimum(np.atleast_1d(np.asarray(distance_rad, dtype=np.float64)), math.pi)[:, None]
    # In steps of the beam where it is narrower than the disc, over the rings that the disc reaches.
    inner = np.maximum(apart - DISC_RAD, 0.0)
    ring = inner + (apart + DISC_RAD - inner) * (np.arange(STEPS) + 0.5) / STEPS
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (ring**2 + apart**2 - DISC_RAD**2) / (2.0 * ring * apart)
    # A beam in the middle of the disc: whole circles.
    share = np.arccos(np.clip(np.where(apart > 0.0, cosine, -1.0), -1.0, 1.0)) / math.pi
    power = np.sum(beam.power_gain(ring, 0.0) * ring * share, axis=1)
    width = (apart + DISC_RAD - inner)[:, 0] / STEPS
    return np.asarray(brightness_k * 10.0 ** (0.1 * gain_dbi) * 0.5 * power * width)


def noise_parts_k(
    link: Link, beam: BeamParams, gain_dbi: float, frequency_hz: float, elevation_rad: Array,
    sun_rad: ArrayLike = math.inf, moon_rad: ArrayLike = math.inf,
) -> dict[str, Array]:  # fmt: skip
    """Return what each part adds to the noise temperature, (n,) each; `system` is the sum.

    `sun_rad` and `moon_rad` are their distances (n,) from the axis of the beam.
    """
    passed = 10.0 ** (-0.1 * atmosphere_loss_db(link.atmosphere, elevation_rad))
    bodies = {"sun": (sun_brightness_k(frequency_hz), sun_rad), "moon": (MOON_K, moon_rad)}
    parts = {
        "cosmic": link.noise.cosmic_k * passed,
        "air": link.atmosphere.physical_temperature_k * (1.0 - passed),
        "ground": np.full_like(passed, link.noise.ground_k),
        "dichroic": np.full_like(passed, link.noise.dichroic_k),
        "chain": np.full_like(passed, link.noise.lna_k),
        **{
            name: passed * disc_noise_k(kelvin, gain_dbi, Beam(beam), apart)
            for name, (kelvin, apart) in bodies.items()
        },
    }
    return parts | {"system": np.sum(list(parts.values()), axis=0)}
