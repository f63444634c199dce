"""Spin of a satellite, from the periodic change of its power.

The largest line of the periodogram, then least squares of a sinusoid on a cubic trend.  The sigma
is the Cramer-Rao bound sqrt(6 / n) noise / (pi T depth) with the noise of the residuals.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from rf_pointing.core.types import Array, Pair

WINDOW_S = 60.0
FEWEST = 100
FALSE_SHARE = 1e-4
TREND_ORDER = 3


@dataclass(frozen=True, slots=True)
class Spin:
    """A periodic change: its frequency with sigma, and amplitude relative to the mean power."""

    frequency_hz: float
    sigma_hz: float
    depth: float


class SpinWatch:
    """Takes powers; `estimate` returns the strongest period, None where chance may give it.

    Changes slower than two periods in the window are taken for the pass, not the spin.
    """

    def __init__(self, window_s: float = WINDOW_S) -> None:
        self._window_s = window_s
        self._rows: deque[Pair] = deque()

    def take(self, t_s: float, power: float) -> None:
        """Note a power; a step back in time forgets what was known."""
        if self._rows and t_s <= self._rows[-1][0]:
            self._rows.clear()
        self._rows.append((t_s, power))
        while t_s - self._rows[0][0] > self._window_s:
            self._rows.popleft()

    def estimate(self) -> Spin | None:
        """Return the spin that the powers show."""
        if len(self._rows) < FEWEST:
            return None
        times, powers = np.array(self._rows).T
        span_s = float(times[-1] - times[0])
        place = 2.0 * (times - times[0]) / span_s - 1.0
        trend = np.polynomial.legendre.legvander(place, TREND_ORDER)
        level = trend @ np.linalg.lstsq(trend, powers, rcond=None)[0]
        if np.min(level) <= 0.0:
            return None
        relative = powers / level - 1.0
        frequencies = np.arange(2.0 / span_s, 0.5 * (len(times) - 1) / span_s, 0.25 / span_s)
        phasors = np.exp(-2j * np.pi * np.outer(frequencies, times - times[0]))
        powers_of = np.abs(phasors @ relative) ** 2
        variance = float(np.mean(relative**2))
        at = int(np.argmax(powers_of))
        # With white noise the share at one frequency is exponential.
        peak = float(powers_of[at]) / (len(times) * max(variance, 1e-300))
        if peak < math.log(len(frequencies) / FALSE_SHARE):
            return None
        found = minimize_scalar(
            lambda hertz: _fit(hertz, times - times[0], trend, relative)[1],
            bounds=frequencies[at] + np.array([-0.5, 0.5]) / span_s,
            options={"xatol": 1e-5 / span_s},
        )
        depth, rest = _fit(float(found.x), times - times[0], trend, relative)
        sigma_hz = math.sqrt(6.0 * rest) / (math.pi * span_s * depth * len(times))
        return Spin(float(found.x), sigma_hz, depth)


def _fit(frequency_hz: float, t_s: Array, trend: Array, relative: Array) -> Pair:
    """Return depth and sum of squared residuals of a sinusoid of this frequency on a trend."""
    angle = 2.0 * np.pi * frequency_hz * t_s
    design = np.column_stack([trend, np.cos(angle), np.sin(angle)])
    solved = np.linalg.lstsq(design, relative, rcond=None)[0]
    residuals = relative - design @ solved
    return float(np.hypot(*solved[-2:])), float(residuals @ residuals)
