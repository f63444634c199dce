"""Time delay between the beam's position and the power it gives, from how conscan answers to a known shift of the scan.

A delay tau makes every estimate R(w tau) times the true error, w the scan's angular rate (counter-clockwise).
Moving the scan's origin by d must change the estimate by -d; it changes it by -R(w tau) d, so the phase of the
response is w tau.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, PointingError, parameter
from rf_pointing.tracking.response import ResponseSums

__all__ = ["DelayEstimate", "DelayEstimator", "DelayParams", "DelayState"]

Array = NDArray[np.float64]


FEWEST_PAIRS = 2.5
"""Faded count of pairs below which nothing tells an answer to the motion from the target's own."""


@dataclass(frozen=True, kw_only=True)
class DelayParams(Params):
    """Scan period and memory of the estimate."""

    period_s: float = parameter(32.0, "time of one turn of the scan", low=0.1, high=3600.0)
    memory: float = parameter(0.95, "weight of the past at each new pair", low=0.0, high=1.0)
    largest_sigma_s: float = parameter(0.5, "uncertainty above which no delay is given", low=1e-6, high=600.0)


class DelayEstimate(NamedTuple):
    """Delay with its standard deviation; `gain` should be 1 within the accuracy of the beamwidth."""

    delay_s: float
    sigma_s: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayState:
    """Sums so far, and the last estimate with its variance per axis.

    `scatter` is the sum of |change|^2 over the variance, `pairs` the number of pairs, both fading like `sums`.
    """

    sums: ResponseSums = ResponseSums()
    scatter: float = 0.0
    pairs: float = 0.0
    last: complex | None = None
    last_variance_rad2: float = 0.0


class DelayEstimator:
    """Learns the delay from separate conscan estimates and the shifts of the origin between them."""

    def __init__(self, params: DelayParams) -> None:
        self.params = params
        self.state = DelayState()

    def add(self, error: PointingError, moved_cross_elevation_rad: float, moved_elevation_rad: float) -> None:
        """Take one estimate and how far the origin was moved since the one before; an invalid one breaks the chain."""
        if not error.valid:
            self.state = replace(self.state, last=None)
            return
        now = complex(error.cross_elevation_rad, error.elevation_rad)
        variance = 0.5 * float(np.trace(error.covariance_rad2))
        sums, scatter, pairs = self.state.sums, self.state.scatter, self.state.pairs
        if self.state.last is not None:
            moved = complex(moved_cross_elevation_rad, moved_elevation_rad)
            change, spread = now - self.state.last, variance + self.state.last_variance_rad2
            memory = self.params.memory
            sums = sums.faded(memory).with_pair(moved, change, spread)
            scatter, pairs = memory * scatter + abs(change) ** 2 / spread, memory * pairs + 1.0
        self.state = DelayState(sums=sums, scatter=scatter, pairs=pairs, last=now, last_variance_rad2=variance)

    def estimate(self) -> DelayEstimate | None:
        """Return the delay within half a period, None while it is not known well enough.

        A target that moves by itself scatters the changes beyond their variance; the uncertainty grows by as much.
        """
        response, pairs = self.state.sums.estimate(), self.state.pairs
        if response is None or pairs < FEWEST_PAIRS:
            return None
        unexplained = self.state.scatter - abs(response.value) ** 2 * self.state.sums.weight
        excess = max(1.0, unexplained / (2.0 * (pairs - 1.0)))
        per_rad = self.params.period_s / (2.0 * math.pi)
        sigma_s = response.phase_sigma_rad * per_rad * math.sqrt(excess)
        if sigma_s > self.params.largest_sigma_s:
            return None
        return DelayEstimate(response.phase_rad * per_rad, sigma_s, abs(response.value))
