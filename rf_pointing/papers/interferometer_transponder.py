"""The passive spacecraft of PI83: mixers, reflector and repeater links, choice of a transponder.

Lines: input s0 + a1 m1 cos(w1 t + phi1) + a2 m2 cos(w2 t + phi2), m = +-1, through a square law
c v^2 (eqs. 5-4 to 5-6) or a diode c exp(q v/kT), whose lines are products of modified Bessel
functions (eqs. 5-10 to 5-16).  The difference line carries the product code m1 m2.

Noise: power ratio after multiplying two noisy narrowband signals (eqs. 5-17 to 5-37), and of the
signal that a nonlinear reflector or a repeater returns (eqs. 5-38 to 5-51).

Choices (chapter 6): each candidate with the bandwidth its receiver must accept, whether it needs
acquisition of a code, and the report's verdict.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.interferometer.radio import LinkParams, noise_power_w, received_power_w
from rf_pointing.array_sensors.interferometer.system import CarrierPlan
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, PUBLISHED, is_published
from rf_pointing.core import as_finite_array, require_between

Array = NDArray[np.float64]
# Enough for arguments up to 30, which the function checks.
_BESSEL_TERMS = 60
AVOIDED_BANDS_HZ = {
    "shuttle S-band": (1.7e9, 2.3e9),
    "shuttle Ku-band low": (13.775e9, 14.0e9),
    "shuttle Ku-band high": (14.85e9, 15.15e9),
    "GPS L2": (1.2276e9 - 5e6, 1.2276e9 + 5e6),
    "GPS L1": (1.57542e9 - 5e6, 1.57542e9 + 5e6),
}
"""Bands in use by other systems (PI83 section 6.1; GPS with its 10 MHz)."""


def square_law_lines(bias: float, amplitude1: float, amplitude2: float) -> dict[str, float]:
    """Return the amplitude of each line of v^2 (PI83 eq. 5-6).

    Dc, difference, f1, f2, 2f1, 2f2, sum.
    """
    return {
        "dc": bias**2 + 0.5 * amplitude1**2 + 0.5 * amplitude2**2,
        "difference": amplitude1 * amplitude2,
        "f1": 2.0 * bias * amplitude1,
        "f2": 2.0 * bias * amplitude2,
        "2f1": 0.5 * amplitude1**2,
        "2f2": 0.5 * amplitude2**2,
        "sum": amplitude1 * amplitude2,
    }


def exponential_line(
    order1: int, order2: int, drive1: float, drive2: float, code1: int = 1, code2: int = 1, bias: float = 0.0
) -> float:
    """Return the amplitude of cos(order1 w1 t +- order2 w2 t) of exp(x), x = q v/kT (PI83 eq.
    5-16).

    `drive` y = q a/kT, `code` the biphase value +-1 (seen only by odd orders, eq. 5-15), `bias` q
    s0/kT.  With both orders above zero the sum and the difference line have this amplitude each.
    """
    line = math.exp(bias)
    for order, drive, code in ((order1, drive1, code1), (order2, drive2, code2)):
        if code not in (-1, 1):
            raise ValueError(f"code={code} must be -1 or 1")
        line *= code**order * modified_bessel(order, drive) * (2.0 if order else 1.0)
    # A product of two cosines is half a sum and half a difference line.
    return 0.5 * line if order1 and order2 else line


def modified_bessel(order: int, argument: float) -> float:
    """Return I_n(x) by its power series (PI83 eq. 5-14), for orders n >= 0 and |x| <= 30."""
    if order < 0 or abs(argument) > 30.0:
        raise ValueError(f"order={order} must be >= 0 and argument={argument} within +-30")
    half = 0.5 * argument
    terms = (half ** (order + 2 * k) / (math.factorial(k) * math.factorial(order + k)) for k in range(_BESSEL_TERMS))
    return math.fsum(terms)


def product_code(code1: ArrayLike, code2: ArrayLike) -> Array:
    """Return the code m1 m2 on the reradiated signal (PI83 eq. 5-7).

    Equal codes give a bare carrier.
    """
    first, second = np.asarray(code1, dtype=np.float64), np.asarray(code2, dtype=np.float64)
    # Codes of other values would change the power, not only the sign.
    if first.shape != second.shape or not np.all(np.isin(np.stack([first, second]), (-1.0, 1.0))):
        raise ValueError("code1 and code2 must be equally long and of values -1 and 1")
    return first * second


def signal_to_noise(amplitude: ArrayLike, noise_sigma: ArrayLike) -> Array:
    """Return the power ratio a^2/(2 sigma^2) of a sinusoid in narrowband noise (PI83 eqs. 5-22 to
    5-24).
    """
    return np.asarray(amplitude, dtype=np.float64) ** 2 / (2.0 * np.asarray(noise_sigma, dtype=np.float64) ** 2)


def mixed_powers_w(
    signal1_w: float, noise1_w: float, signal2_w: float, noise2_w: float, variant: str = CORRECTED
) -> tuple[float, float]:
    """Return the signal and noise power at the difference frequency of the product (PI83 eqs. 5-29
    to 5-33).

    "published" (5-33) counts half of each signal x noise product: it takes the in-phase one and
    leaves out the quadrature one of the same power.
    """
    # The quadrature part of each signal x noise product has the same power as the in-phase part.
    share = 0.25 if is_published(variant) else 0.5
    noise = share * (signal1_w * noise2_w + signal2_w * noise1_w) + 0.5 * noise1_w * noise2_w
    return 0.5 * signal1_w * signal2_w, noise


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
    signal, noise = received_power_w(power_w, range_m, outward_hz, forward, loss), noise_power_w(forward)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Transponder:
    """One configuration of PI83 section 6.2; `bandwidth_hz` is what its input must pass."""

    name: str
    bandwidth_hz: float
    rejects_interference: bool
    within_technology: bool
    complexity: int
    weakness: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Antenna:
    """One element type of PI83 section 6.3 with the half-cone that its pattern serves."""

    name: str
    half_cone_deg: float
    protrudes: bool


TRANSPONDERS = (
    Transponder(
        name="multiple-carrier CW repeater",
        bandwidth_hz=100.0,
        rejects_interference=False,
        within_technology=True,
        complexity=1,
        weakness="can be captured by an interfering signal",
    ),
    Transponder(
        name="coherent PN transponder",
        bandwidth_hz=100.0,
        rejects_interference=True,
        within_technology=True,
        complexity=3,
        weakness="code generator and acquisition cost power",
    ),
    Transponder(
        name="SAW/clipper PN transponder",
        bandwidth_hz=1e6,
        rejects_interference=True,
        within_technology=True,
        complexity=2,
        weakness="gate jitter moves the returned code: high signal-to-noise ratio only",
    ),
    Transponder(
        name="SAW/CCD PN transponder",
        bandwidth_hz=10.0,
        rejects_interference=True,
        within_technology=False,
        complexity=4,
        weakness="exceeds the SAW and CCD technology of 1983",
    ),
)
ANTENNAS = (
    Antenna(name="crossed dipole", half_cone_deg=45.0, protrudes=True),
    Antenna(name="crossed slot", half_cone_deg=45.0, protrudes=False),
    Antenna(name="quad-ridge horn", half_cone_deg=15.0, protrudes=True),
)


def choose_transponder(interference: bool, widest_input_hz: float = 1e3) -> Transponder:
    """Return the simplest feasible configuration that fits the link (PI83 section 6.2).

    `widest_input_hz` is the input bandwidth that the forward link can still carry; `interference`
    requires a code.
    """
    require_between("widest_input_hz", widest_input_hz, 1e-3, None)
    fitting = [
        t
        for t in TRANSPONDERS
        if t.within_technology and t.bandwidth_hz <= widest_input_hz and (t.rejects_interference or not interference)
    ]
    if not fitting:
        raise ValueError(f"widest_input_hz={widest_input_hz} leaves no transponder, must be >= 100.0")
    # The simplest one that fits is the report's own conclusion.
    return min(fitting, key=lambda t: t.complexity)


def antennas_for_cone(half_cone_deg: float, flush: bool = False) -> tuple[Antenna, ...]:
    """Return the element types whose pattern covers the cone, only flush ones if they must be
    stowed.
    """
    return tuple(a for a in ANTENNAS if a.half_cone_deg >= half_cone_deg and not (flush and a.protrudes))


def frequency_conflicts(plan: CarrierPlan) -> tuple[str, ...]:
    """Return which link of `plan` lies in which band in use, empty if none.

    The report's own return link, 2.0 to 2.41 GHz, lies in the shuttle's S-band.
    """
    links = (("forward", plan.forward_carriers_hz), ("return", plan.return_carriers_hz))
    return tuple(
        f"{link} carriers in {band}"
        for link, carriers in links
        for band, (low, high) in AVOIDED_BANDS_HZ.items()
        if np.any((carriers >= low) & (carriers <= high))
    )


def range_rate_from_offsets(offsets_hz: ArrayLike, plan: CarrierPlan) -> tuple[float, float]:
    """Return two-way path rate in m/s and the transponder's oscillator offset in Hz.

    `offsets_hz` (K,) are received minus nominal frequencies: offset_n = oscillator - (fF_n + fR_n)
    rate/(2c).  All share the oscillator's offset, so differencing them against frequency leaves the
    Doppler shift (PI83 section 6.2).
    """
    received = as_finite_array("offsets_hz", offsets_hz, (plan.count,))
    mean_hz = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    # Offset against frequency: the oscillator is the constant, Doppler the slope.
    design = np.stack([np.ones(plan.count), -(mean_hz - mean_hz[0]) / plan.speed_of_light_m_s], axis=1)
    solution, *_ = np.linalg.lstsq(design, received, rcond=None)
    rate = float(solution[1])
    return rate, float(solution[0]) + mean_hz[0] * rate / plan.speed_of_light_m_s
