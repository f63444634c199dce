"""Everything the plant remembers: copy it, stop, put it back, and the run goes on identically."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PlantState"]


@dataclass(slots=True)
class PlantState:
    """State of `AntennaPlant`: `x` (n,) of the linear model, clock, drives, commands under way, latched encoder.

    `debt_s` is the part of the elapsed time (below 0.1 ms) that is not yet integrated; `commands` are (time, azimuth,
    elevation) rate commands still inside the dead time; `random` is the state of the noise generator.
    """

    x: NDArray[np.float64]
    time_s: float
    debt_s: float
    powered: bool
    braked: bool
    at_stop: tuple[bool, bool]
    encoder_rad: NDArray[np.float64]
    commands: tuple[tuple[float, float, float], ...]
    random: Mapping[str, Any] = field(repr=False)
