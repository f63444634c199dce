"""Thermal radiation of a solar panel: a push of 1e-10 to 1e-8 m/s^2, metres along the track a week.

    a_panel = 2 sigma A / (3 c m) (e_b T_b^4 - e_a T_a^4)      towards the Sun, which side a faces
    (T_a - T_b) / R = e_b sigma T_b^4,   R = sum of t_i / K_i
    alpha (1 - efficiency) S = e_a sigma T_a^4 + e_b sigma T_b^4

THERMAL equations (1) to (8), whose two sides are those of its glossary and Table 3.  In time the
panel is one capacity at its mean temperature with this gradient across it: heat crosses in two
minutes what takes an hour to cool.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

STEFAN_W_M2_K4, LIGHT_M_S = 5.6699e-8, 2.998e8
_STEP_S = 10.0


@dataclass(frozen=True, kw_only=True)
class Layer(Params):
    """One layer of a panel."""

    thickness_m: float = parameter(description="thickness", low=1e-9, high=1.0)
    density_kg_m3: float = parameter(description="density", low=0.1, high=3e4)
    heat_j_kg_k: float = parameter(description="specific heat", low=1.0, high=1e5)
    conductivity_w_m_k: float = parameter(description="conductivity", low=1e-5, high=1e4)


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A panel that faces the Sun: layers from side a to side b, and how both absorb and radiate."""

    layers: tuple[Layer, ...]
    area_m2: float
    mass_kg: float
    absorbed: float
    """Share of the light that becomes heat: what becomes electricity is taken off."""
    emissivity_a: float
    emissivity_b: float
    light_w_m2: float = 1368.2

    @property
    def resistance_k_m2_w(self) -> float:
        """Resistance across all layers."""
        return sum(one.thickness_m / one.conductivity_w_m_k for one in self.layers)

    @property
    def capacity_j_m2_k(self) -> float:
        """Heat that a square metre stores for each kelvin."""
        return sum(one.thickness_m * one.density_kg_m3 * one.heat_j_kg_k for one in self.layers)

    def steady_k(self) -> tuple[float, float]:
        """Return the temperatures of sides a and b in full light."""
        from scipy.optimize import brentq

        def surplus(cold: float) -> float:
            hot = cold + self._drop_k(cold)
            return self.absorbed * self.light_w_m2 - self._radiated(hot, cold)

        cold = float(brentq(surplus, 10.0, 1000.0, xtol=1e-9))
        return cold + self._drop_k(cold), cold

    def acceleration_m_s2(self, hot_k: float, cold_k: float) -> float:
        """Return the acceleration towards the Sun at temperatures of sides a and b."""
        scale = 2.0 * STEFAN_W_M2_K4 * self.area_m2 / (3.0 * LIGHT_M_S * self.mass_kg)
        return scale * (self.emissivity_b * cold_k**4 - self.emissivity_a * hot_k**4)

    def mean_k_over(self, shadow_s: float, end_s: float, capacities: float = 1.0) -> Array:
        """Return the mean temperature (n,) every 10 s from the begin of a shadow to `end_s`.

        `capacities` multiplies the capacity of the layers.
        """
        hot, cold = self.steady_k()
        mean, found = 0.5 * (hot + cold), []
        for k in range(math.ceil(end_s / _STEP_S) + 1):
            found.append(mean)
            light = 0.0 if k * _STEP_S < shadow_s else self.absorbed * self.light_w_m2
            half = 0.5 * self._drop_k(mean) * min(light, 1.0)
            flow = light - self._radiated(mean + half, mean - half)
            mean += flow * _STEP_S / (capacities * self.capacity_j_m2_k)
        return np.array(found)

    def _drop_k(self, cold_k: float) -> float:
        return self.resistance_k_m2_w * self.emissivity_b * STEFAN_W_M2_K4 * cold_k**4

    def _radiated(self, hot_k: float, cold_k: float) -> float:
        return STEFAN_W_M2_K4 * (self.emissivity_a * hot_k**4 + self.emissivity_b * cold_k**4)
