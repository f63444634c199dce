"""How well a model repeats sequences it has not seen: the numbers of DSS13-ID Tables 2 to 5.

    error(k) = |y_m - k y_s| / |y_m|                                                          (DSS13-ID eq. 8, 9)

with the gain k that makes it smallest; delta = |k - 1| (eq. 10).  In the cross responses a small
constant rate at the input of the other axis is fitted as well (eq. 7).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.identification.model import StateSpace

__all__ = ["CrossCheck", "StraightCheck", "check_cross", "check_straight"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class StraightCheck:
    """Relative error with the best gain, and how far that gain is from one (`gain_factor`); both ratios, not percent."""

    error: float
    error_at_unit_gain: float
    gain_factor: float


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """Relative error with the fitted bias, and that bias at the other axis' input in its own unit."""

    error: float
    bias: float


def check_straight(model: StateSpace, inputs: ArrayLike, outputs: ArrayLike) -> StraightCheck:
    """Return the errors of one sequence (samples,); the output counts from its first sample."""
    measured = np.asarray(outputs, dtype=np.float64)
    measured = measured - measured[0]
    simulated = model.simulate(inputs)[:, 0]
    gain = float(simulated @ measured / (simulated @ simulated))
    size = float(np.linalg.norm(measured))
    best = float(np.linalg.norm(measured - gain * simulated)) / size
    return StraightCheck(best, float(np.linalg.norm(measured - simulated)) / size, abs(gain - 1.0))


def check_cross(cross: StateSpace, straight: StateSpace, inputs: ArrayLike, outputs: ArrayLike) -> CrossCheck:
    """Return the error of one sequence (samples,) of a cross response.

    `straight` is the model of the axis that was not driven: its response to one constant rate is
    fitted and added.
    """
    measured = np.asarray(outputs, dtype=np.float64)
    simulated = cross.simulate(inputs)[:, 0]
    drift = straight.simulate(np.ones(len(measured)))[:, 0]
    columns = np.column_stack([drift, np.ones(len(measured))])
    weights = np.linalg.lstsq(columns, measured - simulated, rcond=None)[0]
    residual = measured - simulated - columns @ weights
    size = float(np.linalg.norm(measured - measured[0]))
    return CrossCheck(float(np.linalg.norm(residual)) / size, float(weights[0]))
