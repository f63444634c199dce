"""What one term of the bias model is: a name, a unit and its partial derivatives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["ALL_AZIMUTHS", "LOW_AND_HIGH", "RISE_AND_SET", "Angles", "Partial", "Term"]

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


ALL_AZIMUTHS = "passes on all sides of the sky"
LOW_AND_HIGH = "passes at low and at high elevation (above 60 deg)"
RISE_AND_SET = "fast passes on both sides, rising and setting, at several rates"
"""Which data separate a term from the others, in the words of the refusals."""
