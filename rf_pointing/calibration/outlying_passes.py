"""Passes that make a fit doubtful, and the size of the orbit errors of its passes.

With the errors v_g of the passes g estimated under a prior of size s, and their posterior sigma
p_g,

    s^2  <-  sum_g v_g^2 / sum_g (1 - p_g^2 / s^2)

has its fixed point where the prior's size has the greatest likelihood (MacKay 1992, eq. 4.9).  An
error that the angles hardly show (the sum below is less than one pass) keeps its size.

Without errors of the passes, independent residuals of a pass of n points add up to sqrt(n) times
their size.  A larger sum comes from something that the whole pass has in common, which the white
covariance counts as n measurements.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.core.types import Array

# Elements a few days old; a start that is too small finds errors too small to be seen, and stays.
MEASURABLE_FROM = PassPriors.of_orbit(1000.0) or PassPriors(along_track_m=1000.0)
# Sizes need no more than 3 %: sigma depends on them weakly.
_FITS, _ROUNDS, _SETTLED = 6, 100, 0.03
_FEWEST_SEEN = 1.0
_FREE = 1e3
# A size of zero would divide by zero. 1 m is seen in means of 50 samples: of that size the sigma of
# x6 was 1.3 times too large where there was no error.
_LEAST = 1e-5
# The measured size of few passes is itself uncertain: below a factor of two it contradicts nothing.
_LARGER = 2.0


def size_ratios(fit: FitResult, priors: PassPriors) -> Array:
    """Return measured over assumed size of each error in `priors`, 1 where it is not measurable."""
    values = np.array([[one.values[name] for name in priors.names] for one in fit.pass_errors])
    sigma = np.array([[one.sigma[name] for name in priors.names] for one in fit.pass_errors])
    seen = np.sum(np.maximum(1.0 - (sigma / priors.sigma) ** 2, 0.0), axis=0)
    square = np.sum((values / priors.sigma) ** 2, axis=0)
    return np.sqrt(np.where(seen >= _FEWEST_SEEN, square / np.maximum(seen, _FEWEST_SEEN), 1.0))


def measured_pass_priors(
    fit: Callable[[PassPriors], FitResult], start: PassPriors = MEASURABLE_FROM, first: PassPriors | None = None
) -> PassPriors:
    """Return the priors whose sizes are those that the passes show; `fit` fits with given priors.

    An error and its drift keep their ratio in `start`, where the search begins, each round of it;
    `first` are the priors of the first fit, if nearly right ones are known.  Sizes settle to 3 %
    within 6 fits, or are those of the last one.
    """
    priors = first or start
    for _ in range(_FITS):
        sizes = likely_sizes(fit(priors), start)
        moved = np.max(np.abs(np.log(sizes / priors.sigma)))
        priors = priors.replace(**dict(zip(priors.names, sizes.tolist(), strict=True)))
        if moved < _SETTLED:
            break
    return priors


def likely_sizes(fit: FitResult, start: PassPriors) -> Array:
    """Return the sizes of greatest likelihood for the equations of `fit`, searched from `start`."""
    return _Equations.of(fit, start).sizes(start) * start.sigma


def without_pass(fit: FitResult, start: PassPriors, index: int, name: str) -> tuple[float, float, float]:
    """Return error `name` of the `index`-th pass with its sigma, and its size, from the others.

    The pass itself has no say in terms and sizes: its error is whatever its rows demand.
    """
    every, place = _Equations.of(fit, start), start.names.index(name)
    chosen = np.arange(len(every.products)) == index
    others = replace(every, products=every.products[~chosen])
    size = others.sizes(start)
    terms, covariance = others.terms(size)
    # Free in this error only: along the track a turn of the orbit's shape looks nearly the same.
    free = np.where(np.arange(every.own) == place, _FREE, size)
    values, variance = replace(every, products=every.products[chosen]).estimates(free, terms, covariance)
    scale = start.sigma[place]
    return float(values[0, place]) * scale, float(np.sqrt(variance[0, place])) * scale, float(size[place]) * scale


@dataclass(frozen=True, eq=False)
class _Equations:
    """Products (g, w, w) of the passes' rows, with columns of about unit size.

    `own` columns are the errors of a pass, over their prior in the search's start, then come the
    terms and the right side, `length` (k + 1,) their scale.  `prior` (k,) and `prior_right` are
    the weights of the terms' priors.
    """

    products: Array
    own: int
    length: Array
    prior: Array
    prior_right: Array

    @classmethod
    def of(cls, fit: FitResult, start: PassPriors) -> "_Equations":
        if fit.pass_rows is None:
            raise ValueError("pass_priors=None: the fit has no pass errors")
        own, known = len(start.names), [fit.priors.get(name) for name in fit.names]
        # Products instead of triangular factors: sizes need few digits, and this takes a tenth.
        products = np.swapaxes(fit.pass_rows, 1, 2) @ fit.pass_rows
        length = np.sqrt(np.maximum(np.einsum("gii->i", products), 1e-300))
        length[:own] = 1.0 / start.sigma
        length[-1] = 1.0
        prior = np.array([0.0 if one is None else one.sigma**-2.0 for one in known]) / length[own:-1] ** 2
        right = np.array([0.0 if one is None else one.value * one.sigma**-2.0 for one in known]) / length[own:-1]
        return cls(products / length / length[:, np.newaxis], own, length[own:], prior, right)

    def sizes(self, start: PassPriors) -> Array:
        """Return the sizes (p,) of greatest likelihood, over those of the start."""
        groups, size = np.array(start.groups), np.ones(self.own)
        for _ in range(_ROUNDS):
            values, variance = self.estimates(size, *self.terms(size))
            freedom = np.sum(np.maximum(1.0 - variance / size**2, 0.0), axis=0)
            square = np.sum((values / size) ** 2, axis=0)
            total, count = (np.bincount(groups, some, self.own)[groups] for some in (square, freedom))
            change = np.sqrt(np.where(count >= _FEWEST_SEEN, total / np.maximum(count, _FEWEST_SEEN), 1.0))
            before, size = size, np.maximum(size * change, _LEAST)
            if np.max(np.abs(np.log(size / before))) < 0.1 * _SETTLED:
                break
        return size

    def terms(self, size: Array) -> tuple[Array, Array]:
        """Return the terms (k,) and their covariance, with errors of `size` in the passes."""
        own = self.own
        solved = np.linalg.solve(self._mine(size), self.products[:, :own, own:])
        rest = np.sum(self.products[:, own:, own:] - self.products[:, own:, :own] @ solved, axis=0)
        covariance = np.linalg.inv(rest[:-1, :-1] + np.diag(self.prior))
        return covariance @ (rest[:-1, -1] + self.prior_right), covariance

    def estimates(self, size: Array, terms: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the errors (g, p) of the passes that go with the terms, and their variances."""
        own, mine = self.own, self._mine(size)
        solved = np.linalg.solve(mine, self.products[:, :own, own:])
        across = solved[:, :, :-1]
        variance = np.einsum("gii->gi", np.linalg.inv(mine)) + np.einsum("gij,jk,gik->gi", across, covariance, across)
        return solved[:, :, -1] - across @ terms, variance

    def _mine(self, size: Array) -> Array:
        return np.asarray(self.products[:, : self.own, : self.own] + np.diag(size**-2.0))


def warnings_of(fit: FitResult, points: Observations) -> tuple[str, ...]:
    """Return one sentence for each reason to doubt `fit`: lost passes, a sigma that is small."""
    return (*_lost_passes(fit, points), *_small_sigma(fit, points))


def _lost_passes(fit: FitResult, points: Observations) -> tuple[str, ...]:
    # A pass of another target agrees with itself, and the residuals of what is left look fine.
    lost = [number for number in points.passes.tolist() if not np.any(fit.used[points.pass_id == number])]
    if not lost:
        return ()
    return (f"pass {', '.join(map(str, lost))} was edited out whole: another target, a wrong clock or orbit?",)


def _small_sigma(fit: FitResult, points: Observations) -> tuple[str, ...]:
    priors = fit.pass_priors
    if priors is not None:
        ratios = zip(priors.names, priors.sigma.tolist(), size_ratios(fit, priors), strict=True)
        return tuple(
            f"{name} of the passes is {ratio:.1f} times the prior of the fit ({size:.3g}): sigma is too small"
            for name, size, ratio in ratios
            if ratio > _LARGER
        )
    # Without pass errors in the fit only the residuals can show them.
    larger = pass_correlation(fit, points)
    if larger <= _LARGER:
        return ()
    return (
        f"the residuals of a pass are correlated, their sums are {larger:.1f} times those of independent ones: the orbit "
        "of each pass is off, "
        + ("which sigma counts as noise" if fit.noise is not None else "and sigma is too small by about as much"),
    )


def pass_correlation(fit: FitResult, points: Observations) -> float:
    """Return the rms sum of the residuals of a pass of n points, over sqrt(n) times their rms."""
    squares, count = 0.0, 0
    for residual, sigma in (
        (fit.residual_azimuth_rad, points.sigma_azimuth_rad),
        (fit.residual_elevation_rad, points.sigma_elevation_rad),
    ):
        size = residual[fit.used] / sigma[fit.used]
        size = size / np.sqrt(np.mean(size**2))
        _, place, lengths = np.unique(points.pass_id[fit.used], return_inverse=True, return_counts=True)
        squares += float(np.sum(np.bincount(place, weights=size) ** 2 / lengths))
        count += len(lengths)
    return float(np.sqrt(squares / count))
