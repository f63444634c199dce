"""Orbital motion by numerical integration, many orbits at once.

    r'' = -GM r / r^3 + forces      (`forces`)

Neighbouring trajectories are integrated together with the nominal one, so that partial derivatives
are differences of orbits that took the same steps.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import EARTH_MU_M3_S2, Array, as_finite_array
from rf_pointing.orbit.forces import Disturbances

# Millimetres after days; looser, and the differences of neighbouring orbits would show the
# integrator.
_RELATIVE_TOLERANCE = 1e-11


class Attraction(Protocol):
    """The Earth's attraction, as far as it is not among the disturbances."""

    def acceleration(self, position_m: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""


class PointMass:
    """An Earth without a shape."""

    def acceleration(self, position_m: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""
        square = np.einsum("...i,...i->...", position_m, position_m)
        return np.asarray(
            -EARTH_MU_M3_S2 * position_m / (square * np.sqrt(square))[..., np.newaxis]
        )


POINT_MASS = PointMass()


def propagate_together(
    states: ArrayLike, elapsed_s: ArrayLike, gravity: Attraction, *, epoch_t_s: float = 0.0,
    disturbances: Disturbances | None = None, scales: Array | None = None,
    tolerance: float = _RELATIVE_TOLERANCE,
) -> Array:  # fmt: skip
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


def _integrate(
    bundle: Array, elapsed_s: Array, gravity: Attraction, epoch_t_s: float,
    disturbances: Disturbances | None, scales: Array | None, tolerance: float,
) -> Array:  # fmt: skip
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
        slope, (0.0, end), bundle.ravel(), method="DOP853", t_eval=wanted, rtol=tolerance,
        atol=scale,
    )  # fmt: skip
    if not solution.success:
        raise ValueError(f"orbit integration to {end:.0f} s failed: {solution.message}")
    found = solution.y.T.reshape(-1, *shape)
    if end < 0.0:
        place = len(wanted) - 1 - place
    result = np.empty((len(elapsed_s), *shape))
    result[order] = found[place]
    return result
