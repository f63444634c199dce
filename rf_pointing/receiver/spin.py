"""Spin of a satellite, from the periodic change of its power (least-squares periodogram)."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

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
        self._rows: deque[tuple[float, float]] = deque()

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
        mean = float(np.mean(powers))
        if mean <= 0.0:
            return None
        place = 2.0 * (times - times[0]) / span_s - 1.0
        relative = powers / mean - 1.0
        relative = relative - np.polynomial.legendre.legval(
            place, np.polynomial.legendre.legfit(place, relative, TREND_ORDER)
        )
        frequencies = np.arange(2.0 / span_s, 0.5 * (len(times) - 1) / span_s, 0.25 / span_s)
        phasors = np.exp(-2j * np.pi * np.outer(frequencies, times - times[0]))
        powers_of = np.abs(phasors @ relative) ** 2
        variance = float(np.mean(relative**2))
        at = int(np.argmax(powers_of))
        # With white noise the share at one frequency is exponential.
        peak = float(powers_of[at]) / (len(times) * max(variance, 1e-300))
        if peak < math.log(len(frequencies) / FALSE_SHARE):
            return None
        depth = 2.0 * math.sqrt(float(powers_of[at])) / len(times)
        rest = max(variance - 0.5 * depth**2, 1e-12)
        sigma_hz = math.sqrt(6.0 * rest / len(times)) / (math.pi * span_s * depth)
        shift = 0.0
        if 0 < at < len(frequencies) - 1:
            left, middle, right = (float(powers_of[at + k]) for k in (-1, 0, 1))
            shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
        return Spin(float(frequencies[at]) + shift * 0.25 / span_s, sigma_hz, depth)
