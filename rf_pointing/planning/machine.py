"""What the axes can do, and what a pass must keep to be worth tracking: the parameters that certificates are held against."""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter
from rf_pointing.planning.slew import AxisRates

__all__ = ["MachineParams"]


@dataclass(frozen=True, kw_only=True)
class MachineParams(Params):
    """Rates and accelerations of the axes, and the least that a pass must give."""

    rate_limit_rad_s: tuple[float, float] = parameter((math.radians(1.8),) * 2, "largest rates", low=1e-6, high=10.0)
    acceleration_limit_rad_s2: tuple[float, float] = parameter(
        (math.radians(0.8),) * 2, "largest accelerations", low=1e-6, high=100.0
    )
    reserve: float = parameter(0.05, "share of both that planning leaves to the tracking loop", low=0.0, high=0.5)
    sun_radius_rad: float = parameter(math.radians(1.0), "the beam stays this far from the Sun", low=0.0, high=0.5)
    least_share: float = parameter(0.8, "share of the pass that must be received within 3 dB", low=0.0, high=1.0)
    half_power_beamwidth_rad: float = parameter(
        math.radians(0.065), "beamwidth that the loss is computed for", low=1e-6, high=0.5
    )

    @property
    def planned(self) -> AxisRates:
        """The rates and accelerations that planning may use."""
        share = 1.0 - self.reserve
        rate, acceleration = self.rate_limit_rad_s, self.acceleration_limit_rad_s2
        return AxisRates((share * rate[0], share * rate[1]), (share * acceleration[0], share * acceleration[1]))

    @property
    def axes(self) -> AxisRates:
        """Rates and accelerations of the axes."""
        return AxisRates(self.rate_limit_rad_s, self.acceleration_limit_rad_s2)

    def slew_s(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        """Return the time from rest at one position to rest at another, both axes at once."""
        return self.axes.slew_s(start, end)
