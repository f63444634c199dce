"""The angles on which the terms are evaluated: arrays (printed form) or Taylor series (exact)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.calibration import taylor

Array = NDArray[np.float64]

# Temperature at which the thermal terms vanish (ISA sea level).
REFERENCE_TEMPERATURE_K = 288.15


@dataclass(frozen=True)
class ArrayAngles:
    """Angles and their rates as arrays of one shape; sines and cosines are computed once."""

    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate: Array
    elevation_rate: Array
    azimuth_acceleration: Array
    elevation_acceleration: Array
    temperature_k: Array | None = None
    _kept: dict[tuple[str, int], Array] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, motion: Sequence[ArrayLike], temperature_k: Array | None) -> "ArrayAngles":
        """Broadcast azimuth, elevation, their rates and their accelerations to one shape."""
        az, el, az_rate, el_rate, az_acceleration, el_acceleration = np.broadcast_arrays(
            *(np.asarray(value, dtype=np.float64) for value in motion)
        )
        return cls(az, el, az_rate, el_rate, az_acceleration, el_acceleration, temperature_k)

    @cached_property
    def one(self) -> Array:
        return np.ones_like(self.azimuth_rad)

    @cached_property
    def tan_elevation(self) -> Array:
        return self.sin_elevation(1) / self.cos_elevation(1)

    @cached_property
    def sec_elevation(self) -> Array:
        return 1.0 / self.cos_elevation(1)

    @property
    def beyond_zenith(self) -> Array:
        return (self.elevation_rad > np.pi / 2.0).astype(np.float64)

    @property
    def temperature_difference(self) -> Array:
        return _temperature_difference(self.temperature_k) * self.one

    def sin_azimuth(self, multiple: int) -> Array:
        return self._keep("sin_azimuth", multiple, np.sin, self.azimuth_rad)

    def cos_azimuth(self, multiple: int) -> Array:
        return self._keep("cos_azimuth", multiple, np.cos, self.azimuth_rad)

    def sin_elevation(self, multiple: int) -> Array:
        return self._keep("sin_elevation", multiple, np.sin, self.elevation_rad)

    def cos_elevation(self, multiple: int) -> Array:
        return self._keep("cos_elevation", multiple, np.cos, self.elevation_rad)

    # Several terms share a sine; each is computed once for a million rows.
    def _keep(self, name: str, multiple: int, function: np.ufunc, angle: Array) -> Array:
        key = (name, multiple)
        if key not in self._kept:
            self._kept[key] = function(angle if multiple == 1 else multiple * angle)
        return self._kept[key]


@dataclass(frozen=True)
class SeriesAngles:
    """Angles as Taylor series (m, ...), whose derivatives are rates and accelerations."""

    azimuth: Array
    elevation: Array
    temperature_k: Array | None = None
    _kept: dict[tuple[int, int], tuple[Array, Array]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def one(self) -> Array:
        return taylor.constant(1.0, self.azimuth)

    @property
    def tan_elevation(self) -> Array:
        return taylor.divide(self.sin_elevation(1), self.cos_elevation(1))

    @property
    def sec_elevation(self) -> Array:
        return taylor.divide(self.one, self.cos_elevation(1))

    # Both carriers have the same names, so that each term is written once for both forms.
    @property
    def azimuth_rate(self) -> Array:
        return taylor.derivative(self.azimuth)

    @property
    def azimuth_acceleration(self) -> Array:
        return taylor.derivative(self.azimuth, 2)

    @property
    def elevation_rate(self) -> Array:
        return taylor.derivative(self.elevation)

    @property
    def elevation_acceleration(self) -> Array:
        return taylor.derivative(self.elevation, 2)

    # A step in elevation: its derivatives are zero where they exist, so one value is enough for the
    # series.
    @property
    def beyond_zenith(self) -> Array:
        return np.asarray(self.elevation[0] > np.pi / 2.0, dtype=np.float64)

    @property
    def temperature_difference(self) -> Array:
        return _temperature_difference(self.temperature_k) * self.one

    def sin_azimuth(self, multiple: int) -> Array:
        return self._keep(0, multiple)[0]

    def cos_azimuth(self, multiple: int) -> Array:
        return self._keep(0, multiple)[1]

    def sin_elevation(self, multiple: int) -> Array:
        return self._keep(1, multiple)[0]

    def cos_elevation(self, multiple: int) -> Array:
        return self._keep(1, multiple)[1]

    def _keep(self, axis: int, multiple: int) -> tuple[Array, Array]:
        key = (axis, multiple)
        if key not in self._kept:
            self._kept[key] = taylor.sine_cosine(multiple * (self.elevation if axis else self.azimuth))
        return self._kept[key]


def _temperature_difference(temperature_k: Array | None) -> Array:
    # No default: a model fitted with temperatures would be wrong without them, by mdeg and
    # unnoticed.
    if temperature_k is None:
        raise ValueError("temperature_k=None must be given: the model has a temperature term")
    return temperature_k - REFERENCE_TEMPERATURE_K


Angles = ArrayAngles | SeriesAngles
"""What a term is evaluated on."""
