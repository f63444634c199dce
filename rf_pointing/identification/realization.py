"""A state-space model from input and output: OKID, eigensystem realization, balanced reduction.

Observer/Kalman identification, one input and one output (Juang, Phan, Horta and Longman 1991, the
method behind SOCIT's "okid", DSS13-ID Sec. III-D):

    y(k) = D u(k) + sum_{i=1..p} ( b_i u(k-i) + a_i y(k-i) )     observer Markov parameters
    Y(0) = D,   Y(k) = b_k + sum_{i=1..k} a_i Y(k-i)             system Markov parameters

the first by least squares, a_i = b_i = 0 for i > p.  Realization (ERA) from the Hankel matrices:

    H(0) = R S V',   A = S^-1/2 R' H(1) V S^-1/2,   B = S^1/2 V' e_1,   C = e_1' R S^1/2

Balanced reduction keeps the states that both respond to the input and show in the output.  Poles on
the unit circle (the integrator) have no Gramians: they are split off by their invariant subspace,
kept, and joined again, so only the stable part is reduced.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, require_between
from rf_pointing.identification.model import StateSpace

# Share of the largest singular value that counts as zero: rounding leaves up to 1e-14.
RANK_TOLERANCE = 1e-12


@dataclass(frozen=True, slots=True)
class ObserverMarkov:
    """`direct` D, `inputs` b_1..b_p, `outputs` a_1..a_p; `condition` of the scaled fit."""

    direct: float
    inputs: Array
    outputs: Array
    condition: float


def observer_markov(inputs: ArrayLike, outputs: ArrayLike, order: int) -> ObserverMarkov:
    """Return the observer Markov parameters of `order` p from sequences (sequences, samples).

    Raises ValueError if the data are too short for the order or do not excite it.
    """
    u, y = np.atleast_2d(inputs).astype(np.float64), np.atleast_2d(outputs).astype(np.float64)
    if u.shape != y.shape:
        raise ValueError(f"inputs has shape {u.shape}, outputs has {y.shape}: must be equal")
    require_between("order", order, 1, u.shape[1] // 4)
    # Radians per second and radians differ by 1e3: unscaled, rcond would cut the smaller.
    scale_u, scale_y = float(np.std(u)), float(np.std(y))
    if scale_u == 0.0 or scale_y == 0.0:
        raise ValueError(f"inputs have rms {scale_u} and outputs {scale_y}: both must be > 0")
    rows = np.vstack([_regressors(a / scale_u, b / scale_y, order) for a, b in zip(u, y, strict=True)])
    target = np.concatenate([b[order:] for b in y]) / scale_y
    # The triangular factor carries the whole least-squares problem in as many rows as unknowns.
    reduced: Array = np.asarray(np.linalg.qr(np.column_stack([rows, target]), mode="r"))
    solution, _, rank, singular = np.linalg.lstsq(reduced[:-1, :-1], reduced[:-1, -1], rcond=1e-13)
    if rank < rows.shape[1]:
        raise ValueError(f"order={order} needs {rows.shape[1]} independent regressors, the data excite {rank}")
    ratio = scale_y / scale_u
    markov: Array = np.asarray(solution, dtype=np.float64)
    return ObserverMarkov(
        direct=float(markov[0]) * ratio, inputs=markov[1 : order + 1] * ratio,
        outputs=markov[order + 1 :], condition=float(singular[0] / singular[-1]),
    )  # fmt: skip


def system_markov(observer: ObserverMarkov, count: int) -> Array:
    """Return the system Markov parameters Y(0)..Y(count - 1)."""
    order = len(observer.inputs)
    forcing = np.zeros(count)
    forcing[0] = observer.direct
    # A count below the order wants only the first of them.
    forcing[1 : order + 1] = observer.inputs[: count - 1]
    markov = np.zeros(count)
    for k in range(count):
        reach = min(k, order)
        markov[k] = forcing[k] + observer.outputs[:reach] @ markov[k - reach : k][::-1]
    return markov


def _regressors(u: Array, y: Array, order: int) -> Array:
    """Return rows u(k), u(k-1)..u(k-p), y(k-1)..y(k-p) for k = p..n-1."""
    windows_u = np.lib.stride_tricks.sliding_window_view(u, order + 1)[:, ::-1]
    windows_y = np.lib.stride_tricks.sliding_window_view(y[:-1], order)[:, ::-1]
    return np.hstack([windows_u, windows_y])


@dataclass(frozen=True, slots=True)
class Realization:
    """Model of the chosen order and all Hankel singular values, largest first."""

    model: StateSpace
    hankel: Array


def realize(markov: Array, order: int, sample_s: float) -> Realization:
    """Return the realization of `order` from Markov parameters Y(0).. (n,), `sample_s` apart.

    Raises ValueError if the order exceeds the rank of the Hankel matrix.
    """
    # As square as the Markov parameters allow: both factors then have the same accuracy.
    half = (len(markov) - 1) // 2
    require_between("order", order, 1, half)
    hankel = np.lib.stride_tricks.sliding_window_view(markov[1 : 2 * half], half)
    shifted = np.lib.stride_tricks.sliding_window_view(markov[2 : 2 * half + 1], half)
    left, singular, right = np.linalg.svd(hankel)
    rank = int(np.count_nonzero(singular > RANK_TOLERANCE * singular[0]))
    if order > rank:
        raise ValueError(f"order={order} exceeds the rank of the Hankel matrix, {rank}")
    root = np.sqrt(singular[:order])
    a = (left[:, :order].T @ shifted @ right[:order].T) / np.outer(root, root)
    b = (root * right[:order, 0])[:, None]
    c = (root * left[0, :order])[None, :]
    return Realization(StateSpace(a, b, c, np.array([[markov[0]]]), sample_s), singular)


_EDGE = 1e-9
# Share of the largest Hankel singular value: roots of Gramians keep 1.5e-8 of rounding.
_REDUCED_RANK_TOLERANCE = 1e-7


def balanced_reduction(model: StateSpace, order: int) -> StateSpace:
    """Return the model of `order` (integrators included) by balanced truncation of the stable part.

    Raises ValueError if a pole lies outside the unit circle, or `order` is below the number of
    integrators or above that of the states that respond to the input and show in the output.
    """
    kept, stable = _split(model)
    require_between("order", order, max(1, kept.order), model.order)
    transform, inverse, singular = _balancing(stable)
    size = order - kept.order
    rank = int(np.count_nonzero(singular > _REDUCED_RANK_TOLERANCE * np.max(singular, initial=0.0)))
    if size > rank:
        raise ValueError(f"order={order} must be <= {kept.order + rank}, the states that respond and show")
    a = (inverse @ stable.a @ transform)[:size, :size]
    b, c = (inverse @ stable.b)[:size], (stable.c @ transform)[:, :size]
    zeros = np.zeros((kept.order, size))
    joined = np.block([[kept.a, zeros], [zeros.T, a]])
    return StateSpace(joined, np.vstack([kept.b, b]), np.hstack([kept.c, c]), model.d, model.sample_s)


def _split(model: StateSpace) -> tuple[StateSpace, StateSpace]:
    """Return the part with poles on the unit circle and the stable part, decoupled."""
    import scipy.linalg

    largest = float(np.max(np.abs(np.linalg.eigvals(model.a))))
    if largest > 1.0 + _EDGE:
        raise ValueError(f"largest pole magnitude {largest:.12g} must be <= 1")
    # Schur, not eigenvectors: two nearly equal poles at z = 1 have nearly parallel eigenvectors.
    upper, basis, count = scipy.linalg.schur(model.a, sort=lambda re, im: np.hypot(re, im) > 1.0 - _EDGE)
    # The Sylvester equation removes what couples the two blocks; scipy 1.11 refuses an empty one.
    first, second, coupling = upper[:count, :count], upper[count:, count:], upper[:count, count:]
    if coupling.size:
        coupling = scipy.linalg.solve_sylvester(first, -second, -coupling)
    b = basis.T @ model.b
    c = model.c @ basis
    edge = StateSpace(
        upper[:count, :count], b[:count] - coupling @ b[count:], c[:, :count], np.zeros_like(model.d), model.sample_s
    )
    rest = StateSpace(upper[count:, count:], b[count:], c[:, :count] @ coupling + c[:, count:], model.d, model.sample_s)
    return edge, rest


def _balancing(model: StateSpace) -> tuple[Array, Array, Array]:
    """Return the balancing transformation, its inverse and the Hankel singular values."""
    import scipy.linalg

    if model.order == 0:
        return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
    reach = _root(scipy.linalg.solve_discrete_lyapunov(model.a, model.b @ model.b.T))
    show = _root(scipy.linalg.solve_discrete_lyapunov(model.a.T, model.c.T @ model.c))
    left, singular, right = np.linalg.svd(show.T @ reach)
    # A state that cannot be reached has no size; the smallest number keeps the inverse finite.
    scale = 1.0 / np.sqrt(np.maximum(singular, np.finfo(float).tiny))
    return reach @ right.T * scale, (show @ left * scale).T, singular


def _root(gramian: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    # Rounding makes the smallest eigenvalues negative; their true value is zero.
    factor: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
