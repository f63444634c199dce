"""Runs an LQG design on one axis; takes the place of `PositionLoop`, with the same calls.

The estimator works on deviations from the command and sees the command that really went out, so neither a saturated
drive nor a change of mode winds it up.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers.lqg_design import LqgDesign
from rf_pointing.controllers.notch import Notch, NotchState
from rf_pointing.controllers.rate_feedforward import FeedforwardState, RateFeedforward
from rf_pointing.controllers.section import Section, SectionState
from rf_pointing.core import Params, parameter, require_finite

__all__ = ["LqgLoop", "LqgLoopParams", "LqgLoopState"]


@dataclass(frozen=True, kw_only=True)
class LqgLoopParams(Params):
    """What may be changed while the law runs; the law itself is the design."""

    feedforward_gain: float = parameter(1.0, "share of the command's rate fed forward", low=0.0, high=1.2)
    feedforward_band_hz: float = parameter(10.0, "low-pass of the feedforward", low=0.1, high=100.0)
    feedforward_lead_s: float = parameter(0.0, "acceleration fed forward: lag to make up for", low=0.0, high=1.0)
    rate_limit_rad_s: float = parameter(math.radians(2.0), "largest rate command", low=1e-6, high=10.0)


@dataclass(slots=True)
class LqgLoopState:
    """Estimate (7,), latest error, regulator output and command, feedforward filter, section, notch."""

    estimate: NDArray[np.float64]
    error_rad: float = 0.0
    regulator_rad_s: float = 0.0
    command_rad_s: float = 0.0
    feedforward: FeedforwardState = field(default_factory=FeedforwardState)
    shaping: SectionState = field(default_factory=SectionState)
    notch: NotchState = field(default_factory=NotchState)


class LqgLoop:
    """One axis' LQG law; starts from a zero estimate."""

    def __init__(self, design: LqgDesign, params: LqgLoopParams) -> None:
        self._design, self._params = design, params
        self._shaping = Section(design.weights.shaping, design.sample_s)
        self._notch = Notch(design.weights.notch, design.sample_s)
        self._feedforward = RateFeedforward(params.feedforward_band_hz, design.sample_s)
        self._state = LqgLoopState(np.zeros(len(design.a)))
        self._update = np.hstack([design.a - design.observer_gain @ design.c, design.b, -design.observer_gain])

    @property
    def design(self) -> LqgDesign:
        """The design that runs."""
        return self._design

    @property
    def params(self) -> LqgLoopParams:
        """The parameter set in force."""
        return self._params

    @property
    def state(self) -> LqgLoopState:
        """A copy of the complete state."""
        return replace(
            self._state,
            estimate=self._state.estimate.copy(),
            feedforward=replace(self._feedforward.state),
            shaping=replace(self._shaping.state),
            notch=replace(self._notch.state),
        )

    @state.setter
    def state(self, state: LqgLoopState) -> None:
        self._notch.state, self._shaping.state = replace(state.notch), replace(state.shaping)
        self._feedforward.state = replace(state.feedforward)
        self._state = replace(state, estimate=state.estimate.copy())

    def retune(self, params: LqgLoopParams) -> None:
        """Take new parameters from the next sample on, without a jump: the estimate of the disturbance takes over."""
        taken = (self._params.feedforward_gain - params.feedforward_gain) * self._feedforward.state.filtered
        self._feedforward.retune(params.feedforward_band_hz)
        self._state.estimate += taken * self._constant_output()
        self._shaping.shift(taken)
        self._params = params

    def _constant_output(self) -> NDArray[np.float64]:
        """Return the change of the estimate (7,) with which the law gives one unit more, for good.

        Both filters of the estimate hold the unit; the disturbance, which acts where the rate does, explains it.
        """
        change = np.zeros(len(self._design.a))
        change[[3, 5]] = 1.0
        change[-1] = -(1.0 + float(self._design.state_gain[0] @ change)) / self._design.state_gain[0, -1]
        return change

    def reset(self, position_rad: float, velocity_rad_s: float, measured_rad: float, command_rad_s: float) -> None:
        """Start as if the law had been giving `command_rad_s` all along: the next output equals it (bumpless)."""
        for name, value in (("position_rad", position_rad), ("measured_rad", measured_rad)):
            require_finite(name, value)
        error = position_rad - measured_rad
        wanted = command_rad_s - self._params.feedforward_gain * velocity_rad_s
        gain = self._design.state_gain[0]
        estimate = wanted * self._constant_output()
        estimate[0] = -error
        estimate[-1] += gain[0] * error / gain[-1]
        self._state = LqgLoopState(estimate, error, wanted, command_rad_s)
        self._feedforward.reset(velocity_rad_s)
        self._shaping.reset(wanted)
        self._notch.reset(command_rad_s)

    def output(
        self, position_rad: float, velocity_rad_s: float, measured_rad: float, acceleration_rad_s2: float = 0.0
    ) -> float:
        """Return the rate command in rad/s, within the rate limit.

        Raises
        ------
        ValueError
            For a non-finite input.
        """
        for name, value in (("position_rad", position_rad), ("velocity_rad_s", velocity_rad_s)):
            require_finite(name, value)
        require_finite("measured_rad", measured_rad)
        require_finite("acceleration_rad_s2", acceleration_rad_s2)
        params, state = self._params, self._state
        state.error_rad = position_rad - measured_rad
        state.regulator_rad_s = -float(self._design.state_gain[0] @ state.estimate)
        fed = self._feedforward.output(velocity_rad_s + params.feedforward_lead_s * acceleration_rad_s2)
        shaped = self._shaping.output(state.regulator_rad_s)
        state.command_rad_s = self._notch.output(shaped + params.feedforward_gain * fed)
        return min(max(state.command_rad_s, -params.rate_limit_rad_s), params.rate_limit_rad_s)

    def update(self, dt_s: float, applied_rad_s: float) -> None:
        """Advance to the next sample; `applied_rad_s` is the command that really went out.

        Raises
        ------
        ValueError
            If `dt_s` is not the sampling time of the design.
        """
        require_finite("applied_rad_s", applied_rad_s)
        if abs(dt_s - self._design.sample_s) > 1e-6:
            raise ValueError(f"dt_s={dt_s} must be {self._design.sample_s}, the sampling time of the design")
        state = self._state
        really = state.regulator_rad_s + applied_rad_s - state.command_rad_s
        state.estimate = self._update @ np.concatenate([state.estimate, (really, state.error_rad)])
        self._feedforward.update(dt_s)
        self._shaping.update(dt_s)
        self._notch.update(dt_s)
