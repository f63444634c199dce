"""Links over the passive spacecraft of PI83: nonlinear reflector and repeater.

The power ratio after multiplying two noisy narrowband signals (eqs. 5-17 to 5-37), and that of the
signal which a nonlinear reflector or a repeater returns (eqs. 5-38 to 5-51).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.radio import (
    LinkParams,
    noise_power_w,
    received_power_w,
)
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, PUBLISHED, is_published
from rf_pointing.core.types import Array


def mixed_snr(snr1: ArrayLike, snr2: ArrayLike, variant: str = CORRECTED) -> Array:
    """Return the power ratio after mixing.

    2 R1 R2/(R1 + R2 + 2) published, R1 R2/(R1 + R2 + 1) corrected.  For equal inputs R^2/(R + 1),
    PI83 eq. (5-36), against R^2/(2R + 1): 3 dB apart at high ratios.
    """
    first, second = np.asarray(snr1, dtype=np.float64), np.asarray(snr2, dtype=np.float64)
    if is_published(variant):
        return 2.0 * first * second / (first + second + 2.0)
    return first * second / (first + second + 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnLink:
    """Power ratios at the transponder's input, at its output, and of the signal back at the active
    spacecraft.
    """

    snr_input: Array
    snr_output: Array
    snr_return: Array


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
    """Return the ratios of a mixer that multiplies two equal signals and reradiates (PI83 eqs. 5-38
    to 5-48).

    `gain_db` is Gp in the report's sense: output power Gp Ps^2/2 with powers in watts.  `mixing`
    "corrected" counts all signal x noise products (see `mixed_snr`); the report's figures use
    "published".
    """
    signal, noise = (
        received_power_w(power_w, range_m, outward_hz, forward, loss),
        noise_power_w(forward),
    )
    gain = 10.0 ** (0.1 * gain_db)
    output = mixed_snr(signal / noise, signal / noise, mixing)
    # Gain in the report's sense: output power over the square of the input power in watts.
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
    """Return the ratios of a repeater whose local oscillator adds no noise (PI83 eqs. 5-49 to
    5-51).
    """
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
    # Eqs. (5-46) to (5-48): the repeated noise keeps its ratio to the signal, thermal noise comes
    # on top.
    signal = received_power_w(retransmitted_w, range_m, back_hz, back, loss)
    returned = signal / (signal / snr_output + noise_power_w(back))
    return ReturnLink(snr_input=snr_input, snr_output=snr_output, snr_return=returned)
