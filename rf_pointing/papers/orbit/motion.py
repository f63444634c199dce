"""Orbital motion under the Earth's two-body and zonal attraction (J2 to J4), by numerical integration; drag and tides besides.

    a = -GM r / r^3 + J2, J3, J4 in closed form (Vallado, Fundamentals of Astrodynamics, 9.7)

Neighbouring trajectories are integrated together with the nominal one, so that partial derivatives with respect to
the starting state are differences of orbits that took the same steps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.papers.orbit.disturbances import Disturbances

__all__ = ["Gravity", "Trajectory", "propagate", "propagate_together"]

Array = NDArray[np.float64]

_STEP_M, _STEP_M_S = 10.0, 0.01
_RELATIVE_TOLERANCE = 1e-11


@dataclass(frozen=True, kw_only=True)
class Gravity(Params):
    """Zonal harmonics of the attraction (JGM-3); zero switches one off."""

    j2: float = parameter(1.08262668e-3, "second zonal harmonic", low=0.0, high=0.01)
    j3: float = parameter(-2.53265649e-6, "third zonal harmonic", low=-1e-4, high=1e-4)
    j4: float = parameter(-1.61962159e-6, "fourth zonal harmonic", low=-1e-4, high=1e-4)

    def acceleration(self, position_m: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""
        # With u = 1/r^2, s = z^2 u and a, b, d the three harmonics; few operations, for the arrays are small.
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


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States (n, 6) at `t_s` (n,) and, if asked for, their partials (n, 6, 6) with respect to the first state."""

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
    """Integrate `state` (6,) at `epoch_t_s` to the times `t_s` (n,), sorted, on either side of the epoch.

    Raises ValueError for unsorted times and when the integrator gives up.
    """
    start, times = as_finite_array("state", state, (6,)), as_finite_array("t_s", t_s, (None,))
    if np.any(np.diff(times) < 0.0):
        raise ValueError("t_s must not decrease")
    bundle = _bundle(start) if with_partials else start[np.newaxis]
    result = propagate_together(bundle, times - epoch_t_s, gravity, epoch_t_s=epoch_t_s, disturbances=disturbances)
    return Trajectory(times, result[:, 0], _differences(result) if with_partials else None)


def propagate_together(
    states: ArrayLike,
    elapsed_s: ArrayLike,
    gravity: Gravity,
    *,
    epoch_t_s: float = 0.0,
    disturbances: Disturbances | None = None,
) -> Array:
    """Integrate many starting states (m, 6) over the same elapsed times (n,), sorted: the result is (n, m, 6).

    `epoch_t_s` matters only to `disturbances`.
    """
    bundle, times = as_finite_array("states", states, (None, 6)), as_finite_array("elapsed_s", elapsed_s, (None,))
    if np.any(np.diff(times) < 0.0):
        raise ValueError("elapsed_s must not decrease")
    result = np.empty((len(times), *bundle.shape))
    for side in (times < 0.0, times >= 0.0):
        if np.any(side):
            result[side] = _integrate(bundle, times[side], gravity, epoch_t_s, disturbances)
    return result


def _bundle(start: Array) -> Array:
    steps = np.diag([_STEP_M] * 3 + [_STEP_M_S] * 3)
    return np.concatenate([start[np.newaxis], start + steps, start - steps])


def _differences(bundle: Array) -> Array:
    size = np.array([_STEP_M] * 3 + [_STEP_M_S] * 3)
    slopes: Array = (bundle[:, 1:7] - bundle[:, 7:13]) / (2.0 * size[:, np.newaxis])
    return np.swapaxes(slopes, 1, 2)


def _integrate(
    bundle: Array, elapsed_s: Array, gravity: Gravity, epoch_t_s: float, disturbances: Disturbances | None
) -> Array:
    from scipy.integrate import solve_ivp

    shape = bundle.shape

    def slope(elapsed: float, flat: Array) -> Array:
        states = flat.reshape(shape)
        acceleration = gravity.acceleration(states[:, :3])
        if disturbances is not None:
            acceleration += disturbances.acceleration(epoch_t_s + elapsed, states)
        return np.concatenate([states[:, 3:], acceleration], axis=1).ravel()

    order = np.argsort(np.abs(elapsed_s), kind="stable")
    wanted, place = np.unique(elapsed_s[order], return_inverse=True)
    wanted = wanted if elapsed_s[order][-1] >= 0.0 else wanted[::-1]
    end = float(wanted[-1])
    if end == 0.0:
        return np.broadcast_to(bundle, (len(elapsed_s), *shape))
    scale = np.tile([1e-5] * 3 + [1e-8] * 3, shape[0])
    solution = solve_ivp(
        slope, (0.0, end), bundle.ravel(), method="DOP853", t_eval=wanted, rtol=_RELATIVE_TOLERANCE, atol=scale
    )
    if not solution.success:
        raise ValueError(f"orbit integration to {end:.0f} s failed: {solution.message}")
    found = solution.y.T.reshape(-1, *shape)
    if end < 0.0:
        place = len(wanted) - 1 - place
    result = np.empty((len(elapsed_s), *shape))
    result[order] = found[place]
    return result
