"""Wind on the dish: mean speed, Davenport gusts along and across it, torque on both axes by attitude.

    torque = rho/2 * V^2 * A * D * (c0 + c1 n.f) * (n x f)

with n the boresight and f the direction the wind blows to; its vertical part turns the azimuth axis, its part along the
elevation axis turns the elevation axis.  V and f follow the gusts, so the torque gusts with 2 V v and with the swing
of the direction.  Coefficients are of the size of wind-tunnel results for paraboloids; docs/math/wind.md.
"""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter, require_between
from rf_pointing.servo.gust import GustFilter

__all__ = ["Wind", "WindParams", "WindState", "gust_torque_n_m", "torque_constants", "wind_torque_n_m"]

Array = NDArray[np.float64]

_GUST_STEP_S = 0.02
_CALM_M_S = 1e-3


@dataclass(frozen=True, kw_only=True)
class WindParams(Params):
    """Wind at the dish and the dish's aerodynamic coefficients."""

    mean_speed_m_s: float = parameter(0.0, "mean wind speed", low=0.0, high=60.0)
    from_azimuth_rad: float = parameter(0.0, "azimuth the wind comes from", low=-6.3, high=6.3)
    drag_coefficient: float = parameter(0.005, "surface drag coefficient kappa of the site", low=0.0, high=0.1)
    lateral_ratio: float = parameter(0.75, "rms of the gusts across the wind over those along it", low=0.0, high=2.0)
    dish_diameter_m: float = parameter(34.0, "dish diameter", low=0.1, high=200.0)
    air_density: float = parameter(1.225, "air density in kg/m^3", low=0.1, high=2.0)
    moment_base: float = parameter(0.10, "moment coefficient c0", low=-1.0, high=1.0)
    moment_incidence: float = parameter(
        0.08, "moment coefficient c1, with the dish facing the wind", low=-1.0, high=1.0
    )


@dataclass(slots=True)
class WindState:
    """State of `Wind`: filter states along and across (2, 4), time left until the next gust value, noise generator."""

    filters: Array
    left_s: float
    random: Mapping[str, Any]


def wind_torque_n_m(
    params: WindParams, along_m_s: float, across_m_s: float, azimuth_rad: float, elevation_rad: float
) -> tuple[float, float]:
    """Return the torque (N m) about azimuth and elevation of a wind of these components on the dish's attitude.

    `along_m_s` is mean plus gust along the mean direction, `across_m_s` the gust to the right of it.
    """
    return gust_torque_n_m(along_m_s, across_m_s, azimuth_rad, elevation_rad, torque_constants(params))


def torque_constants(params: WindParams) -> tuple[float, float, float, float]:
    """Return what `gust_torque_n_m` needs: azimuth blown to, rho/2 A D, moment coefficients c0 and c1."""
    area = 0.25 * math.pi * params.dish_diameter_m**2
    lever = 0.5 * params.air_density * area * params.dish_diameter_m
    return params.from_azimuth_rad + math.pi, lever, params.moment_base, params.moment_incidence


def gust_torque_n_m(
    along_m_s: float,
    across_m_s: float,
    azimuth_rad: float,
    elevation_rad: float,
    constants: tuple[float, float, float, float],
) -> tuple[float, float]:
    """Return the torques of `wind_torque_n_m` from plain floats; also compiled."""
    blown_to, lever, base, incidence = constants
    pressure = lever * (along_m_s * along_m_s + across_m_s * across_m_s)
    off = blown_to + math.atan2(across_m_s, along_m_s) - azimuth_rad
    level, facing = math.cos(elevation_rad), math.cos(off)
    coefficient = base - incidence * level * facing
    return (
        pressure * coefficient * level * math.sin(off),
        -pressure * coefficient * math.sin(elevation_rad) * facing,
    )


class Wind:
    """Gusting wind: `step` returns the torque on both axes; gusts are renewed every 20 ms."""

    def __init__(self, params: WindParams, random: np.random.Generator) -> None:
        self._params, self._random = params, random
        self._torque = torque_constants(params)
        self._blows = params.mean_speed_m_s > _CALM_M_S
        speed = params.mean_speed_m_s if self._blows else 1.0
        self._filter = GustFilter.davenport(speed, params.drag_coefficient)
        self._decay, self._noise = self._filter.step_matrices(_GUST_STEP_S)
        filters = random.standard_normal((2, 4)) @ self._filter.stationary_factor().T
        self._state = WindState(filters, _GUST_STEP_S, random.bit_generator.state)

    @property
    def params(self) -> WindParams:
        """The parameter set in force."""
        return self._params

    @property
    def state(self) -> WindState:
        """A copy of the complete state, noise generator included."""
        self._state.random = self._random.bit_generator.state
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: WindState) -> None:
        self._state = copy.deepcopy(state)
        self._random.bit_generator.state = state.random

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Wind speed along the mean direction (mean plus gust) and across it to the right."""
        if not self._blows:
            return 0.0, 0.0
        along, across = (self._state.filters @ self._filter.residues).tolist()
        return self._params.mean_speed_m_s + along, self._params.lateral_ratio * across

    def step(self, dt_s: float, azimuth_rad: float, elevation_rad: float) -> Array:
        """Advance the gusts by `dt_s` and return the torque (2,) in N m on azimuth and elevation."""
        require_between("dt_s", dt_s, 1e-6, 10.0)
        if not self._blows:
            return np.zeros(2)
        self._state.left_s -= dt_s
        while self._state.left_s <= 1e-9:
            noise = self._random.standard_normal((2, 4))
            self._state.filters = self._state.filters * self._decay + noise @ self._noise.T
            self._state.left_s += _GUST_STEP_S
        along, across = self.speed_m_s
        return np.array(gust_torque_n_m(along, across, azimuth_rad, elevation_rad, self._torque))
