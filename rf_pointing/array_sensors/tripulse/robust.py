"""Tripulse below 10 dB: estimators that do not divide by a noisy sum beam.

One cycle of pulses is y = K (1, j tan u_x, j tan u_y) + noise with an unknown complex K and u = N
kd eps/4.  With the delta signals turned by -j and every signal divided by its noise, y' = K v + n
with a real vector v, so that all a set of cycles says about the direction is the real matrix M =
Re sum y' y'^H, whatever the phase of each cycle was.  `PosteriorEstimate` is the mean and
covariance of eps under exp(kappa v^T M v / |v|^2) times the Gaussian prior of the initial
attitude sensor.  Its variance is finite at every SNR, never above the prior's.  kappa = SNR / (1 +
SNR), the SNR of one cycle being learnt from M, is what remains of the likelihood when every
cycle's K is integrated out as a complex Gaussian; taking K as fitted exactly (kappa = 1) would
make many weak cycles look better than they are.

Not in TRIPULSE, which restricts itself to high SNR: the variance of the plain ratio is infinite.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.core import as_finite_array, require_finite
from rf_pointing.core.types import Array

# 25 points over ten sigma resolve a Gaussian; six shrinking grids follow a posterior down to a
# millionth of the prior.
GRID_POINTS = 25
GRID_SIGMAS = 5.0
REFINEMENTS = 6
# Grids of this many matrices fit into memory: 2000 x 25 x 25 values.
CHUNK = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorEstimate:
    """Posterior mean (..., 2) and covariance (..., 2, 2) of the projection error."""

    projection_error: Array
    covariance: Array


def signal_matrix(signals: ArrayLike, noise_variances: ArrayLike) -> Array:
    """Return M (..., 3, 3) of beam signals (..., cycles, 3) in the paper's time convention.

    `noise_variances` (3,) are the total complex variances of a signal of each beam, the same in
    every cycle.
    """
    s = np.asarray(signals, dtype=np.complex128)
    if s.ndim < 2 or s.shape[-1] != 3 or s.shape[-2] < 1:
        raise ValueError(
            f"signals has shape {s.shape}, must be (..., cycles, 3) with at least 1 cycle"
        )
    require_finite("signals", s)
    real = s * np.array([1.0, -1j, -1j]) / np.sqrt(_noise(noise_variances))
    return np.asarray(np.einsum("...na,...nb->...ab", real, real.conj()).real)


def posterior_projection_error(
    params: TripulseArrayParams,
    matrix: ArrayLike,
    cycles: int,
    noise_variances: ArrayLike,
    prior_sigma: ArrayLike,
) -> PosteriorEstimate:
    """Return the posterior of the projection error from M (..., 3, 3) of `cycles` cycles.

    Parameters
    ----------
    prior_sigma : standard deviation (2,) of the initial projection error, whose mean is zero

    Sums over a grid that shrinks onto the posterior in `REFINEMENTS` steps.
    """
    m = np.asarray(matrix, dtype=np.float64)
    if m.shape[-2:] != (3, 3):
        raise ValueError(f"matrix has shape {m.shape}, must be (..., 3, 3)")
    require_finite("matrix", m)
    prior = as_finite_array("prior_sigma", prior_sigma, (2,))
    if np.any(prior <= 0.0):
        raise ValueError(f"prior_sigma={prior} must be > 0")
    if cycles < 1:
        raise ValueError(f"cycles={cycles} must be >= 1")
    flat = m.reshape(-1, 3, 3)
    parts = [
        _posterior(params, flat[start : start + CHUNK], cycles, _noise(noise_variances), prior)
        for start in range(0, len(flat), CHUNK)
    ]
    mean, covariance = (np.concatenate(items) for items in zip(*parts, strict=True))
    return PosteriorEstimate(
        projection_error=mean.reshape((*m.shape[:-2], 2)),
        covariance=covariance.reshape((*m.shape[:-2], 2, 2)),
    )


def _posterior(
    params: TripulseArrayParams, matrix: Array, cycles: int, noise: Array, prior: Array
) -> tuple[Array, Array]:
    # Just inside the unambiguous region: at its edge the tangent is infinite.
    limit = params.unambiguous_projection * (1.0 - 1e-9)
    unit = (np.arange(GRID_POINTS) + 0.5) / GRID_POINTS
    largest = np.linalg.eigvalsh(matrix)[:, -1]
    # cycles (1 + SNR) is what the largest eigenvalue estimates; a first cycle or two only serve to
    # learn K.
    kappa = 1.0 - np.minimum(1.0, max(cycles - 2, 0) / np.maximum(largest, 1e-300))
    mean = np.zeros((len(matrix), 2))
    # From edge to edge at most: a posterior at both edges keeps both, wherever its mean lies.
    reach = np.broadcast_to(np.minimum(GRID_SIGMAS * prior, 2.0 * limit), mean.shape)
    for _ in range(REFINEMENTS):
        # Middles of equal cells within the region: points heaped up at its edge would count many
        # times.
        low, high = np.maximum(mean - reach, -limit), np.minimum(mean + reach, limit)
        grid = low[:, None, :] + (high - low)[:, None, :] * unit[None, :, None]
        mass = _posterior_mass(params, matrix * kappa[:, None, None], noise, prior, grid)
        mean, covariance = _moments(mass, grid)
        # Never below one cell: a posterior narrower than the grid shows as a single point.
        cell = (high - low) / GRID_POINTS
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        reach = np.minimum(reach, GRID_SIGMAS * np.maximum(sigma, 0.4 * cell))
    return mean, covariance


def _posterior_mass(
    params: TripulseArrayParams, matrix: Array, noise: Array, prior: Array, grid: Array
) -> Array:
    """Return the normalised posterior (batch, points x, points y) on `grid` (batch, points, 2)."""
    tangent = np.tan(grid * params.kd * np.array([params.n_x, params.n_y]) / 4.0)
    scale = 1.0 / np.sqrt(noise)
    vx, vy = tangent[:, :, None, 0] * scale[1], tangent[:, None, :, 1] * scale[2]
    v0 = scale[0]
    m = matrix[:, :, :, None, None]
    squares = m[:, 0, 0] * v0**2 + m[:, 1, 1] * vx**2 + m[:, 2, 2] * vy**2
    products = m[:, 0, 1] * v0 * vx + m[:, 0, 2] * v0 * vy + m[:, 1, 2] * vx * vy
    length2 = v0**2 + vx**2 + vy**2
    prior_x, prior_y = np.moveaxis((grid / prior) ** 2 / 2.0, -1, 0)
    log_mass = (squares + 2.0 * products) / length2 - prior_x[:, :, None] - prior_y[:, None, :]
    mass = np.exp(log_mass - np.max(log_mass, axis=(1, 2), keepdims=True))
    return np.asarray(mass / np.sum(mass, axis=(1, 2), keepdims=True))


def _moments(mass: Array, grid: Array) -> tuple[Array, Array]:
    along_x, along_y = np.sum(mass, axis=2), np.sum(mass, axis=1)
    mean = np.stack(
        [np.sum(along_x * grid[..., 0], axis=1), np.sum(along_y * grid[..., 1], axis=1)], axis=-1
    )
    offset = grid - mean[:, None, :]
    covariance = np.empty((len(mass), 2, 2))
    covariance[:, 0, 0] = np.sum(along_x * offset[..., 0] ** 2, axis=1)
    covariance[:, 1, 1] = np.sum(along_y * offset[..., 1] ** 2, axis=1)
    cross = np.einsum("nij,ni,nj->n", mass, offset[..., 0], offset[..., 1])
    covariance[:, 0, 1] = covariance[:, 1, 0] = cross
    return mean, covariance


def _noise(noise_variances: ArrayLike) -> Array:
    noise = as_finite_array("noise_variances", noise_variances, (3,))
    if np.any(noise <= 0.0):
        raise ValueError(f"noise_variances={noise} must be > 0")
    return noise
