"""Which terms the data support: selection by BIC, and prediction of passes left out.

    BIC = chi^2 / v + k ln(n),    v = max(1, reduced chi^2 of all candidates)

for n equations and k terms.  All subsets are solved from one triangle: the data are read once.  A
term enters when it lowers the BIC, and leaves when the BIC falls without it.

The data that fit the terms also chose them, and the covariance C of a fit of the chosen ones knows
nothing of that.  A term x is spread as

    sum_m w_m N(x_m, C_m),    -2 ln w_m = chi_m^2 / v + ln det(I + T A_m' A_m T / v)

over the chosen subset and its neighbours m, those with up to four terms more or fewer (Bayesian
model averaging, Hoeting et al. 1999), for equations A_m and terms of the sizes T; chi_m^2 is the
least sum of squares with x / T among them.  The BIC is close to that for terms that are seen well,
and takes one that the data show barely for unlikely.  Mounts differ: T is 0.3, 0.6 and 1.2 times
the usual sizes with equal right.  The sigma of x is the mean of what holds 68.3 % of the sum about
the chosen x, and half of what holds 95.4 %.

No sigma holds both of a narrow sum with a wide tail: a lag taken for zero makes that of the other
axis 15 times as certain where orbit errors look as equal lags do, and wrong where the first is real
and only too small to be seen.  A term without which another one's sigma is less than an eighth is
therefore fitted too (`kept`), and the sum is over the subsets with it.  That follows from the
geometry: decided by the data it would keep the terms that noise makes look real.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rf_pointing.calibration.fit import fit_bias_model, held_at_zero
from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.fit_result import FitResult, Nuisance
from rf_pointing.calibration.normal_equations import NormalEquations
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors, SharedErrors
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.core import Array, BoolArray, IntArray, wrap_rad

# Terms that enter and leave in turn would go on for ever.
_MOST_STEPS = 100
# Share of the longest column below which one is rounding (the sine of pi is 1e-16).
_NOTHING = 1e-13
# Criteria this close are equal: chi squared is a difference of sums whose rounding may reach 1e-6.
_SAME_BIC = 1e-4
# -2 ln of the share of the best subset's weight from which on one adds nothing that shows.
_UNLIKELY = 14.0
# Terms by which a subset differs from the chosen one: more have no weight.
_MOST_CHANGED = 4
# Prior sizes that are tried, as factors of the usual size of a term.
_SIZES = (0.3, 0.6, 1.2)
# Where another term raises a sigma by more than this factor, the data cannot choose that term.
_MOST_NARROWED = 8.0
# Halvings of an interval: to a millionth of a sigma.
_HALVINGS = 30


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well a model predicts a pass it has not seen: on-sky rms per pass and of all."""

    pass_ids: IntArray
    rms_rad: Array
    total_rms_rad: float


@dataclass(frozen=True, eq=False)
class TermSelection:
    """The chosen terms, in the order of the candidates.

    `widening` (k,) is the factor by which the uncertainty of the choice widens their sigma.  The
    data do not show those `kept`, which are fitted because others depend on them.
    """

    names: tuple[str, ...]
    widening: Array
    kept: tuple[str, ...] = ()


def select_terms(
    observations: Observations, candidates: Sequence[str], *,
    held: Mapping[str, float] | None = None, pass_priors: PassPriors | None = None,
    about: FitResult | None = None, shared: SharedErrors | None = None,
    nuisances: Sequence[Nuisance] = (), always: Collection[str] = (),
) -> TermSelection:  # fmt: skip
    """Return the `candidates` that the data support; the others count as zero.

    Those of `always` are chosen whatever the data show.  Terms that are not candidates have the
    values in `held`, zero without it.  The equations are those of the printed form, or linear
    `about` a fit of all candidates.  Raises ValueError for unknown names and a search that has not
    settled.
    """
    terms_by_name(candidates)
    search = _Search.of(
        observations, tuple(candidates), held or {}, pass_priors, about, shared, nuisances
    )
    chosen = frozenset(always) & frozenset(candidates)
    bic = search.bic(chosen)
    for _ in range(_MOST_STEPS):
        move = search.best_move(chosen, bic, always)
        if move is None:
            names = tuple(name for name in candidates if name in chosen)
            return search.selection(names)
        name, bic = move
        chosen ^= {name}
    raise ValueError(f"term selection has not settled after {_MOST_STEPS} steps")


def held_out_passes(
    observations: Observations, terms: Sequence[str], *, held: Mapping[str, float] | None = None,
    pass_priors: PassPriors | None = None,
) -> HeldOut:  # fmt: skip
    """Fit without each pass in turn and return how far off the fit is on the pass left out."""
    # Not rows: those of a pass share its orbit error and would predict each other too well.
    fixed = held_at_zero(terms) if held is None else held
    rms, squares, count = [], 0.0, 0
    for number in observations.passes:
        left_out = observations.select(observations.pass_id == number)
        rest = observations.select(observations.pass_id != number)
        model = fit_bias_model(rest, terms=terms, held=fixed, pass_priors=pass_priors).model
        offset = model.offset_rad(*left_out.motion(), temperature_k=left_out.temperature_k)
        across = wrap_rad(left_out.residual_azimuth_rad - offset[0]) * np.cos(
            left_out.true_elevation_rad
        )
        square = across**2 + (left_out.residual_elevation_rad - offset[1]) ** 2
        rms.append(float(np.sqrt(np.mean(square))))
        squares, count = squares + float(np.sum(square)), count + len(square)
    return HeldOut(observations.passes, np.array(rms), float(np.sqrt(squares / count)))


@dataclass(frozen=True, eq=False)
class _Search:
    equations: NormalEquations
    scale: float

    @classmethod
    def of(
        cls, data: Observations, names: tuple[str, ...], held: Mapping[str, float],
        pass_priors: PassPriors | None, about: FitResult | None, shared: SharedErrors | None,
        nuisances: Sequence[Nuisance],
    ) -> "_Search":  # fmt: skip
        # Products of terms are not terms: a lag of 0.5 s alone looks as 0.12 s^2 more otherwise.
        form = "printed" if about is None else about.form
        problem = FitProblem(
            data, names, {**held_at_zero(names), **held}, {}, pass_priors, form, shared, nuisances
        )
        everything, one = np.ones(len(data), dtype=bool), np.ones(len(data))
        values = np.array([0.0 if about is None else about.coefficients[name] for name in names])
        equations, _ = problem.equations(values, everything, one)
        full = cls(equations, 1.0)
        # Where sigma is stated too small, any term would lower chi-square by enough.
        freedom = max(equations.rows - len(names), 1)
        return cls(equations, max(1.0, full.solve(names)[0] / freedom))

    def solve(self, chosen: Collection[str]) -> tuple[float, Array, Array]:
        """Return the least sum of squares with these terms, their values and covariance.

        Inseparable terms do no harm here: they share what they explain.
        """
        columns = [column for column, name in enumerate(self.equations.names) if name in chosen]
        matrix, right = self.equations.factor[:, columns], self.equations.factor[:, -1]
        if not columns:
            return float(right @ right), np.zeros(0), np.zeros((0, 0))
        lengths = np.linalg.norm(matrix, axis=0)
        # A column of rounding alone, scaled to one, would explain some noise: it stays zero.
        inverse = np.where(
            lengths > _NOTHING * np.max(lengths), 1.0 / np.maximum(lengths, 1e-300), 0.0
        )
        left, singular, rotation = np.linalg.svd(matrix * inverse, full_matrices=False)
        kept = singular > 1e-9 * singular[0]
        along, root = (
            left[:, kept].T @ right,
            (rotation[kept] / singular[kept, np.newaxis]).T * inverse[:, np.newaxis],
        )
        return float(right @ right - along @ along), root @ along, root @ root.T

    def bic(self, chosen: Collection[str]) -> float:
        """Return the criterion of a set of terms."""
        return self.solve(chosen)[0] / self.scale + len(chosen) * float(np.log(self.equations.rows))

    def best_move(
        self, chosen: frozenset[str], bic: float, always: Collection[str]
    ) -> tuple[str, float] | None:
        """Return the removal that lowers the BIC, else the best addition that does, else None."""
        # Removal first: a term that came in early may be made needless by a later one.
        removals = [(self.bic(chosen - {name}), name) for name in chosen.difference(always)]
        if removals and min(removals)[0] < bic:
            return _least(removals)
        additions = [
            (self.bic(chosen | {name}), name) for name in self.equations.names if name not in chosen
        ]
        if additions and min(additions)[0] < bic - _SAME_BIC:
            return _least(additions)
        return None

    def selection(self, names: tuple[str, ...]) -> TermSelection:
        """Return the chosen terms, those that they depend on, and what widens their sigma."""
        kept = self._needed(names)
        names = tuple(name for name in self.equations.names if name in names or name in kept)
        mixture = self._mixture(names, kept)
        narrow, wide = (mixture.holding(math.erf(k / math.sqrt(2.0))) / k for k in (1.0, 2.0))
        return TermSelection(
            names, np.maximum(0.5 * (narrow + wide), 1.0), tuple(n for n in names if n in kept)
        )

    def _needed(self, names: tuple[str, ...]) -> frozenset[str]:
        """Return the absent terms without which the sigma of a fitted one is far too small."""
        every, kept = self.equations.names, frozenset[str]()
        while True:
            fitted = [name for name in every if name in names or name in kept]
            sigma, found = self._sigma(fitted), []
            for absent in (name for name in every if name not in fitted):
                among = [name for name in every if name in fitted or name == absent]
                own = np.array([name != absent for name in among])
                with_it, usual = (
                    self._sigma(among),
                    np.array([term.size for term in terms_by_name(among)]),
                )
                # Ignore fits that do not constrain every term better than its prior.
                if fitted and np.all(with_it < usual):
                    found.append((float(np.max(with_it[own] / sigma)), absent))
            ratio, name = max(found, default=(0.0, ""))
            if ratio <= _MOST_NARROWED:
                return kept
            kept |= {name}

    def _sigma(self, chosen: Collection[str]) -> Array:
        """Return the standard deviations of these terms, fitted together."""
        return np.sqrt(np.diag(self.solve(chosen)[2]) * self.scale)

    def _mixture(self, names: tuple[str, ...], kept: frozenset[str]) -> "_Mixture":
        """Return how the terms `names` spread over the subsets near theirs that have the `kept`."""
        every = self.equations.names
        free = [place for place, name in enumerate(every) if name not in kept]
        changes = [some for count in range(_MOST_CHANGED + 1) for some in combinations(free, count)]
        member = np.tile([name in names for name in every], (len(changes), 1))
        for row, change in zip(member, changes, strict=True):
            row[list(change)] ^= True
        # The same subsets once for each size of terms.
        parts = [self._posteriors(member, share) for share in _SIZES]
        above, values, sigma = (np.concatenate(column) for column in zip(*parts, strict=True))
        member = np.tile(member, (len(_SIZES), 1))
        above -= np.min(above)
        likely = above < _UNLIKELY
        weights = np.exp(-0.5 * above[likely])
        places = [every.index(name) for name in names]
        _, fitted, covariance = self.solve(names)
        one_sigma = np.sqrt(np.diag(covariance) * self.scale)
        apart, wide = (
            (values[likely][:, places] - fitted) / one_sigma,
            sigma[likely][:, places] / one_sigma,
        )
        # A subset without the term has it at zero, exactly.
        return _Mixture(
            member[likely], weights / np.sum(weights), apart, np.maximum(wide, _NOTHING)
        )

    def _posteriors(self, member: BoolArray, share: float) -> tuple[Array, Array, Array]:
        """Return -2 ln of the weight (m,) of subsets (m, k), and values and sigma (m, k).

        They are zero of terms that are not in a subset.  Terms are of a `share` of the usual sizes.
        """
        sizes = share * np.array([term.size for term in terms_by_name(self.equations.names)])
        matrix, right = self.equations.factor[:, :-1] * sizes, self.equations.factor[:, -1]
        system, along = (
            np.eye(len(sizes)) + matrix.T @ matrix / self.scale,
            matrix.T @ right / self.scale,
        )
        above = np.full(len(member), right @ right / self.scale)
        values, sigma = np.zeros(member.shape), np.zeros(member.shape)
        counts = np.sum(member, axis=1)
        # Subsets of one size are solved together: each by itself takes ten times as long.
        for count in np.unique(counts):
            rows = np.flatnonzero(counts == count)[:, np.newaxis]
            places = np.nonzero(member[rows[:, 0]])[1].reshape(len(rows), count)
            part = system[places[:, :, np.newaxis], places[:, np.newaxis, :]]
            inverse = np.linalg.inv(part)
            found = (inverse @ along[places][..., np.newaxis])[..., 0]
            values[rows, places] = sizes[places] * found
            sigma[rows, places] = sizes[places] * np.sqrt(np.einsum("mii->mi", inverse))
            above[rows[:, 0]] += np.linalg.slogdet(part)[1] - np.sum(along[places] * found, axis=1)
        return above, values, sigma


@dataclass(frozen=True, eq=False)
class _Mixture:
    """Normals of `weights` (m,) that sum to one, each of a subset with the terms `member` (m, n).

    `apart` and `wide` (m, k) are means and sigmas about the fitted terms, in units of their sigma.
    """

    member: BoolArray
    weights: Array
    apart: Array
    wide: Array

    def holding(self, share: float) -> Array:
        """Return the half width (k,) about zero that holds `share` of the mixture."""
        low, high = (
            np.zeros(self.apart.shape[1]),
            np.max(np.abs(self.apart) + 6.0 * self.wide, axis=0),
        )
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            inside = 1.0 - self.weights @ self.outside(slice(None), middle)
            low, high = (
                np.where(inside < share, middle, low),
                np.where(inside < share, high, middle),
            )
        return np.asarray(0.5 * (low + high))

    def outside(self, terms: int | slice, half: float | Array) -> Array:
        """Return the share of each normal of `terms` that is farther than `half` from zero."""
        # Imported here: no node but a calibrator that fits needs scipy, which costs 30 MB.
        from scipy.special import ndtr

        apart, wide = self.apart[:, terms], self.wide[:, terms]
        return np.asarray(1.0 - (ndtr((half - apart) / wide) - ndtr((-half - apart) / wide)))


def _least(moves: list[tuple[float, str]]) -> tuple[str, float]:
    """Return the move to the least criterion."""
    # Inseparable terms have equal criteria but for rounding: the first by name is taken.
    least = min(moves)[0]
    name, bic = min((name, bic) for bic, name in moves if bic <= least + _SAME_BIC)
    return name, bic
