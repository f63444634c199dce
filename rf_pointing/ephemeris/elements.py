"""Mean orbital elements of one object for SGP4, whatever message they came in.

The catalogue number is an integer of up to nine digits.  The number handed to the propagator is
only a label there; the sgp4 library refuses labels above 339999, so those get 0 inside the
propagator and keep their number here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from sgp4.api import WGS72, Satrec

from rf_pointing.core import DAY_S, require_between, require_finite
from rf_pointing.core.checks import near_names

# From 1949-12-31T00:00, where the propagator counts from, to 1970-01-01.
_DAYS_1949_TO_1970 = 7306.0
_LARGEST_LABEL = 339999
MOST_COMPARED = 5000
# Revolutions a day that an orbit about the Earth may have: beyond the smallest it is lost, beyond
# the largest inside.
MEAN_MOTIONS = (1e-3, 20.0)


@dataclass(frozen=True, kw_only=True)
class Elements:
    """Mean elements (TEME, SGP4 theory, WGS 72); angles in rad, epoch in UTC POSIX seconds."""

    name: str
    catalogue_number: int
    epoch_t_s: float
    inclination_rad: float
    ascending_node_rad: float
    eccentricity: float
    argument_of_perigee_rad: float
    mean_anomaly_rad: float
    mean_motion_rad_s: float
    drag_per_earth_radius: float
    mean_motion_dot_rad_s2: float = 0.0
    mean_motion_ddot_rad_s3: float = 0.0
    international_designator: str = ""
    classification: str = "U"
    element_set_number: int = 0
    revolution_number: int = 0

    def __post_init__(self) -> None:
        require_between("catalogue_number", self.catalogue_number, 0, 999999999)
        require_between("eccentricity", self.eccentricity, 0.0, math.nextafter(1.0, 0.0))
        require_between("inclination_rad", self.inclination_rad, 0.0, math.pi)
        if not self.mean_motion_rad_s > 0.0:
            raise ValueError(f"mean_motion_rad_s={self.mean_motion_rad_s} of {self.name} must be > 0")
        for name in _FLOATS:
            require_finite(name, getattr(self, name))

    def satrec(self) -> Satrec:
        """Return a fresh SGP4 record; it holds the state of its last call, so do not share one."""
        record = Satrec()
        # The label is of no consequence to the propagation.
        label = self.catalogue_number if self.catalogue_number <= _LARGEST_LABEL else 0
        # The record keeps Taylor coefficients, as a TLE does, per minute.
        half_dot, dot_dot = self.mean_motion_dot_rad_s2 * 3600.0 / 2.0, self.mean_motion_ddot_rad_s3
        record.sgp4init(
            WGS72, "i", label, self.epoch_t_s / DAY_S + _DAYS_1949_TO_1970,
            self.drag_per_earth_radius, half_dot, dot_dot * 216000.0 / 6.0, self.eccentricity,
            self.argument_of_perigee_rad, self.inclination_rad, self.mean_anomaly_rad,
            self.mean_motion_rad_s * 60.0, self.ascending_node_rad,
        )  # fmt: skip
        return record


_FLOATS = [item.name for item in fields(Elements) if item.type is float]
_NAMES = [item.name for item in fields(Elements)]


def to_row(elements: Elements) -> list[Any]:
    """Return the values of the fields in order: name, number, ...; the inverse is `from_row`."""
    return [getattr(elements, name) for name in _NAMES]


def from_row(row: Sequence[Any]) -> Elements:
    """Return the elements of the values of all fields."""
    return Elements(**dict(zip(_NAMES, row, strict=True)))


def find_elements(elements: Sequence[Elements], wanted: str) -> Elements:
    """Return the newest set of the object with that catalogue number or name (case ignored).

    An unknown object is refused with the nearest names, a name shared by several objects with their
    numbers.
    """
    key = wanted.strip().casefold()
    found = [e for e in elements if e.name.casefold() == key or (key.isdigit() and e.catalogue_number == int(key))]
    if not found:
        # Comparing with each of a hundred thousand names would take minutes.
        some = elements[:: max(1, len(elements) // MOST_COMPARED)]
        labels = [str(e.catalogue_number) if key.isdigit() else e.name for e in some]
        # One wrong digit of five is near, two are another satellite.
        near = near_names(key, filter(None, labels), 0.75 if key.isdigit() else 0.6)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(e.name for e in some[:3])}, ..."
        raise ValueError(f"satellite={wanted!r} is not among {len(elements)} elements; {hint}")
    numbers = sorted({e.catalogue_number for e in found})
    if len(numbers) > 1:
        raise ValueError(f"satellite={wanted!r} names several objects: {', '.join(map(str, numbers))}; give the number")
    return max(found, key=lambda e: e.epoch_t_s)
