"""Law of a second stage: it takes what the mount leaves of the command.

    e = command - encoder,   d = sum_k p_k e(n - k)   within travel and rate

The mount never sees the deflection: its own integral brings e, and with it d, to zero.  That is the
offload, and the loop of the mount stays what it was.  The taps p predict e over the latency of the
stage (`station/antenna/stage_design.py`).

Where the mount is too far off for longer than `hand_back_s`, the stage returns to its
centre at its rate, and follows again once e has been within half of its travel for as long.
"""

import copy
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import as_finite_array, require_between
from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.core.types import Array

RESUMED = 0.5
"""Share of the travel within which the mount is near enough for the stage to follow again."""


@dataclass(slots=True)
class SecondStageState:
    """Newest residuals (n, 2), command (2,), and since when the other mode is due."""

    residual_rad: Array
    command_rad: Array
    handed_back: bool = False
    due_s: float = 0.0


class SecondStage:
    """The law of both directions; `taps` (n, 2) act on the newest residual first."""

    def __init__(self, params: SecondStageParams, taps: Array) -> None:
        self.params, self._taps = params, taps
        self._state = SecondStageState(np.zeros(taps.shape), np.zeros(2))

    @property
    def state(self) -> SecondStageState:
        """A copy of the complete state."""
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: SecondStageState) -> None:
        self._state = copy.deepcopy(state)

    def step(self, residual_rad: Array, dt_s: float, *, follow: bool) -> Array:
        """Return the deflection (2,) to command for the next `dt_s`.

        `residual_rad` (2,) is command minus encoder on the sky; without `follow` the stage goes to
        its centre.  Raises ValueError for numbers that are not finite or a time out of (0, 1] s.
        """
        residual = as_finite_array("residual_rad", residual_rad, (2,))
        require_between("dt_s", dt_s, 1e-6, 1.0)
        state, travel = self._state, self.params.travel_rad
        state.residual_rad = np.vstack([residual, state.residual_rad[:-1]])
        wanted = np.sum(self._taps * state.residual_rad, axis=0)
        self._judge(residual, wanted, dt_s)
        if not follow or state.handed_back:
            wanted = np.zeros(2)
        largest = self.params.rate_rad_s * dt_s
        moved = np.clip(np.clip(wanted, -travel, travel) - state.command_rad, -largest, largest)
        state.command_rad = state.command_rad + moved
        return state.command_rad.copy()

    def _judge(self, residual: Array, wanted: Array, dt_s: float) -> None:
        """Leave the mount alone, or follow again, once that has been due for long enough."""
        state, travel = self._state, self.params.travel_rad
        if state.handed_back:
            due = float(np.max(np.abs(residual))) <= RESUMED * travel
        else:
            due = float(np.max(np.abs(wanted))) > travel
        state.due_s = state.due_s + dt_s if due else 0.0
        # Sums of ticks: one that is due must not wait for a rounding error.
        if state.due_s >= self.params.hand_back_s - 1e-9:
            state.handed_back, state.due_s = not state.handed_back, 0.0
