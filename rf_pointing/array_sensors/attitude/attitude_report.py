"""Attitude and rate as the attitude sensors report them, and when a measurement counts as arrived.

A stamp must not lie ahead of the clock: every later measurement would count as late.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.attitude.quaternion import unit_quaternion
from rf_pointing.core import as_finite_array, require_finite
from rf_pointing.core.types import Array

LARGEST_LEAD_S = 5.0
"""Simulation time reaches the nodes one by one, so a stamp may be ahead of a node's clock by some
of its steps."""
# Relative to the largest element: a covariance that crossed the wire as float64 is symmetric only
# to rounding.
_ROUNDING = 1e-9


def require_arrived(t_s: float, now_s: float) -> None:
    """Raise ValueError if a measurement of `t_s` cannot have been made by `now_s`."""
    require_finite("t_s", t_s)
    if t_s > now_s + LARGEST_LEAD_S:
        raise ValueError(
            f"t_s={t_s} is {t_s - now_s:.6g} s ahead of the clock, must be <= {LARGEST_LEAD_S} s"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeReport:
    """Orientation at `t_s`: `quaternion` (x, y, z, w) takes components in the body to components in
    the reference frame.

    `covariance_rad2` (3, 3): of the small rotation between true and reported orientation, about the
    reference axes. An invalid report carries its reason.
    """

    t_s: float
    quaternion: Array
    covariance_rad2: Array
    valid: bool
    reason: str

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        # Wire data: a quaternion that is not of unit length is a fault of the sender, not rounding
        # to repair silently.
        object.__setattr__(
            self,
            "quaternion",
            unit_quaternion(as_finite_array("quaternion", self.quaternion, (4,))),
        )
        object.__setattr__(
            self, "covariance_rad2", require_covariance("covariance_rad2", self.covariance_rad2, 3)
        )
        # A consumer that rejects an attitude must be able to log why; an empty reason looks like a
        # valid one.
        if not self.valid and not self.reason:
            raise ValueError("reason='' must say why the attitude is not valid")


@dataclass(frozen=True, slots=True, kw_only=True)
class RateReport:
    """Inertial angular rate (3,) of a body in its own axes at `t_s`, with covariance (3, 3)."""

    t_s: float
    rate_rad_s: Array
    covariance_rad2_s2: Array

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        object.__setattr__(self, "rate_rad_s", as_finite_array("rate_rad_s", self.rate_rad_s, (3,)))
        covariance = require_covariance("covariance_rad2_s2", self.covariance_rad2_s2, 3)
        object.__setattr__(self, "covariance_rad2_s2", covariance)


def require_covariance(name: str, value: Array, size: int) -> Array:
    """Return `value` (size, size) if it is finite, symmetric and without a negative eigenvalue, to
    rounding.
    """
    matrix = as_finite_array(name, value, (size, size))
    largest = float(np.max(np.abs(matrix)))
    if float(np.max(np.abs(matrix - matrix.T))) > _ROUNDING * largest:
        raise ValueError(f"{name} is not symmetric")
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < -_ROUNDING * largest:
        raise ValueError(f"{name} has eigenvalue {smallest}, must be >= 0")
    return matrix
