"""Power modulation of a spinning spacecraft: regressors that take it out of the conscan estimate, and its period.

A spin multiplies the power by a slowly varying factor; its logarithm over one period is a cos + b sin for every period
(or harmonic) given.  A period too close to that of the scan cannot be told from a pointing error.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between

__all__ = ["spin_columns", "spin_period_s"]

Array = NDArray[np.float64]

COARSE_STEPS_PER_CYCLE = 4


def spin_columns(t_s: Array, periods_s: tuple[float, ...]) -> Array:
    """Return cosine and sine of every spin period at the times (n,), shape (n, 2 * periods)."""
    phase = 2.0 * math.pi * np.outer(t_s - t_s[0], 1.0 / np.array(periods_s))
    return np.concatenate([np.cos(phase), np.sin(phase)], axis=1)


def spin_period_s(t_s: Array, power_w: Array, shortest_s: float, longest_s: float) -> tuple[float, float]:
    """Return the period that explains most of the power's modulation, and the share of the variance it explains.

    Times and powers (n,) of a beam that rests on the target, not necessarily uniform.  The frequency is searched on a
    grid of a quarter cycle over the record and refined by a parabola.  Raises ValueError for fewer than 8 samples or a
    record shorter than `longest_s`.
    """
    span = float(t_s[-1] - t_s[0])
    require_between("samples", len(t_s), 8, None)
    require_between("longest_s", longest_s, shortest_s, span)
    lowest, highest = 1.0 / longest_s, 1.0 / shortest_s
    count = max(math.ceil(COARSE_STEPS_PER_CYCLE * span * (highest - lowest)), 4)
    grid = np.linspace(lowest, highest, count + 1)
    signal = power_w / np.mean(power_w) - 1.0
    shares = np.array([_explained_share(t_s, signal, frequency) for frequency in grid])
    best = int(np.argmax(shares))
    if best in (0, count):
        return float(1.0 / grid[best]), float(shares[best])
    left, centre, right = shares[best - 1 : best + 2]
    shift = 0.5 * (left - right) / (left - 2.0 * centre + right)
    frequency = float(grid[best] + shift * (grid[1] - grid[0]))
    return 1.0 / frequency, _explained_share(t_s, signal, frequency)


def _explained_share(t_s: Array, signal: Array, frequency_hz: float) -> float:
    columns = np.column_stack([np.ones_like(t_s), spin_columns(t_s, (1.0 / frequency_hz,))])
    fit = np.linalg.lstsq(columns, signal, rcond=None)[0]
    return 1.0 - float(np.sum((signal - columns @ fit) ** 2) / np.sum((signal - np.mean(signal)) ** 2))
