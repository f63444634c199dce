"""Simulated second stage: latency, rate limit, first-order loop, end stops; both directions alike.

    d' = 2 pi f_b (u(t - latency) - d),   |d'| <= rate,   |d| <= travel

exact for commands that are held, at any time step.
"""

import copy
import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import require_between
from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.core.types import Array


@dataclass(slots=True)
class StagePlantState:
    """Time, deflection (2,), and the commands in force and on their way: due time, (2,)."""

    t_s: float
    deflection_rad: Array
    commands: tuple[tuple[float, Array], ...]


class StagePlant:
    """One stage, at rest in its centre; `command` it, then `step` it."""

    problem = ""

    def __init__(self, params: SecondStageParams) -> None:
        self.params = params
        self._state = StagePlantState(0.0, np.zeros(2), ((-math.inf, np.zeros(2)),))

    @property
    def state(self) -> StagePlantState:
        """A copy of the complete state."""
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: StagePlantState) -> None:
        self._state = copy.deepcopy(state)

    @property
    def deflection_rad(self) -> Array:
        """Deflection (2,) of the beam."""
        return self._state.deflection_rad.copy()

    def command(self, deflection_rad: Array) -> None:
        """Command a deflection (2,); it acts after the latency."""
        due_s = self._state.t_s + self.params.latency_s
        self._state.commands = (*self._state.commands, (due_s, np.array(deflection_rad)))

    def step(self, dt_s: float) -> None:
        """Advance by `dt_s`, within (0, 1] s."""
        require_between("dt_s", dt_s, 1e-6, 1.0)
        state, end_s = self._state, self._state.t_s + dt_s
        while True:
            (_, wanted), *later = state.commands
            until_s = min(end_s, later[0][0]) if later else end_s
            if until_s > state.t_s:
                state.deflection_rad = self._towards(wanted, until_s - state.t_s)
                state.t_s = until_s
            if not later or later[0][0] > end_s:
                return
            state.commands = tuple(later)

    def _towards(self, wanted: Array, dt_s: float) -> Array:
        """Return the deflection after `dt_s` of a held command, at the rate first where far off."""
        params, pole = self.params, 2.0 * math.pi * self.params.bandwidth_hz
        away = np.clip(wanted, -params.travel_rad, params.travel_rad) - self._state.deflection_rad
        near = params.rate_rad_s / pole
        slewing_s = np.minimum(np.maximum(np.abs(away) - near, 0.0) / params.rate_rad_s, dt_s)
        rest = away - np.sign(away) * params.rate_rad_s * slewing_s
        return np.asarray(
            self._state.deflection_rad + away - rest * np.exp(-pole * (dt_s - slewing_s))
        )
