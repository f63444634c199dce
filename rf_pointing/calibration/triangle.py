"""Least squares in square-root form: a triangle R with |R x - z| = |A x - b|, updated by orthogonal steps.

Blocks of rows are folded in one after the other, so any number of observations fits in the memory of one block, and
no normal equations are formed (their condition number is the square).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.separability import null_space_message

__all__ = ["RANK_TOLERANCE", "Solution", "Triangle"]

Array = NDArray[np.float64]

RANK_TOLERANCE = 1e-9
"""Smallest ratio of singular values of the column-scaled matrix that still counts as full rank."""


@dataclass(frozen=True)
class Solution:
    """Minimum of |A x - b|: `values` (k,), `covariance` (k, k) for unit row sigma, and how well it is determined."""

    names: tuple[str, ...]
    values: Array
    covariance: Array
    rank: int
    condition: float
    residual_square: float
    """|A x - b|^2 at the minimum."""


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

    def add(self, matrix: Array, right: Array, columns: Sequence[int] | NDArray[np.int64]) -> None:
        """Fold in rows matrix @ x[columns] = right, each already divided by its sigma."""
        self.add_blocks([(matrix, right, columns)])

    def add_blocks(self, blocks: Iterable[tuple[Array, Array, Sequence[int] | NDArray[np.int64]]]) -> None:
        """Fold in several blocks (matrix, right, columns) of rows, each reduced by itself first."""
        rows, count = [], 0
        for matrix, right, columns in blocks:
            reduced = _triangle_of(np.column_stack([matrix, right]))
            wide = np.zeros((len(reduced), len(self.names) + 1))
            wide[:, columns] = reduced[:, :-1]
            wide[:, -1] = reduced[:, -1]
            rows.append(wide)
            count += len(right)
        self.add_triangle(np.concatenate(rows), count)

    def add_triangle(self, rows: Array, count: int) -> None:
        """Fold in rows (m, k + 1) of matrix and right side together that stand for `count` equations."""
        self.factor = _triangle_of(np.concatenate([self.factor, rows]))
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
        scale = np.sqrt(np.sum(matrix * matrix, axis=0))
        if len(matrix) < count or not scale.all():
            empty = [name for name, length in zip(self.names, scale, strict=True) if length == 0.0]
            raise ValueError(f"{self.rows} equations do not determine {', '.join(empty or self.names)}")
        left, singular, rotation = np.linalg.svd(matrix / scale, full_matrices=False)
        lost = singular < RANK_TOLERANCE * singular[0]
        if lost.any():
            raise ValueError(null_space_message(self.names, rotation[lost] / scale, scale))
        root = (rotation / singular[:, np.newaxis] / scale).T
        values = root @ (right @ left)
        residual = matrix @ values - right
        return Solution(
            names=self.names,
            values=values,
            covariance=root @ root.T,
            rank=count,
            condition=float(singular[0] / singular[-1]),
            residual_square=float(residual @ residual),
        )


def _triangle_of(rows: Array) -> Array:
    return cast(Array, np.linalg.qr(rows, mode="r"))
