"""From the motion of a target relative to the antenna to what the antenna sees.

Light time.  With sigma = +1 (receive) or -1 (transmit) the target is taken at u = t - sigma tau,
c tau = |target(u) - antenna(t)|.  For the direction target and antenna are both moved to u in the
non-rotating frame: moving the antenna too is the diurnal aberration.  The range is c tau.

Offsets.  A target moved by q along a unit vector m at right angles to rho is at
rho cos(q) + |rho| sin(q) m; the derivatives of m are carried along, so the rates stay the
derivatives of the angles.  Across the motion m = -rho x rho' / |rho x rho'|, across the way to a
fixed axis m = rho x axis / |rho x axis|, towards the axis m x rho / |rho|.

Angles, from east-north-up components; the accelerations by differentiating once more:

    az' = (n e' - e n') / h^2,   el' = (h u' - u h') / rho^2,   h^2 = e^2 + n^2
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.core import SPEED_OF_LIGHT_M_S, Array
from rf_pointing.core.target_motion import TargetMotion
from rf_pointing.ephemeris.state_vector import StateVector, Vector, combined, cross, dot, norm, root

Unit = tuple[Vector, Vector, Vector]
SENSES = {"receive": 1.0, "transmit": -1.0, "none": 0.0}


def delayed(relative: StateVector, antenna: StateVector, sense: float) -> tuple[StateVector, Any, Any]:
    """Return the inertial motion as seen through light, with range c tau [m] and its rate [m/s].

    `relative` is target minus antenna and `antenna` the antenna's own motion, both with inertial
    derivatives.  The third order of the series, v^3 tau^3 / rho^2, is below a millimetre to the
    Moon's distance; for a planet use a source that is apparent already.
    """
    r, v, a, j = relative.derivatives()
    distance = norm(r)
    # Geometry only, for comparison with tables that leave the light time out.
    if sense == 0.0:
        return relative, distance, dot(r, v) / distance
    # Solves c tau = |target(t - sigma tau) - antenna(t)| to first order at once.
    tau = distance / (SPEED_OF_LIGHT_M_S + sense * (dot(r, v) + dot(r, antenna.velocity)) / distance)
    shift = -sense * tau
    half_square = 0.5 * shift * shift
    position = combined((1.0, r), (shift, v), (half_square, a))
    velocity = combined((1.0, v), (shift, a), (half_square, j))
    acceleration = combined((1.0, a), (shift, j))
    # The path of the light ends at the antenna's place at t, not at u: up to 60 m from it.
    path = combined((1.0, position), (shift, antenna.velocity), (half_square, antenna.acceleration))
    range_m = norm(path)
    of_target = dot(path, velocity) + dot(path, antenna.velocity) + shift * dot(path, antenna.acceleration)
    closing = of_target - dot(path, antenna.velocity)
    tau_rate = closing / (SPEED_OF_LIGHT_M_S * range_m + sense * of_target)
    _, _, curvature = _length(position, velocity, acceleration)
    # Derivatives by u become those by t, du/dt = 1 - sigma tau': those by u are off by v/c.
    clock = 1.0 - sense * tau_rate
    tau_acceleration = curvature * clock**3 / SPEED_OF_LIGHT_M_S
    acceleration = combined((clock * clock, acceleration), (-sense * tau_acceleration, velocity))
    seen = StateVector(position, combined((clock, velocity)), acceleration, j)
    return seen, range_m, tau_rate * SPEED_OF_LIGHT_M_S


def moved_across(motion: StateVector, offset_rad: float, axis: Vector | None = None) -> StateVector:
    """Return the motion (rotating axes) of the target moved to the right of its motion.

    With an `axis` (zenith, pole) to the right of the way there.  Its range is unchanged.  Raises
    ValueError for a target that has no such direction: at rest on the sky, or on the axis.
    """
    return _moved(motion, offset_rad, _across(motion, offset_rad, axis))


def moved_towards(motion: StateVector, offset_rad: float, axis: Vector) -> StateVector:
    """Return the motion of the target moved towards an axis; ValueError for one on the axis."""
    m, m1, m2 = _across(motion, offset_rad, axis)
    r, r1, r2 = _unit(*motion.derivatives()[:3])
    to1 = combined((1.0, cross(m1, r)), (1.0, cross(m, r1)))
    to2 = combined((1.0, cross(m2, r)), (2.0, cross(m1, r1)), (1.0, cross(m, r2)))
    return _moved(motion, offset_rad, (cross(m, r), to1, to2))


def moved_about(motion: StateVector, offset_rad: float, axis: Vector) -> StateVector:
    """Return the motion turned about a unit axis, counterclockwise seen from its end."""
    c, s = math.cos(offset_rad), math.sin(offset_rad)

    def turned(v: Vector) -> Vector:
        return combined((c, v), (s, cross(axis, v)), ((1.0 - c) * dot(axis, v), axis))

    return StateVector(*map(turned, motion.derivatives()))


def _across(motion: StateVector, offset_rad: float, axis: Vector | None) -> Unit:
    r, v, a, j = motion.derivatives()
    if axis is None:
        normal = combined((-1.0, cross(r, v)))
        normal1 = combined((-1.0, cross(r, a)))
        normal2 = combined((-1.0, cross(v, a)), (-1.0, cross(r, j)))
    else:
        normal, normal1, normal2 = cross(r, axis), cross(v, axis), cross(a, axis)
    # A target at rest on the sky, a geostationary one seen exactly, has no direction of motion.
    if np.any(norm(normal) == 0.0):
        name = "cross_track_offset_rad" if axis is None else "offset_rad"
        needs = "that moves on the sky" if axis is None else "that is not at the zenith or pole"
        raise ValueError(f"{name}={offset_rad} needs a target {needs}")
    return _unit(normal, normal1, normal2)


def _moved(motion: StateVector, offset_rad: float, along: Unit) -> StateVector:
    """Return the motion moved along a unit vector, given with its derivatives."""
    r, v, a, j = motion.derivatives()
    m, m1, m2 = along
    rho, rho1, rho2 = _length(r, v, a)
    c, s = math.cos(offset_rad), math.sin(offset_rad)
    position = combined((c, r), (s * rho, m))
    velocity = combined((c, v), (s * rho1, m), (s * rho, m1))
    acceleration = combined((c, a), (s * rho2, m), (2.0 * s * rho1, m1), (s * rho, m2))
    return StateVector(position, velocity, acceleration, j)


def _length(r: Vector, v: Vector, a: Vector) -> tuple[Any, Any, Any]:
    """Return |r| and its two derivatives."""
    length = norm(r)
    rate = dot(r, v) / length
    return length, rate, (dot(v, v) + dot(r, a) - rate * rate) / length


def _unit(r: Vector, v: Vector, a: Vector) -> Unit:
    """Return r/|r| and its two derivatives."""
    length, rate, curvature = _length(r, v, a)
    inverse = 1.0 / length
    inverse1 = -rate / length**2
    inverse2 = -curvature / length**2 + 2.0 * rate**2 / length**3
    unit = combined((inverse, r))
    unit1 = combined((inverse, v), (inverse1, r))
    return unit, unit1, combined((inverse, a), (2.0 * inverse1, v), (inverse2, r))


# Azimuth is undefined at the zenith; a millimetre added in quadrature keeps its rates finite.
_LEAST_HORIZONTAL_M = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class LookAngles(TargetMotion):
    """Where a target is on the sky.

    Elevation is apparent (refraction included), `true_elevation_rad` is without refraction.
    `satellite_gain_db` is that of the target's antenna towards the site, against its axis.
    """

    true_elevation_rad: Array
    satellite_gain_db: Array


def angles_and_rates(enu: StateVector) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Return azimuth in (-pi, pi], elevation, their rates and accelerations, of rotating motion."""
    (e, n, u), (e1, n1, u1), (e2, n2, u2) = enu.position, enu.velocity, enu.acceleration
    h = root(e * e + n * n + _LEAST_HORIZONTAL_M**2)
    rho2 = h * h + u * u
    h1 = (e * e1 + n * n1) / h
    h2 = (e1 * e1 + n1 * n1 + e * e2 + n * n2 - h1 * h1) / h
    azimuth_rate = (n * e1 - e * n1) / (h * h)
    elevation_rate = (h * u1 - u * h1) / rho2
    azimuth_acceleration = (n * e2 - e * n2) / (h * h) - 2.0 * azimuth_rate * h1 / h
    elevation_acceleration = (h * u2 - u * h2) / rho2 - 2.0 * elevation_rate * (h * h1 + u * u1) / rho2
    arctan2: Any = math.atan2 if isinstance(u, float) else np.arctan2
    return (arctan2(e, n), arctan2(u, h), azimuth_rate, elevation_rate, azimuth_acceleration, elevation_acceleration)
