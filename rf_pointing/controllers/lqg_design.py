"""What an LQG controller consists of, together with the model and the weights it was designed for.

    v(k) = -K x(k),   x(k+1) = A x(k) + B v(k) + L (-e(k) - C x(k)),   u = N(z) [ S(z) v + F r' ]

x holds the axis angle and drive rate (as deviations from the command), the states of the notch N and of the shaping
section S, and a slow rate disturbance; the last makes the integral action.  e is command minus encoder.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers.notch import NotchParams
from rf_pointing.controllers.section import SectionParams
from rf_pointing.core import Params, parameter

__all__ = ["LqgDesign", "LqgWeights"]

Array = NDArray[np.float64]

_MATRICES = ("a", "b", "c", "state_gain", "observer_gain", "model_a", "model_b", "model_c", "model_d")


@dataclass(frozen=True, kw_only=True)
class LqgWeights(Params):
    """The choices of the designer: the notch and the section in series, and three ratios."""

    notch_frequency_hz: float = parameter(description="notch in the rate command", low=0.01, high=100.0)
    notch_damping: float = parameter(description="width of the notch", low=0.01, high=3.0)
    shaping_zero_hz: float = parameter(description="zeros of the section", low=0.01, high=100.0)
    shaping_zero_damping: float = parameter(description="damping of its zeros", low=0.0, high=5.0)
    shaping_pole_hz: float = parameter(description="poles of the section", low=0.01, high=100.0)
    shaping_pole_damping: float = parameter(description="damping of its poles", low=0.001, high=5.0)
    control_weight: float = parameter(description="price of rate over price of angle", low=1e-9, high=1e6)
    disturbance_intensity: float = parameter(
        description="variance per step of the rate disturbance over encoder variance", low=1e-12, high=1e6
    )
    rate_intensity: float = parameter(
        description="variance per step of the drive rate over encoder variance", low=0.0, high=1e6
    )

    @property
    def notch(self) -> NotchParams:
        """The notch's own parameter set."""
        return NotchParams(frequency_hz=self.notch_frequency_hz, damping=self.notch_damping)

    @property
    def shaping(self) -> SectionParams:
        """The section's own parameter set."""
        return SectionParams(
            zero_hz=self.shaping_zero_hz,
            zero_damping=self.shaping_zero_damping,
            pole_hz=self.shaping_pole_hz,
            pole_damping=self.shaping_pole_damping,
        )


@dataclass(frozen=True, slots=True)
class LqgDesign:
    """Matrices of the law, the drive it was made for and the margins found on the full model.

    `a` (7, 7), `b` (7, 1), `c` (1, 7), `state_gain` (1, 7), `observer_gain` (7, 1); `model_a` (n, n) to `model_d` (1, 1)
    is the identified model from rate command to encoder, `drive_bandwidth_rad_s` and `drive_gain` what was read off it;
    `peak_sensitivity`, `gain_margin_db`, `phase_margin_rad` are of the encoder loop on it.
    """

    a: Array
    b: Array
    c: Array
    state_gain: Array
    observer_gain: Array
    model_a: Array
    model_b: Array
    model_c: Array
    model_d: Array
    sample_s: float
    drive_bandwidth_rad_s: float
    drive_gain: float
    weights: LqgWeights
    peak_sensitivity: float
    gain_margin_db: float
    phase_margin_rad: float

    def to_mapping(self) -> dict[str, Any]:
        """Return plain numbers and lists for a file."""
        values = {name: getattr(self, name) for name in self.__slots__}
        plain = {name: value.tolist() if name in _MATRICES else value for name, value in values.items()}
        plain["weights"] = {name: getattr(self.weights, name) for name in self.weights.__dataclass_fields__}
        return plain

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "LqgDesign":
        """Return the design in `values`; an unknown or missing key is an error."""
        unknown, missing = sorted(set(values) - set(cls.__slots__)), sorted(set(cls.__slots__) - set(values))
        if unknown or missing:
            raise ValueError(f"LQG design has unknown keys {unknown} and lacks {missing}")
        parts: dict[str, Any] = {name: np.array(values[name], dtype=np.float64) for name in _MATRICES}
        numbers = {name: values[name] for name in cls.__slots__ if name not in _MATRICES and name != "weights"}
        return cls(**parts, **numbers, weights=LqgWeights.from_mapping(values["weights"]))
