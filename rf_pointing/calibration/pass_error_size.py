"""How large the orbit errors of the passes are, measured by the fit itself.

With the errors v_g of the passes g estimated under a prior of size s, and their posterior sigma p_g,

    s^2  <-  sum_g v_g^2 / sum_g (1 - p_g^2 / s^2)

has its fixed point where the prior's size has the greatest likelihood (MacKay 1992, eq. 4.9).  An error that the angles
hardly show (the sum below is less than one pass) keeps its size.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.pass_errors import PassPriors

__all__ = ["MEASURABLE_FROM", "measured_pass_priors", "size_ratios"]

Array = NDArray[np.float64]

MEASURABLE_FROM = PassPriors(along_track_m=1000.0, cross_track_m=1000.0, radial_m=1000.0)
"""Sizes from which the search starts: those of elements a few days old."""
_ROUNDS, _SETTLED = 25, 0.1
_FEWEST_SEEN = 1.0
_LEAST = 1e-3


def size_ratios(fit: FitResult, priors: PassPriors) -> Array:
    """Return, for each error in `priors`, how many times larger its measured size is; 1 where it cannot be measured."""
    values = np.array([[one.values[name] for name in priors.names] for one in fit.pass_errors])
    sigma = np.array([[one.sigma[name] for name in priors.names] for one in fit.pass_errors])
    seen = np.sum(np.clip(1.0 - (sigma / priors.sigma) ** 2, 0.0, 1.0), axis=0)
    square = np.sum((values / priors.sigma) ** 2, axis=0)
    return np.sqrt(np.where(seen >= _FEWEST_SEEN, square / np.maximum(seen, _FEWEST_SEEN), 1.0))


def measured_pass_priors(fit: Callable[[PassPriors], FitResult], start: PassPriors = MEASURABLE_FROM) -> PassPriors:
    """Return the priors whose sizes are those that the passes show, beginning at `start`; `fit` fits with given ones.

    Sizes settle to 10 % within 25 rounds or stay where the last round left them; they shrink to a thousandth of `start`
    at most.
    """
    priors = start
    least = dict(zip(start.names, _LEAST * start.sigma, strict=True))
    for _ in range(_ROUNDS):
        ratios = dict(zip(priors.names, size_ratios(fit(priors), priors).tolist(), strict=True))
        sizes = {name: max(least[name], ratio * getattr(priors, name)) for name, ratio in ratios.items()}
        moved = max(abs(np.log(size / getattr(priors, name))) for name, size in sizes.items())
        priors = priors.replace(**sizes)
        if moved < _SETTLED:
            break
    return priors
