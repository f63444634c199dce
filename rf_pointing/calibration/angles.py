"""The angles on which the terms are evaluated: arrays (printed form) or Taylor series (exact)."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration import taylor
from rf_pointing.calibration.mount import lift
from rf_pointing.core import Array, Kinematics

# Temperature at which the thermal terms vanish (ISA sea level).
REFERENCE_TEMPERATURE_K = 288.15


@dataclass(frozen=True)
class _Angles(ABC):
    """Common part of both forms: each term is written once for both."""

    azimuth: Array
    elevation: Array
    temperature_k: ArrayLike | None
    mount: Kinematics | None = field(default=None, kw_only=True)
    _kept: dict[tuple[str, int], tuple[Array, Array]] = field(
        default_factory=dict, kw_only=True, repr=False
    )

    @property
    @abstractmethod
    def one(self) -> Array:
        """Return the constant 1 in the form of the angles."""

    @abstractmethod
    def _sine_and_cosine(self, angle: Array) -> tuple[Array, Array]: ...

    def sin_azimuth(self, multiple: int) -> Array:
        return self._keep("azimuth", multiple)[0]

    def cos_azimuth(self, multiple: int) -> Array:
        return self._keep("azimuth", multiple)[1]

    def sin_elevation(self, multiple: int) -> Array:
        return self._keep("elevation", multiple)[0]

    def cos_elevation(self, multiple: int) -> Array:
        return self._keep("elevation", multiple)[1]

    @property
    def temperature_difference(self) -> Array:
        # No default: a model fitted with temperatures would be wrong by mdeg without them.
        if self.temperature_k is None:
            raise ValueError("temperature_k=None must be given: the model has a temperature term")
        return (
            np.asarray(self.temperature_k, dtype=np.float64) - REFERENCE_TEMPERATURE_K
        ) * self.one

    @cached_property
    def lift(self) -> tuple[Array, Array]:
        # A mount that is not known has no vertical, and a guess bends the beam to any side.
        if self.mount is None:
            raise ValueError("mount=None must be given: the model has a flexure along the vertical")
        return lift(self.mount, self.azimuth, self.elevation)

    # Several terms share a sine; each is computed once for a million rows.
    def _keep(self, axis: str, multiple: int) -> tuple[Array, Array]:
        key = (axis, multiple)
        if key not in self._kept:
            self._kept[key] = self._sine_and_cosine(multiple * getattr(self, axis))
        return self._kept[key]


@dataclass(frozen=True)
class ArrayAngles(_Angles):
    """Angles and their rates as arrays of one shape."""

    azimuth_rate: Array
    elevation_rate: Array
    azimuth_acceleration: Array
    elevation_acceleration: Array

    @classmethod
    def of(
        cls, motion: Sequence[ArrayLike], temperature_k: ArrayLike | None,
        mount: Kinematics | None = None,
    ) -> "ArrayAngles":  # fmt: skip
        """Broadcast azimuth, elevation, their rates and their accelerations to one shape."""
        azimuth, elevation, *rates = np.broadcast_arrays(
            *(np.asarray(part, dtype=np.float64) for part in motion)
        )
        if len(rates) != 4:
            raise ValueError(
                f"motion has {len(motion)} parts, must have 6: angles, rates and accelerations"
            )
        return cls(azimuth, elevation, temperature_k, *rates, mount=mount)

    @cached_property
    def one(self) -> Array:
        return np.ones_like(self.azimuth)

    @cached_property
    def tan_elevation(self) -> Array:
        return self.sin_elevation(1) / self.cos_elevation(1)

    @cached_property
    def sec_elevation(self) -> Array:
        return 1.0 / self.cos_elevation(1)

    @property
    def beyond_zenith(self) -> Array:
        return (self.elevation > np.pi / 2.0).astype(np.float64)

    def _sine_and_cosine(self, angle: Array) -> tuple[Array, Array]:
        return np.sin(angle), np.cos(angle)


@dataclass(frozen=True)
class SeriesAngles(_Angles):
    """Angles as Taylor series (m, ...), whose derivatives are rates and accelerations."""

    @property
    def one(self) -> Array:
        return taylor.constant(1.0, self.azimuth)

    @property
    def tan_elevation(self) -> Array:
        return taylor.divide(self.sin_elevation(1), self.cos_elevation(1))

    @property
    def sec_elevation(self) -> Array:
        return taylor.divide(self.one, self.cos_elevation(1))

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

    # A step: its derivatives are zero where they exist, so one value is enough for the series.
    @property
    def beyond_zenith(self) -> Array:
        return np.asarray(self.elevation[0] > np.pi / 2.0, dtype=np.float64)

    def _sine_and_cosine(self, angle: Array) -> tuple[Array, Array]:
        return taylor.sine_cosine(angle)


Angles = ArrayAngles | SeriesAngles
"""Argument of a term: angles as arrays, or as series."""
