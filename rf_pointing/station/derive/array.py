"""The array of patches on the dish."""

import math
from functools import cache

from rf_pointing.core.derived import Rows, Value, rounded, tuned
from rf_pointing.rf.dish_array import DishArrayParams, least_level_db_hz
from rf_pointing.station.derive.band import Band
from rf_pointing.station.description.content import ArraySection

PATTERN_DB = 44.3
"""Gain of a dish, G = 27000 deg^2 / h^2, in dBi at a beamwidth of 1 deg."""
ARRAY_ABOVE_DB = 2.0
"""From half of the directions valid to all but 1 %, with 8 to 16 patches."""


def array(of: Band) -> Rows:
    """The patches: where they are, and their loss against the dish."""
    section = of.content.array
    if section is None:
        return {}
    given = ("elements", "radius_m", "roll_deg", "axis_cross_elevation_deg", "axis_elevation_deg", "phase_sigma_deg")
    return {name: Value(getattr(section, name), f"array.{name}") for name in given} | {
        "wavelength_m": Value(rounded(of.wavelength_m), "bands.*.frequency_mhz", "that of the carrier"),
        "element_loss_db": Value(
            _loss_db(of, section), "array.element_gain_dbi", "27000 deg^2 / h^2 over a patch's gain"
        ),
    }


def thresholds(of: Band) -> Rows:
    """C/N0 of the array at which the state table takes and leaves it."""
    section = of.content.array
    if section is None:
        return {}
    gain_db = rounded(10.0 * math.log10(section.elements) - _loss_db(of, section), 4)
    gain = {"array_gain_db": Value(gain_db, "array.element_gain_dbi", "all patches together over the dish")}
    level_db_hz = level_of_array_db_hz(section, of.wavelength_m)
    if math.isinf(level_db_hz):
        return gain
    return gain | {
        "array_off_db_hz": tuned(rounded(level_db_hz, 3), "half of the directions are valid"),
        "array_on_db_hz": tuned(
            rounded(level_db_hz + ARRAY_ABOVE_DB, 3), "2 dB above, where all directions are valid"
        ),
    }  # fmt: skip


def _loss_db(of: Band, section: ArraySection) -> float:
    return rounded(PATTERN_DB - 20.0 * math.log10(of.beamwidth_deg) - section.element_gain_dbi, 4)


@cache
def level_of_array_db_hz(section: ArraySection, wavelength_m: float) -> float:
    """Return the C/N0 of all patches at which half of the directions are valid, or infinity."""
    return least_level_db_hz(
        DishArrayParams(
            elements=section.elements, radius_m=section.radius_m, wavelength_m=wavelength_m,
            phase_sigma_rad=math.radians(section.phase_sigma_deg),
        )
    )  # fmt: skip
