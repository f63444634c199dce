"""How noisy calibration points are: sigma from the scatter within points, and between them.

A pass has one noise: in elevation the same everywhere, in azimuth v(E) = a + b / cos^2 E, since
noise on the sky is 1 / cos E larger there.  A noise measured for each point by itself (10 samples:
35 % off) would give the quietest point the largest weight, and the fit too small a sigma.  So would
an a that chance has made positive: it is taken from b, which is all the noise of the few high
points (above 80 deg 0.81 of the variance).  So b is alone unless a lowers chi^2 by more than 4.

Noise that is correlated over seconds scatters less within a point than between points.  So the
residuals z of a fit, divided by sigma, give the factor of sigma^2,

    F^2 = sum_k sum_i z_i z_i+k / sum_k sum_i (1 - H)_i,i+k

over the lags k (in points of one pass) as far as they are correlated.  H is the hat matrix of terms
and pass errors: what they take out of the residuals is mostly slow, and is a quarter of the slow
part when every pass has five errors of its own.

What is edited at c sigma lowers the scatter of the rest and follows the fit.  Of P = P(|z| < c) the
residuals keep the variance 1 - 2 c phi(c) / P, and the same share of the kept data holds the fit
(influence function of a skipped mean; Hampel et al., Robust Statistics, 1986): 0.973 for c = 3.
F^2 is over the square of it, so that the covariance is that of what the fit scatters by.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.thinning import PiecewiseRows, Thinned
from rf_pointing.core.types import Array, IntArray

Chosen = NDArray[np.bool_]

_MEDIAN_TO_SIGMA = 1.4826
# A step or a gust within 10 s; noise alone reaches it once in 30 000 points.
_BENT_SIGMA = 4.0
# Chi-square by which noise that is even in azimuth must lower it: 2 sigma.
_EVEN_SHOWS = 4.0
_ROUNDS = 8
# Correlations below are noise of the estimate; the sum stops at the first of them.
_SIGNIFICANT = 2.0
_MOST_LAGS = 60
# Least variance, for a simulation without scatter; its square is still above the smallest float.
_LEAST_VARIANCE = 1e-150


def share_after_editing(limit_sigma: float) -> float:
    """Return the variance that normal residuals keep without those beyond a limit; 0: no limit."""
    if limit_sigma == 0.0:
        return 1.0
    density = math.sqrt(2.0 / math.pi) * math.exp(-0.5 * limit_sigma**2)
    return 1.0 - limit_sigma * density / math.erf(limit_sigma / math.sqrt(2.0))


@dataclass(frozen=True)
class NoiseScale:
    """By what the variance of one axis is larger than its sigma says, and the sigma of that."""

    factor: float
    uncertainty: float


def noise_scale(residuals: Array, influence: Array, passes: IntArray) -> NoiseScale:
    """Return F^2 of one axis.

    Parameters
    ----------
    residuals, passes
        Residuals over sigma (n,) and the pass (n,) of each, in the order of time within a pass.
    influence
        Rows U (n, m) with H = U U'.
    """
    size = len(residuals)
    square, freedom = float(residuals @ residuals), size - float(np.sum(influence**2))
    if freedom <= 0.0:
        return NoiseScale(1.0, np.inf)
    white, lags = square / freedom, 0
    for lag in range(1, min(_MOST_LAGS, size)):
        pairs = passes[lag:] == passes[:-lag]
        count = int(np.sum(pairs))
        product = float(np.sum((residuals[lag:] * residuals[:-lag])[pairs]))
        taken = -float(np.sum(np.einsum("ij,ij->i", influence[lag:], influence[:-lag])[pairs]))
        if product - white * taken <= _SIGNIFICANT * white * np.sqrt(count):
            break
        square, freedom, lags = square + 2.0 * product, freedom + 2.0 * taken, lag
    factor = square / max(freedom, 0.1 * size)
    return NoiseScale(factor, factor * np.sqrt(2.0 * (2 * lags + 1) / size))


def noise_of(points: Thinned, elevation_rad: Array) -> tuple[Array, Chosen]:
    """Return the sigma (n, 2) of azimuth and elevation, the first channels, and who has it (n,).

    Pieces that scatter about their line far more than those of their pass usually do have not:
    something happened in them.
    """
    _, place = np.unique(points.passes, return_inverse=True)
    level = _sums(place, points.freedom * points.variance[:, 1]) / _sums(place, points.freedom)
    azimuth = _split(place, points.variance[:, 0], points.freedom, np.cos(elevation_rad) ** -2.0)
    variance = np.stack([azimuth, level[place]], axis=1)
    of_pass = PiecewiseRows.of(
        np.flatnonzero(np.diff(points.passes, prepend=-1) != 0), len(points.t_s)
    )
    straight = np.ones(len(place), dtype=bool)
    for channel, expected in zip(points.variance.T, variance.T, strict=False):
        straight &= (
            _excess(channel / np.maximum(expected, _LEAST_VARIANCE), points.freedom, of_pass)
            <= _BENT_SIGMA
        )
    return np.sqrt(variance / points.counts[:, np.newaxis]), straight


def _excess(ratio: Array, freedom: Array, of_pass: PiecewiseRows) -> Array:
    """Return by how many sigma each variance (n,), over that expected, exceeds the usual one.

    The cube root of a chi-square is nearly normal (Wilson and Hilferty).
    """
    root = np.cbrt(ratio)
    usual = np.maximum(of_pass.medians(root), 1e-12)[of_pass.row]
    # Correlated noise has fewer degrees of freedom and scatters more.
    width = _MEDIAN_TO_SIGMA * of_pass.medians(np.abs(root / usual - 1.0))[of_pass.row]
    return np.asarray(
        (root / usual - 1.0) / np.maximum(width, np.sqrt(2.0 / (9.0 * np.maximum(freedom, 1.0))))
    )


def _sums(place: IntArray, values: Array) -> Array:
    return np.asarray(np.bincount(place, weights=values), dtype=np.float64)


def _split(place: IntArray, variance: Array, freedom: Array, secant2: Array) -> Array:
    """Return a + b / cos^2 E with the a, b >= 0 of each pass that fit its variances best.

    Where a does not show, it is zero.
    """
    fitted = (_sums(place, freedom * variance) / _sums(place, freedom))[place]
    for _ in range(_ROUNDS):
        # A measured variance scatters in proportion to the true one.
        weight = freedom / np.maximum(fitted, _LEAST_VARIANCE) ** 2
        largest = np.max(weight)
        weight = weight / largest
        one, cross, two = (_sums(place, weight * secant2**power) for power in (0, 1, 2))
        flat, steep = _sums(place, weight * variance), _sums(place, weight * secant2 * variance)
        determinant = one * two - cross**2
        apart = determinant > 1e-6 * one * two
        safe = np.where(apart, determinant, 1.0)
        a, b = (two * flat - cross * steep) / safe, (one * steep - cross * flat) / safe
        # A variance scatters by 2 v^2 / freedom, so chi-square falls by half of what is explained.
        shows = 2.0 * _EVEN_SHOWS / largest
        both = apart & (a >= 0.0) & (b >= 0.0) & (a * flat + b * steep > steep**2 / two + shows)
        # Outside the quadrant the better of its two edges is the least.
        edge = steep**2 / two + shows > flat**2 / one
        a, b = (
            np.where(both, a, np.where(edge, 0.0, flat / one)),
            np.where(both, b, np.where(edge, steep / two, 0.0)),
        )
        fitted = a[place] + b[place] * secant2
    return fitted
