"""Radio links of the interferometer: power budget, power ratios of all paths, coupling noise.

R = Pt Gt Gr/(Lp Pn), Lp = (4 pi rho f/c)^2, Pn = k T B F (PI83 eqs. 5-38 to 5-48, 8-17 to 8-19).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.measurement import phase_variance
from rf_pointing.array_sensors.interferometer.system import CarrierPlan
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

LOWEST_SNR = 10.0
"""Power ratio below which phase noise is not Gaussian and loops lose lock (10 dB)."""


@dataclass(frozen=True, kw_only=True)
class LinkParams(Params):
    """Receiver and antennas of one link.

    The constants are those that Tables 8-2 and 8-3 were computed with.
    """

    bandwidth_hz: float = parameter(100.0, "noise bandwidth", low=1e-3, high=1e10)
    noise_figure_db: float = parameter(10.0, "receiver noise figure", low=0.0, high=60.0)
    transmit_gain_db: float = parameter(3.0, "transmitting antenna gain", low=-30.0, high=60.0)
    receive_gain_db: float = parameter(3.0, "receiving antenna gain", low=-30.0, high=60.0)
    temperature_k: float = parameter(300.0, "reference temperature", low=1.0, high=1e4)
    # Rounded as in the report, whose tables hold to four digits only with these constants.
    boltzmann: float = parameter(1.38e-23, "Boltzmann constant in J/K", low=1.3e-23, high=1.5e-23)
    speed_of_light_m_s: float = parameter(3.0e8, "speed of light", low=2.9e8, high=3.1e8)

    @property
    def gains(self) -> float:
        """Product of both antenna gains, as a power ratio."""
        return float(10.0 ** (0.1 * (self.transmit_gain_db + self.receive_gain_db)))


def path_loss(
    range_m: ArrayLike,
    frequency_hz: ArrayLike,
    speed_of_light_m_s: float = 3.0e8,
    variant: str = CORRECTED,
) -> Array:
    """Return Lp as a power ratio (PI83 eq. 8-19).

    "published": (8 pi rho/lambda)^2 as eq. (5-39) reads, four times too much; (8-19) and the tables
    have 4 pi.
    """
    turns = 8.0 if is_published(variant) else 4.0
    distance = np.asarray(range_m, dtype=np.float64)
    # Zero range would give an infinite ratio, which the noise model takes for a perfect
    # measurement.
    if not np.all(distance > 0.0):
        raise ValueError(f"range_m={float(np.min(distance))} must be > 0")
    return (
        turns * np.pi * distance * np.asarray(frequency_hz, dtype=np.float64) / speed_of_light_m_s
    ) ** 2


def noise_power_w(link: LinkParams) -> float:
    """Return k T B F in watts (PI83 eqs. 5-41, 8-18)."""
    return float(
        link.boltzmann
        * link.temperature_k
        * link.bandwidth_hz
        * 10.0 ** (0.1 * link.noise_figure_db)
    )


def received_power_w(
    power_w: ArrayLike,
    range_m: ArrayLike,
    frequency_hz: ArrayLike,
    link: LinkParams,
    loss: str = CORRECTED,
) -> Array:
    """Return the received power in watts (PI83 eq. 5-38)."""
    return (
        np.asarray(power_w)
        * link.gains
        / path_loss(range_m, frequency_hz, link.speed_of_light_m_s, loss)
    )


def link_snr(
    power_w: ArrayLike, range_m: ArrayLike, frequency_hz: ArrayLike, link: LinkParams
) -> Array:
    """Return the power ratio of signal and noise (PI83 eqs. 5-42, 8-17).

    Inverse of `required_power_w`.
    """
    return received_power_w(power_w, range_m, frequency_hz, link) / noise_power_w(link)


def required_power_w(
    snr: ArrayLike, range_m: ArrayLike, frequency_hz: ArrayLike, link: LinkParams
) -> Array:
    """Return the radiated power in watts that gives `snr`; inverse of `link_snr`."""
    loss = path_loss(range_m, frequency_hz, link.speed_of_light_m_s)
    return np.asarray(snr) * noise_power_w(link) * loss / link.gains


@dataclass(frozen=True, kw_only=True)
class RadioParams(Params):
    """Radiated powers per carrier and element; the defaults are the report's simulation."""

    forward_power_w: float = parameter(
        2.2, "radiated by the active centre element", low=1e-9, high=1e6
    )
    return_power_w: float = parameter(1.1, "radiated by each passive element", low=1e-9, high=1e6)
    # Below it more power does not help: 1e-4 rad is that of 80 dB.
    phase_noise_rad: float = parameter(
        1e-4, "sigma of a loop's phase besides receiver noise", low=0.0, high=1.0
    )
    hardware_phase_rad: float = parameter(
        0.0, "sigma of a fixed, unknown phase of carrier and path", low=0.0, high=1.0
    )
    hardware_rate_rad_s: float = parameter(
        0.0, "sigma of a fixed, unknown error of a path's phase rate", low=0.0, high=100.0
    )
    hardware_coupling: float = parameter(
        0.0, "sigma of a fixed, unknown error of a coupling", low=0.0, high=1.0
    )


def signal_to_noise_ratios(
    outward_m: ArrayLike, back_m: ArrayLike, radio: RadioParams, plan: CarrierPlan, link: LinkParams
) -> tuple[Array, Array]:
    """Return the power ratios of forward link (..., K) and return links (..., K, n, n)."""
    out = np.asarray(outward_m, dtype=np.float64)[..., None]
    back = np.asarray(back_m, dtype=np.float64)[..., None, :, :]
    forward = link_snr(radio.forward_power_w, out, plan.forward_carriers_hz, link)
    return forward, link_snr(
        radio.return_power_w, back, plan.return_carriers_hz[:, None, None], link
    )


def amplitude_sigma(
    range_m: ArrayLike,
    radio: RadioParams,
    plan: CarrierPlan,
    link: LinkParams,
    variant: str = CORRECTED,
) -> Array:
    """Return the noise sigma (...) of one coupling, largest coupling one, from K carriers.

    "corrected": mean over the carriers, return power; "published": what the listing computes - only
    the last carrier's draw survives, is divided by nine all the same, and the forward power stands
    for the return power.
    """
    distance = np.asarray(range_m, dtype=np.float64)[..., None]
    if is_published(variant):
        # The listing's slip, kept for comparison: forward power on the return link.
        snr = link_snr(radio.forward_power_w, distance, plan.return_carriers_hz, link)
        return np.sqrt(phase_variance(snr[..., -1])) / plan.count
    snr = link_snr(radio.return_power_w, distance, plan.return_carriers_hz, link)
    # An amplitude relative to the carrier has the same variance as its phase, 1/(2R).
    return np.asarray(np.sqrt(np.sum(phase_variance(snr), axis=-1)) / plan.count)
