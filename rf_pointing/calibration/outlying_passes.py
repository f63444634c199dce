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
from typing import Any

import numpy as np

from rf_pointing.calibration.fit_result import FitResult, Prior
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors, SharedErrors, Sharing
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
    size = np.hypot(priors.sigma, fit.shared.priors.sigma) if fit.shared else priors.sigma
    seen = np.sum(np.maximum(1.0 - (sigma / size) ** 2, 0.0), axis=0)
    square = np.sum((values / size) ** 2, axis=0)
    return np.sqrt(np.where(seen >= _FEWEST_SEEN, square / np.maximum(seen, _FEWEST_SEEN), 1.0))


def measured_pass_priors(
    fit: Callable[[PassPriors, SharedErrors | None], FitResult],
    start: PassPriors = MEASURABLE_FROM,
    first: tuple[PassPriors, SharedErrors | None] | None = None,
) -> tuple[PassPriors, SharedErrors | None]:
    """Return the priors whose sizes are those that the passes show; `fit` fits with given priors.

    An error and its drift keep their ratio in `start`, where the search begins, each round of it;
    `first` are the priors of the first fit, whose sets of elements share errors or not.  Sizes
    settle to 3 % within 6 fits, or are those of the last one.
    """
    priors, shared = first or (start, None)
    for _ in range(_FITS):
        sizes = likely_sizes(fit(priors, shared), start)
        before = np.concatenate([priors.sigma, shared.priors.sigma if shared else []])
        moved = np.max(np.abs(np.log(sizes / before)))
        priors = _sized(priors, sizes)
        if shared is not None:
            shared = replace(shared, priors=_sized(priors, sizes[len(priors.names) :]))
        if moved < _SETTLED:
            break
    return priors, shared


def _sized(priors: PassPriors, sizes: Array) -> PassPriors:
    return priors.replace(**dict(zip(priors.names, sizes.tolist(), strict=False)))


def likely_sizes(fit: FitResult, start: PassPriors) -> Array:
    """Return the sizes of greatest likelihood for the equations of `fit`, searched from `start`.

    Those of the passes come first, then those of the sets of elements, where these share errors.
    """
    sizes = _Equations.of(fit, start).sizes(start)
    return np.asarray(sizes * np.tile(start.sigma, len(sizes) // len(start.sigma)))


def free_errors(fit: FitResult, start: PassPriors, name: str) -> tuple[Array, Array]:
    """Return error `name` (g,) of every pass as its rows demand, and the covariance (g, g).

    Nothing holds them together but the terms: one that is common to all passes may be any size.
    """
    every, place = _Equations.of(fit, start), start.names.index(name)
    # Free in this error only: along the track a turn of the orbit's shape looks nearly the same,
    # and would be measured from the late passes.
    size = np.sqrt(np.sum(every.sizes(start, free=place).reshape(-1, every.own) ** 2, axis=0))
    alone = replace(every, sharing=None)
    terms, covariance = alone.terms(size)
    solved = np.linalg.solve(alone.mine(size), alone.products[:, : alone.own, alone.own :])[
        :, place
    ]
    inverse = np.linalg.inv(alone.mine(size))[:, place, place]
    across = solved[:, :-1]
    scale = start.sigma[place]
    joint = np.diag(inverse) + across @ covariance @ across.T
    return np.asarray((solved[:, -1] - across @ terms) * scale), np.asarray(joint * scale**2)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Products (g, w, w) of the passes' rows, with columns of about unit size.

    `own` columns are the errors of a pass, over their prior in the search's start, then come what
    the campaign has in common, the terms and the right side, `length` (k + 1,) their scale.
    `prior` (k,) and `prior_right` are the weights of the priors of these.
    """

    products: Array
    own: int
    length: Array
    prior: Array
    prior_right: Array
    sharing: Sharing | None

    @classmethod
    def of(cls, fit: FitResult, start: PassPriors) -> "_Equations":
        if fit.pass_rows is None:
            raise ValueError("pass_priors=None: the fit has no pass errors")
        own, terms = len(start.names), [fit.priors.get(name) for name in fit.names]
        known = [Prior(0.0, sigma) for one in fit.nuisances for sigma in one.sigma.tolist()] + terms
        # Products instead of triangular factors: sizes need few digits, and this takes a tenth.
        products = np.swapaxes(fit.pass_rows, 1, 2) @ fit.pass_rows
        length = np.sqrt(np.maximum(np.einsum("gii->i", products), 1e-300))
        length[:own] = 1.0 / start.sigma
        length[-1] = 1.0
        prior = (
            np.array([0.0 if one is None else one.sigma**-2.0 for one in known])
            / length[own:-1] ** 2
        )
        right = (
            np.array([0.0 if one is None else one.value * one.sigma**-2.0 for one in known])
            / length[own:-1]
        )
        sharing = fit.sharing
        if sharing is not None:
            # Editing may have left nothing of a pass.
            numbers = fit.pass_places
            turns = sharing.turns[numbers] / start.sigma[:, np.newaxis] * start.sigma
            sharing = Sharing(np.unique(sharing.sets[numbers], return_inverse=True)[1], turns)
        return cls(
            products / length / length[:, np.newaxis], own, length[own:], prior, right, sharing
        )

    def sizes(self, start: PassPriors, free: int | None = None) -> Array:
        """Return the sizes (p,) of greatest likelihood, over those of the start.

        Where sets of elements share errors theirs follow (2 p,).  Error `free` of the passes is of
        any size.
        """
        levels = 1 if self.sharing is None else 2
        groups = np.concatenate([np.array(start.groups) + k * self.own for k in range(levels)])
        size = np.ones(levels * self.own)
        held = np.arange(len(size)) == (-1 if free is None else free)
        size[held] = _FREE
        for _ in range(_ROUNDS):
            sums = [
                (
                    np.sum((values / one) ** 2, axis=0),
                    np.sum(np.maximum(1.0 - variance / one**2, 0.0), axis=0),
                )
                for (values, variance), one in zip(
                    self.estimates(size, *self.terms(size)), np.split(size, levels), strict=True
                )
            ]
            square, freedom = (np.concatenate(each) for each in zip(*sums, strict=True))
            total, count = (
                np.bincount(groups, some, len(size))[groups] for some in (square, freedom)
            )
            change = np.sqrt(
                np.where(
                    (count >= _FEWEST_SEEN) & ~held, total / np.maximum(count, _FEWEST_SEEN), 1.0
                )
            )
            before, size = size, np.maximum(size * change, _LEAST)
            if np.max(np.abs(np.log(size / before))) < 0.1 * _SETTLED:
                break
        return size

    def terms(self, size: Array) -> tuple[Array, Array]:
        """Return the terms (k,) and their covariance, with errors of `size` in the passes."""
        rest = self._without_passes(size)[1]
        if self.sharing is not None:
            own = self.own
            solved = np.linalg.solve(
                _with_prior(rest[:, :own, :own], size[own:]), rest[:, :own, own:]
            )
            rest = rest[:, own:, own:] - rest[:, own:, :own] @ solved
        rest = np.sum(rest, axis=0)
        covariance = np.linalg.inv(rest[:-1, :-1] + np.diag(self.prior))
        return covariance @ (rest[:-1, -1] + self.prior_right), covariance

    def estimates(self, size: Array, terms: Array, covariance: Array) -> list[tuple[Array, Array]]:
        """Return the errors (g, p) of the passes that go with the terms, and their variances.

        Those of the sets of elements follow.
        """
        own = self.own
        solved, rest = self._without_passes(size)
        values, joint = terms[np.newaxis], covariance[np.newaxis]
        found, place = [], np.zeros(len(solved), dtype=np.int64)
        if self.sharing is not None:
            mine = _with_prior(rest[:, :own, :own], size[own:])
            shared: Any = np.linalg.solve(mine, rest[:, :own, own:])
            found.append(_errors(mine, shared, values, joint))
            across = -np.linalg.solve(mine, rest[:, :own, own:-1])
            upper = across @ covariance
            both = np.linalg.inv(mine) + upper @ np.swapaxes(across, 1, 2)
            lower = np.broadcast_to(covariance, (len(mine), *covariance.shape))
            joint = np.block([[both, upper], [np.swapaxes(upper, 1, 2), lower]])
            values = np.concatenate(
                [found[0][0], np.broadcast_to(terms, (len(mine), len(terms)))], axis=1
            )
            place = self.sharing.sets
        found.insert(0, _errors(self.mine(size), solved, values[place], joint[place]))
        return found

    def mine(self, size: Array) -> Array:
        """Return the products (g, p, p) of the passes' own errors, with priors of `size`."""
        return _with_prior(self.products[:, : self.own, : self.own], size[: self.own])

    def _without_passes(self, size: Array) -> tuple[Array, Array]:
        """Return the passes' errors by all others (g, p, m), and the products of these alone.

        The products are sums over the passes of a set, where these share errors.
        """
        own, products = self.own, self.products
        across, rest = products[:, :own, own:], products[:, own:, own:]
        if self.sharing is not None:
            seen = products[:, :own, :own] @ self.sharing.turns
            turned = np.swapaxes(self.sharing.turns, 1, 2)
            rest = np.block(
                [[turned @ seen, turned @ across], [np.swapaxes(turned @ across, 1, 2), rest]]
            )
            across = np.concatenate([seen, across], axis=2)
        solved: Any = np.linalg.solve(self.mine(size), across)
        rest = rest - np.swapaxes(across, 1, 2) @ solved
        if self.sharing is None:
            return solved, rest
        total = np.zeros((int(np.max(self.sharing.sets)) + 1, *rest.shape[1:]))
        np.add.at(total, self.sharing.sets, rest)
        return solved, total


def _with_prior(products: Array, size: Array) -> Array:
    return np.asarray(products + np.diag(size**-2.0))


def _errors(mine: Array, solved: Array, values: Array, covariance: Array) -> tuple[Array, Array]:
    """Return errors (g, p) and their variances, from how they follow from the other unknowns."""
    across = solved[:, :, :-1]
    variance = np.einsum("gii->gi", np.linalg.inv(mine)) + np.sum(
        (across @ covariance) * across, axis=2
    )
    return solved[:, :, -1] - (across @ values[..., np.newaxis])[..., 0], variance


def warnings_of(fit: FitResult, points: Observations) -> tuple[str, ...]:
    """Return one sentence for each reason to doubt `fit`: lost passes, a sigma that is small."""
    return (*_lost_passes(fit, points), *_small_sigma(fit, points))


def _lost_passes(fit: FitResult, points: Observations) -> tuple[str, ...]:
    # A pass of another target agrees with itself, and the residuals of what is left look fine.
    lost = [
        number
        for number in points.passes.tolist()
        if not np.any(fit.used[points.pass_id == number])
    ]
    if not lost:
        return ()
    return (
        f"pass {', '.join(map(str, lost))} was edited out whole: another target, a wrong clock or orbit?",
    )


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
        + (
            "which sigma counts as noise"
            if fit.noise is not None
            else "and sigma is too small by about as much"
        ),
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
        _, place, lengths = np.unique(
            points.pass_id[fit.used], return_inverse=True, return_counts=True
        )
        squares += float(np.sum(np.bincount(place, weights=size) ** 2 / lengths))
        count += len(lengths)
    return float(np.sqrt(squares / count))
