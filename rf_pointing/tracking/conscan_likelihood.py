"""Conscan by maximum likelihood on the exact Gaussian beam, without the paper's linearisation.

Model: P_i = exp(a + 2 mu u_i.theta / h^2 - mu |u_i|^2 / h^2 + spin terms), u_i the beam's offset, theta the target's.
The unknown power and |theta|^2 are both in a, so the model is log-linear in (a, theta) for any theta.  The receiver's
variance is alpha_i P_i (CONSCAN B-5: alpha = 2 N0/T).  Score: sum_i x_i (measured P_i - P_i) / alpha_i = 0, concave,
solved by Newton; it is linear in the measured power, and the bias -1/2 sum_i x_i w_i q_i that the maximum keeps is
removed in closed form (Cordeiro and McCullagh 1991).  The inverse Hessian is the Cramer-Rao bound.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MU
from rf_pointing.tracking.conscan_window import SMALLEST_INFORMATION, is_singular

__all__ = ["BeamDesign", "LikelihoodFit", "beam_design", "columns_independent", "fit_beam", "least_spread_rad"]

Array = NDArray[np.float64]

MAX_ITERATIONS = 25
LOSS = -0.25 / MU  # -mu u^2 / h^2 from the columns 2 mu u / h
_SINGULAR = "the powers do not determine the direction: one outweighs the others, or the beam moved on a line"
STEP_TOLERANCE = 2e-3  # of a beamwidth; what is left after that step is below 1e-5
FRESH_STEP = 1e-2  # after a smaller step the information matrix of the step before still serves
LARGEST_LOGARITHM = 600.0  # of the power: Newton may overshoot, and exp overflows at 709


class BeamDesign(NamedTuple):
    """Regressors of n beam positions, shared by every run of a batch."""

    columns: Array  # (n, k): 1, cross-elevation, elevation, spin terms
    products: Array  # (n, k * k): the outer products of each row, the row itself first
    loss: Array  # (n,): -mu |u|^2 / h^2
    half_power_beamwidth_rad: float


class LikelihoodFit(NamedTuple):
    """Target minus scan origin (..., 2), covariance (..., 2, 2), mean chi squared per degree of freedom (...)."""

    error_rad: Array
    covariance_rad2: Array
    chi_squared: Array
    converged: NDArray[np.bool_]


def beam_design(
    beam_cross_elevation_rad: Array,
    beam_elevation_rad: Array,
    half_power_beamwidth_rad: float,
    spin_columns: Array | None = None,
) -> BeamDesign:
    """Prepare the positions (n,) of the beam; `spin_columns` (n, m) enter the logarithm of the power."""
    scale = 2.0 * MU / half_power_beamwidth_rad
    count, unknowns = len(beam_elevation_rad), 3 if spin_columns is None else 3 + spin_columns.shape[1]
    columns = np.empty((count, unknowns))
    columns[:, 0] = 1.0
    np.multiply(beam_cross_elevation_rad, scale, out=columns[:, 1])
    np.multiply(beam_elevation_rad, scale, out=columns[:, 2])
    if spin_columns is not None:
        columns[:, 3:] = spin_columns
    products = (columns[:, :, None] * columns[:, None, :]).reshape(count, -1)
    loss = LOSS * (products[:, unknowns + 1] + products[:, 2 * unknowns + 2])
    return BeamDesign(columns, products, loss, half_power_beamwidth_rad)


def least_spread_rad(design: BeamDesign) -> float:
    """Return the rms motion of the beam along the axis on which it moved least."""
    sums, unknowns = np.add.reduce(design.products).tolist(), design.columns.shape[1]
    count, right, up = sums[:3]
    xx, xy, yy = sums[unknowns + 1], sums[unknowns + 2], sums[2 * unknowns + 2]
    xx, xy, yy = xx - right * right / count, xy - right * up / count, yy - up * up / count
    least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    return math.sqrt(max(least, 0.0) / count) * design.half_power_beamwidth_rad / (2.0 * MU)


def columns_independent(design: BeamDesign) -> bool:
    """Return whether equally good samples at these positions determine every unknown."""
    return not is_singular(_square(np.add.reduce(design.products)))


def fit_beam(design: BeamDesign, power_w: Array, noise_w: Array) -> LikelihoodFit:
    """Return the maximum-likelihood direction for powers (..., n) of variance `noise_w` (..., n) times their mean.

    Leading dimensions are independent runs at the same beam positions.  A run that does not converge says so.
    Raises LinAlgError, a ValueError, where the powers do not determine every unknown.
    """
    columns, products = design.columns, design.products
    unknowns = columns.shape[1]
    weighted = power_w / noise_w
    moments = weighted @ products
    score, bound = moments[..., :unknowns], _inverse(moments)
    solution = _logarithmic_start(design, power_w, weighted, bound)
    size2 = math.inf
    for _ in range(MAX_ITERATIONS):
        weight = np.exp(_bounded(solution @ columns.T + design.loss)) / noise_w
        moments = weight @ products
        if size2 > FRESH_STEP**2:
            bound = _inverse(moments)
        step = _apply(bound, score - moments[..., :unknowns])
        solution = solution + step
        length2 = _dot(step, step)
        size2 = float(length2 if length2.ndim == 0 else length2.max())
        if size2 < STEP_TOLERANCE**2:
            break
    leverage = bound.reshape(*weight.shape[:-1], -1) @ products.T
    bias = _apply(bound, (weight * leverage) @ columns)
    scale = design.half_power_beamwidth_rad
    misfit = weighted - weight
    return LikelihoodFit(
        scale * (solution + 0.5 * bias)[..., 1:3],
        scale**2 * bound[..., 1:3, 1:3],
        _dot(misfit, misfit / weight) / (len(columns) - unknowns),
        np.asarray(length2 < STEP_TOLERANCE**2),
    )


def _logarithmic_start(design: BeamDesign, power_w: Array, weighted: Array, bound: Array) -> Array:
    """Return the least-squares solution for the logarithm of the power, biased by the noise but close."""
    return _apply(bound, (weighted * (np.log(power_w) - design.loss)) @ design.columns)


def _bounded(logarithm: Array) -> Array:
    return np.minimum(np.maximum(logarithm, -LARGEST_LOGARITHM), LARGEST_LOGARITHM)


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = matrix @ vector if vector.ndim == 1 else (matrix @ vector[..., None])[..., 0]
    return product


def _dot(a: Array, b: Array) -> Array:
    product: Array = a @ b if a.ndim == 1 else np.sum(a * b, axis=-1)
    return product


def _inverse(flat: Array) -> Array:
    """Return the inverses of symmetric matrices given as rows (..., k * k); 3 x 3 alone by cofactors, 3 times faster.

    Raises LinAlgError for a singular one.  3 x 3 the determinant, the product of the eigenvalues, is judged.
    """
    if flat.shape != (9,):
        matrix = _square(flat)
        if is_singular(matrix):
            raise np.linalg.LinAlgError(_SINGULAR)
        return np.asarray(np.linalg.inv(matrix))
    a, b, c, _, d, e, _, _, f = flat.tolist()
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * ca + b * cb + c * cc
    if not determinant > SMALLEST_INFORMATION * (a * d * f):
        raise np.linalg.LinAlgError(_SINGULAR)
    ce = b * c - a * e
    adjugate = np.array((ca, cb, cc, cb, a * f - c * c, ce, cc, ce, a * d - b * b))
    return np.asarray(adjugate / determinant).reshape(3, 3)


def _square(flat: Array) -> Array:
    size = math.isqrt(flat.shape[-1])
    return flat.reshape(*flat.shape[:-1], size, size)
