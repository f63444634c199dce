"""Radio refraction of the troposphere: true elevation to apparent elevation, and its exact inverse.

The bending R of a ray that arrives at the apparent elevation E (s = sin E, c = cos E) is

    R(E) = N0 c / (s + (p1 s + p0) / (s^2 + q1 s + q0)),        true = E - R(E)

whose four coefficients are fitted once, on construction, to rays traced through a spherical
atmosphere of two exponentials (dry and wet) that has the refractivity N0 of ITU-R P.453 at the
antenna.  The form is exactly zero at the zenith and changes sign there, so a plunged antenna
(elevation above 90 deg) sees the same sky.  Below the horizon no ray arrives: from 0 to -1 deg of
apparent elevation R levels off smoothly to a constant, so that a target that has not risen yet
still has continuous rates.  In steep air it levels off earlier, before the form's pole: the
constant is less than three times the bending on the horizon.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np

from rf_pointing.core.checks import require_finite
from rf_pointing.core.parameters import Params, parameter
from rf_pointing.core.types import Array

_EARTH_RADIUS_M = 6.371e6
# Scale height of dry air per kelvin, R/(M g): it gives the zenith delay of 2.28 mm/hPa that the
# pressure fixes.
_DRY_HEIGHT_M_PER_K = 29.27
_WET_HEIGHT_M = 2000.0
_TOP_M = 1.2e5
# Refractivity gradient in N units per metre at which rays near the horizon follow the ground
# (0.157, less 5 %).
_DUCTING_PER_M = 0.150
_LEVEL_RAD = math.radians(0.5)
# Largest part of the way from the horizon to the pole, along the form's slope, that R is followed.
_LARGEST_SHARE = 0.5
# Newton squares the error in each step: after a step this small the next would be below 1e-15
# rad.
_TOLERANCE_RAD = 1e-9
# Where every step were a bisection, 0.3 rad would take 29 to the tolerance.
_MAX_ITERATIONS = 60
# Rays that the closed form is fitted to: dense near the horizon, where the bending changes fastest.
_FITTED_RAD = np.radians(np.concatenate([np.linspace(0.0, 3.0, 40), np.linspace(3.5, 85.0, 60)]))
# Above this sine relative errors count: 0.1 % at the horizon is as good as at 45 deg.
_LEAST_SINE = 0.02
# Nodes of the integral along one ray.
_NODES = 200


@dataclass(frozen=True, kw_only=True)
class RadioRefraction(Params):
    """Refraction from the weather at the antenna; `standard` gives the mean of an altitude."""

    pressure_hpa: float = parameter(
        1013.25, "air pressure at the antenna, not reduced to sea level", 300.0, 1100
    )
    temperature_k: float = parameter(288.15, "air temperature at the antenna", 180.0, 330.0)
    relative_humidity: float = parameter(0.5, "relative humidity at the antenna, 0 to 1", 0.0, 1.0)

    def check_together(self) -> None:
        """Refuse air in which horizontal rays are trapped: no elevation correction exists there."""
        gradient = self.refractivity_dry / (_DRY_HEIGHT_M_PER_K * self.temperature_k)
        gradient += self.refractivity_wet / _WET_HEIGHT_M
        if gradient > _DUCTING_PER_M:
            raise ValueError(
                f"relative_humidity={self.relative_humidity} at temperature_k={self.temperature_k} gives "
                f"{1e3 * gradient:.0f} N/km, must be <= {1e3 * _DUCTING_PER_M:.0f} N/km: low rays would be trapped"
            )

    # Its rays are traced once for all tracks of a site.
    @classmethod
    @lru_cache(maxsize=64)
    def standard(cls, altitude_m: float) -> Self:
        """Return the refraction of the ICAO standard troposphere with half saturated air."""
        # ICAO: 6.5 K per kilometre, and the pressure that follows from it.
        temperature_k = 288.15 - 6.5e-3 * altitude_m
        return cls(
            pressure_hpa=1013.25 * (temperature_k / 288.15) ** 5.2559, temperature_k=temperature_k
        )

    @cached_property
    def refractivity_dry(self) -> float:
        """Dry term of the surface refractivity in N units (ITU-R P.453-14 equation 5)."""
        return 77.6 * (self.pressure_hpa - self._vapour_pressure_hpa) / self.temperature_k

    @cached_property
    def refractivity_wet(self) -> float:
        """Wet term of the surface refractivity in N units (ITU-R P.453-14 equation 5)."""
        vapour_hpa = self._vapour_pressure_hpa
        return 72.0 * vapour_hpa / self.temperature_k + 3.75e5 * vapour_hpa / self.temperature_k**2

    def apply(self, elevation_rad: Any) -> Any:
        """Return the apparent elevation of true elevations, float for float, array for array.

        Defined over [-pi/2, 3 pi/2]: beyond pi/2 the antenna is plunged and the correction still
        lifts the ray.
        """
        return self._apparent(elevation_rad)[0]

    def remove(self, apparent_rad: Any) -> Any:
        """Return the true elevation of apparent elevations; the exact inverse of `apply`."""
        return apparent_rad - self._bending(apparent_rad)[0]

    def apply_with_rates(
        self, elevation_rad: Any, rate_rad_s: Any, acceleration_rad_s2: Any
    ) -> tuple[Any, Any, Any]:
        """Return the apparent elevation with rate and acceleration."""
        apparent, slope, curvature = self._apparent(elevation_rad)
        gain = 1.0 / (1.0 - slope)
        acceleration = acceleration_rad_s2 * gain + rate_rad_s**2 * curvature * gain**3
        return apparent, rate_rad_s * gain, acceleration

    def _apparent(self, elevation_rad: Any) -> tuple[Any, Any, Any]:
        """Return the apparent elevation E, dR/dE and d2R/dE2 there (Newton on the inverse).

        E - R(E) increases everywhere, so the largest bending brackets the root: a step that leaves
        the bracket or is not half the one before, as below a steep horizon, becomes a bisection.
        """
        require_finite("elevation_rad", elevation_rad)
        plain = isinstance(elevation_rad, float)
        # A step of Newton from the true elevation: it misses by the curvature alone.
        guess, slope, _ = self._bending(elevation_rad)
        apparent = elevation_rad + guess / (1.0 - slope)
        low, high = elevation_rad - self._reach_rad, elevation_rad + self._reach_rad
        longest: Any = math.inf
        for _ in range(_MAX_ITERATIONS):
            bending, slope, curvature = self._bending(apparent)
            misfit = apparent - bending - elevation_rad
            step = misfit / (1.0 - slope)
            before, apparent, size = apparent, apparent - step, abs(step)
            # Plain floats apart: numpy takes ten times longer for one elevation.
            if plain:
                if size < _TOLERANCE_RAD:
                    break
                low, high = (low, before) if misfit > 0.0 else (before, high)
                if not (low < apparent < high and size < longest):
                    apparent = 0.5 * (low + high)
            else:
                small = size < _TOLERANCE_RAD
                if np.all(small):
                    break
                low, high = (
                    np.where(misfit > 0.0, low, before),
                    np.where(misfit > 0.0, before, high),
                )
                good = small | ((low < apparent) & (apparent < high) & (size < longest))
                apparent = np.where(good, apparent, 0.5 * (low + high))
            # Steps that do not shrink would creep towards a cycle around the kink at the horizon.
            longest = 0.5 * size
        else:
            raise ValueError(
                f"elevation_rad={elevation_rad} has no apparent elevation in {_MAX_ITERATIONS} steps"
            )
        return apparent, slope, curvature

    @cached_property
    def _vapour_pressure_hpa(self) -> float:
        celsius = self.temperature_k - 273.15
        return self.relative_humidity * 6.1121 * math.exp(17.502 * celsius / (celsius + 240.97))

    @cached_property
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        """N0 and p1, p0, q1, q0 by least squares on traced rays, each weighted by its bending."""
        n0 = 1e-6 * (self.refractivity_dry + self.refractivity_wet)
        bending = self._traced_bending(_FITTED_RAD)
        s = np.sin(_FITTED_RAD)
        rest = n0 * np.cos(_FITTED_RAD) / bending - s
        weight = bending / np.maximum(s, _LEAST_SINE)
        columns = np.stack([s, np.ones_like(s), -rest * s, -rest], axis=1) * weight[:, None]
        p1, p0, q1, q0 = np.linalg.lstsq(columns, rest * s**2 * weight, rcond=None)[0]
        return n0, float(p1), float(p0), float(q1), float(q0)

    @cached_property
    def _level_rad(self) -> float:
        """Return how far below the horizon R still grows: half of the way to the pole, or less."""
        _, p1, p0, q1, q0 = self._coefficients
        at_horizon, slope = p0 / q0, 1.0 + (p1 - q1 * p0 / q0) / q0
        return min(_LEVEL_RAD, _LARGEST_SHARE * at_horizon / slope)

    @cached_property
    def _reach_rad(self) -> float:
        """Return slightly more than the largest bending, which is that below the horizon."""
        return 1.01 * float(self._bending(-0.25 * math.pi)[0])

    def _traced_bending(self, apparent_rad: Array) -> Array:
        """Bending integral of -(dn/dr) c / (n sqrt(n^2 r^2 - c^2)) dr, r = r0 + x^2."""
        # Gauss-Legendre in x = sqrt(height): the integrand is singular in height at the horizon.
        node, weight = np.polynomial.legendre.leggauss(_NODES)
        x = 0.5 * math.sqrt(_TOP_M) * (node + 1.0)
        height = x**2
        dry_height, wet_height = _DRY_HEIGHT_M_PER_K * self.temperature_k, _WET_HEIGHT_M
        dry = 1e-6 * self.refractivity_dry * np.exp(-height / dry_height)
        wet = 1e-6 * self.refractivity_wet * np.exp(-height / wet_height)
        n, n0 = 1.0 + dry + wet, 1.0 + 1e-6 * (self.refractivity_dry + self.refractivity_wet)
        gradient = dry / dry_height + wet / wet_height
        invariant = n0 * _EARTH_RADIUS_M * np.cos(apparent_rad)[:, None]
        # n r - c without cancellation: at the horizon it is metres out of 6.4e6.
        above = n * height + (n - n0) * _EARTH_RADIUS_M
        above = above + 2.0 * n0 * _EARTH_RADIUS_M * np.sin(apparent_rad[:, None] / 2.0) ** 2
        integrand = (
            invariant * gradient * 2.0 * x / (n * np.sqrt(above * (above + 2.0 * invariant)))
        )
        traced: Array = integrand @ (weight * 0.5 * math.sqrt(_TOP_M))
        return traced

    def _bending(self, apparent_rad: Any) -> tuple[Any, Any, Any]:
        """Return R, dR/dE and d2R/dE2, mirrored at the zenith, level below the horizon."""
        plain = isinstance(apparent_rad, float)
        # Plain floats through the math module: a pointing loop needs one elevation at a time.
        sin, cos, copysign = (
            (math.sin, math.cos, math.copysign) if plain else (np.sin, np.cos, np.copysign)
        )
        side: Any = copysign(1.0, 0.5 * math.pi - apparent_rad)
        folded = 0.5 * math.pi - side * (0.5 * math.pi - apparent_rad)
        level, level_slope, level_curvature = _levelled(folded, self._level_rad)
        n0, p1, p0, q1, q0 = self._coefficients
        s: Any = sin(level)
        c: Any = cos(level)
        denominator = s * (s + q1) + q0
        ratio = (p1 * s + p0) / denominator
        ratio_s = (p1 - ratio * (2.0 * s + q1)) / denominator
        q_ss = -2.0 * (ratio_s * (2.0 * s + q1) + ratio) / denominator
        q, q_s = s + ratio, 1.0 + ratio_s
        bending = n0 * c / q
        slope = -n0 * (s + c * c * q_s / q) / q
        curvature = (
            n0 * c * (-1.0 + (3.0 * s * q_s - c * c * q_ss) / q + 2.0 * (c * q_s / q) ** 2) / q
        )
        return (
            side * bending,
            slope * level_slope,
            side * (curvature * level_slope**2 + slope * level_curvature),
        )


def _levelled(elevation_rad: Any, depth_rad: float) -> tuple[Any, Any, Any]:
    """Return the elevation held from below, C2: itself above the horizon, then down to `-depth`."""
    if isinstance(elevation_rad, float) and elevation_rad >= 0.0:
        return elevation_rad, 1.0, 0.0
    width = 2.0 * depth_rad
    above = elevation_rad + width
    t = np.minimum(np.maximum(above / width, 0.0), 1.0)
    level = -depth_rad + width * t**3 * (1.0 - 0.5 * t) + np.maximum(above - width, 0.0)
    return level, t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / width
