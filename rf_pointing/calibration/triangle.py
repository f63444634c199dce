"""Least squares in square-root form: a triangle R with |R x - z| = |A x - b|, updated by orthogonal steps.

Blocks of rows are folded in one after the other, so any number of observations fits in the memory of one block, and
no normal equations are formed (their condition number is the square).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.separability import advice_for, null_space_message

__all__ = ["RANK_TOLERANCE", "Solution", "Triangle", "triangle_of"]

Array = NDArray[np.float64]

_WORK_PER_COLUMN = 32
RANK_TOLERANCE = 1e-9
"""Smallest ratio of singular values of the column-scaled matrix that still counts as full rank."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Minimum of |A x - b|: `values` (k,), `covariance` (k, k) for unit row sigma, and how well it is determined.

    `scaled` (k, k) is the triangle of A with columns of unit length.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    rank: int
    residual_square: float
    """|A x - b|^2 at the minimum."""
    scaled: Array

    @cached_property
    def condition(self) -> float:
        """Return the condition number of A with columns of unit length."""
        singular = np.linalg.svd(self.scaled, compute_uv=False)
        return float(singular[0] / singular[-1])


@dataclass
class Triangle:
    """The square-root state; `copy` before adding rows that may have to be taken back."""

    names: tuple[str, ...]
    factor: Array = field(default_factory=lambda: np.zeros((0, 0)))
    rows: int = 0

    def __post_init__(self) -> None:
        width = len(self.names) + 1
        if self.factor.size == 0:
            self.factor = np.zeros((0, width))
        if self.factor.shape[1] != width:
            raise ValueError(f"factor has {self.factor.shape[1]} columns, must be {width}")

    def copy(self) -> "Triangle":
        """Return an independent copy."""
        return Triangle(self.names, self.factor.copy(), self.rows)

    def add_blocks(self, blocks: Iterable[tuple[Array, NDArray[np.int64]]]) -> None:
        """Fold in blocks of rows [matrix | right] (n, m + 1), divided by sigma, for the unknowns `columns` (m,).

        Each block is reduced by itself first.  The arrays are used as work space.
        """
        reduced = [(triangle_of(rows), columns, len(rows)) for rows, columns in blocks]
        stacked = np.zeros((sum(len(part) for part, _, _ in reduced), len(self.names) + 1), order="F")
        start = 0
        for part, columns, _ in reduced:
            here = stacked[start : start + len(part)]
            here[:, columns], here[:, -1] = part[:, :-1], part[:, -1]
            start += len(part)
        self.add_triangle(stacked, sum(count for _, _, count in reduced))

    def add_triangle(self, rows: Array, count: int) -> None:
        """Fold in rows (m, k + 1) of matrix and right side together that stand for `count` equations."""
        self.factor = triangle_of(np.concatenate([self.factor, rows]) if len(self.factor) else rows)
        self.rows += count

    def add_prior(self, name: str, value: float, sigma: float) -> None:
        """Fold in the knowledge name = value +/- sigma."""
        if not sigma > 0.0:
            raise ValueError(f"prior sigma of {name}={sigma} must be > 0")
        row = np.zeros((1, len(self.names) + 1))
        row[0, self.names.index(name)], row[0, -1] = 1.0 / sigma, value / sigma
        self.add_triangle(row, 1)

    def solve(self) -> Solution:
        """Return the least-squares solution; raises ValueError naming the terms the data cannot separate."""
        count = len(self.names)
        matrix, right = self.factor[:, :count], self.factor[:, count]
        scale = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
        if len(matrix) < count or not scale.all():
            lost = [name for name, length in zip(self.names, scale, strict=True) if length == 0.0] or self.names
            raise ValueError(
                f"{self.rows} equations do not determine {', '.join(lost)}: fix them, give priors, or add {advice_for(lost)}"
            )
        scaled = matrix[:count] / scale
        inverse = self._inverse(scaled, scale)
        root = inverse / scale[:, np.newaxis]
        return Solution(
            names=self.names,
            values=root @ right[:count],
            covariance=root @ root.T,
            rank=count,
            residual_square=float(right[count:] @ right[count:]),
            scaled=scaled,
        )

    def _inverse(self, scaled: Array, scale: Array) -> Array:
        inverse = _inverse_of(scaled)
        # The Frobenius norms bound the condition number from above: only a suspect matrix pays for its SVD.
        # "not <=" and not ">": the bound of an inverse that overflowed is not a number.
        if inverse is None or not np.vdot(inverse, inverse) * len(scaled) <= RANK_TOLERANCE**-2:
            _, singular, rotation = np.linalg.svd(scaled)
            lost = singular < RANK_TOLERANCE * singular[0]
            if inverse is None or np.any(lost):
                raise ValueError(null_space_message(self.names, rotation[lost] / scale, scale))
        return inverse


def triangle_of(rows: Array) -> Array:
    """Return R (min(n, m), m) of the QR factors of `rows` (n, m), which serves as work space.

    LAPACK is called directly: numpy's wrapper costs more than the work for a few hundred rows.
    """
    height, width = min(rows.shape), rows.shape[1]
    factor, _, _, info = _lapack().dgeqrf(rows, lwork=_WORK_PER_COLUMN * width, overwrite_a=True)
    if info != 0:
        raise ValueError(f"QR factorisation failed: info={info}")
    return cast(Array, factor[:height] * _upper(height, width))


@cache
def _lapack() -> Any:
    from scipy.linalg import lapack

    return lapack


@cache
def _upper(height: int, width: int) -> Array:
    return np.asfortranarray(np.triu(np.ones((height, width))))


def _inverse_of(triangle: Array) -> Array | None:
    """Return the inverse, None where a diagonal element is exactly zero."""
    inverse, info = _lapack().dtrtri(triangle)
    return cast(Array, inverse) if info == 0 else None
