"""Two tests on the innovations of a filter: is its covariance still true?

Innovations of a consistent filter are white with the covariance S that the filter claims.  Over the
last directions, weighted by w^k with w = 1 - 1/N for several N:

* their mean square: sum w^k z^T S^-1 z / sum w^k is chi-square of n = 2 (sum w^k)^2 / sum w^2k
  degrees, over n/2;
* their mean: h = sum w^k E^T S^-1 z has the covariance J = sum w^2k E^T S^-1 E, so q = h^T J^-1 h
  is chi-square of three degrees (E the rows across the reference, orbital frame).

A torque or a phase that the filter does not know biases the attitude by several claimed sigmas
while every direction still looks sound.  The mean shows it long before the mean square, and
b = (sum w^k E^T S^-1 E)^-1 h is its size.
"""

from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

# The largest axis counts: a single station shows nothing of the turn about itself.
OBSERVED = 1e-6
# Fewest directions: with a handful neither sum is chi-square yet.
FEWEST = 5.0
NOTICED = 0.05
"""Probability that the mean of sound innovations widens the covariance."""


@dataclass(frozen=True, kw_only=True)
class WatchParams(Params):
    """Memories of the watch, and how often it may be wrong."""

    # A short one for what sets in at once, a long one for what is small.
    directions: tuple[float, ...] = parameter(
        (20.0, 100.0, 500.0),
        "directions over which the innovations are averaged",
        low=5.0,
        high=1e5,
    )
    false_alarm: float = parameter(
        1e-5, "probability that the innovations of a sound filter are refused", low=1e-12, high=0.1
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InnovationWatch:
    """Weighted sums over the directions so far, one of each for every memory.

    `with_direction` adds a direction, `reasons` tests the sums, `bias_covariance` is what the mean
    adds to the covariance of the attitude.
    """

    weight: Array = field(default_factory=lambda: np.zeros(1))
    weight2: Array = field(default_factory=lambda: np.zeros(1))
    squared: Array = field(default_factory=lambda: np.zeros(1))
    mean: Array = field(default_factory=lambda: np.zeros((1, 3)))
    information: Array = field(default_factory=lambda: np.zeros((1, 3, 3)))
    spread: Array = field(default_factory=lambda: np.zeros((1, 3, 3)))

    def with_direction(
        self, params: WatchParams, z: Array, spread: Array, rows: Array, largest: float
    ) -> "InnovationWatch":
        """Return the sums with one innovation `z` (2,) of covariance `spread` (2, 2) across `rows`
        (2, 3).

        A direction outside the gate, `largest`, counts in the mean square only.
        """
        keep = 1.0 - 1.0 / np.array(params.directions)
        scaled = np.linalg.solve(spread, z)
        squared = float(z @ scaled)
        inside = float(squared <= largest)
        information = inside * rows.T @ np.linalg.solve(spread, rows)
        matrix_keep = keep[:, None, None]
        return InnovationWatch(
            weight=keep * self.weight + 1.0,
            weight2=keep**2 * self.weight2 + 1.0,
            squared=keep * self.squared + min(squared, largest),
            mean=keep[:, None] * self.mean + inside * rows.T @ scaled,
            information=matrix_keep * self.information + information,
            spread=matrix_keep**2 * self.spread + information,
        )

    def reasons(self, params: WatchParams) -> list[str]:
        """Return in words what contradicts the filter's covariance, from the memory that shows it
        best.
        """
        if self.weight[0] < FEWEST:
            return []
        found = []
        freedom = 2.0 * self.weight**2 / self.weight2
        mean_square = self.squared / self.weight
        limit = 2.0 * chi_square_limit(freedom, params.false_alarm) / freedom
        worst = int(np.argmax(mean_square / limit))
        if mean_square[worst] > limit[worst]:
            found.append(
                f"mean squared innovation {mean_square[worst]:.3g} must be <= {limit[worst]:.3g}, 2 is expected"
            )
        bias = float(np.max(self._mean_squares()))
        largest = float(chi_square_limit(np.array(3.0), params.false_alarm))
        if bias > largest:
            found.append(
                f"innovations have a common mean: chi-square {bias:.3g} must be <= {largest:.3g}; a torque, a "
                "phase or a place is not as known"
            )
        return found

    def bias_covariance(self) -> Array:
        """Return b b^T (3, 3), rad^2, of the memory with the most significant mean, less what
        chance explains.
        """
        squares = self._mean_squares()
        best = int(np.argmax(squares))
        limit = float(chi_square_limit(np.array(3.0), NOTICED))
        if self.weight[0] < FEWEST or squares[best] <= limit:
            return np.zeros((3, 3))
        bias = (
            np.linalg.pinv(self.information[best], rcond=OBSERVED, hermitian=True) @ self.mean[best]
        )
        return np.asarray((1.0 - limit / squares[best]) * np.outer(bias, bias))

    def _mean_squares(self) -> Array:
        """Return q of every memory."""
        values, axes = np.linalg.eigh(self.spread)
        along = np.einsum("nij,ni->nj", axes, self.mean)
        seen = values > OBSERVED * values[:, -1:]
        return np.asarray(
            np.sum(np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0), axis=-1)
        )


def chi_square_limit(freedom: Array, probability: float) -> Array:
    """Return what chi-square of `freedom` degrees exceeds with `probability`."""
    from scipy.special import chdtri

    return np.asarray(chdtri(freedom, probability))
