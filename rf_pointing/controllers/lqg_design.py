"""What an LQG controller consists of, together with the model and the weights it was designed for.

    v(k) = -K x(k),   x(k+1) = A x(k) + B v(k) + L (-e(k) - C x(k)),   u = N(z) [ v + F r' ]

x holds the axis angle and drive rate (as deviations from the command), the two notch states, and a slow rate
disturbance; the last makes the integral action.  e is command minus encoder, N the notch of the rate command.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.geometry import Params, parameter

__all__ = ["LqgDesign", "LqgWeights"]

Array = NDArray[np.float64]

_MATRICES = ("a", "b", "c", "state_gain", "observer_gain")


@dataclass(frozen=True, kw_only=True)
class LqgWeights(Params):
    """The choices of the designer: the notch in series and three ratios."""

    notch_frequency_hz: float = parameter(description="notch in the rate command", low=0.01, high=100.0)
    notch_damping: float = parameter(description="width of the notch", low=0.01, high=3.0)
    control_weight: float = parameter(description="price of rate over price of angle", low=1e-9, high=1e6)
    disturbance_intensity: float = parameter(
        description="variance per step of the rate disturbance over encoder variance", low=1e-12, high=1e6
    )
    rate_intensity: float = parameter(
        description="variance per step of the drive rate over encoder variance", low=0.0, high=1e6
    )


@dataclass(frozen=True, slots=True)
class LqgDesign:
    """Matrices of the law, the drive it was made for and the margins found on the full model.

    `a` (5, 5), `b` (5, 1), `c` (1, 5), `state_gain` (1, 5), `observer_gain` (5, 1); `drive_bandwidth_rad_s` and
    `drive_gain` describe the model; `peak_sensitivity`, `gain_margin_db`, `phase_margin_rad` are of the encoder loop.
    """

    a: Array
    b: Array
    c: Array
    state_gain: Array
    observer_gain: Array
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
        parts = {name: np.array(values[name], dtype=np.float64) for name in _MATRICES}
        numbers = {name: values[name] for name in cls.__slots__ if name not in _MATRICES and name != "weights"}
        return cls(**parts, **numbers, weights=LqgWeights.from_mapping(values["weights"]))
