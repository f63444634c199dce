"""Wind on the dish: mean speed, gusts along and across it, torque on both axes by attitude.

Gusts have Davenport's spectrum (Davenport 1961, V the mean speed at 10 m height),

    S(f) = 4 kappa V^2 / f * x^2 / (1 + x^2)^(4/3),   x = 1200 m * f / V

approximated by white noise through G s (s + z1)(s + z2) / ((s + p1)...(s + p4)), exact at any time
step.

    torque = rho/2 * V^2 * A * D * (c0 + c1 n.f) * (n x f)

with n the boresight and f the direction the wind blows to; its vertical part turns the azimuth
axis, its part along the elevation axis turns the elevation axis.  V and f follow the gusts, so the
torque gusts with 2 V v and with the swing of the direction.  Coefficients are of the size of
wind-tunnel results for paraboloids; docs/math/wind.md.
"""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rf_pointing.core import Params, parameter, require_between
from rf_pointing.core.types import Array

# Gusts are renewed on a grid of their own, so that the wind of a seed does not depend on the
# control period.
_GUST_STEP_S = 0.02
# Below this there is no wind; the shaping filter's poles would lie at zero.
_CALM_M_S = 1e-3
# Fitted in x, so that one fit serves all speeds: within 0.3 dB for 0.3 < x < 1000, that is 2 mHz to
# 6.7 Hz at 8 m/s.
GUST_LENGTH_M = 1200.0
_LEVEL = 39.5379847
_ZEROS = np.array([15.9230820, 202.318487])
_POLES = np.array([0.275876131, 1.82643308, 24.2825212, 313.564259])


@dataclass(frozen=True, kw_only=True)
class WindParams(Params):
    """Wind at the dish, and the aerodynamic coefficients of the dish."""

    mean_speed_m_s: float = parameter(0.0, "mean wind speed", low=0.0, high=60.0)
    from_azimuth_rad: float = parameter(0.0, "azimuth the wind comes from", low=-6.3, high=6.3)
    drag_coefficient: float = parameter(
        0.005, "surface drag coefficient kappa of the site", low=0.0, high=0.1
    )
    lateral_ratio: float = parameter(
        0.75, "rms of the gusts across the wind over those along it", low=0.0, high=2.0
    )
    dish_diameter_m: float = parameter(34.0, "dish diameter", low=0.1, high=200.0)
    air_density: float = parameter(1.225, "air density in kg/m^3", low=0.1, high=2.0)
    moment_base: float = parameter(0.10, "moment coefficient c0", low=-1.0, high=1.0)
    moment_incidence: float = parameter(
        0.08, "moment coefficient c1, with the dish facing the wind", low=-1.0, high=1.0
    )


@dataclass(slots=True)
class WindState:
    """Filters along and across (2, 4), time to the next gust value, noise generator."""

    filters: Array
    left_s: float
    random: Mapping[str, Any]


def wind_torque_n_m(
    params: WindParams,
    along_m_s: float,
    across_m_s: float,
    azimuth_rad: float,
    elevation_rad: float,
) -> tuple[float, float]:
    """Return the torques (N m) on azimuth and elevation of a wind on the dish's attitude.

    `along_m_s` is mean plus gust along the mean direction, `across_m_s` the gust to the right of
    it.
    """
    area = 0.25 * math.pi * params.dish_diameter_m**2
    lever = 0.5 * params.air_density * area * params.dish_diameter_m
    pressure = lever * (along_m_s * along_m_s + across_m_s * across_m_s)
    # The wind is named by where it comes from; the torque needs where it blows to.
    off = params.from_azimuth_rad + math.pi + math.atan2(across_m_s, along_m_s) - azimuth_rad
    level, facing = math.cos(elevation_rad), math.cos(off)
    coefficient = params.moment_base - params.moment_incidence * level * facing
    return (
        pressure * coefficient * level * math.sin(off),
        -pressure * coefficient * math.sin(elevation_rad) * facing,
    )


@dataclass(frozen=True, slots=True)
class GustFilter:
    """Shaping filter in diagonal form, driven by one white noise.

    Its states decay at `poles_rad_s` (4,) and sum to the gust speed by `residues` (4,).
    """

    poles_rad_s: Array
    residues: Array

    @classmethod
    def davenport(cls, mean_speed_m_s: float, drag_coefficient: float) -> "GustFilter":
        """Return the filter of Davenport's spectrum at a mean speed (m/s) and drag coefficient."""
        require_between("mean_speed_m_s", mean_speed_m_s, 1e-3, None)
        scale = 2.0 * math.pi * mean_speed_m_s / GUST_LENGTH_M
        gain = scale * math.sqrt(0.5 * drag_coefficient * mean_speed_m_s * GUST_LENGTH_M * _LEVEL)
        # Those of s (s + z1)(s + z2) / prod(s + p) at its poles.
        residues = [
            -p * np.prod(_ZEROS - p) / np.prod(np.delete(_POLES, k) - p)
            for k, p in enumerate(_POLES)
        ]
        return cls(scale * _POLES, gain * np.array(residues))

    def step_matrices(self, dt_s: float) -> tuple[Array, Array]:
        """Return the decay (4,) and the noise factor (4, 4) of a step of `dt_s`.

        After an infinite step nothing is left of the state before: the factor times unit normal
        numbers is a stationary state.
        """
        sums = np.add.outer(self.poles_rad_s, self.poles_rad_s)
        # Poles a factor of a thousand apart make the covariance singular to rounding.
        values, vectors = np.linalg.eigh(-np.expm1(-sums * dt_s) / sums)
        return np.exp(-self.poles_rad_s * dt_s), vectors * np.sqrt(np.maximum(values, 0.0))


class Wind:
    """Gusting wind: `step` returns the torque on both axes; gusts are renewed every 20 ms."""

    def __init__(self, params: WindParams, random: "np.random.Generator") -> None:
        self.params, self._random = params, random
        self._blows = params.mean_speed_m_s > _CALM_M_S
        self._filter = GustFilter.davenport(
            max(params.mean_speed_m_s, _CALM_M_S), params.drag_coefficient
        )
        self._decay, self._noise = self._filter.step_matrices(_GUST_STEP_S)
        filters = random.standard_normal((2, 4)) @ self._filter.step_matrices(math.inf)[1].T
        self._state = WindState(filters, _GUST_STEP_S, random.bit_generator.state)

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
        return self.params.mean_speed_m_s + along, self.params.lateral_ratio * across

    def step(self, dt_s: float, azimuth_rad: float, elevation_rad: float) -> Array:
        """Advance the gusts by `dt_s` and return the torque (2,) in N m of both axes."""
        require_between("dt_s", dt_s, 1e-6, 10.0)
        if not self._blows:
            return np.zeros(2)
        self._state.left_s -= dt_s
        # The tolerance is a rounding error of many ticks, far below any step.
        while self._state.left_s <= 1e-9:
            noise = self._random.standard_normal((2, 4))
            self._state.filters = self._state.filters * self._decay + noise @ self._noise.T
            self._state.left_s += _GUST_STEP_S
        along, across = self.speed_m_s
        return np.array(wind_torque_n_m(self.params, along, across, azimuth_rad, elevation_rad))


class WindSource(Protocol):
    """Whatever turns the axes of a simulated antenna from outside."""

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Wind speed along a direction and across it to the right, as an anemometer shows it."""

    def step(self, dt_s: float, azimuth_rad: float, elevation_rad: float) -> Array:
        """Advance by `dt_s` and return the torque (2,) in N m of both axes."""


class RecordedWind:
    """Wind that blew once more: linear between its records, and held at both ends.

    Parameters
    ----------
    params : of the dish; its mean speed and direction do not count.
    start_s : time at which the first step begins.
    t_s : times (n,) of the records, rising.
    velocity_m_s : velocity (n, 2) of the air to east and north, whose torque follows the attitude.
    torque_n_m : torque (n, 2) of azimuth and elevation itself, in place of a velocity.
    """

    def __init__(
        self, params: WindParams, start_s: float, t_s: Array, *,
        velocity_m_s: Array | None = None, torque_n_m: Array | None = None,
    ) -> None:  # fmt: skip
        if (velocity_m_s is None) == (torque_n_m is None):
            raise ValueError("a recorded wind needs velocity_m_s or torque_n_m, one of them")
        # Named by where it comes from: along 0 deg it blows to the south, and its right is west.
        self._params = params.replace(from_azimuth_rad=0.0)
        self._torque = torque_n_m is not None
        self._t_s, self._now_s = t_s, start_s
        given = torque_n_m if velocity_m_s is None else -velocity_m_s[:, ::-1]
        self._columns = np.asarray(given).T

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Wind speed to south and west; zero where only its torque is known."""
        return (0.0, 0.0) if self._torque else self._now()

    def step(self, dt_s: float, azimuth_rad: float, elevation_rad: float) -> Array:
        """Advance by `dt_s` and return the torque (2,) in N m of both axes."""
        first, second = self._now()
        self._now_s += dt_s
        if self._torque:
            return np.array((first, second))
        return np.array(wind_torque_n_m(self._params, first, second, azimuth_rad, elevation_rad))

    def _now(self) -> tuple[float, float]:
        first, second = (
            float(np.interp(self._now_s, self._t_s, column)) for column in self._columns
        )
        return first, second
