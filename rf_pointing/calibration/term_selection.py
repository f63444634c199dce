"""Which terms the data support: selection by BIC, and prediction of passes left out.

    BIC = chi^2 / v + k ln(n),    v = max(1, reduced chi^2 of all candidates)

for n equations and k terms.  All subsets are solved from one triangle: the data are read once.  A
term enters when it lowers the BIC, and leaves when the BIC falls without it.

The data that fit the terms also chose them, and the covariance C of a fit of the chosen ones knows
nothing of that.  A term x is spread as

    sum_m w_m N(x_m, C_m),    -2 ln w_m = chi_m^2 / v + ln det(I + T A_m' A_m T / v)

over the chosen subset and its neighbours m, those with up to four terms more or fewer (Bayesian
model averaging, Hoeting et al. 1999), for equations A_m and terms of the usual sizes T; chi_m^2 is
the least sum of squares with x / T among them.  The BIC is close to that for terms that are seen
well, and takes one that the data show barely for unlikely.  The sigma of x holds 68.3 % of the sum
about the chosen x.  The root of its mean square would hold 82 % where one subset in a hundred, with
two terms that are hardly separable, is spread ten times as wide.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from rf_pointing.calibration.fit import fit_bias_model, held_at_zero
from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.calibration.triangle import Triangle
from rf_pointing.core import wrap_rad

Array = NDArray[np.float64]

# Terms that enter and leave in turn would go on for ever.
_MOST_STEPS = 100
# Of the longest column: a shorter one is rounding (the sine of pi is 1e-16).
_NOTHING = 1e-13
# Criteria this close are equal: chi squared is a difference of sums whose rounding may reach 1e-6.
_SAME_BIC = 1e-4
# -2 ln of the share of the best subset's weight from which on one adds nothing that shows.
_UNLIKELY = 14.0
# Share of a normal distribution within one sigma.
_ONE_SIGMA = math.erf(math.sqrt(0.5))
# Of an interval: to a millionth of a sigma.
_HALVINGS = 30


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well a model predicts a pass it has not seen: on-sky rms per pass and of all."""

    pass_ids: NDArray[np.int64]
    rms_rad: Array
    total_rms_rad: float


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen terms, in the order of the candidates.

    `widening` (k,) is the factor by which the uncertainty of the choice widens their sigma.
    """

    names: tuple[str, ...]
    widening: Array


def select_terms(
    observations: Observations,
    candidates: Sequence[str],
    *,
    held: Mapping[str, float] | None = None,
    pass_priors: PassPriors | None = None,
) -> Selection:
    """Return the `candidates` that the data support; the others count as zero.

    Terms that are no candidates have the values in `held`, zero without it.  Raises ValueError for
    unknown names and a search that has not settled.
    """
    terms_by_name(candidates)
    search = _Search.of(observations, tuple(candidates), held or {}, pass_priors)
    chosen: frozenset[str] = frozenset()
    bic = search.bic(chosen)
    for _ in range(_MOST_STEPS):
        move = search.best_move(chosen, bic)
        if move is None:
            names = tuple(name for name in candidates if name in chosen)
            return Selection(names, search.widening(names))
        name, bic = move
        chosen ^= {name}
    raise ValueError(f"term selection has not settled after {_MOST_STEPS} steps")


def held_out_passes(
    observations: Observations,
    terms: Sequence[str],
    *,
    held: Mapping[str, float] | None = None,
    pass_priors: PassPriors | None = None,
) -> HeldOut:
    """Fit without each pass in turn and return how far off the fit is on the pass left out."""
    # Not rows: those of a pass share its orbit error and would predict each other too well.
    fixed = held_at_zero(terms) if held is None else held
    rms, squares, count = [], 0.0, 0
    for number in observations.passes:
        left_out = observations.select(observations.pass_id == number)
        rest = observations.select(observations.pass_id != number)
        model = fit_bias_model(rest, terms=terms, held=fixed, pass_priors=pass_priors).model
        offset = model.offset_rad(*left_out.motion(), temperature_k=left_out.temperature_k)
        across = wrap_rad(left_out.residual_azimuth_rad - offset[0]) * np.cos(left_out.true_elevation_rad)
        square = across**2 + (left_out.residual_elevation_rad - offset[1]) ** 2
        rms.append(float(np.sqrt(np.mean(square))))
        squares, count = squares + float(np.sum(square)), count + len(square)
    return HeldOut(observations.passes, np.array(rms), float(np.sqrt(squares / count)))


@dataclass(frozen=True, eq=False)
class _Search:
    triangle: Triangle
    scale: float

    @classmethod
    def of(
        cls, data: Observations, names: tuple[str, ...], held: Mapping[str, float], pass_priors: PassPriors | None
    ) -> "_Search":
        problem = FitProblem(data, names, {**held_at_zero(names), **held}, {}, pass_priors, "printed")
        everything, one = np.ones(len(data), dtype=bool), np.ones(len(data))
        triangle, _ = problem.triangle(np.zeros(len(names)), everything, one)
        full = cls(triangle, 1.0)
        # Where sigma is stated too small, any term would lower chi-square by enough.
        freedom = max(triangle.rows - len(names), 1)
        return cls(triangle, max(1.0, full.solve(names)[0] / freedom))

    def solve(self, chosen: Collection[str]) -> tuple[float, Array, Array]:
        """Return the least sum of squares with these terms, their values and covariance.

        Inseparable terms do no harm here: they share what they explain.
        """
        columns = [column for column, name in enumerate(self.triangle.names) if name in chosen]
        matrix, right = self.triangle.factor[:, columns], self.triangle.factor[:, -1]
        if not columns:
            return float(right @ right), np.zeros(0), np.zeros((0, 0))
        lengths = np.linalg.norm(matrix, axis=0)
        # A column of rounding alone, scaled to one, would explain some noise: it stays zero.
        inverse = np.where(lengths > _NOTHING * np.max(lengths), 1.0 / np.maximum(lengths, 1e-300), 0.0)
        left, singular, rotation = np.linalg.svd(matrix * inverse, full_matrices=False)
        kept = singular > 1e-9 * singular[0]
        along, root = left[:, kept].T @ right, (rotation[kept] / singular[kept, np.newaxis]).T * inverse[:, np.newaxis]
        return float(right @ right - along @ along), root @ along, root @ root.T

    def bic(self, chosen: Collection[str]) -> float:
        """Return the criterion of a set of terms."""
        return self.solve(chosen)[0] / self.scale + len(chosen) * float(np.log(self.triangle.rows))

    def best_move(self, chosen: frozenset[str], bic: float) -> tuple[str, float] | None:
        """Return the removal that lowers the BIC, else the best addition that does, else None."""
        # Removal first: a term that came in early may be made needless by a later one.
        removals = [(self.bic(chosen - {name}), name) for name in chosen]
        if removals and min(removals)[0] < bic:
            return _least(removals)
        additions = [(self.bic(chosen | {name}), name) for name in self.triangle.names if name not in chosen]
        if additions and min(additions)[0] < bic - _SAME_BIC:
            return _least(additions)
        return None

    def widening(self, names: tuple[str, ...]) -> Array:
        """Return by what the uncertainty of the choice widens the sigma of each chosen term."""
        every, chosen = self.triangle.names, frozenset(names)
        changes = [frozenset(some) for count in range(5) for some in combinations(every, count)]
        found = [self._posterior(chosen ^ change) for change in changes]
        above = np.array([one[0] for one in found]) - min(one[0] for one in found)
        likely = above < _UNLIKELY
        weights = np.exp(-0.5 * above[likely])
        places = [every.index(name) for name in names]
        values, sigma = (np.array([one[k] for one in found])[likely][:, places] for k in (1, 2))
        _, fitted, covariance = self.solve(chosen)
        one_sigma = np.sqrt(np.diag(covariance) * self.scale)
        apart, wide = (values - fitted) / one_sigma, sigma / one_sigma
        within = [
            _holding(math.erf(k / math.sqrt(2.0)), weights / np.sum(weights), apart, wide) / k for k in (1.0, 2.0)
        ]
        return np.asarray(np.maximum(np.mean(within, axis=0), 1.0))

    def _posterior(self, chosen: Collection[str]) -> tuple[float, Array, Array]:
        """Return -2 ln of a subset's weight, and values and sigma (k,), zero of what is not in."""
        names = self.triangle.names
        places = [place for place, name in enumerate(names) if name in chosen]
        sizes = np.array([term.size for term in terms_by_name([names[place] for place in places])])
        matrix, right = self.triangle.factor[:, places] * sizes, self.triangle.factor[:, -1]
        system = np.eye(len(places)) + matrix.T @ matrix / self.scale
        along = matrix.T @ right / self.scale
        inverse = np.linalg.inv(system)
        values, sigma = np.zeros(len(names)), np.zeros(len(names))
        values[places], sigma[places] = sizes * (inverse @ along), sizes * np.sqrt(np.diag(inverse))
        square = right @ right / self.scale - along @ inverse @ along
        return float(square + np.linalg.slogdet(system)[1]), values, sigma


def _holding(share: float, weights: Array, apart: Array, wide: Array) -> Array:
    """Return the half width (k,) about zero that holds `share` of each mixture of normals.

    `weights` (m,) sum to one; `apart` and `wide` (m, k) are means and sigmas, in units of one.
    """
    low, high = np.zeros(apart.shape[1]), np.max(np.abs(apart) + 6.0 * wide, axis=0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        # A subset without the term has it at zero, exactly.
        width = np.maximum(wide, _NOTHING)
        inside = weights @ (ndtr((middle - apart) / width) - ndtr((-middle - apart) / width))
        low, high = np.where(inside < share, middle, low), np.where(inside < share, high, middle)
    return np.asarray(0.5 * (low + high))


def _least(moves: list[tuple[float, str]]) -> tuple[str, float]:
    """Return the move to the least criterion."""
    # Inseparable terms have equal criteria but for rounding: the first by name is taken.
    least = min(moves)[0]
    name, bic = min((name, bic) for bic, name in moves if bic <= least + _SAME_BIC)
    return name, bic
