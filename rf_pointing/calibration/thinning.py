"""Thinning to one sample per second and smoothing to three points per 30 s (SATCAL 3), by least squares.

Both work on observed minus reference: what is left after subtracting the orbit is so smooth that a line per second
and a parabola per 30 s take nothing of the signal away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.pieces import fitted_piece, pieces_of

__all__ = ["Thinned", "smooth", "thin"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Thinned:
    """Residuals (n, m) of m channels at `t_s` (n,), their sigma (n, m), and what was dropped and why.

    `noise` (m,) is the standard deviation of one input sample, measured from its scatter.
    """

    t_s: Array
    residuals: Array
    sigma: Array
    noise: Array
    dropped: dict[str, int]


def thin(t_s: Array, residuals: Array, *, second_s: float, fewest: int) -> Thinned:
    """Return one point per `second_s`: the least-squares line through its samples at their mean time.

    At the mean time the line is the mean; its residuals give the noise of a sample.
    """
    first = np.flatnonzero(np.diff(np.floor(t_s / second_s), prepend=-np.inf))
    counts = np.diff(first, append=len(t_s))
    middle, value = _means(t_s, first, counts), _means(residuals, first, counts)
    off, apart = t_s - np.repeat(middle, counts), residuals - np.repeat(value, counts, axis=0)
    slope_part = np.add.reduceat(off[:, np.newaxis] * apart, first) ** 2
    lever = np.add.reduceat(off**2, first)[:, np.newaxis]
    enough = (counts >= max(fewest, 3)) & (lever[:, 0] > 0.0)
    if not np.any(enough):
        raise ValueError(f"no {second_s:g}-s piece has the {max(fewest, 3)} samples it needs")
    squares = np.add.reduceat(apart**2, first)[enough] - slope_part[enough] / lever[enough]
    noise = np.sqrt(np.sum(squares, axis=0) / np.sum(counts[enough] - 2))
    dropped = {f"in a {second_s:g}-s piece with fewer than {fewest} samples": int(np.sum(counts[~enough]))}
    sigma = noise / np.sqrt(counts[enough])[:, np.newaxis]
    return Thinned(middle[enough], value[enough], sigma, noise, dropped)


def smooth(
    t_s: Array, residuals: Array, sigma: Array, *, piece_s: float, points: int, fewest: int, worst_scatter: float
) -> Thinned:
    """Return `points` points per `piece_s`, evenly spaced: the parabola through the piece at those times.

    `sigma` (n, m) is that of the input points.  A piece that scatters more than `worst_scatter` times that about its
    parabola does not follow one and is dropped.  Neighbouring points of a piece are correlated (0.25 in a full one);
    their sigma is raised so that their mean has the right one when they are taken as independent.
    """
    found, short, crooked = [], 0, 0
    for rows in pieces_of(t_s, piece_s):
        if len(rows) < fewest:
            short += len(rows)
            continue
        piece = _Piece.of(t_s[rows], residuals[rows], 2, _spread_points(t_s[rows], piece_s, points))
        if np.any(piece.scatter > worst_scatter * np.mean(sigma[rows], axis=0)):
            crooked += len(rows)
        else:
            found.append(piece)
    noise = _pooled(found, f"no {piece_s:g}-s piece has {fewest} samples and follows a parabola")
    reasons = {f"in a {piece_s:g}-s piece with fewer than {fewest} samples": short, "not along a parabola": crooked}
    return _joined(found, noise, np.maximum(noise, np.sqrt(np.mean(sigma**2, axis=0))), reasons)


def _means(values: Array, first: NDArray[np.int64], counts: NDArray[np.int64]) -> Array:
    # About the first value: times since 1970 would lose their microseconds in a sum.
    shifted = np.add.reduceat(values - values[0], first)
    return np.asarray(values[0] + (shifted.T / counts).T)


@dataclass(frozen=True, eq=False)
class _Piece:
    t_s: Array
    values: Array
    factor: Array
    squares: Array
    freedom: int

    @classmethod
    def of(cls, t: Array, residuals: Array, degree: int, at: Array) -> "_Piece":
        values, left, covariance = fitted_piece(t, residuals, degree, at)
        together = max(1.0, float(np.sum(covariance) / np.trace(covariance)))
        factor = np.diag(covariance) * together
        return cls(at, values, factor, np.sum(left**2, axis=0), len(t) - degree - 1)

    @property
    def scatter(self) -> Array:
        return np.asarray(np.sqrt(self.squares / self.freedom))


def _pooled(pieces: list[_Piece], message: str) -> Array:
    if not pieces:
        raise ValueError(message)
    squares = np.sum([piece.squares for piece in pieces], axis=0)
    return np.asarray(np.sqrt(squares / sum(piece.freedom for piece in pieces)))


def _joined(pieces: list[_Piece], noise: Array, one: Array, dropped: dict[str, int]) -> Thinned:
    factor = np.concatenate([piece.factor for piece in pieces])
    return Thinned(
        np.concatenate([piece.t_s for piece in pieces]),
        np.concatenate([piece.values for piece in pieces]),
        np.sqrt(factor)[:, np.newaxis] * one,
        noise,
        dropped,
    )


def _spread_points(t: Array, length_s: float, points: int) -> Array:
    start = np.floor(t[0] / length_s) * length_s
    wanted = start + length_s * (np.arange(points) + 0.5) / points
    return np.asarray(wanted[(wanted >= t[0] - 0.5) & (wanted <= t[-1] + 0.5)])
