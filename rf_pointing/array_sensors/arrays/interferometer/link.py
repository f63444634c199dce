"""Power budgets: free-space links, nonlinear reflector, simple repeater, active transponder.

R = Pt Gt Gr/(Lp Pn), Lp = (4 pi rho f/c)^2, Pn = k T B F (PI83 eqs. 5-38 to 5-51, 8-17 to 8-19).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.mixer_noise import mixed_snr
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, PUBLISHED, is_published
from rf_pointing.core import Params, parameter

__all__ = [
    "LinkParams",
    "ReturnLink",
    "link_snr",
    "noise_power_w",
    "nonlinear_reflector",
    "path_loss",
    "received_power_w",
    "required_power_w",
    "simple_repeater",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LinkParams(Params):
    """Receiver and antennas of one link; the constants are those that Tables 8-2 and 8-3 were computed with."""

    bandwidth_hz: float = parameter(100.0, "noise bandwidth", low=1e-3, high=1e10)
    noise_figure_db: float = parameter(10.0, "receiver noise figure", low=0.0, high=60.0)
    transmit_gain_db: float = parameter(3.0, "transmitting antenna gain", low=-30.0, high=60.0)
    receive_gain_db: float = parameter(3.0, "receiving antenna gain", low=-30.0, high=60.0)
    temperature_k: float = parameter(300.0, "reference temperature", low=1.0, high=1e4)
    boltzmann: float = parameter(1.38e-23, "Boltzmann constant in J/K", low=1.3e-23, high=1.5e-23)
    speed_of_light_m_s: float = parameter(3.0e8, "speed of light", low=2.9e8, high=3.1e8)

    @property
    def gains(self) -> float:
        """Product of both antenna gains, as a power ratio."""
        return float(10.0 ** (0.1 * (self.transmit_gain_db + self.receive_gain_db)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnLink:
    """Power ratios at the transponder's input, at its output, and of the signal back at the active spacecraft."""

    snr_input: Array
    snr_output: Array
    snr_return: Array


def path_loss(
    range_m: ArrayLike, frequency_hz: ArrayLike, speed_of_light_m_s: float = 3.0e8, variant: str = CORRECTED
) -> Array:
    """Return Lp as a power ratio (PI83 eq. 8-19).

    "published": (8 pi rho/lambda)^2 as eq. (5-39) reads, four times too much; (8-19) and the tables have 4 pi.
    """
    turns = 8.0 if is_published(variant) else 4.0
    distance = np.asarray(range_m, dtype=np.float64)
    if not np.all(distance > 0.0):
        raise ValueError(f"range_m={float(np.min(distance))} must be > 0")
    return (turns * np.pi * distance * np.asarray(frequency_hz, dtype=np.float64) / speed_of_light_m_s) ** 2


def noise_power_w(link: LinkParams) -> float:
    """Return k T B F in watts (PI83 eqs. 5-41, 8-18)."""
    return float(link.boltzmann * link.temperature_k * link.bandwidth_hz * 10.0 ** (0.1 * link.noise_figure_db))


def received_power_w(
    power_w: ArrayLike, range_m: ArrayLike, frequency_hz: ArrayLike, link: LinkParams, loss: str = CORRECTED
) -> Array:
    """Return the received power in watts (PI83 eq. 5-38)."""
    return np.asarray(power_w) * link.gains / path_loss(range_m, frequency_hz, link.speed_of_light_m_s, loss)


def link_snr(power_w: ArrayLike, range_m: ArrayLike, frequency_hz: ArrayLike, link: LinkParams) -> Array:
    """Return the power ratio of signal and noise (PI83 eqs. 5-42, 8-17); inverse of `required_power_w`."""
    return received_power_w(power_w, range_m, frequency_hz, link) / noise_power_w(link)


def required_power_w(snr: ArrayLike, range_m: ArrayLike, frequency_hz: ArrayLike, link: LinkParams) -> Array:
    """Return the radiated power in watts that gives `snr`; inverse of `link_snr`."""
    loss = path_loss(range_m, frequency_hz, link.speed_of_light_m_s)
    return np.asarray(snr) * noise_power_w(link) * loss / link.gains


def nonlinear_reflector(
    power_w: float,
    range_m: ArrayLike,
    gain_db: float,
    outward_hz: float,
    back_hz: float,
    forward: LinkParams,
    back: LinkParams,
    loss: str = CORRECTED,
    mixing: str = PUBLISHED,
) -> ReturnLink:
    """Return the ratios of a mixer that multiplies two equal signals and reradiates (PI83 eqs. 5-38 to 5-48).

    `gain_db` is Gp in the report's sense: output power Gp Ps^2/2 with powers in watts.  `mixing` "corrected" counts
    all signal x noise products (see `mixed_snr`); the report's figures use "published".
    """
    signal, noise = received_power_w(power_w, range_m, outward_hz, forward, loss), noise_power_w(forward)
    gain = 10.0 ** (0.1 * gain_db)
    output = mixed_snr(signal / noise, signal / noise, mixing)
    retransmitted = gain * signal**2 / 2.0
    return _returned(signal / noise, output, retransmitted, range_m, back_hz, back, loss)


def simple_repeater(
    power_w: float,
    range_m: ArrayLike,
    gain_db: float,
    outward_hz: float,
    back_hz: float,
    forward: LinkParams,
    back: LinkParams,
    loss: str = CORRECTED,
) -> ReturnLink:
    """Return the ratios of a repeater whose local oscillator adds no noise (PI83 eqs. 5-49 to 5-51)."""
    signal = received_power_w(power_w, range_m, outward_hz, forward, loss)
    snr = signal / noise_power_w(forward)
    return _returned(snr, snr, 10.0 ** (0.1 * gain_db) * signal, range_m, back_hz, back, loss)


def _returned(
    snr_input: Array,
    snr_output: Array,
    retransmitted_w: Array,
    range_m: ArrayLike,
    back_hz: float,
    back: LinkParams,
    loss: str,
) -> ReturnLink:
    # Eqs. (5-46) to (5-48): the repeated noise keeps its ratio to the signal, thermal noise comes on top.
    signal = received_power_w(retransmitted_w, range_m, back_hz, back, loss)
    returned = signal / (signal / snr_output + noise_power_w(back))
    return ReturnLink(snr_input=snr_input, snr_output=snr_output, snr_return=returned)
