"""Orbital motion by numerical integration, and the turning Earth under it.

    a = -GM r / r^3 + J2, J3, J4 in closed form

Vallado, Fundamentals of Astrodynamics, 9.7.  Further forces (`forces`) are optional; the zonal
harmonics are then those of the field, and the Earth is `POINT_MASS` here.

Neighbouring trajectories are integrated together with the nominal one, so that partial derivatives
with respect to the starting state are differences of orbits that took the same steps.

Precession, nutation, polar motion and UT1-UTC are left out: inertial axes here are "true equator,
mean equinox of date" to a few arc seconds, the same for simulated and estimated orbits.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Params, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.core.types import Array
from rf_pointing.orbit.forces import Disturbances, sidereal_angle_rad, turned_about_pole

_FLATTENING = 1.0 / 298.257223563
# Central differences: the curvature of the orbit cancels, rounding stays below 1e-9 of the
# partials.
_STEP_M, _STEP_M_S = 10.0, 0.01
# Millimetres after days; looser, and the differences of neighbouring orbits would show the
# integrator.
_RELATIVE_TOLERANCE = 1e-11


def to_earth_fixed(vector: Array, t_s: ArrayLike) -> Array:
    """Return inertial vectors (n, 3) in Earth-fixed axes; `to_inertial` is the inverse."""
    return turned_about_pole(vector, -sidereal_angle_rad(t_s))


def to_inertial(vector: Array, t_s: ArrayLike) -> Array:
    """Return Earth-fixed vectors (n, 3) in inertial axes."""
    return turned_about_pole(vector, sidereal_angle_rad(t_s))


@dataclass(frozen=True, kw_only=True)
class Site(Params):
    """A tracking station on the WGS-84 ellipsoid."""

    name: str = parameter(description="station name")
    latitude_rad: float = parameter(
        description="geodetic latitude", low=-math.pi / 2.0, high=math.pi / 2.0
    )
    longitude_rad: float = parameter(
        description="longitude, east positive", low=-math.pi, high=2.0 * math.pi
    )
    height_m: float = parameter(0.0, "height above the ellipsoid", low=-500.0, high=9000.0)

    def position_m(self) -> Array:
        """Return the Earth-fixed position (3,)."""
        # WGS-84: geodetic latitude, so the station is not on the line to the Earth's centre.
        eccentricity2 = _FLATTENING * (2.0 - _FLATTENING)
        sin_lat, cos_lat = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        normal = EARTH_RADIUS_M / math.sqrt(1.0 - eccentricity2 * sin_lat**2)
        across = (normal + self.height_m) * cos_lat
        up = (normal * (1.0 - eccentricity2) + self.height_m) * sin_lat
        return np.array(
            [across * math.cos(self.longitude_rad), across * math.sin(self.longitude_rad), up]
        )

    def axes(self) -> Array:
        """Return the rotation (3, 3) from Earth-fixed axes to east, north, up."""
        sin_lat, cos_lat = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        sin_lon, cos_lon = math.sin(self.longitude_rad), math.cos(self.longitude_rad)
        return np.array(
            [
                [-sin_lon, cos_lon, 0.0],
                [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
                [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
            ]
        )


@dataclass(frozen=True, kw_only=True)
class Gravity(Params):
    """Zonal harmonics of the attraction (JGM-3); zero switches one off."""

    j2: float = parameter(1.08262668e-3, "second zonal harmonic", low=0.0, high=0.01)
    j3: float = parameter(-2.53265649e-6, "third zonal harmonic", low=-1e-4, high=1e-4)
    j4: float = parameter(-1.61962159e-6, "fourth zonal harmonic", low=-1e-4, high=1e-4)

    def acceleration(self, position_m: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""
        # With u = 1/r^2, s = z^2 u and a, b, d the three harmonics; few operations, for the arrays
        # are small.
        z = position_m[..., 2]
        u = 1.0 / np.einsum("...i,...i->...", position_m, position_m)
        s = z * z * u
        a = (1.5 * self.j2 * EARTH_RADIUS_M**2) * u
        w = u * u
        d = (0.625 * self.j4 * EARTH_RADIUS_M**4) * w
        c = (2.5 * self.j3 * EARTH_RADIUS_M**3) * u
        b = c * u * z
        rest = a + 3.0 * b
        scale = (-EARTH_MU_M3_S2) * u * np.sqrt(u)
        across = 1.0 + rest - 3.0 * d + s * (d * (42.0 - 63.0 * s) - 5.0 * a - 7.0 * b)
        result: Array = position_m * (scale * across)[..., np.newaxis]
        result[..., 2] += scale * (z * (rest + a + d * (28.0 * s - 12.0)) - 0.6 * c)
        return result


POINT_MASS = Gravity(j2=0.0, j3=0.0, j4=0.0)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States (n, 6) at `t_s` (n,); partials (n, 6, 6) by the first state, if requested."""

    t_s: Array
    states: Array
    partials: Array | None


def propagate(
    epoch_t_s: float,
    state: ArrayLike,
    t_s: ArrayLike,
    gravity: Gravity,
    *,
    with_partials: bool = False,
    disturbances: Disturbances | None = None,
) -> Trajectory:
    """Integrate `state` (6,) at `epoch_t_s` to the times `t_s` (n,), sorted, on either side of the
    epoch.

    Raises ValueError for unsorted times and when the integrator gives up.
    """
    start, times = as_finite_array("state", state, (6,)), as_finite_array("t_s", t_s, (None,))
    if np.any(np.diff(times) < 0.0):
        raise ValueError("t_s must not decrease")
    bundle = _bundle(start) if with_partials else start[np.newaxis]
    result = propagate_together(
        bundle, times - epoch_t_s, gravity, epoch_t_s=epoch_t_s, disturbances=disturbances
    )
    return Trajectory(times, result[:, 0], _differences(result) if with_partials else None)


def propagate_together(
    states: ArrayLike,
    elapsed_s: ArrayLike,
    gravity: Gravity,
    *,
    epoch_t_s: float = 0.0,
    disturbances: Disturbances | None = None,
    scales: Array | None = None,
    tolerance: float = _RELATIVE_TOLERANCE,
) -> Array:
    """Integrate many starting states (m, 6) over the same elapsed times (n,), sorted.

    The result is (n, m, 6).  `epoch_t_s` and the `scales` (m, 3) of each state matter only to
    `disturbances`.  `tolerance` is that of a step, relative.
    """
    bundle, times = (
        as_finite_array("states", states, (None, 6)),
        as_finite_array("elapsed_s", elapsed_s, (None,)),
    )
    if np.any(np.diff(times) < 0.0):
        raise ValueError("elapsed_s must not decrease")
    result = np.empty((len(times), *bundle.shape))
    # The integrator runs in one direction: once back and once ahead from the epoch.
    for side in (times < 0.0, times >= 0.0):
        if np.any(side):
            result[side] = _integrate(
                bundle, times[side], gravity, epoch_t_s, disturbances, scales, tolerance
            )
    return result


def _bundle(start: Array) -> Array:
    steps = np.diag([_STEP_M] * 3 + [_STEP_M_S] * 3)
    return np.concatenate([start[np.newaxis], start + steps, start - steps])


def _differences(bundle: Array) -> Array:
    size = np.array([_STEP_M] * 3 + [_STEP_M_S] * 3)
    slopes: Array = (bundle[:, 1:7] - bundle[:, 7:13]) / (2.0 * size[:, np.newaxis])
    return np.swapaxes(slopes, 1, 2)


def _integrate(
    bundle: Array,
    elapsed_s: Array,
    gravity: Gravity,
    epoch_t_s: float,
    disturbances: Disturbances | None,
    scales: Array | None,
    tolerance: float,
) -> Array:
    from scipy.integrate import solve_ivp

    shape = bundle.shape

    def slope(elapsed: float, flat: Array) -> Array:
        states = flat.reshape(shape)
        acceleration = gravity.acceleration(states[:, :3])
        if disturbances is not None:
            acceleration += disturbances.acceleration(epoch_t_s + elapsed, states, scales)
        return np.concatenate([states[:, 3:], acceleration], axis=1).ravel()

    order = np.argsort(np.abs(elapsed_s), kind="stable")
    # t_eval must be strictly monotonic; several measurements share a time.
    wanted, place = np.unique(elapsed_s[order], return_inverse=True)
    wanted = wanted if elapsed_s[order][-1] >= 0.0 else wanted[::-1]
    end = float(wanted[-1])
    if end == 0.0:
        return np.broadcast_to(bundle, (len(elapsed_s), *shape))
    # Metres and metres per second: one absolute tolerance would suit neither.
    scale = np.tile([1e-5] * 3 + [1e-8] * 3, shape[0])
    solution = solve_ivp(
        slope,
        (0.0, end),
        bundle.ravel(),
        method="DOP853",
        t_eval=wanted,
        rtol=tolerance,
        atol=scale,
    )
    if not solution.success:
        raise ValueError(f"orbit integration to {end:.0f} s failed: {solution.message}")
    found = solution.y.T.reshape(-1, *shape)
    if end < 0.0:
        place = len(wanted) - 1 - place
    result = np.empty((len(elapsed_s), *shape))
    result[order] = found[place]
    return result
