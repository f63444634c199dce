"""From samples to points, by least squares: outliers, one a second, three per 30 s (SATCAL 3).

All of it works on observed minus reference: what is left after subtracting the orbit is so smooth
that a line per second and a parabola per 30 s take nothing of the signal away.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEDIAN_TO_SIGMA = 1.4826
# SATCAL 3: 3 sigma, one sample a second, three points of every 30 s.
_OUTLIER_SIGMA = 3.0
_THIN_S, _THIN_FEWEST = 1.0, 4
_PIECE_S, _POINTS, _PIECE_FEWEST = 30.0, 3, 15
# White noise scatters by 1.0 +- 0.15 in a piece: this drops what bends and spares what is noisy.
_WORST_SCATTER = 1.6
_FEWEST, _ROUNDS = 8, 10
_GROSS_NEIGHBOURS, _GROSS_SIGMA = 4, 8.0
# The quietest quarter of the pieces is quiet unless the noise is everywhere.
_PARABOLAS_QUANTILE = 0.25


@dataclass(frozen=True, eq=False)
class Thinned:
    """Residuals (n, m) of m channels at `t_s` (n,), their sigma (n, m), and drops by reason.

    `noise` (m,) is the standard deviation of one input sample, measured from its scatter.
    """

    t_s: Array
    residuals: Array
    sigma: Array
    noise: Array
    dropped: dict[str, int]


def _first_rows(t_s: Array, length_s: float) -> NDArray[np.int64]:
    """Return the first row of each piece [k, k + 1) * `length_s` of increasing times."""
    return np.flatnonzero(np.diff(np.floor(t_s / length_s), prepend=-np.inf))


def _pieces_of(t_s: Array) -> list[NDArray[np.int64]]:
    """Return the rows of each 30-s piece."""
    return np.split(np.arange(len(t_s)), _first_rows(t_s, _PIECE_S)[1:])


def _parabola(t: Array, values: Array, at: Array) -> tuple[Array, Array, Array]:
    """Return the parabola of (n, m) values at `at` (p,), residuals, covariance factor (p, p).

    The covariance of the fitted values is the factor times the variance of one sample.
    """
    # Scaled to -1..1: powers of seconds since 1970 have no common digits left.
    middle, half = 0.5 * (t[0] + t[-1]), max(0.5 * (t[-1] - t[0]), 1e-9)
    basis = np.vander((t - middle) / half, 3)
    wanted = np.vander((at - middle) / half, 3)
    orthogonal, factor = np.linalg.qr(basis)
    coefficients = np.linalg.solve(factor, orthogonal.T @ values)
    spread = np.linalg.solve(factor.T, wanted.T)
    return wanted @ coefficients, values - basis @ coefficients, spread.T @ spread


def _spread_of(residuals: Array) -> float:
    """Return the standard deviation by the median size, which outliers hardly move."""
    return _MEDIAN_TO_SIGMA * float(np.median(np.abs(residuals)))


def find_outliers(t_s: Array, residuals: Mapping[str, Array]) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return the samples to keep (n,) and how many each channel of `residuals` rejected.

    A sample is judged by a parabola through its 30-s piece and by the robust spread about it.
    """
    # By pieces: the antenna's own bias is part of the residuals and changes through the pass.
    keep, dropped = np.ones(len(t_s), dtype=bool), {}
    for name, residual in residuals.items():
        wrong = _gross(residual)
        for rows in _pieces_of(t_s):
            wrong[rows] |= _beyond(t_s[rows], residual[rows], wrong[rows])
        dropped[f"{name} beyond {_OUTLIER_SIGMA:g} sigma"] = int(np.sum(keep & wrong))
        keep &= ~wrong
    return keep, dropped


def _gross(residual: Array) -> NDArray[np.bool_]:
    # A running median first: one error of degrees would bend the parabola that is to find it.
    width = 2 * _GROSS_NEIGHBOURS + 1
    if len(residual) < width:
        return np.zeros(len(residual), dtype=bool)
    padded = np.pad(residual, _GROSS_NEIGHBOURS, mode="reflect")
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    deviation = residual - smooth
    return np.asarray(np.abs(deviation) > _GROSS_SIGMA * max(_spread_of(deviation), 1e-12))


def _beyond(t: Array, residual: Array, wrong: NDArray[np.bool_]) -> NDArray[np.bool_]:
    for _ in range(_ROUNDS):
        good = np.flatnonzero(~wrong)
        if len(good) < _FEWEST:
            return wrong
        fitted, inner, _ = _parabola(t[good], residual[good, np.newaxis], t)
        found = np.abs(residual - fitted[:, 0]) > _OUTLIER_SIGMA * max(_spread_of(inner), 1e-12)
        if np.array_equal(found | wrong, wrong):
            return wrong
        wrong = wrong | found
    return wrong


def thin(t_s: Array, residuals: Array) -> Thinned:
    """Return one point a second: the line through its samples at their mean time.

    At the mean time the line is the mean; its residuals give the noise of a sample, for each piece
    by itself.  Slower samples are not thinned.  Raises ValueError if no second has enough samples.
    """
    # Pooled over 30 s and not over the pass: noise on the sky is 1/cos El times larger in azimuth.
    if len(t_s) > 1 and np.median(np.diff(t_s)) * _THIN_FEWEST > 1.01 * _THIN_S:
        return _as_they_are(t_s, residuals)
    first = _first_rows(t_s, _THIN_S)
    counts = np.diff(first, append=len(t_s))
    middle, value = _means(t_s, first, counts), _means(residuals, first, counts)
    off, apart = t_s - np.repeat(middle, counts), residuals - np.repeat(value, counts, axis=0)
    slope_part = np.add.reduceat(off[:, np.newaxis] * apart, first) ** 2
    lever = np.add.reduceat(off**2, first)[:, np.newaxis]
    enough = (counts >= _THIN_FEWEST) & (lever[:, 0] > 0.0)
    if not np.any(enough):
        raise ValueError(f"no {_THIN_S:g}-s piece has the {_THIN_FEWEST} samples it needs")
    squares = np.add.reduceat(apart**2, first)[enough] - slope_part[enough] / lever[enough]
    noise, own = _noise(middle[enough], squares, counts[enough] - 2)
    dropped = {f"in a {_THIN_S:g}-s piece with fewer than {_THIN_FEWEST} samples": int(np.sum(counts[~enough]))}
    sigma = own / np.sqrt(counts[enough])[:, np.newaxis]
    return Thinned(middle[enough], value[enough], sigma, noise, dropped)


def smooth(t_s: Array, residuals: Array, sigma: Array) -> Thinned:
    """Return three points of every piece, evenly spaced: the parabola through it at those times.

    `sigma` (n, m) is that of the input points.  A piece that scatters more than `_WORST_SCATTER`
    times as much about its parabola is dropped.  Raises ValueError if no piece is left.
    """
    # Unless most pieces do: noise that is correlated over seconds (wind, a hunting servo, coarse
    # encoders) scatters like that everywhere.  It raises the sigma of all points instead; dropping
    # had left 19 points of 5386.
    pieces = [
        _Piece.of(t_s[rows], residuals[rows], np.mean(sigma[rows], axis=0))
        for rows in _pieces_of(t_s)
        if len(rows) >= _PIECE_FEWEST
    ]
    if not pieces:
        raise ValueError(f"no {_PIECE_S:g}-s piece has {_PIECE_FEWEST} samples")
    usual = np.maximum(np.quantile([piece.excess for piece in pieces], _PARABOLAS_QUANTILE, axis=0), 1.0)
    found = [piece for piece in pieces if np.all(piece.excess <= _WORST_SCATTER * usual)]
    if not found:
        raise ValueError(f"no {_PIECE_S:g}-s piece with {_PIECE_FEWEST} samples follows a parabola")
    fitted, taken = (sum(piece.count for piece in some) for some in (pieces, found))
    too_short = f"in a {_PIECE_S:g}-s piece with fewer than {_PIECE_FEWEST} samples"
    return _joined(found, {too_short: len(t_s) - fitted, "not along a parabola": fitted - taken})


def _as_they_are(t_s: Array, residuals: Array) -> Thinned:
    """Return the samples with the noise of their second differences, of six times its variance."""
    if len(t_s) < 3:
        raise ValueError(f"samples={len(t_s)} must be >= 3 to measure their noise")
    bends = np.diff(residuals, 2, axis=0) ** 2 / 6.0
    squares = np.concatenate([bends[:1], bends, bends[-1:]])
    noise, own = _noise(t_s, squares, np.ones(len(t_s), dtype=np.int64))
    return Thinned(t_s, residuals, own, noise, {})


def _noise(t_s: Array, squares: Array, freedom: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the noise (m,) of all samples, and for each row (n, m) that of its piece."""
    first = _first_rows(t_s, _PIECE_S)
    of_pool = np.add.reduceat(squares, first) / np.add.reduceat(freedom, first)[:, np.newaxis]
    own = np.repeat(of_pool, np.diff(first, append=len(t_s)), axis=0)
    return np.sqrt(np.sum(squares, axis=0) / np.sum(freedom)), np.sqrt(own)


def _means(values: Array, first: NDArray[np.int64], counts: NDArray[np.int64]) -> Array:
    # About the first value: times since 1970 would lose their microseconds in a sum.
    shifted = np.add.reduceat(values - values[0], first)
    return np.asarray(values[0] + (shifted.T / counts).T)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A parabola: its points, their variance over a sample's, and the stated sigma of a sample.

    `squares` and `products` (m,) are the sums of squares and of products of neighbours.
    """

    t_s: Array
    values: Array
    factor: Array
    squares: Array
    products: Array
    stated: Array
    count: int

    @classmethod
    def of(cls, t: Array, residuals: Array, stated: Array) -> "_Piece":
        middles = np.floor(t[0] / _PIECE_S) * _PIECE_S + _PIECE_S * (np.arange(_POINTS) + 0.5) / _POINTS
        # A sample is the mean of a second, so the piece reaches half a second beyond it.
        at = middles[(middles >= t[0] - 0.5) & (middles <= t[-1] + 0.5)]
        values, left, covariance = _parabola(t, residuals, at)
        # Neighbours are correlated by 0.25: a raised sigma makes their mean right.
        together = max(1.0, float(np.sum(covariance) / np.trace(covariance)))
        products = np.sum(left[1:] * left[:-1], axis=0)
        return cls(at, values, np.diag(covariance) * together, np.sum(left**2, axis=0), products, stated, len(t))

    @property
    def freedom(self) -> int:
        return self.count - 3

    @property
    def excess(self) -> Array:
        """Return the scatter about the parabola, divided by the stated sigma (m,)."""
        return np.asarray(np.sqrt(self.squares / self.freedom) / np.maximum(self.stated, 1e-300))


def _joined(pieces: list[_Piece], dropped: dict[str, int]) -> Thinned:
    freedom = np.array([piece.freedom for piece in pieces], dtype=np.float64)
    raised = np.sqrt(np.average([np.square(piece.excess) for piece in pieces], axis=0, weights=freedom))
    noise = np.sqrt(np.sum([piece.squares for piece in pieces], axis=0) / np.sum(freedom))
    raised = np.maximum(raised, 1.0) * _correlation_factor(pieces)
    sigma = [np.sqrt(piece.factor)[:, np.newaxis] * piece.stated * raised for piece in pieces]
    return Thinned(
        np.concatenate([piece.t_s for piece in pieces]),
        np.concatenate([piece.values for piece in pieces]),
        np.concatenate(sigma),
        noise,
        dropped,
    )


def _correlation_factor(pieces: list[_Piece]) -> Array:
    """Return the factor (m,) by which noise of correlation rho raises the sigma of a mean.

    sqrt((1 + rho) / (1 - rho)) for a first-order process; the parabola takes 3/n out of rho.
    """
    squares = np.sum([piece.squares / np.maximum(piece.stated, 1e-300) ** 2 for piece in pieces], axis=0)
    products = np.sum([piece.products / np.maximum(piece.stated, 1e-300) ** 2 for piece in pieces], axis=0)
    length = float(np.mean([piece.count for piece in pieces]))
    rho = np.clip(products / np.maximum(squares, 1e-300) + 3.0 / length, 0.0, 0.98)
    return np.asarray(np.sqrt((1.0 + rho) / (1.0 - rho)))
