"""The terms of the bias model (SATCAL eqs. 1-2) and the registry of named extensions.

Each term adds coefficient * azimuth(...) to the azimuth and coefficient * elevation(...) to the elevation:

    Az_o = Az_t + x1 + x2 tan El + x3 sec El + x4 sin Az + x5 cos Az + x6 Az' + x7 Az'' + (x8 sin Az - x9 cos Az) tan El
    El_o = El_t + x8 cos Az + x9 sin Az + x10 + x11 cos El + x12 sin El + x13 El' + x14 El''

The four terms that tilt or skew an axis (x2, x3, x8, x9) are rotations; the printed form is their first order.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["EXTENSION_TERMS", "TERMS", "TERM_NAMES", "Angles", "Term", "all_terms", "terms_by_name"]

Array = NDArray[np.float64]


class Angles(Protocol):
    """What a term may look at; plain arrays and Taylor series both offer it."""

    @property
    def one(self) -> Array: ...
    @property
    def tan_elevation(self) -> Array: ...
    @property
    def sec_elevation(self) -> Array: ...
    @property
    def azimuth_rate(self) -> Array: ...
    @property
    def azimuth_acceleration(self) -> Array: ...
    @property
    def elevation_rate(self) -> Array: ...
    @property
    def elevation_acceleration(self) -> Array: ...
    @property
    def beyond_zenith(self) -> Array: ...
    @property
    def temperature_difference(self) -> Array: ...
    def sin_azimuth(self, multiple: int) -> Array: ...
    def cos_azimuth(self, multiple: int) -> Array: ...
    def sin_elevation(self, multiple: int) -> Array: ...
    def cos_elevation(self, multiple: int) -> Array: ...


Partial = Callable[[Angles], Array]
_LIMITS = {"rad": 0.1, "s": 10.0, "s^2": 100.0, "rad/K": 0.01}


@dataclass(frozen=True, kw_only=True)
class Term:
    """One coefficient of the model.

    `number` is the index of SATCAL's x (0 for an extension).  `kind` is "rotation" (tilts or skews an axis), "lag"
    (proportional to a rate or an acceleration) or "additive" (an encoder or flexure shift of one axis).
    `separated_by` says which data make the term observable.
    """

    name: str
    number: int
    unit: str
    kind: str
    formula: str
    separated_by: str
    azimuth: Partial | None = None
    elevation: Partial | None = None
    needs_temperature: bool = False

    @property
    def limit(self) -> float:
        """Return the largest believable magnitude in the term's unit; beyond it degrees were given for radians."""
        return _LIMITS[self.unit]


_ALL_AZIMUTHS = "passes on all sides of the sky"
_LOW_AND_HIGH = "passes at low and at high elevation (above 60 deg)"
_RISE_AND_SET = "fast passes on both sides, rising and setting, at several rates"

TERMS: tuple[Term, ...] = (
    Term(
        name="azimuth_offset",
        number=1,
        unit="rad",
        kind="additive",
        formula="dAz = x1",
        separated_by=_LOW_AND_HIGH,
        azimuth=lambda a: a.one,
    ),
    Term(
        name="non_orthogonality",
        number=2,
        unit="rad",
        kind="rotation",
        formula="dAz = x2 tan El",
        separated_by=_LOW_AND_HIGH,
        azimuth=lambda a: a.tan_elevation,
    ),
    Term(
        name="collimation",
        number=3,
        unit="rad",
        kind="rotation",
        formula="dAz = x3 sec El",
        separated_by=_LOW_AND_HIGH,
        azimuth=lambda a: a.sec_elevation,
    ),
    Term(
        name="azimuth_encoder_sine",
        number=4,
        unit="rad",
        kind="additive",
        formula="dAz = x4 sin Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(1),
    ),
    Term(
        name="azimuth_encoder_cosine",
        number=5,
        unit="rad",
        kind="additive",
        formula="dAz = x5 cos Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: a.cos_azimuth(1),
    ),
    Term(
        name="azimuth_velocity_lag",
        number=6,
        unit="s",
        kind="lag",
        formula="dAz = x6 dAz/dt",
        separated_by=_RISE_AND_SET,
        azimuth=lambda a: a.azimuth_rate,
    ),
    Term(
        name="azimuth_acceleration_lag",
        number=7,
        unit="s^2",
        kind="lag",
        formula="dAz = x7 d2Az/dt2",
        separated_by=_RISE_AND_SET,
        azimuth=lambda a: a.azimuth_acceleration,
    ),
    Term(
        name="mislevel_east",
        number=8,
        unit="rad",
        kind="rotation",
        formula="dAz = x8 sin Az tan El, dEl = x8 cos Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(1) * a.tan_elevation,
        elevation=lambda a: a.cos_azimuth(1),
    ),
    Term(
        name="mislevel_north",
        number=9,
        unit="rad",
        kind="rotation",
        formula="dAz = -x9 cos Az tan El, dEl = x9 sin Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: -a.cos_azimuth(1) * a.tan_elevation,
        elevation=lambda a: a.sin_azimuth(1),
    ),
    Term(
        name="elevation_offset",
        number=10,
        unit="rad",
        kind="additive",
        formula="dEl = x10",
        separated_by=_LOW_AND_HIGH,
        elevation=lambda a: a.one,
    ),
    Term(
        name="droop",
        number=11,
        unit="rad",
        kind="additive",
        formula="dEl = x11 cos El",
        separated_by=_LOW_AND_HIGH,
        elevation=lambda a: a.cos_elevation(1),
    ),
    Term(
        name="elevation_encoder_sine",
        number=12,
        unit="rad",
        kind="additive",
        formula="dEl = x12 sin El",
        separated_by=_LOW_AND_HIGH,
        elevation=lambda a: a.sin_elevation(1),
    ),
    Term(
        name="elevation_velocity_lag",
        number=13,
        unit="s",
        kind="lag",
        formula="dEl = x13 dEl/dt",
        separated_by=_RISE_AND_SET,
        elevation=lambda a: a.elevation_rate,
    ),
    Term(
        name="elevation_acceleration_lag",
        number=14,
        unit="s^2",
        kind="lag",
        formula="dEl = x14 d2El/dt2",
        separated_by=_RISE_AND_SET,
        elevation=lambda a: a.elevation_acceleration,
    ),
)
"""The 14 terms of SATCAL eqs. (1)-(2), in the paper's order."""

TERM_NAMES: tuple[str, ...] = tuple(term.name for term in TERMS)

EXTENSION_TERMS: tuple[Term, ...] = (
    Term(
        name="azimuth_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dAz = c sin 2Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(2),
    ),
    Term(
        name="azimuth_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dAz = c cos 2Az",
        separated_by=_ALL_AZIMUTHS,
        azimuth=lambda a: a.cos_azimuth(2),
    ),
    Term(
        name="elevation_azimuth_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c sin 2Az",
        separated_by=_ALL_AZIMUTHS,
        elevation=lambda a: a.sin_azimuth(2),
    ),
    Term(
        name="elevation_azimuth_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos 2Az",
        separated_by=_ALL_AZIMUTHS,
        elevation=lambda a: a.cos_azimuth(2),
    ),
    Term(
        name="elevation_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c sin 2El",
        separated_by=_LOW_AND_HIGH,
        elevation=lambda a: a.sin_elevation(2),
    ),
    Term(
        name="elevation_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos 2El",
        separated_by=_LOW_AND_HIGH,
        elevation=lambda a: a.cos_elevation(2),
    ),
    Term(
        name="droop_beyond_zenith",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos El where El > 90 deg",
        separated_by="plunged passes (elevation above 90 deg)",
        elevation=lambda a: a.cos_elevation(1) * a.beyond_zenith,
    ),
    Term(
        name="azimuth_temperature",
        number=0,
        unit="rad/K",
        kind="additive",
        formula="dAz = c (T - 288.15 K)",
        separated_by="passes at several temperatures",
        azimuth=lambda a: a.temperature_difference,
        needs_temperature=True,
    ),
    Term(
        name="elevation_temperature",
        number=0,
        unit="rad/K",
        kind="additive",
        formula="dEl = c (T - 288.15 K)",
        separated_by="passes at several temperatures",
        elevation=lambda a: a.temperature_difference,
        needs_temperature=True,
    ),
)
"""Named terms that may be added to the 14; all act on one axis only."""


def all_terms() -> dict[str, Term]:
    """Return every known term by name."""
    return {term.name: term for term in TERMS + EXTENSION_TERMS}


def terms_by_name(names: Iterable[str]) -> tuple[Term, ...]:
    """Return the terms of `names` in that order; an unknown or repeated name is an error."""
    known, chosen = all_terms(), list(names)
    unknown = [name for name in chosen if name not in known]
    if unknown:
        raise ValueError(f"the bias model has no term {', '.join(unknown)}; it has {', '.join(known)}")
    repeated = sorted({name for name in chosen if chosen.count(name) > 1})
    if repeated:
        raise ValueError(f"term {', '.join(repeated)} is given more than once")
    return tuple(known[name] for name in chosen)
