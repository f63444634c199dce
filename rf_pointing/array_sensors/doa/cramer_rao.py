"""Cramer-Rao bounds of the direction of arrival.

One Gaussian source on a uniform circular array of M >= 5 elements, per-element SNR, L snapshots:

    var u = var v = (1 + 1/(M SNR)) / (L SNR M (k r)^2),   var theta = var u / cos^2(theta),
    var phi = var u / sin^2(theta),                        cross error sin(theta) phi: var u.

Several sources: the stochastic bound of Stoica and Nehorai (1990),

    CRB = 1/(2 L) {Re[(D^H P D) o (S A^H R^-1 A S)^T]}^-1

with unit noise, A the responses, D their derivatives, S the source covariance and P the projector
off A.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.doa.array import (
    CircularArrayParams,
    phase_radius_rad,
    steering,
    steering_taylor,
)
from rf_pointing.core import require_between
from rf_pointing.core.types import Array, ComplexArray

SMALLEST_SEPARATION = 1e-9
"""Ratio of the singular values of the responses below which two directions are one."""
SMALLEST_INFORMATION = 1e-13
"""Eigenvalue of the information matrix scaled to a unit diagonal; rounding leaves 1e-15 of a zero.
"""


def cosine_sigma_rad(array: CircularArrayParams, snapshots: int, snr: float) -> float:
    """Return the bound on the standard deviation of each direction cosine, one source, `snr` per
    element (ratio).
    """
    require_between("snapshots", snapshots, 1, None)
    require_between("snr", snr, 1e-12, None)
    total = array.elements * snr
    return math.sqrt((1.0 + 1.0 / total) / (snapshots * total)) / phase_radius_rad(array)


def effective_snr(array: CircularArrayParams, snapshots: int, snr: float) -> float:
    """Return kappa = L (M SNR)^2 / (1 + M SNR), the inverse squared bound in units of phase at the
    rim.

    It places MUSIC's threshold better than L M SNR, because it holds the loss of estimating from L
    noisy snapshots: at L M SNR = 48, 100 snapshots give 16 % outliers and 10 give 0.01 %.  The RMSE
    of one source exceeds the bound by 5 % at kappa = 42, 58, 79, 123 for L = 10, 30, 100, 1000;
    outliers set in below 30 to 50.
    """
    return 1.0 / (phase_radius_rad(array) * cosine_sigma_rad(array, snapshots, snr)) ** 2


def polar_sigma_rad(
    array: CircularArrayParams, theta_rad: ArrayLike, snapshots: int, snr: float
) -> tuple[Array, Array]:
    """Return the bounds on theta and phi at `theta_rad`.

    Phi's is infinite on the normal, where azimuth is undefined.
    """
    sigma = cosine_sigma_rad(array, snapshots, snr)
    theta = np.asarray(theta_rad, dtype=np.float64)
    # On the normal the bound on phi is infinite; that is the answer and no accident.
    with np.errstate(divide="ignore"):
        return np.asarray(sigma / np.cos(theta)), np.asarray(sigma / np.abs(np.sin(theta)))


def search_grid_rmse(sigma: ArrayLike, step: float) -> Array:
    """Return sqrt(sigma^2 + step^2 / 12), both in one unit.

    The RMSE of an unrefined search over a grid of `step`.
    """
    return np.sqrt(np.square(np.asarray(sigma, dtype=np.float64)) + step**2 / 12.0)


def direction_bound_rad2(
    array: CircularArrayParams,
    directions: Array,
    source_covariance: ComplexArray,
    snapshots: int,
    response: ComplexArray | None = None,
) -> Array:
    """Return the bound (2 K, 2 K) on u_1..u_K, v_1..v_K for K Gaussian sources in unit element
    noise.

    Parameters
    ----------
    directions : (K, 3) unit vectors.
    source_covariance : (K, K) Hermitian, powers over the noise power of one element on the
        diagonal.
    response : (n, M) coupling and gain matrix C of the n elements in use, measured vector C a;
        identity when None.

    Raises
    ------
    ValueError
        If the sources cannot be separated (singular information).
    """
    matrix = np.eye(array.elements, dtype=np.complex128) if response is None else response
    ideal = steering(array, directions)
    taylor = steering_taylor(array)
    received = (matrix @ ideal.T).astype(np.complex128)
    slopes = np.concatenate([matrix @ (ideal * taylor[:, i]).T for i in (1, 2)], axis=1)
    values = np.linalg.svd(received, compute_uv=False)
    if values[-1] < SMALLEST_SEPARATION * values[0]:
        raise ValueError(f"directions cannot be separated: {directions.tolist()}")
    covariance = received @ source_covariance @ received.conj().T + np.eye(len(matrix))
    # The part of the derivatives that the sources themselves cannot imitate: P D with P the
    # projector off A.
    off = slopes - received @ np.linalg.lstsq(received, slopes, rcond=None)[0]
    weight = (
        source_covariance
        @ received.conj().T
        @ np.linalg.solve(covariance, received)
        @ source_covariance
    )
    information = 2.0 * snapshots * np.real((off.conj().T @ off) * np.tile(weight, (2, 2)).T)
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    # Scaled to a unit diagonal: sources of very different power are not a reason to refuse.
    if (
        not np.all(scale > 0.0)
        or np.linalg.eigvalsh(information / np.outer(scale, scale))[0] < SMALLEST_INFORMATION
    ):
        raise ValueError("directions cannot be separated: the information matrix is singular")
    return np.asarray(np.linalg.inv(information), dtype=np.float64)
