"""Direction of arrival as unit vector and as polar angles, and what azimuth means near theta = 0.

DOA eq. (1): s = (sin theta cos phi, sin theta sin phi, cos theta); theta from the array normal +z, phi from +x to +y.

At theta = 0 azimuth is undefined.  The unit vector is the estimate; phi is atan2(s_y, s_x), zero by definition on the
normal itself.  Its error is finite only as a rotation about the normal: `cross` = sin(theta) * (phi error) is the angle
on the sky and stays regular, and the RMSE of phi itself follows the projected normal law (`azimuth_rmse_rad`), which
is the Cramer-Rao bound where sin(theta) >> sigma and saturates at 180/sqrt(3) = 103.9 deg on the normal.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import require_between, wrap_rad

__all__ = ["azimuth_rmse_rad", "direction_from_polar", "polar_basis", "polar_errors_rad", "polar_from_direction"]

Array = NDArray[np.float64]


def direction_from_polar(theta_rad: ArrayLike, phi_rad: ArrayLike) -> Array:
    """Return unit vectors (..., 3) of polar angle and azimuth (DOA eq. (1)); inverse of `polar_from_direction`."""
    theta, phi = np.broadcast_arrays(np.asarray(theta_rad, dtype=np.float64), np.asarray(phi_rad, dtype=np.float64))
    across = np.sin(theta)
    return np.stack([across * np.cos(phi), across * np.sin(phi), np.cos(theta)], axis=-1)


def polar_from_direction(direction: ArrayLike) -> tuple[Array, Array]:
    """Return theta in [0, pi] and phi in [0, 2 pi) of vectors (..., 3) of any length; phi = 0 on the normal."""
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.mod(np.arctan2(y, x), 2.0 * np.pi)


def polar_basis(direction: Array) -> Array:
    """Return rows e_theta, e_phi, s (..., 3, 3): the local frame of each unit vector, with phi = 0 on the normal."""
    x, y, z = (direction[..., i] for i in range(3))
    across = np.hypot(x, y)
    cosine = np.divide(x, across, out=np.ones_like(across), where=across > 0.0)
    sine = np.divide(y, across, out=np.zeros_like(across), where=across > 0.0)
    basis = np.zeros((*direction.shape, 3))
    basis[..., 0, 0], basis[..., 0, 1], basis[..., 0, 2] = z * cosine, z * sine, -across
    basis[..., 1, 0], basis[..., 1, 1] = -sine, cosine
    basis[..., 2, :] = direction
    return basis


def polar_errors_rad(estimate: Array, truth: Array) -> tuple[Array, Array, Array]:
    """Return theta error, phi error folded into [-pi, pi), and cross error sin(theta_true) * phi error.

    `estimate` and `truth` are directions (..., 3).
    """
    theta_estimate, phi_estimate = polar_from_direction(estimate)
    theta, phi = polar_from_direction(truth)
    azimuth = wrap_rad(phi_estimate - phi)
    return theta_estimate - theta, azimuth, np.sin(theta) * azimuth


def azimuth_rmse_rad(theta_rad: float, sigma_rad: float) -> float:
    """Return the RMSE of phi when both direction cosines carry independent Gaussian errors `sigma_rad`.

    The azimuth of a displaced circular Gaussian has the projected normal density with k = sin(theta) / sigma,

        p(e) = exp(-k^2/2) / (2 pi) + k cos(e) / sqrt(2 pi) * exp(-k^2 sin(e)^2 / 2) * Phi(k cos(e)).
    """
    from scipy.special import ndtr

    require_between("sigma_rad", sigma_rad, 1e-12, None)
    ratio = math.sin(theta_rad) / sigma_rad
    reach = math.pi if ratio < 12.0 else 12.0 / ratio
    error, step = np.linspace(-reach, reach, 4001, retstep=True)
    along = ratio * np.cos(error)
    density = math.exp(-0.5 * ratio**2) / (2.0 * math.pi) + along / math.sqrt(2.0 * math.pi) * np.exp(
        -0.5 * (ratio * np.sin(error)) ** 2
    ) * ndtr(along)
    weight = np.ones_like(error)
    weight[[0, -1]] = 0.5
    return math.sqrt(float(np.sum(weight * error**2 * density)) * float(step))
