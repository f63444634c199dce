"""Choices around the passive spacecraft's transponder: configuration, antennas, frequencies to avoid, Doppler.

PI83 chapter 6 in a form that a design can ask: each candidate with the bandwidth its receiver must accept, whether it
needs acquisition of a code, and the report's verdict.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.core import as_finite_array, require_between

__all__ = [
    "ANTENNAS",
    "AVOIDED_BANDS_HZ",
    "TRANSPONDERS",
    "Antenna",
    "Transponder",
    "antennas_for_cone",
    "choose_transponder",
    "frequency_conflicts",
    "range_rate_from_offsets",
]

Array = NDArray[np.float64]

AVOIDED_BANDS_HZ = {
    "shuttle S-band": (1.7e9, 2.3e9),
    "shuttle Ku-band low": (13.775e9, 14.0e9),
    "shuttle Ku-band high": (14.85e9, 15.15e9),
    "GPS L2": (1.2276e9 - 5e6, 1.2276e9 + 5e6),
    "GPS L1": (1.57542e9 - 5e6, 1.57542e9 + 5e6),
}
"""Bands in use by other systems (PI83 section 6.1; GPS with its 10 MHz)."""


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
    """Return the simplest configuration in reach of technology that fits the link (PI83 section 6.2, conclusions).

    `widest_input_hz` is the input bandwidth that the forward link can still carry; `interference` asks for a code.
    """
    require_between("widest_input_hz", widest_input_hz, 1e-3, None)
    fitting = [
        t
        for t in TRANSPONDERS
        if t.within_technology and t.bandwidth_hz <= widest_input_hz and (t.rejects_interference or not interference)
    ]
    if not fitting:
        raise ValueError(f"widest_input_hz={widest_input_hz} leaves no transponder, must be >= 100.0")
    return min(fitting, key=lambda t: t.complexity)


def antennas_for_cone(half_cone_deg: float, flush: bool = False) -> tuple[Antenna, ...]:
    """Return the element types whose pattern covers the cone, only flush ones if they must be stowed."""
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

    `offsets_hz` (K,) are received minus nominal frequencies: offset_n = oscillator - (fF_n + fR_n) rate/(2c).  All
    share the oscillator's offset, so differencing them against frequency leaves the Doppler shift (PI83 section 6.2).
    """
    received = as_finite_array("offsets_hz", offsets_hz, (plan.count,))
    mean_hz = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    design = np.stack([np.ones(plan.count), -(mean_hz - mean_hz[0]) / plan.speed_of_light_m_s], axis=1)
    solution, *_ = np.linalg.lstsq(design, received, rcond=None)
    rate = float(solution[1])
    return rate, float(solution[0]) + mean_hz[0] * rate / plan.speed_of_light_m_s
