"""Measured directions along the scene: drawn from a pool of real MUSIC estimates, or MUSIC at every step.

The pool holds one MUSIC estimate per direction of the scene, in the local frame (e_theta, e_phi, s) of its true
direction.  For another true direction an entry of nearly the same theta is drawn and turned into that direction's
frame: the array is isotropic in azimuth, so this is the error that MUSIC would make, outliers included.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams
from rf_pointing.array_sensors.arrays.cramer_rao import cosine_sigma_rad
from rf_pointing.array_sensors.arrays.music import estimate_directions
from rf_pointing.array_sensors.arrays.polar_direction import polar_basis, polar_from_direction
from rf_pointing.array_sensors.arrays.snapshots import draw_covariances
from rf_pointing.array_sensors.attitude.process_noise import TABLE_Q

__all__ = ["GRID_RAD", "DirectionCase", "ErrorPool", "draw_directions", "error_pool", "measure_directions"]

Array = NDArray[np.float64]

GRID_RAD = np.radians(1.0)
NEIGHBOURS = 250
"""Pool entries on each side in theta from which an error is drawn: 1.2 % of the pool."""
OUTLIER_COSINE = np.cos(np.radians(20.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionCase:
    """One row of the paper's tables: snapshots and SNR, and how its directions are found.

    `refined`: the peak itself, else the node of the 1-deg grid.  `q` is the filter's process noise, DOA's Q = q E_6.
    """

    snapshots: int
    snr_db: float
    refined: bool = True
    q: float = TABLE_Q

    @property
    def level(self) -> tuple[int, float]:
        """Snapshots and SNR: what MUSIC's own estimate depends on."""
        return self.snapshots, self.snr_db

    @property
    def snr(self) -> float:
        """Signal-to-noise ratio of one element as a ratio."""
        return float(10.0 ** (self.snr_db / 10.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorPool:
    """Estimates (n, 3) in the local frame of their true directions, by rising theta (n,), and what a filter may know.

    `sigma_rad` is the standard deviation of a direction cosine without outliers; `outliers` the share beyond 20 deg;
    `variance` (3,) that of W's components, which the published filter uses.
    """

    theta_rad: Array
    local: Array
    sigma_rad: float
    outliers: float
    variance: Array


def measure_directions(
    array: CircularArrayParams, case: DirectionCase, truth: Array, stream: np.random.Generator
) -> Array:
    """Return a refined MUSIC estimate (n, 3) of each true direction (n, 3)."""
    covariance = draw_covariances(array, truth, case.snr, case.snapshots, stream, waveform="constant_modulus")
    return estimate_directions(array, covariance).direction


def error_pool(array: CircularArrayParams, case: DirectionCase, truth: Array, stream: np.random.Generator) -> ErrorPool:
    """Return the pool of one MUSIC estimate per true direction (n, 3); the paper's tables use n >= 20 000."""
    estimate = measure_directions(array, case, truth, stream)
    basis = polar_basis(truth)
    local = np.einsum("nij,nj->ni", basis, estimate)
    theta, _ = polar_from_direction(truth)
    order = np.argsort(theta)
    near = local[:, 2] > OUTLIER_COSINE
    across = (estimate - truth)[near, :2]
    bound = cosine_sigma_rad(array, case.snapshots, case.snr)
    return ErrorPool(
        theta_rad=theta[order],
        local=local[order],
        sigma_rad=max(bound, float(np.sqrt(np.mean(across**2)))),
        outliers=float(np.mean(~near)),
        variance=np.mean((estimate - truth) ** 2, axis=0),
    )


def draw_directions(pool: ErrorPool, truth: Array, count: int, stream: np.random.Generator) -> Array:
    """Return `count` measured directions (n, count, 3) of each true direction (n, 3)."""
    theta, _ = polar_from_direction(truth)
    place = np.searchsorted(pool.theta_rad, theta)[:, None]
    reach = min(NEIGHBOURS, len(pool.theta_rad) // 2)
    place = np.clip(place, reach, len(pool.theta_rad) - 1 - reach)
    chosen = place + stream.integers(-reach, reach + 1, size=(len(truth), count))
    drawn = pool.local[chosen] @ polar_basis(truth)
    drawn[..., 2] = np.abs(drawn[..., 2])
    return np.asarray(drawn)
