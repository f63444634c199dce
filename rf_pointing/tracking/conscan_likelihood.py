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

from rf_pointing.tracking.conscan_equations import MU

__all__ = ["BeamDesign", "LikelihoodFit", "beam_design", "fit_beam"]

Array = NDArray[np.float64]

MAX_ITERATIONS = 25
STEP_TOLERANCE = 1e-4  # of a beamwidth; what is left after that step is below 1e-6
FRESH_STEP = 1e-2  # after a smaller step the information matrix of the step before still serves


class BeamDesign(NamedTuple):
    """Regressors of n beam positions, shared by every run of a batch."""

    columns: Array  # (n, k): 1, cross-elevation, elevation, spin terms
    products: Array  # (n, k * k): the outer products of each row
    loss: Array  # (n,): -mu |u|^2 / h^2
    half_power_beamwidth_rad: float


class LikelihoodFit(NamedTuple):
    """Target minus scan origin (..., 2), covariance (..., 2, 2), mean chi squared per degree of freedom (...)."""

    error_rad: Array
    covariance_rad2: Array
    chi_squared: Array
    converged: Array


def beam_design(
    beam_cross_elevation_rad: Array,
    beam_elevation_rad: Array,
    half_power_beamwidth_rad: float,
    spin_columns: Array | None = None,
) -> BeamDesign:
    """Prepare the positions (n,) of the beam; `spin_columns` (n, m) enter the logarithm of the power."""
    x = beam_cross_elevation_rad / half_power_beamwidth_rad
    y = beam_elevation_rad / half_power_beamwidth_rad
    columns = np.empty((len(x), 3 if spin_columns is None else 3 + spin_columns.shape[1]))
    columns[:, 0], columns[:, 1], columns[:, 2] = 1.0, 2.0 * MU * x, 2.0 * MU * y
    if spin_columns is not None:
        columns[:, 3:] = spin_columns
    products = (columns[:, :, None] * columns[:, None, :]).reshape(len(x), -1)
    return BeamDesign(columns, products, -MU * (x * x + y * y), half_power_beamwidth_rad)


def fit_beam(design: BeamDesign, power_w: Array, noise_w: Array) -> LikelihoodFit:
    """Return the maximum-likelihood direction for powers (..., n) of variance `noise_w` (..., n) times their mean.

    Leading dimensions are independent runs at the same beam positions.  A run that does not converge says so.
    """
    columns, products = design.columns, design.products
    weighted = power_w / noise_w
    solution, bound = _logarithmic_start(design, power_w, weighted)
    size = np.inf
    for _ in range(MAX_ITERATIONS):
        weight = np.exp(solution @ columns.T + design.loss) / noise_w
        if size > FRESH_STEP:
            bound = _inverse(weight @ products)
        step: Array = np.matvec(bound, (weighted - weight) @ columns)
        solution = solution + step
        size = abs(step).max()
        if size < STEP_TOLERANCE:
            break
    leverage = bound.reshape(*weight.shape[:-1], -1) @ products.T
    bias: Array = np.matvec(bound, (weight * leverage) @ columns)
    scale = design.half_power_beamwidth_rad
    misfit = weighted - weight
    return LikelihoodFit(
        scale * (solution + 0.5 * bias)[..., 1:3],
        scale**2 * bound[..., 1:3, 1:3],
        (misfit * misfit / weight).sum(axis=-1) / (columns.shape[0] - columns.shape[1]),
        abs(step).max(axis=-1) < STEP_TOLERANCE,
    )


def _logarithmic_start(design: BeamDesign, power_w: Array, weighted: Array) -> tuple[Array, Array]:
    """Return the least-squares solution for the logarithm of the power, biased by the noise but close, and its bound."""
    bound = _inverse(weighted @ design.products)
    solution: Array = np.matvec(bound, (weighted * (np.log(power_w) - design.loss)) @ design.columns)
    return solution, bound


def _inverse(flat: Array) -> Array:
    """Return the inverses of symmetric matrices given as rows (..., k * k); 3 x 3 alone by cofactors, 3 times faster."""
    if flat.shape != (9,):
        size = math.isqrt(flat.shape[-1])
        return np.asarray(np.linalg.inv(flat.reshape(*flat.shape[:-1], size, size)), dtype=np.float64)
    a, b, c, _, d, e, _, _, f = flat.tolist()
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * ca + b * cb + c * cc
    if not determinant > 0.0:
        raise np.linalg.LinAlgError(f"determinant={determinant} must be > 0")
    ce = b * c - a * e
    return np.array([[ca, cb, cc], [cb, a * f - c * c, ce], [cc, ce, a * d - b * b]]) / determinant
