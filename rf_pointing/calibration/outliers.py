"""Second level: samples more than 3 sigma off the ephemeris (SATCAL 3), judged against their neighbours.

The antenna's own bias is part of "observed minus ephemeris" and changes through the pass; so each 30-s piece is
compared with its own parabola and its own robust spread, after a running median has removed gross errors.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.pieces import fitted_piece, pieces_of, spread_of

__all__ = ["find_outliers"]

Array = NDArray[np.float64]

_PIECE_S, _DEGREE, _FEWEST, _ROUNDS = 30.0, 2, 8, 10
_GROSS_NEIGHBOURS, _GROSS_SIGMA = 4, 8.0


def find_outliers(
    t_s: Array, residuals: Mapping[str, Array], limit_sigma: float
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return which samples to keep (n,) and how many each channel rejected; residuals are observed minus ephemeris."""
    keep, dropped = np.ones(len(t_s), dtype=bool), {}
    for name, residual in residuals.items():
        wrong = _gross(residual)
        for rows in pieces_of(t_s, _PIECE_S):
            wrong[rows] |= _beyond(t_s[rows], residual[rows], wrong[rows], limit_sigma)
        dropped[f"{name} beyond {limit_sigma:g} sigma"] = int(np.sum(keep & wrong))
        keep &= ~wrong
    return keep, dropped


def _gross(residual: Array) -> NDArray[np.bool_]:
    width = 2 * _GROSS_NEIGHBOURS + 1
    if len(residual) < width:
        return np.zeros(len(residual), dtype=bool)
    padded = np.pad(residual, _GROSS_NEIGHBOURS, mode="reflect")
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    deviation = residual - smooth
    return np.asarray(np.abs(deviation) > _GROSS_SIGMA * max(spread_of(deviation), 1e-12))


def _beyond(t: Array, residual: Array, wrong: NDArray[np.bool_], limit_sigma: float) -> NDArray[np.bool_]:
    for _ in range(_ROUNDS):
        good = np.flatnonzero(~wrong)
        if len(good) < _FEWEST:
            return wrong
        fitted, inner, _ = fitted_piece(t[good], residual[good, np.newaxis], _DEGREE, t)
        found = np.abs(residual - fitted[:, 0]) > limit_sigma * max(spread_of(inner), 1e-12)
        if np.array_equal(found | wrong, wrong):
            return wrong
        wrong = wrong | found
    return wrong
