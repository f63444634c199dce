"""Derived parameters: rows of values with the key that gives each and its formula as text.

A block that scales with the antenna says here how: from the numbers of a band to the rows of its
own parameter set.  Angles are in degrees, as in the description and in the formulas that a user
reads.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from rf_pointing.core.types import Pair


@dataclass(frozen=True, slots=True)
class Value:
    """One parameter: its value in edge units, the key that gives it, and how it is derived.

    The key of one that only `tuning` changes is empty until its full name is known.
    """

    value: Any
    key: str
    formula: str = ""


Rows = Mapping[str, Any]
"""Values of one parameter set by their edge names; a mapping below a name is a nested set."""


def tuned(value: Any, formula: str) -> Value:
    """Return a derived value that `tuning` may override."""
    return Value(value, "", formula)


def rounded(value: float, digits: int = 6) -> float:
    """Return `value` with so many significant digits: a derived number is read by people."""
    return float(f"{value:.{digits}g}")


class BandNumbers(Protocol):
    """Numbers of one band that scans and searches scale with.

    Beamwidth (full width at half power, also as a `width` for every set that needs it), coarser
    encoder step, largest commanded rates and accelerations of both axes, time between two carrier
    powers, and from the beam's direction to the power that it gives.
    """

    @property
    def beamwidth_deg(self) -> float: ...
    @property
    def width(self) -> Value: ...
    @property
    def step_deg(self) -> float: ...
    @property
    def rates_deg_s(self) -> Pair: ...
    @property
    def accelerations_deg_s2(self) -> Pair: ...
    @property
    def power_period_s(self) -> float: ...
    @property
    def delay_s(self) -> float: ...
