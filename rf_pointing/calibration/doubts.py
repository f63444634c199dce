"""What makes a fit doubtful, and how large the orbit errors of its passes are.

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

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors

Array = NDArray[np.float64]

# Elements a few days old; a start that is too small finds errors too small to be seen, and stays.
MEASURABLE_FROM = PassPriors(along_track_m=1000.0, cross_track_m=1000.0, radial_m=1000.0)
# Sizes need no more than 10 %: sigma depends on them weakly, and every round is a fit.
_ROUNDS, _SETTLED = 25, 0.1
_FEWEST_SEEN = 1.0
# A size of zero would divide by zero; a thousandth of the start has no effect any more.
_LEAST = 1e-3
# The measured size of few passes is itself uncertain: below a factor of two it contradicts nothing.
_LARGER = 2.0


def size_ratios(fit: FitResult, priors: PassPriors) -> Array:
    """Return measured over assumed size of each error in `priors`, 1 where it is not measurable."""
    values = np.array([[one.values[name] for name in priors.names] for one in fit.pass_errors])
    sigma = np.array([[one.sigma[name] for name in priors.names] for one in fit.pass_errors])
    seen = np.sum(np.clip(1.0 - (sigma / priors.sigma) ** 2, 0.0, 1.0), axis=0)
    square = np.sum((values / priors.sigma) ** 2, axis=0)
    return np.sqrt(np.where(seen >= _FEWEST_SEEN, square / np.maximum(seen, _FEWEST_SEEN), 1.0))


def measured_pass_priors(fit: Callable[[PassPriors], FitResult], start: PassPriors = MEASURABLE_FROM) -> PassPriors:
    """Return the priors whose sizes are those that the passes show; `fit` fits with given priors.

    Sizes settle to 10 % within 25 rounds, or are those of the last round.
    """
    priors = start
    for _ in range(_ROUNDS):
        sizes = np.maximum(_LEAST * start.sigma, size_ratios(fit(priors), priors) * priors.sigma)
        moved = np.max(np.abs(np.log(sizes / priors.sigma)))
        priors = priors.replace(**dict(zip(priors.names, sizes.tolist(), strict=True)))
        if moved < _SETTLED:
            break
    return priors


def doubts_of(fit: FitResult, points: Observations) -> tuple[str, ...]:
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
        "of each pass is off, and sigma is too small by about as much",
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
