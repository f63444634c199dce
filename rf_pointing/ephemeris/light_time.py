"""Light time: where the target was when it sent what arrives now, or will be when it gets what is sent now.

With sigma = +1 (receive) or -1 (transmit) the target is taken at u = t - sigma tau, tau = rho(u) / c.  Position of
target and antenna are both moved to u in the non-rotating frame; moving the antenna too is the diurnal aberration.
"""

from typing import Any

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris.state_vector import StateVector, Vector, combined, dot, norm

__all__ = ["SENSES", "delayed"]

SENSES = {"receive": 1.0, "transmit": -1.0, "none": 0.0}


def delayed(relative: StateVector, sense: float) -> tuple[StateVector, Any, Any]:
    """Return the inertial motion as seen through light, with range c tau [m] and its rate [m/s].

    `relative` is target minus antenna with inertial derivatives.  The third order of the series, v^3 tau^3 / rho^2,
    is below a millimetre to the Moon's distance; for a planet use a source that is apparent already.
    """
    r, v, a, j = relative.derivatives()
    distance = norm(r)
    rate = dot(r, v) / distance
    if sense == 0.0:
        return relative, distance, rate
    tau = distance / (SPEED_OF_LIGHT_M_S + sense * rate)
    shift = -sense * tau
    position = combined((1.0, r), (shift, v), (0.5 * shift * shift, a))
    velocity = combined((1.0, v), (shift, a), (0.5 * shift * shift, j))
    acceleration = combined((1.0, a), (shift, j))
    return _with_clock(position, velocity, acceleration, j, sense)


def _with_clock(r: Vector, v: Vector, a: Vector, j: Vector, sense: float) -> tuple[StateVector, Any, Any]:
    """Turn derivatives by u into derivatives by t: du/dt = 1 - sigma tau'."""
    distance = norm(r)
    rate = dot(r, v) / distance
    curvature = (dot(v, v) + dot(r, a) - rate * rate) / distance
    tau_rate = rate / (SPEED_OF_LIGHT_M_S + sense * rate)
    clock = 1.0 - sense * tau_rate
    tau_acceleration = curvature * clock**3 / SPEED_OF_LIGHT_M_S
    velocity = combined((clock, v))
    acceleration = combined((clock * clock, a), (-sense * tau_acceleration, v))
    return StateVector(r, velocity, acceleration, j), distance, tau_rate * SPEED_OF_LIGHT_M_S
