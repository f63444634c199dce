"""Parameters that belong to one pass only, eliminated from its equations by an orthogonal step.

The rows [P | A | b] of a pass and the prior rows [1/sigma | 0 | 0] of its own parameters p are brought to a triangle;
what lies below the rows of p is free of p and goes on to the common terms.  The rows of p give its estimate back.
Passes of about the same length are brought to their triangles together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.triangle import Solution

__all__ = ["PassHeads", "eliminate"]

Array = NDArray[np.float64]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PassHeads:
    """The rows of the passes' own parameters: own (g, p, p) @ p + common (g, p, k) @ x = right (g, p).

    `passes` (g,) says which pass each belongs to, ascending.
    """

    passes: Places
    own: Array
    common: Array
    right: Array

    def values(self, solution: Solution) -> Array:
        """Return the passes' parameters (g, p) that go with the common solution."""
        right = self.right - self.common @ solution.values
        return np.asarray(np.linalg.solve(self.own, right[..., np.newaxis])[..., 0])

    def sigma(self, solution: Solution) -> Array:
        """Return their standard deviations (g, p), the uncertainty of the terms included."""
        inverse = np.linalg.inv(self.own)
        across = inverse @ self.common
        variance = np.sum(inverse**2, axis=2) + np.sum((across @ solution.covariance) * across, axis=2)
        return np.asarray(np.sqrt(variance))


def eliminate(rows: Array, passes: Places, prior_sigma: Array) -> tuple[PassHeads, Array]:
    """Return the rows of the passes' own parameters and, free of them, rows (m, k + 1) for the common triangle.

    `rows` (n, p + k + 1) holds the pass's own partials, the common ones and the right side, divided by sigma; `passes`
    (n,) the pass that each belongs to.
    """
    numbers, group, lengths = np.unique(passes, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    first = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    rank = np.arange(len(rows)) - np.repeat(first, lengths)
    size_class = np.ceil(np.log2(lengths)).astype(np.int64)
    own = len(prior_sigma)
    heads, rest = np.zeros((len(numbers), own, rows.shape[1])), []
    for size in np.unique(size_class):
        members = np.flatnonzero(size_class == size)
        chosen = size_class[group[order]] == size
        place = np.searchsorted(members, group[order][chosen])
        triangles = _triangles(rows[order[chosen]], place, rank[chosen], len(members), prior_sigma)
        heads[members] = triangles[:, :own]
        rest.append(triangles[:, own:, own:].reshape(-1, rows.shape[1] - own))
    return PassHeads(numbers, heads[:, :, :own], heads[:, :, own:-1], heads[:, :, -1]), np.concatenate(rest)


def _triangles(rows: Array, place: Places, rank: Places, count: int, prior_sigma: Array) -> Array:
    """Return the triangles (count, ., w) of groups of rows; row i is the `rank[i]`-th of group `place[i]`.

    Shorter groups are filled up with zeros, which change no triangle.
    """
    own = len(prior_sigma)
    stack = np.zeros((count, own + int(np.max(rank)) + 1, rows.shape[1]))
    stack[:, np.arange(own), np.arange(own)] = 1.0 / prior_sigma
    stack[place, own + rank] = rows
    return np.asarray(np.linalg.qr(stack, mode="r"))
