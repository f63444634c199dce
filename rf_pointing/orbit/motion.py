"""Orbital motion by numerical integration, many orbits at once.

    r'' = -GM r / r^3 + forces      (`forces`)

over a piece of a revolution with all its nodes together: the accelerations there are integrated as
polynomials, and positions and accelerations follow each other until neither moves (Picard's
iteration on Chebyshev's nodes; Bai and Junkins, J. Astronaut. Sci. 58, 2011).  The forces are
evaluated for hundreds of places in one call, where numpy costs least.

Neighbouring trajectories are integrated together with the nominal one, so that partial derivatives
are differences of orbits that took the same steps.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from rf_pointing.core import EARTH_MU_M3_S2, Array, as_finite_array
from rf_pointing.orbit.forces import Disturbances

# A field of degree 12 has 4 of its waves in a piece.
_NODES, _PIECES = 40, 3.0
_SETTLED_M, _MOST_SWEEPS, _INNER = 1e-4, 30, 3
# Waves that begin at -1, on the nodes, from values on them.
_X = -np.cos(np.linspace(0.0, math.pi, _NODES))
_FIT: Array = np.asarray(np.linalg.inv(chebyshev.chebvander(_X, _NODES - 1)), np.float64)
_SUM: Array = chebyshev.chebvander(_X, _NODES) @ chebyshev.chebint(_FIT, lbnd=-1, axis=0)


Attraction = Callable[[Array], Array]
"""The acceleration (..., 3) at positions (..., 3), m/s^2, as far as it is not a disturbance."""


def point_mass(position_m: Array) -> Array:
    """Return the acceleration (..., 3) by an Earth without a shape at positions (..., 3), m/s^2."""
    square = np.einsum("...i,...i->...", position_m, position_m)
    return np.asarray(-EARTH_MU_M3_S2 * position_m / (square * np.sqrt(square))[..., np.newaxis])


def propagate_together(
    states: ArrayLike, elapsed_s: ArrayLike, gravity: Attraction, *, epoch_t_s: float = 0.0,
    disturbances: Disturbances | None = None, scales: Array | None = None,
) -> Array:  # fmt: skip
    """Integrate many starting states (m, 6) over the same elapsed times (n,), in any order.

    The result is (n, m, 6).  `epoch_t_s` and the `scales` (m, 3) of each state matter only to
    `disturbances`.
    """
    bundle = as_finite_array("states", states, (None, 6))
    given = as_finite_array("elapsed_s", elapsed_s, (None,))
    # A time that is wanted twice has one state, to the last bit.
    times, place = np.unique(given, return_inverse=True)
    result, longest_s = np.empty((len(times), *bundle.shape)), _piece_s(bundle)
    # Once back and once ahead from the epoch.
    for side in (times < 0.0, times >= 0.0):
        start, end_s = bundle, float(max(times[side], key=abs, default=0.0))
        count = max(math.ceil(abs(end_s) / longest_s), 1)
        half_s = 0.5 * end_s / count or 1.0
        piece = np.where(side, np.minimum(times // (2.0 * half_s), count - 1), -1)
        for k in range(count if np.any(side) else 0):
            t_s = (2 * k + 1 + _X) * half_s
            nodes = _piece(start, half_s, gravity, epoch_t_s + t_s, disturbances, scales)
            mine = piece == k
            at = times[mine] / half_s - (2 * k + 1)
            result[mine] = np.tensordot(chebyshev.chebvander(at, _NODES - 1) @ _FIT, nodes, 1)
            start = nodes[-1]
    return result[place]


def _piece_s(bundle: Array) -> float:
    """Return a third of the revolution of a circle at the perigee of the lowest orbit."""
    position, velocity = bundle[:, :3], bundle[:, 3:]
    radius, turning = np.linalg.norm(position, axis=1), np.cross(position, velocity)
    level = np.sum(turning**2, axis=1) / EARTH_MU_M3_S2
    energy = np.sum(velocity**2, axis=1) / EARTH_MU_M3_S2 - 2.0 / radius
    lowest = np.min(level / (1.0 + np.sqrt(np.maximum(1.0 + energy * level, 0.0))))
    # What falls to the Earth's middle is refused by the iteration, not by the number of pieces.
    return 2.0 * math.pi / _PIECES * math.sqrt(max(float(lowest), 1e6) ** 3 / EARTH_MU_M3_S2)


def _piece(
    start: Array, half_s: float, gravity: Attraction, t_s: Array,
    disturbances: Disturbances | None, scales: Array | None,
) -> Array:  # fmt: skip
    """Return the states (nodes, m, 6) of a piece that lasts for twice `half_s`."""
    position, velocity = start[:, :3], start[:, 3:]
    rate = np.sqrt(EARTH_MU_M3_S2 / np.linalg.norm(position, axis=1, keepdims=True) ** 3)
    # A circle is a good beginning.
    phase = half_s * (1.0 + _X[:, np.newaxis, np.newaxis]) * rate
    found = np.empty((_NODES, *start.shape))
    found[..., :3] = position * np.cos(phase) + velocity / rate * np.sin(phase)
    found[..., 3:] = velocity * np.cos(phase) - position * rate * np.sin(phase)
    for _ in range(_MOST_SWEEPS):
        before, forced = found[..., :3].copy(), np.zeros(3)
        if disturbances is not None:
            forced = disturbances.acceleration(t_s, found, scales)
        # The point mass pulls hardest and costs least.
        for _ in range(_INNER):
            pull = gravity(found[..., :3]) + forced
            found[..., 3:] = velocity + np.tensordot(half_s * _SUM, pull, 1)
            found[..., :3] = position + np.tensordot(half_s * _SUM, found[..., 3:], 1)
        if np.max(np.abs(found[..., :3] - before)) < _SETTLED_M:
            return found
    raise ValueError(
        f"orbit integration failed at {float(t_s[0]):.0f} s: positions have not settled to "
        f"{_SETTLED_M:g} m after {_MOST_SWEEPS} sweeps"
    )
