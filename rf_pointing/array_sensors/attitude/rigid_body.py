"""Attitude motion of a satellite with wheels (DOA eqs. (23), (24)), for simulation and filters.

    I dw/dt = -w x (I w + h) - dh/dt + T,   T = control + gravity gradient 3 n^2 c x I c,

c = nadir in the body.  The quaternion is the orientation of the body in the orbital frame (body to
orbital components), numerically the paper's q_bo with its scalar last; the paper's C_bo is the
transpose of its matrix.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.attitude.rotations import (
    cross_matrix,
    cross_product,
    matrix_from_quaternion,
    quaternion_from_turn,
    quaternion_product,
)
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class SatelliteParams(Params):
    """Inertia of DOA eq. (25)."""

    ixx_kg_m2: float = parameter(6.6199, "moment of inertia", low=1e-6, high=1e6)
    iyy_kg_m2: float = parameter(8.95, "moment of inertia", low=1e-6, high=1e6)
    izz_kg_m2: float = parameter(9.4968, "moment of inertia", low=1e-6, high=1e6)
    ixy_kg_m2: float = parameter(
        0.01636, "element (1, 2) of the inertia matrix", low=-1e6, high=1e6
    )
    ixz_kg_m2: float = parameter(0.2363, "element (1, 3) of the inertia matrix", low=-1e6, high=1e6)
    iyz_kg_m2: float = parameter(0.2247, "element (2, 3) of the inertia matrix", low=-1e6, high=1e6)

    def check_together(self) -> None:
        """Refuse an inertia that no body has: principal moments break the triangle inequality."""
        low, middle, high = np.linalg.eigvalsh(_inertia_matrix(self))
        # A flat body has low + middle = high, a thin rod low = 0: neither is left to the last bits.
        if low <= _ROUNDING * high or low + middle < (1.0 - _ROUNDING) * high:
            raise ValueError(
                f"principal moments {low}, {middle}, {high} kg m^2: none may exceed the sum of the others"
            )


@dataclass(frozen=True, slots=True)
class RigidInertia:
    """Inertia matrix (3, 3) in kg m^2 and its inverse."""

    matrix: Array
    inverse: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownTorque:
    """Inputs the satellite knows, body axes (..., 3).

    Control torque, wheel momentum and its rate.
    """

    control_n_m: Array
    wheel_momentum_n_m_s: Array
    wheel_momentum_rate_n_m: Array


def rigid_inertia(satellite: SatelliteParams) -> RigidInertia:
    """Return the inertia and its inverse."""
    matrix = _inertia_matrix(satellite)
    return RigidInertia(matrix, np.asarray(np.linalg.inv(matrix), dtype=np.float64))


def gravity_gradient_n_m(inertia: RigidInertia, rotation: Array, frame_rate: Array) -> Array:
    """Return 3 n^2 c x I c (..., 3); `rotation` is body to orbital, n = |frame_rate|."""
    nadir = rotation[..., 2, :]
    squared = np.sum(frame_rate**2, axis=-1)[..., None]
    return np.asarray(3.0 * squared * cross_product(nadir, nadir @ inertia.matrix))


def rate_slope_rad_s2(inertia: RigidInertia, rate: Array, torque: Array, momentum: Array) -> Array:
    """Return dw/dt (..., 3) of DOA eq. (23); `torque` holds everything but the gyroscopic term."""
    return np.asarray(
        (torque - cross_product(rate, rate @ inertia.matrix + momentum)) @ inertia.inverse
    )


# The quaternion and the rate are stepped apart because the attitude has a closed form under a
# constant rate, the rate has not.
def propagate(
    inertia: RigidInertia,
    quaternion: Array,
    rate: Array,
    known: KnownTorque,
    frame_rate: Array,
    dt_s: float,
    rotation: Array | None = None,
) -> tuple[Array, Array]:
    """Return quaternion (..., 4) and inertial body rate (..., 3) after `dt_s`.

    `rotation` is the quaternion's, if known.  The rate by the classical Runge-Kutta step with the
    torques held; the attitude by q' = exp(-w_o dt) q exp(turn) with the fourth-order Magnus turn,
    the integral of the rate plus dt^2/12 w x w' for its change of direction.
    """
    if rotation is None:
        rotation = matrix_from_quaternion(quaternion)
    torque = (
        known.control_n_m
        - known.wheel_momentum_rate_n_m
        + gravity_gradient_n_m(inertia, rotation, frame_rate)
    )
    momentum = known.wheel_momentum_n_m_s
    k1 = rate_slope_rad_s2(inertia, rate, torque, momentum)
    k2 = rate_slope_rad_s2(inertia, rate + 0.5 * dt_s * k1, torque, momentum)
    k3 = rate_slope_rad_s2(inertia, rate + 0.5 * dt_s * k2, torque, momentum)
    k4 = rate_slope_rad_s2(inertia, rate + dt_s * k3, torque, momentum)
    after = rate + dt_s * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    turn = (
        dt_s * rate + dt_s**2 * (k1 + k2 + k3) / 6.0 + dt_s**2 / 12.0 * cross_product(rate, after)
    )
    turned = quaternion_product(quaternion, quaternion_from_turn(turn))
    return quaternion_product(quaternion_from_turn(-frame_rate * dt_s), turned), after


def rate_jacobian(inertia: RigidInertia, rate: Array, momentum: Array) -> Array:
    """Return d(dw/dt)/dw = I^-1 ([(I w + h) x] - [w x] I), (..., 3, 3).

    Upper left block of DOA eq. (29).
    """
    inner = cross_matrix(rate @ inertia.matrix + momentum) - cross_matrix(rate) @ inertia.matrix
    return np.asarray(inertia.inverse @ inner)


def gravity_jacobian(inertia: RigidInertia, rotation: Array, frame_rate: Array) -> Array:
    """Return d(gravity gradient)/d(body rotation) (..., 3, 3), for a rotation error d with C_ob = C
    exp([d x]).
    """
    nadir = rotation[..., 2, :]
    squared = np.sum(frame_rate**2, axis=-1)[..., None, None]
    # the error turns the nadir seen in the body: dc = c x d
    return np.asarray(
        3.0
        * squared
        * (cross_matrix(nadir) @ inertia.matrix - cross_matrix(nadir @ inertia.matrix))
        @ cross_matrix(nadir)
    )


def _inertia_matrix(satellite: SatelliteParams) -> Array:
    xy, xz, yz = satellite.ixy_kg_m2, satellite.ixz_kg_m2, satellite.iyz_kg_m2
    return np.array(
        [
            [satellite.ixx_kg_m2, xy, xz],
            [xy, satellite.iyy_kg_m2, yz],
            [xz, yz, satellite.izz_kg_m2],
        ]
    )
