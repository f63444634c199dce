"""Least squares in square-root form: a triangle R with |R x - z| = |A x - b|, by orthogonal steps.

Blocks of rows are folded in one after the other; no normal equations are formed, as their condition
number is the square.  Parameters that belong to one pass only are eliminated first: the rows [P | A
| b] of a pass and the prior rows [1/sigma | 0 | 0] of its own parameters p become a triangle; what
lies below the rows of p is free of p and goes on to the common terms, and the rows of p give p once
the terms are known.  What several passes have in common, the error of one set of elements or of
the whole campaign, is eliminated from what is left in the same way, level by level.

What the data do not determine is reported by the terms' names, with data that would separate them.
"""

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.terms import ALL_TERMS
from rf_pointing.core.types import Array

Places = NDArray[np.int64]

# At one elevation the exact fit went to angles of 2.5 deg, and good terms 29 sigma off.
LARGEST_SIGMA_RAD = 5e-3
# Smallest ratio of singular values of the column-scaled matrix that still counts as full rank.
RANK_TOLERANCE = 1e-9
# A term with less of the null direction than this is there by rounding, and no use to the reader.
_SHARE = 0.05
# LAPACK's block size: without work space for blocks it takes the slow, unblocked way.
_WORK_PER_COLUMN = 32


@dataclass(frozen=True, eq=False)
class Solution:
    """Minimum of |A x - b|: `values` (k,), `covariance` (k, k) for unit row sigma.

    `scaled` (k, k) is the triangle of A with columns of unit length.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    residual_square: float
    """|A x - b|^2 at the minimum."""
    scaled: Array

    @cached_property
    def condition(self) -> float:
        """Return the condition number of A with columns of unit length."""
        singular = np.linalg.svd(self.scaled, compute_uv=False)
        return float(singular[0] / singular[-1])


@dataclass
class NormalEquations:
    """The square-root state: `factor` [R | z] of all rows so far, and how many they were."""

    names: tuple[str, ...]
    factor: Array = field(init=False)
    rows: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.factor = np.zeros((0, len(self.names) + 1))

    def add_blocks(self, blocks: Iterable[tuple[Array, NDArray[np.int64]]]) -> None:
        """Fold in blocks of rows [matrix | right] (n, m + 1), divided by sigma, of some unknowns.

        Each block is reduced by itself first.  The arrays are used as work space.
        """
        # Most terms act on one axis: two QRs of half the columns are half the work of one of all.
        reduced = [(equations_of(rows), columns, len(rows)) for rows, columns in blocks]
        stacked = np.zeros(
            (sum(len(part) for part, _, _ in reduced), len(self.names) + 1), order="F"
        )
        start = 0
        for part, columns, _ in reduced:
            here = stacked[start : start + len(part)]
            here[:, columns], here[:, -1] = part[:, :-1], part[:, -1]
            start += len(part)
        self.add_equations(stacked, sum(count for _, _, count in reduced))

    def add_equations(self, rows: Array, count: int) -> None:
        """Fold in rows (m, k + 1), matrix and right side, that stand for `count` equations."""
        self.factor = equations_of(
            np.concatenate([self.factor, rows]) if len(self.factor) else rows
        )
        self.rows += count

    def add_prior(self, name: str, value: float, sigma: float) -> None:
        """Fold in the knowledge name = value +/- sigma."""
        if not sigma > 0.0:
            raise ValueError(f"prior sigma of {name}={sigma} must be > 0")
        row = np.zeros((1, len(self.names) + 1))
        row[0, self.names.index(name)], row[0, -1] = 1.0 / sigma, value / sigma
        self.add_equations(row, 1)

    def solve(self) -> Solution:
        """Return the solution; raises ValueError naming the terms the data cannot separate."""
        count = len(self.names)
        matrix, right = self.factor[:, :count], self.factor[:, count]
        scale = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
        if len(matrix) < count or not scale.all():
            lost = [
                name for name, length in zip(self.names, scale, strict=True) if length == 0.0
            ] or self.names
            raise ValueError(
                f"{self.rows} equations do not determine {', '.join(lost)}: fix them, give priors, or add {advice_for(lost)}"
            )
        # On columns of unit length: radians and seconds differ by orders of magnitude.
        scaled = matrix[:count] / scale
        inverse = self._inverse(scaled, scale)
        root = inverse / scale[:, np.newaxis]
        return Solution(
            names=self.names, values=root @ right[:count], covariance=root @ root.T,
            residual_square=float(right[count:] @ right[count:]), scaled=scaled,
        )  # fmt: skip

    def _inverse(self, scaled: Array, scale: Array) -> Array:
        inverse = _inverse_of(scaled)
        # The Frobenius norms bound the condition number from above: only a suspect matrix pays for
        # its SVD.  "not <=" and not ">": the bound of an inverse that overflowed is not a number.
        if not np.vdot(inverse, inverse) * len(scaled) <= RANK_TOLERANCE**-2:
            _, singular, rotation = np.linalg.svd(scaled)
            lost = singular < RANK_TOLERANCE * singular[0]
            if np.any(lost):
                raise ValueError(_null_space_message(self.names, rotation[lost] / scale, scale))
        return inverse


@dataclass(frozen=True, eq=False)
class PassHeads:
    """The rows of the passes' own parameters: own (g, p, p) @ p + common @ x = right (g, p).

    `passes` (g,) says which pass each belongs to, ascending; of another level, which group.
    """

    passes: Places
    own: Array
    common: Array
    right: Array

    def joint(self, values: Array, root: Array) -> tuple[Array, Array]:
        """Return values (g, p + k) and square root (g, p + k, p + m) of the covariance of all.

        The own parameters come first, then the common ones, whose values (g, k) and square root
        (g, k, m) are given.
        """
        inverse = np.linalg.inv(self.own)
        right = self.right - np.einsum("gij,gj->gi", self.common, values)
        own = np.einsum("gij,gj->gi", inverse, right)
        upper = np.concatenate([inverse, -inverse @ self.common @ root], axis=2)
        lower = np.concatenate([np.zeros((*root.shape[:2], inverse.shape[2])), root], axis=2)
        return np.concatenate([own, values], axis=1), np.concatenate([upper, lower], axis=1)


def pass_equations(rows: Array, passes: Places) -> tuple[Places, Array]:
    """Return the passes, ascending, and the triangle (g, w, w) of the rows (n, w) of each."""
    numbers, group, lengths = np.unique(passes, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    first = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    rank = np.arange(len(rows)) - np.repeat(first, lengths)
    # Passes of about one length are reduced together: a QR for each costs mostly its call.
    size_class = np.ceil(np.log2(lengths)).astype(np.int64)
    factors = np.zeros((len(numbers), rows.shape[1], rows.shape[1]))
    for size in np.unique(size_class):
        members = np.flatnonzero(size_class == size)
        chosen = size_class[group[order]] == size
        # Shorter passes are filled up with zeros, which change no triangle.
        stack = np.zeros((len(members), int(np.max(lengths[members])), rows.shape[1]))
        stack[np.searchsorted(members, group[order][chosen]), rank[chosen]] = rows[order[chosen]]
        reduced = np.asarray(np.linalg.qr(stack, mode="r"))
        factors[members, : reduced.shape[1]] = reduced
    return numbers, factors


def eliminate(
    numbers: Places, factors: Array, prior_sigma: Array, expected: Array | None = None
) -> tuple[PassHeads, Array]:
    """Return the rows of the passes' own parameters, and rows (g, m, k + 1) free of them.

    The columns of the `factors` are the pass's own partials, the common ones and the right side.
    The own parameters scatter with `prior_sigma` about zero, or about what `expected` (g, own, k)
    makes of the common ones.
    """
    own = len(prior_sigma)
    prior = np.zeros((len(numbers), own, factors.shape[2]))
    prior[:, np.arange(own), np.arange(own)] = 1.0 / prior_sigma
    if expected is not None:
        prior[:, :, own:-1] = -expected / prior_sigma[:, np.newaxis]
    reduced = np.asarray(np.linalg.qr(np.concatenate([prior, factors], axis=1), mode="r"))
    heads = reduced[:, :own]
    rest = reduced[:, own:, own:]
    return PassHeads(numbers, heads[:, :, :own], heads[:, :, own:-1], heads[:, :, -1]), rest


def require_determined(names: Sequence[str], covariance: Array, known: Container[str]) -> None:
    """Raise ValueError naming angles of a sigma beyond LARGEST_SIGMA_RAD, and data for them."""
    # Terms in `known` have a prior: the user has stated how far they may be off.
    sigma = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    lost = [
        n
        for n in names
        if n not in known and ALL_TERMS[n].unit == "rad" and sigma[n] > LARGEST_SIGMA_RAD
    ]
    if lost:
        largest, limit = (
            np.degrees(value) for value in (max(sigma[name] for name in lost), LARGEST_SIGMA_RAD)
        )
        raise ValueError(
            f"the data hardly separate {' + '.join(lost)} (sigma up to {largest:.2g} deg, must be <= {limit:.2g} deg): "
            f"fix one of the terms, give a prior, or add {advice_for(lost)}"
        )


def advice_for(names: Sequence[str]) -> str:
    """Return which data would separate `names`."""
    wanted = dict.fromkeys(ALL_TERMS[name].separated_by for name in names if name in ALL_TERMS)
    return "; ".join(wanted) if wanted else "a prior on one of them"


def equations_of(rows: Array) -> Array:
    """Return R (min(n, m), m) of the QR factors of `rows` (n, m), which serves as work space."""
    # LAPACK is called directly: numpy's wrapper costs more than the work for a few hundred rows.
    height, width = min(rows.shape), rows.shape[1]
    factor, _, _, info = _lapack().dgeqrf(rows, lwork=_WORK_PER_COLUMN * width, overwrite_a=True)
    if info != 0:
        raise ValueError(f"QR factorisation failed: info={info}")
    return cast(Array, factor[:height] * _upper(height, width))


@cache
def _lapack() -> Any:
    # Loaded by the first fit: a node that only applies a model starts without scipy.
    from scipy.linalg import lapack

    return lapack


@cache
def _upper(height: int, width: int) -> Array:
    return np.asfortranarray(np.triu(np.ones((height, width))))


def _inverse_of(factor: Array) -> Array:
    """Return the inverse, infinite where a diagonal element is exactly zero."""
    inverse, info = _lapack().dtrtri(factor)
    return cast(Array, inverse) if info == 0 else np.full_like(factor, np.inf)


def _null_space_message(names: Sequence[str], directions: Array, scale: Array) -> str:
    """Return the message for null directions (m, k) of a matrix of column norms `scale` (k,)."""
    sentences = []
    for effect in np.abs(_echelon(directions * scale)):
        involved = [
            name
            for name, share in zip(names, effect / np.max(effect), strict=True)
            if share > _SHARE
        ]
        sentences.append(" + ".join(involved))
    everyone = list(dict.fromkeys(name for sentence in sentences for name in sentence.split(" + ")))
    return (
        f"the data cannot separate {'; '.join(sentences)}: "
        f"fix one of the terms, give a prior, or add {advice_for(everyone)}"
    )


def _echelon(rows: Array) -> Array:
    """Return the reduced basis of the space that `rows` (m, k) span.

    It is unique; which basis an SVD gives depends on the last bits.
    """
    rows = rows.copy()
    for index in range(len(rows)):
        size = np.max(np.abs(rows[index:]), axis=0)
        column = int(np.argmax(size > _SHARE * np.max(size)))
        pivot = index + int(np.argmax(np.abs(rows[index:, column])))
        rows[[index, pivot]] = rows[[pivot, index]]
        rows[index] /= rows[index, column]
        others = np.arange(len(rows)) != index
        rows[others] -= np.outer(rows[others, column], rows[index])
    return rows
