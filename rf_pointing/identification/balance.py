"""Balanced reduction: keep the states that both respond to the input and show in the output.

Poles on the unit circle (the integrator) have no Gramians; they are split off by their invariant
subspace, kept whole and joined again, so only the stable part is reduced.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between
from rf_pointing.identification.model import StateSpace

__all__ = ["balanced_reduction", "hankel_singular_values"]

Array = NDArray[np.float64]

_EDGE = 1e-9


def balanced_reduction(model: StateSpace, order: int) -> StateSpace:
    """Return the model of `order` (integrators included) by balanced truncation of the stable part.

    Raises
    ------
    ValueError
        If a pole lies outside the unit circle, or fewer states are asked for than there are integrators.
    """
    kept, stable = _split(model)
    require_between("order", order, max(1, kept.order), model.order)
    transform, inverse, _ = _balancing(stable)
    size = order - kept.order
    a = (inverse @ stable.a @ transform)[:size, :size]
    b, c = (inverse @ stable.b)[:size], (stable.c @ transform)[:, :size]
    zeros = np.zeros((kept.order, size))
    joined = np.block([[kept.a, zeros], [zeros.T, a]])
    return StateSpace(joined, np.vstack([kept.b, b]), np.hstack([kept.c, c]), model.d, model.sample_s)


def hankel_singular_values(model: StateSpace) -> Array:
    """Return the Hankel singular values of the stable part, largest first."""
    return _balancing(_split(model)[1])[2]


def _split(model: StateSpace) -> tuple[StateSpace, StateSpace]:
    """Return the part with poles on the unit circle and the stable part, decoupled."""
    import scipy.linalg

    largest = float(np.max(np.abs(np.linalg.eigvals(model.a))))
    if largest > 1.0 + _EDGE:
        raise ValueError(f"largest pole magnitude {largest} must be <= 1")
    upper, basis, count = scipy.linalg.schur(model.a, sort=lambda re, im: np.hypot(re, im) > 1.0 - _EDGE)
    coupling = scipy.linalg.solve_sylvester(upper[:count, :count], -upper[count:, count:], -upper[:count, count:])
    b = basis.T @ model.b
    c = model.c @ basis
    edge = StateSpace(
        upper[:count, :count], b[:count] - coupling @ b[count:], c[:, :count], np.zeros_like(model.d), model.sample_s
    )
    rest = StateSpace(upper[count:, count:], b[count:], c[:, :count] @ coupling + c[:, count:], model.d, model.sample_s)
    return edge, rest


def _balancing(model: StateSpace) -> tuple[Array, Array, Array]:
    """Return the balancing transformation, its inverse and the Hankel singular values (square-root method)."""
    import scipy.linalg

    if model.order == 0:
        return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
    reach = _root(scipy.linalg.solve_discrete_lyapunov(model.a, model.b @ model.b.T))
    show = _root(scipy.linalg.solve_discrete_lyapunov(model.a.T, model.c.T @ model.c))
    left, singular, right = np.linalg.svd(show.T @ reach)
    scale = 1.0 / np.sqrt(np.maximum(singular, np.finfo(float).tiny))
    return reach @ right.T * scale, (show @ left * scale).T, singular


def _root(gramian: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    factor: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
