"""Calibrate gains and mutual coupling from sources in known directions.

A covariance taken with one source at a known s_i has the principal eigenvector v_i ~ diag(g) C(c) a(s_i), so the part
of the model off v_i must vanish:

    r_i = (I - v_i v_i^H) diag(g) C(c) a(s_i) = 0,   g_0 = 1, c_0 = 1.

Bilinear in g and c, holomorphic in both: Gauss-Newton on complex unknowns, started at no coupling and equal gains.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams, steering
from rf_pointing.array_sensors.arrays.covariance import eigen
from rf_pointing.array_sensors.arrays.mutual_coupling import ArrayResponse, coupling_basis

__all__ = ["CouplingFit", "fit_response"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MAX_ITERATIONS = 50
STEP_TOLERANCE = 1e-10
LARGEST_CONDITION = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingFit:
    """Response found, with the covariance (n, n) and correlation of the unknowns [g_1.., c_1..], n = M - 1 + M // 2.

    `residual` (pilots, M) in units of the element gain; `rank` and `condition` are those of the Jacobian.
    """

    response: ArrayResponse
    covariance: ComplexArray
    correlation: ComplexArray
    residual: ComplexArray
    rank: int
    condition: float
    iterations: int


def fit_response(array: CircularArrayParams, directions: Array, covariances: ComplexArray) -> CouplingFit:
    """Return gains and coupling from covariances (P, M, M) of pilots at known `directions` (P, 3).

    Raises
    ------
    ValueError
        If the pilots do not determine all unknowns (the message names the least determined one), the fit does not
        converge, or shapes disagree.
    """
    if directions.shape != (len(covariances), 3):
        raise ValueError(f"directions has shape {directions.shape}, must be ({len(covariances)}, 3)")
    principal = eigen(covariances, array.elements).vectors[..., 0]
    off = np.eye(array.elements) - principal[:, :, None] * principal[:, None, :].conj()
    shifted = np.einsum("dij,pj->pid", coupling_basis(array.elements), steering(array, directions))
    gain = np.ones(array.elements, dtype=np.complex128)
    coupling = np.zeros(array.elements // 2 + 1, dtype=np.complex128)
    coupling[0] = 1.0
    for iteration in range(1, MAX_ITERATIONS + 1):
        residual, jacobian = _linearise(off, shifted, gain, coupling)
        _require_rank(jacobian, array.elements)
        step = np.linalg.lstsq(jacobian, -residual.ravel(), rcond=None)[0]
        gain[1:] += step[: array.elements - 1]
        coupling[1:] += step[array.elements - 1 :]
        if np.max(np.abs(step)) < STEP_TOLERANCE:
            residual, jacobian = _linearise(off, shifted, gain, coupling)
            return _fit(ArrayResponse(gain=gain, coupling=coupling[1:]), residual, jacobian, iteration)
    raise ValueError(f"calibration did not converge in {MAX_ITERATIONS} iterations, last step {np.max(np.abs(step))}")


def _linearise(
    off: ComplexArray, shifted: ComplexArray, gain: ComplexArray, coupling: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the residuals (P, M) and their Jacobian (P M, M - 1 + M // 2)."""
    coupled = shifted @ coupling
    residual = np.einsum("pij,pj->pi", off, gain * coupled)
    by_gain = off * coupled[:, None, :]
    by_coupling = off @ (gain[None, :, None] * shifted)
    jacobian = np.concatenate([by_gain[:, :, 1:], by_coupling[:, :, 1:]], axis=-1)
    return residual, jacobian.reshape(-1, jacobian.shape[-1])


def _require_rank(jacobian: ComplexArray, elements: int) -> None:
    _, values, vectors = np.linalg.svd(jacobian, full_matrices=len(jacobian) < jacobian.shape[1])
    values = np.append(values, np.zeros(jacobian.shape[1] - len(values)))
    lost = values * LARGEST_CONDITION < values[0]
    if np.any(lost):
        # The basis of the undetermined space, and ties within it, depend on the last bits: of the worst
        # unknowns the first is named.
        share = np.linalg.norm(vectors[lost], axis=0)
        worst = int(np.argmax(share > 0.999 * np.max(share)))
        name = f"gain[{worst + 1}]" if worst < elements - 1 else f"coupling[{worst - elements + 1}]"
        raise ValueError(
            f"pilots do not determine {name}: condition {values[0] / max(values[-1], 1e-300):.3g} "
            f"must be <= {LARGEST_CONDITION:g}"
        )


def _fit(response: ArrayResponse, residual: ComplexArray, jacobian: ComplexArray, iterations: int) -> CouplingFit:
    values = np.linalg.svd(jacobian, compute_uv=False)
    # each pilot loses one complex equation to its unknown complex amplitude
    freedom = residual.size - len(residual) - jacobian.shape[1]
    if freedom < 1:
        raise ValueError(f"pilots={len(residual)} leave {freedom} degrees of freedom, must be >= 1")
    variance = float(np.sum(np.abs(residual) ** 2)) / freedom
    covariance = variance * np.linalg.inv(jacobian.conj().T @ jacobian)
    sigma = np.sqrt(np.diag(covariance).real)
    return CouplingFit(
        response=response,
        covariance=covariance,
        correlation=covariance / np.outer(sigma, sigma),
        residual=residual,
        rank=int(np.count_nonzero(values * LARGEST_CONDITION >= values[0])),
        condition=float(values[0] / values[-1]),
        iterations=iterations,
    )
