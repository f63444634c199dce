"""Figures of an antenna by the noise of a known source: G/T, system noise, aperture efficiency.

    Y   = power on the source / power off it
    G/T = 8 pi k (Y - 1) K L / (S lambda^2)
    T_A = S A_e / (2 k K L),   A_e = G lambda^2 / 4 pi,   T_sys = T_A / (Y - 1)

S is the flux density of both polarisations above the air, of which an antenna takes half, K the
size correction of `disc.py` and L the loss of the air.  One source gives G/T alone.  With the gain
it gives the system noise, and with the system noise (a hot load, a stated receiver) the gain.
"""

import math
from dataclasses import dataclass

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.sources import Flux
from rf_pointing.rf.beam import BeamParams
from rf_pointing.rf.noise import BOLTZMANN_J_K

# Relative error of the loss of the air in dB: that of a model without weather.
AIR_ERROR = 0.1
# Envelope of the side lobes (ITU-R S.465): 32 - 25 log10(angle/deg) dBi from 1 deg on.
SIDE_LOBE_DB = 32.0, 25.0
FARTHEST_LOBE_DBI = -10.0


@dataclass(frozen=True, kw_only=True)
class Sigma:
    """A number and its standard deviation."""

    value: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of merit that follow from one source; temperatures with the air as it is.

    Attributes
    ----------
    g_over_t_db_k : G/T in dB/K.
    system_noise_k, efficiency : each with the other, or the gain, as it is stated: None without it.
    correction : K; `relative_error` of the flux is the larger part of every sigma.
    """

    y: Sigma
    g_over_t_db_k: Sigma
    system_noise_k: Sigma | None
    efficiency: Sigma | None
    correction: float
    relative_error: float


def figures(
    y: tuple[float, float],
    flux: Flux,
    frequency_hz: float,
    beam: BeamParams,
    *,
    air_loss_db: float,
    gain_dbi: float | None = None,
    system_noise_k: float | None = None,
    diameter_m: float | None = None,
) -> Figures:
    """Return the figures of a Y-factor and its sigma.

    `gain_dbi` gives the system noise, `system_noise_k` and `diameter_m` the aperture efficiency.
    ValueError for a Y-factor that is not above 1.
    """
    if not y[0] > 1.0:
        raise ValueError(f"y={y[0]:.4f} must be > 1: the source adds no power")
    wavelength_m = SPEED_OF_LIGHT_M_S / frequency_hz
    correction = DiscResponse(beam).correction(flux.radius_rad / beam.half_power_beamwidth_rad)
    loss = 10.0 ** (0.1 * air_loss_db)
    error = math.hypot(flux.relative_error, y[1] / (y[0] - 1.0), AIR_ERROR * math.log(loss))
    ratio = 8.0 * math.pi * BOLTZMANN_J_K * (y[0] - 1.0) * correction * loss
    g_over_t = ratio / (flux.flux_w_m2_hz * wavelength_m**2)
    noise = efficiency = None
    if gain_dbi is not None:
        kelvin = 10.0 ** (0.1 * gain_dbi) / g_over_t
        noise = Sigma(value=kelvin, sigma=error * kelvin)
    if system_noise_k is not None and diameter_m is not None:
        share = g_over_t * system_noise_k / (math.pi * diameter_m / wavelength_m) ** 2
        efficiency = Sigma(value=share, sigma=error * share)
    db = 10.0 / math.log(10.0)
    return Figures(
        y=Sigma(value=y[0], sigma=y[1]), correction=correction, relative_error=flux.relative_error,
        g_over_t_db_k=Sigma(value=db * math.log(g_over_t), sigma=db * error),
        system_noise_k=noise, efficiency=efficiency,
    )  # fmt: skip


def source_noise_k(flux: Flux, frequency_hz: float, gain_dbi: float) -> float:
    """Return the antenna temperature of a point with this flux on the axis: T_A for K = 1."""
    area_m2 = 10.0 ** (0.1 * gain_dbi) * (SPEED_OF_LIGHT_M_S / frequency_hz) ** 2 / (4.0 * math.pi)
    return float(flux.flux_w_m2_hz * area_m2 / (2.0 * BOLTZMANN_J_K))


def side_lobe_noise_k(flux: Flux, frequency_hz: float, angle_rad: float) -> float:
    """Return the most that a source so far off the axis adds through the side lobes."""
    apart_deg = max(math.degrees(angle_rad), 1.0)
    lobe_dbi = max(SIDE_LOBE_DB[0] - SIDE_LOBE_DB[1] * math.log10(apart_deg), FARTHEST_LOBE_DBI)
    return source_noise_k(flux, frequency_hz, lobe_dbi)
