"""Integrator of the radio tracking error, H = 2 pi f_m / s in discrete time.

    o(k+1) = o(k) + 2 pi f_m T e(k)                                             (BWG eq. 7, Fig. 12)

The error of the sample before is what acts (the delay of Fig. 12).  Between samples the offset runs
on a straight line with the rate 2 pi f_m e(k), so the servo sees no staircase and its feedforward
gets the exact rate; when the next sample is late the offset stops at the end of its line.

A first error of half a beamwidth would command its whole rate at once; the rate changes by
`acceleration_rad_s2` at most.

Beyond the paper, e may be the mean of the latest errors while that mean is small.  Five at 10 Hz
have nulls at 2 and 4 Hz and leave too little of the bending modes between to be driven through the
delay of commands that are sent ahead, whatever its phase; an error to be caught, after a search,
acts at once (docs/math/controllers.md).
"""

import copy
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Params, as_finite_array, parameter, require_finite
from rf_pointing.core.types import Array


@dataclass(frozen=True, kw_only=True)
class TrackerIntegratorParams(Params):
    """Loop bandwidth, sampling and bound of the offset."""

    bandwidth_hz: float = parameter(0.04, "f_m of H = 2 pi f_m / s", low=0.0, high=5.0)
    sample_s: float = parameter(0.1, "time between two errors", low=0.001, high=10.0)
    mean_of: int = parameter(1, "number of latest errors whose mean acts", low=1, high=50)
    mean_within_rad: float = parameter(
        math.radians(0.01), "size of the mean up to which it acts, the newest error alone beyond", low=0.0, high=1.0
    )
    offset_limit_rad: float = parameter(math.radians(1.0), "largest offset on either axis", low=1e-9, high=1.0)
    acceleration_rad_s2: float = parameter(
        math.radians(0.2), "largest change of the offset's rate in 1 s, on either axis", low=1e-6, high=1.0
    )


@dataclass(slots=True)
class TrackerIntegratorState:
    """Offset (2,) at `t_s`, its rate (2,) up to `end_s`, latest errors."""

    offset_rad: Array = field(default_factory=lambda: np.zeros(2))
    rate_rad_s: Array = field(default_factory=lambda: np.zeros(2))
    t_s: float = 0.0
    end_s: float = 0.0
    frozen: bool = False
    errors: tuple[tuple[float, float], ...] = ()


class TrackerIntegrator:
    """Two-axis integrator: `update` with every sample, `at` for offset and rate at any time."""

    def __init__(self, params: TrackerIntegratorParams) -> None:
        self.params = params
        self._state = TrackerIntegratorState()

    @property
    def state(self) -> TrackerIntegratorState:
        """A copy of the complete state."""
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: TrackerIntegratorState) -> None:
        self._state = copy.deepcopy(state)

    @property
    def frozen(self) -> bool:
        """Whether errors are ignored and the offset held."""
        return self._state.frozen

    def retune(self, params: TrackerIntegratorParams) -> None:
        """Take new parameters from the next error on; the offset stays, within the new limit."""
        self.params = params
        self._state.offset_rad = self._clamped(self._state.offset_rad)

    def reset(self, t_s: float, offset_rad: ArrayLike = (0.0, 0.0)) -> None:
        """Start at `t_s` from `offset_rad` (2,) at rest, not frozen."""
        require_finite("t_s", t_s)
        offset = self._clamped(as_finite_array("offset_rad", offset_rad, (2,)))
        # Errors from before it belong to another motion.
        self._state = TrackerIntegratorState(offset, t_s=t_s, end_s=t_s)

    def freeze(self, t_s: float) -> None:
        """Hold the offset of `t_s` and ignore errors until `reset`."""
        require_finite("t_s", t_s)
        self._settle(t_s)
        self._state.rate_rad_s = np.zeros(2)
        self._state.frozen = True

    def change(self, offset_rad: Array | float = 0.0, signs: Array | float = 1.0) -> None:
        """Move the offset by `offset_rad` (2,), and multiply it and its rate by `signs` (2,)."""
        state = self._state
        state.offset_rad, state.rate_rad_s = (state.offset_rad + offset_rad) * signs, state.rate_rad_s * signs

    def update(self, t_s: float, error_rad: ArrayLike) -> None:
        """Take the error (2,) measured for the interval before `t_s`.

        Raises
        ------
        ValueError
            For a non-finite error or a time before the previous one.
        """
        error = as_finite_array("error_rad", error_rad, (2,))
        require_finite("t_s", t_s)
        # A late error finds the offset at rest on the end of its line: the rate then starts again
        # from zero.
        running = t_s <= self._state.end_s + 1e-6
        self._settle(t_s)
        if self._state.frozen:
            return
        # Five errors have a null at 2 Hz: the radio loop must not drive the bending modes.
        latest = (*self._state.errors, (float(error[0]), float(error[1])))[-self.params.mean_of :]
        self._state.errors = latest
        mean = np.add.reduce(latest, axis=0) / len(latest)
        # A target to be caught is not to be waited for: beyond the bound the newest error acts
        # alone.
        acting = mean if math.hypot(mean[0], mean[1]) <= self.params.mean_within_rad else error
        wanted = 2.0 * math.pi * self.params.bandwidth_hz * acting
        before = self._state.rate_rad_s if running else np.zeros(2)
        # A step of the rate would be a step of the servo's feedforward.
        largest = self.params.acceleration_rad_s2 * self.params.sample_s
        self._state.rate_rad_s = before + np.minimum(np.maximum(wanted - before, -largest), largest)
        self._state.end_s = t_s + self.params.sample_s

    def at(self, t_s: float) -> tuple[Array, Array]:
        """Return offset (2,) and its rate (2,) at `t_s`, not before the latest update."""
        state = self._state
        if t_s < state.t_s:
            raise ValueError(f"t_s={t_s} must be >= {state.t_s}, the time of the latest update")
        offsets, rates = self.along(np.array([t_s]))
        return offsets[0], rates[0]

    def along(self, t_s: Array) -> tuple[Array, Array]:
        """Return offsets and rates (n, 2) at times (n,); times before the latest update get its."""
        state = self._state
        times = np.maximum(t_s, state.t_s)[:, None]
        offsets = state.offset_rad + state.rate_rad_s * (np.minimum(times, state.end_s) - state.t_s)
        # At its limit the offset stands: a rate fed forward there would push against it for ever.
        moving = (times < state.end_s) & (np.abs(offsets) < self.params.offset_limit_rad)
        return self._clamped(offsets), np.where(moving, state.rate_rad_s, 0.0)

    def _settle(self, t_s: float) -> None:
        self._state.offset_rad = self.at(t_s)[0]
        self._state.t_s = self._state.end_s = t_s

    def _clamped(self, offset_rad: Array) -> Array:
        limit_rad = self.params.offset_limit_rad
        clamped: Array = np.minimum(np.maximum(offset_rad, -limit_rad), limit_rad)
        return clamped
