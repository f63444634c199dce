"""From samples to points, by least squares: outliers, one a second, three per 30 s (SATCAL 3).

All of it works on observed minus reference, less the model and the orbit errors known so far: what
is left is so smooth that the mean of a second, and of 10 s, takes nothing of the signal away.  The
passes of a campaign are processed together; `passes` (n,) says which one a sample belongs to, and
samples are in the order of passes and time.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array

Places = NDArray[np.int64]
Chosen = NDArray[np.bool_]

_MEDIAN_TO_SIGMA = 1.4826
# SATCAL 3: 3 sigma, one sample a second, three points of every 30 s.
_OUTLIER_SIGMA, _PIECE_S = 3.0, 30.0
_THIN_S, _THIN_FEWEST = 1.0, 4
_POINT_S, _POINT_FEWEST = 10.0, 5
_FEWEST, _ROUNDS = 8, 10
_GROSS_NEIGHBOURS, _GROSS_SIGMA = 4, 8.0


@dataclass(frozen=True, eq=False)
class Thinned:
    """Residuals (n, m) at `t_s` (n,) of `passes` (n,), means of `counts` (n,) samples.

    `variance` (n, m) is that of a sample about the line through its piece, with `freedom` (n,)
    degrees of freedom, zero where a piece is one sample.
    """

    t_s: Array
    passes: Places
    residuals: Array
    counts: Array
    variance: Array
    freedom: Array
    dropped: dict[str, int]

    def select(self, rows: Chosen, why: str) -> "Thinned":
        """Return some of the points; the others are counted as dropped, sample by sample."""
        dropped = self.dropped | {why: int(np.sum(self.counts[~rows]))}
        return Thinned(
            self.t_s[rows], self.passes[rows], self.residuals[rows], self.counts[rows],
            self.variance[rows], self.freedom[rows], dropped,
        )  # fmt: skip

    @property
    def noise(self) -> Array:
        """Return the standard deviation (m,) of one sample, over all pieces."""
        return np.asarray(
            np.sqrt(self.freedom @ self.variance / max(float(np.sum(self.freedom)), 1.0))
        )


@dataclass(frozen=True, eq=False)
class PiecewiseRows:
    """Rows of unequal length as a table (p, n) that is filled up.

    Everything that is done to a piece is done to all at once: a loop over the pieces took most of
    the time of a campaign.
    """

    row: Places
    column: Places
    present: Chosen

    @classmethod
    def of(cls, first: Places, count: int) -> "PiecewiseRows":
        """Return the table of `count` samples whose pieces begin at `first`."""
        lengths = np.diff(first, append=count)
        row = np.repeat(np.arange(len(first)), lengths)
        column = np.arange(count) - np.repeat(first, lengths)
        present = np.arange(int(np.max(lengths))) < lengths[:, np.newaxis]
        return cls(row, column, present)

    def filled(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return the values (n,) in their places, zeros elsewhere."""
        table = np.zeros(self.present.shape, dtype=values.dtype)
        table[self.row, self.column] = values
        return table

    def medians(self, values: Array) -> Array:
        """Return the median of the values (n,) of each row."""
        return medians(np.asarray(self.filled(values), dtype=np.float64), self.present)


def medians(values: Array, chosen: Chosen) -> Array:
    """Return the median of the chosen values of each row, zero where none is chosen."""
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    counts, rows = np.sum(chosen, axis=1), np.arange(len(values))
    low, high = np.maximum((counts - 1) // 2, 0), np.minimum(counts // 2, values.shape[1] - 1)
    return np.where(counts > 0, 0.5 * (ordered[rows, low] + ordered[rows, high]), 0.0)


def _pieces(t_s: Array, passes: Places, length_s: float) -> Places:
    """Return the first row of each piece [k, k + 1) * `length_s` of a pass."""
    starts = (np.diff(np.floor(t_s / length_s), prepend=-np.inf) != 0.0) | (
        np.diff(passes, prepend=-1) != 0
    )
    return np.flatnonzero(starts)


def find_outliers(
    t_s: Array, passes: Places, residuals: Mapping[str, Array]
) -> tuple[Chosen, dict[str, int]]:
    """Return the samples to keep (n,) and how many each channel of `residuals` rejected.

    A sample is judged by a parabola through its 30-s piece and by the robust spread about it.
    """
    # By pieces: the antenna's own bias is part of the residuals and changes through the pass.
    keep, dropped = np.ones(len(t_s), dtype=bool), {}
    pieces = PiecewiseRows.of(_pieces(t_s, passes, _PIECE_S), len(t_s))
    # Scaled to -1..1: powers of seconds since 1970 have no common digits left.
    place = np.asarray(
        pieces.filled(2.0 * np.mod(t_s, _PIECE_S) / _PIECE_S - 1.0), dtype=np.float64
    )
    basis = np.stack([np.ones_like(place), place, place**2], axis=-1)
    of_pass = PiecewiseRows.of(np.flatnonzero(np.diff(passes, prepend=-1) != 0), len(t_s))
    for name, residual in residuals.items():
        wrong = _beyond(pieces, basis, residual, _gross(of_pass, residual))
        dropped[f"{name} beyond {_OUTLIER_SIGMA:g} sigma"] = int(np.sum(keep & wrong))
        keep &= ~wrong
    return keep, dropped


def _gross(of_pass: PiecewiseRows, residual: Array) -> Chosen:
    # A running median first: one error of degrees would bend the parabola that is to find it.
    lengths = np.sum(of_pass.present, axis=1)[of_pass.row]
    reach = np.arange(-_GROSS_NEIGHBOURS, _GROSS_NEIGHBOURS + 1)
    # Reflected at the ends of a pass: the neighbours there are of another one.
    place = np.abs(of_pass.column[:, np.newaxis] + reach)
    last = (lengths - 1)[:, np.newaxis]
    place = np.clip(np.where(place > last, 2 * last - place, place), 0, last)
    start = (np.arange(len(residual)) - of_pass.column)[:, np.newaxis]
    deviation = residual - np.median(residual[start + place], axis=1)
    spread = _MEDIAN_TO_SIGMA * of_pass.medians(np.abs(deviation))[of_pass.row]
    far = np.abs(deviation) > _GROSS_SIGMA * np.maximum(spread, 1e-12)
    return np.asarray(far & (lengths > 2 * _GROSS_NEIGHBOURS))


def _beyond(pieces: PiecewiseRows, basis: Array, residual: Array, gross: Chosen) -> Chosen:
    """Return which samples (n,) are gross or lie off the parabola of their piece."""
    values = np.asarray(pieces.filled(residual), dtype=np.float64)
    wrong = ~pieces.present | np.asarray(pieces.filled(gross), dtype=bool)
    # Pieces in which nothing was found do not change any more.
    active = np.arange(len(values))
    for _ in range(_ROUNDS):
        good = ~wrong[active]
        active, good = (part[np.sum(good, axis=1) >= _FEWEST] for part in (active, good))
        if len(active) == 0:
            break
        left = np.abs(_off_parabolas(basis[active], values[active], good))
        spread = _MEDIAN_TO_SIGMA * medians(left, good)
        found = good & (left > _OUTLIER_SIGMA * np.maximum(spread, 1e-12)[:, np.newaxis])
        wrong[active] |= found
        active = active[np.any(found, axis=1)]
    return np.asarray(wrong[pieces.row, pieces.column])


def _off_parabolas(basis: Array, values: Array, good: Chosen) -> Array:
    """Return the values (p, n) less the parabolas through the good ones of each row."""
    weighted = np.swapaxes(basis * good[..., np.newaxis], 1, 2)
    fitted = np.linalg.solve(weighted @ basis, weighted @ values[..., np.newaxis])
    return np.asarray(values - (basis @ fitted)[..., 0])


def thin(t_s: Array, passes: Places, residuals: Array) -> Thinned:
    """Return one point a second, the mean of its samples; slower passes are not thinned.

    Raises ValueError if no second has enough samples.
    """
    starts = np.diff(passes, prepend=-1) != 0
    of_pass = PiecewiseRows.of(np.flatnonzero(starts), len(t_s))
    step = of_pass.medians(np.diff(t_s, append=np.inf))[of_pass.row]
    slow = step * _THIN_FEWEST > 1.01 * _THIN_S
    first = np.union1d(_pieces(t_s, passes, _THIN_S), np.flatnonzero(slow))
    return _means(t_s, passes, residuals, first, np.where(slow[first], 1, _THIN_FEWEST), _THIN_S)


def smooth(t_s: Array, passes: Places, residuals: Array) -> Thinned:
    """Return three points of every 30 s: the mean of 10 s at its mean time.

    Raises ValueError if no piece has enough samples.
    """
    first = _pieces(t_s, passes, _POINT_S)
    return _means(t_s, passes, residuals, first, np.full(len(first), _POINT_FEWEST), _POINT_S)


def _means(
    t_s: Array, passes: Places, residuals: Array, first: Places, fewest: Places, length_s: float
) -> Thinned:
    """Return the mean of each piece at its mean time, which is the line through it there.

    Pieces begin at the rows `first` (p,), and have at least `fewest` (p,) samples.
    """
    counts = np.diff(first, append=len(t_s))
    # From the start of a piece: times since 1970 would lose their microseconds in a sum.
    start = t_s[first]
    off = t_s - np.repeat(start, counts)
    middle, value = (
        np.add.reduceat(off, first) / counts,
        np.add.reduceat(residuals, first) / counts[:, np.newaxis],
    )
    off, apart = off - np.repeat(middle, counts), residuals - np.repeat(value, counts, axis=0)
    slope = np.add.reduceat(off[:, np.newaxis] * apart, first) ** 2
    lever = np.maximum(np.add.reduceat(off**2, first), 1e-9)[:, np.newaxis]
    freedom = np.maximum(counts - 2.0, 0.0)
    squares = np.add.reduceat(apart**2, first) - slope / lever
    variance = np.maximum(squares, 0.0) / np.maximum(freedom, 1.0)[:, np.newaxis]
    every = Thinned(
        start + middle, passes[first], value, counts.astype(np.float64), variance, freedom, {}
    )
    enough = counts >= fewest
    if not np.any(enough):
        raise ValueError(f"no {length_s:g}-s piece has the {np.max(fewest)} samples it needs")
    return every.select(
        enough, f"in a {length_s:g}-s piece with fewer than {np.max(fewest)} samples"
    )
