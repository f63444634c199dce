"""The report's design tables, computed: cycle errors (7-1), carriers against power ratio (8-1), powers (8-2, 8-3)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_probability import required_ratio, step_error_probability
from rf_pointing.array_sensors.arrays.interferometer.carriers import frequency_ratio
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams, required_power_w
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import require_between, require_choice

__all__ = [
    "CarrierCountRow",
    "carrier_count_row",
    "carrier_count_table",
    "cycle_error_table",
    "link_powers_w",
]

SYSTEMS = ("CFT", "DFT")
_LOWEST_HZ = 1500.0
_HIGHEST_HZ = {"CFT": 2.5e9, "DFT": 100e6}
_FLOOR_DB = {"CFT": 10.0, "DFT": 10.0 + 10.0 * math.log10(2.0)}
_SOLVER_LIMIT_DB = 110.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CarrierCountRow:
    """One row of Table 8-1: cycles per step and the power ratio of each link that K carriers need."""

    carriers: int
    step_probability: float
    ratio: float
    snr_db: float


def cycle_error_table(ratios: Sequence[float], snr_db: Sequence[float]) -> NDArray[np.float64]:
    """Return p_ei (len(snr_db), len(ratios)) (PI83 Table 7-1)."""
    return np.array([[step_error_probability(nu, 10.0 ** (0.1 * r)) for nu in ratios] for r in snr_db])


def carrier_count_row(
    carriers: int, system: str, total_probability: float = 0.001, variant: str = CORRECTED
) -> CarrierCountRow:
    """Return the row of Table 8-1 for K carriers of the "CFT" or "DFT" system.

    "published": K - 1 steps for both systems, the ratio limited to 110 dB, where the author's iteration stopped.
    "corrected": DFT climbs from difference to difference in K - 2 steps (K >= 3), no limit.  DFT needs 3.01 dB more
    because two phases are differenced; neither goes below 10 dB per phase, the model's own assumption.
    """
    require_choice("system", system, SYSTEMS)
    published = is_published(variant)
    steps = carriers - (1 if published or system == "CFT" else 2)
    require_between("carriers", carriers, 2 if steps >= carriers - 1 else 3, None)
    ratio = frequency_ratio(_HIGHEST_HZ[system], _LOWEST_HZ, steps)
    probability = total_probability / steps
    doubling = 2.0 if system == "DFT" else 1.0
    snr_db = max(10.0 * math.log10(doubling * required_ratio(ratio, probability)), _FLOOR_DB[system])
    if published:
        snr_db = min(snr_db, _SOLVER_LIMIT_DB)
    return CarrierCountRow(carriers=carriers, step_probability=probability, ratio=ratio, snr_db=snr_db)


def carrier_count_table(system: str, variant: str = CORRECTED) -> list[CarrierCountRow]:
    """Return Table 8-1 of one system up to 25 carriers."""
    first = 2 if is_published(variant) or system == "CFT" else 3
    return [carrier_count_row(k, system, variant=variant) for k in range(first, 26)]


def link_powers_w(
    snr_db: float, range_m: float, forward_hz: float, return_hz: float, link: LinkParams
) -> tuple[float, float]:
    """Return the radiated powers of forward and return link (PI83 Tables 8-2, 8-3)."""
    snr = 10.0 ** (0.1 * snr_db)
    forward, back = (required_power_w(snr, range_m, frequency, link) for frequency in (forward_hz, return_hz))
    return float(forward), float(back)
