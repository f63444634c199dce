"""Measured directions of the DOA study: polar angles, the published grid search, error pools.

DOA eq. (1): s = (sin theta cos phi, sin theta sin phi, cos theta); theta from the array normal +z,
phi from +x to +y.  The unit vector is the estimate.  At theta = 0 azimuth is undefined: phi is
atan2(s_y, s_x), zero by definition on the normal itself.  `cross` = sin(theta) * (phi error) is the
angle on the sky and stays regular.  The RMSE of phi itself follows the projected normal law: the
Cramer-Rao bound where sin(theta) >> sigma, 180/sqrt(3) = 103.9 deg on the
normal.

Grid search (section 3.1): the step becomes a floor of step / sqrt(12) in both angles, 0.289 deg at
1 deg, whatever the signal.  The floor repeats with the direction, so it is not white: a filter
cannot average it away.  `nearest_node` gives the full search's result in 97 of 100 cases from the
refined peak alone; in the others the peak lies half way between two nodes.

Pool: one MUSIC estimate per direction of the scene, in the local frame (e_theta, e_phi, s) of its
true direction.  For another true direction an entry of nearly the same theta is drawn and turned
into that direction's frame.  The array is isotropic in azimuth, so this is the error that MUSIC
would make, outliers included.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.multiplicative_filter import TABLE_Q
from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.cramer_rao import cosine_sigma_rad
from rf_pointing.array_sensors.doa.music import estimate_directions, principal_eigenvectors
from rf_pointing.array_sensors.doa.snapshots import draw_covariances
from rf_pointing.core import require_between, wrap_rad
from rf_pointing.core.types import Array, ComplexArray

GRID_RAD = np.radians(1.0)
NEIGHBOURS = 250
"""Pool entries on each side in theta from which an error is drawn: 1.2 % of the pool."""
# Errors beyond 20 deg are sidelobes: they do not belong to the sigma that a filter may assume.
OUTLIER_COSINE = np.cos(np.radians(20.0))


def direction_from_polar(theta_rad: ArrayLike, phi_rad: ArrayLike) -> Array:
    """Return unit vectors (..., 3) of polar angle and azimuth (DOA eq. (1)).

    Inverse of `polar_from_direction`.
    """
    theta, phi = np.broadcast_arrays(
        np.asarray(theta_rad, dtype=np.float64), np.asarray(phi_rad, dtype=np.float64)
    )
    across = np.sin(theta)
    return np.stack([across * np.cos(phi), across * np.sin(phi), np.cos(theta)], axis=-1)


def polar_from_direction(direction: ArrayLike) -> tuple[Array, Array]:
    """Return theta in [0, pi] and phi in [0, 2 pi) of vectors (..., 3) of any length; phi = 0 on
    the normal.
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.mod(np.arctan2(y, x), 2.0 * np.pi)


def polar_basis(direction: Array) -> Array:
    """Return rows e_theta, e_phi, s (..., 3, 3).

    The local frame of each unit vector, with phi = 0 on the normal.
    """
    x, y, z = (direction[..., i] for i in range(3))
    across = np.hypot(x, y)
    # On the normal phi is 0 by definition: the frame stays orthonormal instead of NaN.
    cosine = np.divide(x, across, out=np.ones_like(across), where=across > 0.0)
    sine = np.divide(y, across, out=np.zeros_like(across), where=across > 0.0)
    basis = np.zeros((*direction.shape, 3))
    basis[..., 0, 0], basis[..., 0, 1], basis[..., 0, 2] = z * cosine, z * sine, -across
    basis[..., 1, 0], basis[..., 1, 1] = -sine, cosine
    basis[..., 2, :] = direction
    return basis


def polar_errors_rad(estimate: Array, truth: Array) -> tuple[Array, Array, Array]:
    """Return theta error, phi error folded into [-pi, pi), and cross error sin(theta_true) * phi
    error.

    `estimate` and `truth` are directions (..., 3).
    """
    theta_estimate, phi_estimate = polar_from_direction(estimate)
    theta, phi = polar_from_direction(truth)
    azimuth = wrap_rad(phi_estimate - phi)
    return theta_estimate - theta, azimuth, np.sin(theta) * azimuth


def grid_search(
    array: CircularArrayParams,
    covariance: ComplexArray,
    step_rad: float,
    theta_max_rad: float = np.pi / 2.0,
) -> Array:
    """Return the grid direction (n, 3) with the largest spectrum of each covariance (n, M, M)."""
    require_between("step_rad", step_rad, 1e-4, 0.5)
    require_between("theta_max_rad", theta_max_rad, step_rad, np.pi / 2.0)
    theta = np.arange(0.0, theta_max_rad + 0.5 * step_rad, step_rad)
    phi = np.arange(round(2.0 * np.pi / step_rad)) * step_rad
    nodes = direction_from_polar(*(axis.ravel() for axis in np.meshgrid(theta, phi, indexing="ij")))
    manifold = steering(array, nodes).T
    best = np.empty(len(covariance), dtype=np.intp)
    # 32 000 nodes times 256 covariances fit into memory.
    for start in range(0, len(covariance), 256):
        principal = principal_eigenvectors(covariance[start : start + 256], array.elements)
        spectrum = principal.conj() @ manifold
        best[start : start + 256] = np.argmax(spectrum.real**2 + spectrum.imag**2, axis=-1)
    return nodes[best]


def nearest_node(direction: Array, step_rad: float) -> Array:
    """Return the node of the grid of theta and phi nearest to each refined peak (..., 3)."""
    require_between("step_rad", step_rad, 1e-4, 0.5)
    theta, phi = polar_from_direction(direction)
    return direction_from_polar(
        np.round(theta / step_rad) * step_rad, np.round(phi / step_rad) * step_rad
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionCase:
    """One row of the paper's tables: snapshots and SNR, and how its directions are found.

    `refined`: the peak itself, else the node of the 1-deg grid.  `q` is the filter's process noise,
    DOA's Q = q E_6.
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
    """Estimates (n, 3) in the local frame of their true directions, by rising theta (n,), and what
    a filter may know.

    `sigma_rad` is the standard deviation of a direction cosine without outliers; `outliers` the
    share beyond 20 deg; `variance` (3,) that of W's components, which the published filter uses.
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
    covariance = draw_covariances(
        array, truth, case.snr, case.snapshots, stream, waveform="constant_modulus"
    )
    return estimate_directions(array, covariance).direction


def error_pool(
    array: CircularArrayParams, case: DirectionCase, truth: Array, stream: np.random.Generator
) -> ErrorPool:
    """Return the pool of one MUSIC estimate per true direction (n, 3).

    The paper's tables use n >= 20 000.
    """
    estimate = measure_directions(array, case, truth, stream)
    basis = polar_basis(truth)
    local = np.einsum("nij,nj->ni", basis, estimate)
    theta, _ = polar_from_direction(truth)
    order = np.argsort(theta)
    # The third local component is the cosine of the whole error.
    near = local[:, 2] > OUTLIER_COSINE
    across = (estimate - truth)[near, :2]
    bound = cosine_sigma_rad(array, case.snapshots, case.snr)
    return ErrorPool(
        theta_rad=theta[order],
        local=local[order],
        # A small pool may by chance fall below the bound, which no estimator can.
        sigma_rad=max(bound, float(np.sqrt(np.mean(across**2)))),
        outliers=float(np.mean(~near)),
        variance=np.mean((estimate - truth) ** 2, axis=0),
    )


def draw_directions(
    pool: ErrorPool, truth: Array, count: int, stream: np.random.Generator
) -> Array:
    """Return `count` measured directions (n, count, 3) of each true direction (n, 3)."""
    theta, _ = polar_from_direction(truth)
    place = np.searchsorted(pool.theta_rad, theta)[:, None]
    reach = min(NEIGHBOURS, len(pool.theta_rad) // 2)
    # At the ends of the pool the neighbourhood is shifted inwards, not cut: every entry stays as
    # likely.
    place = np.clip(place, reach, len(pool.theta_rad) - 1 - reach)
    chosen = place + stream.integers(-reach, reach + 1, size=(len(truth), count))
    drawn = pool.local[chosen] @ polar_basis(truth)
    # Turned outliers may point behind the array, which MUSIC never reports.
    drawn[..., 2] = np.abs(drawn[..., 2])
    return np.asarray(drawn)
