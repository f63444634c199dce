"""Eigensystem realization: a state-space model from Markov parameters, its Hankel singular values showing the order.

H(0) = R S V',   A = S^-1/2 R' H(1) V S^-1/2,   B = first column of S^1/2 V',   C = first row of R
S^1/2
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between
from rf_pointing.identification.model import StateSpace

__all__ = ["Realization", "realize", "suggested_order"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Realization:
    """Model of the chosen order and all Hankel singular values, largest first."""

    model: StateSpace
    hankel: Array


def realize(markov: Array, order: int, sample_s: float) -> Realization:
    """Return the realization of `order` from Markov parameters Y(0), Y(1).. (n,) sampled every `sample_s`.

    Raises
    ------
    ValueError
        If the order exceeds the rank of the Hankel matrix.
    """
    half = (len(markov) - 1) // 2
    require_between("order", order, 1, half)
    hankel = np.lib.stride_tricks.sliding_window_view(markov[1 : 2 * half], half)
    shifted = np.lib.stride_tricks.sliding_window_view(markov[2 : 2 * half + 1], half)
    left, singular, right = np.linalg.svd(hankel)
    if singular[order - 1] <= 1e-14 * singular[0]:
        raise ValueError(
            f"order={order} exceeds the rank of the Hankel matrix, {np.sum(singular > 1e-14 * singular[0])}"
        )
    root = np.sqrt(singular[:order])
    a = (left[:, :order].T @ shifted @ right[:order].T) / np.outer(root, root)
    b = (root * right[:order, 0])[:, None]
    c = (root * left[0, :order])[None, :]
    return Realization(StateSpace(a, b, c, np.array([[markov[0]]]), sample_s), singular)


def suggested_order(hankel: Array, floor_ratio: float = 1e-4) -> int:
    """Return how many Hankel singular values exceed `floor_ratio` times the second one.

    The second, because the first is the integrator of the drive and as large as the data are long.
    """
    require_between("floor_ratio", floor_ratio, 1e-15, 1.0)
    return int(np.count_nonzero(hankel > floor_ratio * hankel[min(1, len(hankel) - 1)]))
