"""Position loop of one axis: PI on the encoder, rate feedforward, notch, anti-windup.

    u = N(s) [ S(s) (k_p e + k_i int(e)) + F(s) r' ],   e = r - measured        (BWG Fig. 1, 16)

with N the notch and S, beyond the paper and off by default, a second-order section for the feedback
alone.

The feedforward takes the rate of the command from the trajectory (never by differencing) through a
low-pass at the band limit; optionally the acceleration, led by the lag of the drive.  Use:
`output(...)`, then `update(dt_s, applied)` with the command the drive really got.
"""

import math
from dataclasses import dataclass, field, replace

from rf_pointing.controllers.filters import (
    FeedforwardState,
    RateFeedforward,
    Section,
    SectionParams,
    SectionState,
    notch_section,
)
from rf_pointing.core import Params, parameter, require_between, require_finite


@dataclass(frozen=True, kw_only=True)
class PositionLoopParams(Params):
    """Gains and limits of one axis."""

    proportional_gain: float = parameter(0.5, "k_p in (rad/s)/rad", low=0.0, high=50.0)
    integral_gain: float = parameter(1.8, "k_i in (rad/s)/(rad s)", low=0.0, high=500.0)
    feedforward_gain: float = parameter(1.0, "share of the command's rate fed forward", low=0.0, high=1.2)
    feedforward_band_hz: float = parameter(10.0, "low-pass of the feedforward", low=0.1, high=100.0)
    feedforward_lead_s: float = parameter(0.0, "acceleration fed forward: lag to make up for", low=0.0, high=1.0)
    notch_enabled: bool = parameter(True, "whether the notch acts")
    notch_frequency_hz: float = parameter(2.12, "notch frequency", low=0.01, high=500.0)
    notch_damping: float = parameter(0.2, "notch width delta", low=0.001, high=2.0)
    shaping_enabled: bool = parameter(False, "whether the section S acts on the feedback")
    shaping_zero_hz: float = parameter(2.0, "frequency of its zeros", low=0.01, high=500.0)
    shaping_zero_damping: float = parameter(0.5, "damping of its zeros", low=0.0, high=5.0)
    shaping_pole_hz: float = parameter(4.0, "frequency of its poles", low=0.01, high=500.0)
    shaping_pole_damping: float = parameter(0.5, "damping of its poles", low=0.001, high=5.0)
    rate_limit_rad_s: float = parameter(math.radians(2.0), "largest rate command", low=1e-6, high=10.0)
    drive_lag_s: float = parameter(0.06, "lag of the rate loop with half a sample", low=0.0, high=1.0)

    def check_together(self) -> None:
        """Refuse gains that no drive of this lag could follow."""
        # s^3 lag + s^2 + k_p s + k_i is stable for k_p > k_i lag (Routh).
        lag_s = self.drive_lag_s
        if self.notch_enabled:
            lag_s += self.notch_damping / (math.pi * self.notch_frequency_hz)
        if self.shaping_enabled:
            lag_s += self.shaping_pole_damping / (math.pi * self.shaping_pole_hz)
            lag_s -= self.shaping_zero_damping / (math.pi * self.shaping_zero_hz)
        bound = self.integral_gain * lag_s
        if self.integral_gain > 0.0 and self.proportional_gain <= bound:
            raise ValueError(
                f"proportional_gain={self.proportional_gain} must be > {bound:.4g} "
                f"(integral_gain={self.integral_gain} times the lag {lag_s:.3f} s), the loop would be unstable"
            )

    @property
    def shaping(self) -> SectionParams:
        """The shaping section's own parameter set."""
        return SectionParams(
            enabled=self.shaping_enabled,
            zero_hz=self.shaping_zero_hz,
            zero_damping=self.shaping_zero_damping,
            pole_hz=self.shaping_pole_hz,
            pole_damping=self.shaping_pole_damping,
        )

    @property
    def notch(self) -> SectionParams:
        """The notch's own parameter set."""
        return notch_section(self.notch_frequency_hz, self.notch_damping, enabled=self.notch_enabled)


@dataclass(slots=True)
class PositionLoopState:
    """Integral (rad s), latest error and command, and the filters."""

    integral_rad_s: float = 0.0
    error_rad: float = 0.0
    command_rad_s: float = 0.0
    feedforward: FeedforwardState = field(default_factory=FeedforwardState)
    shaping: SectionState = field(default_factory=SectionState)
    notch: SectionState = field(default_factory=SectionState)


class PositionLoop:
    """One axis' position loop; starts with everything at zero."""

    def __init__(self, params: PositionLoopParams, dt_s: float = 0.02) -> None:
        self.params = params
        self._shaping, self._notch = Section(params.shaping, dt_s), Section(params.notch, dt_s)
        self._feedforward = RateFeedforward(params.feedforward_band_hz, dt_s)
        self._state = PositionLoopState()

    @property
    def state(self) -> PositionLoopState:
        """A copy of the complete state."""
        return replace(
            self._state,
            feedforward=replace(self._feedforward.state),
            shaping=replace(self._shaping.state),
            notch=replace(self._notch.state),
        )

    @state.setter
    def state(self, state: PositionLoopState) -> None:
        shaping, notch = (
            Section(self.params.shaping, state.shaping.dt_s),
            Section(self.params.notch, state.notch.dt_s),
        )
        shaping.state, notch.state = replace(state.shaping), replace(state.notch)
        self._feedforward.state = replace(state.feedforward)
        self._shaping, self._notch, self._state = shaping, notch, replace(state)

    def retune(self, params: PositionLoopParams) -> None:
        """Take new parameters without a jump of the command; all of them or, with ValueError, none.

        The integral is shifted so that k_p e + k_i int(e) stays what it was, plus what the
        feedforward no longer gives; with k_i = 0 there is none to shift.
        """
        # The notch may be refused after the section was changed: then the section goes back, so
        # that nothing has changed.
        before = self._shaping.params
        self._shaping.retune(params.shaping)
        try:
            self._notch.retune(params.notch)
        except ValueError:
            self._shaping.retune(before)
            raise
        self._feedforward.retune(params.feedforward_band_hz)
        state, old = self._state, self.params
        if params.integral_gain > 0.0:
            # The sum of both parts stays; only their shares change.
            held = (old.proportional_gain - params.proportional_gain) * state.error_rad
            taken = (old.feedforward_gain - params.feedforward_gain) * self._feedforward.state.filtered
            state.integral_rad_s = (old.integral_gain * state.integral_rad_s + held + taken) / params.integral_gain
            self._shaping.shift(taken)
        else:
            state.integral_rad_s = 0.0
        self.params = params

    def reset(self, position_rad: float, velocity_rad_s: float, measured_rad: float, command_rad_s: float) -> None:
        """Start as if the loop had been giving `command_rad_s`: the next output equals it.

        Without integral gain only the filters are settled and the output is that of the
        proportional part.
        """
        for name, value in (("position_rad", position_rad), ("measured_rad", measured_rad)):
            require_finite(name, value)
        params, error = self.params, position_rad - measured_rad
        feedforward = params.feedforward_gain * velocity_rad_s
        rest = command_rad_s - params.proportional_gain * error - feedforward
        integral = rest / params.integral_gain if params.integral_gain > 0.0 else 0.0
        self._state = PositionLoopState(integral, error, command_rad_s)
        self._feedforward.reset(velocity_rad_s)
        self._shaping.reset(command_rad_s - feedforward)
        self._notch.reset(command_rad_s)

    def output(
        self,
        position_rad: float,
        velocity_rad_s: float,
        measured_rad: float,
        acceleration_rad_s2: float = 0.0,
    ) -> float:
        """Return the rate command in rad/s, within the rate limit.

        Raises
        ------
        ValueError
            For a non-finite input.
        """
        require_finite("position_rad", position_rad)
        require_finite("velocity_rad_s", velocity_rad_s)
        require_finite("measured_rad", measured_rad)
        require_finite("acceleration_rad_s2", acceleration_rad_s2)
        params, state = self.params, self._state
        state.error_rad = position_rad - measured_rad
        rate = velocity_rad_s + params.feedforward_lead_s * acceleration_rad_s2
        fed_back = params.proportional_gain * state.error_rad + params.integral_gain * state.integral_rad_s
        raw = self._shaping.output(fed_back) + params.feedforward_gain * self._feedforward.output(rate)
        state.command_rad_s = self._notch.output(raw)
        return min(max(state.command_rad_s, -params.rate_limit_rad_s), params.rate_limit_rad_s)

    def update(self, dt_s: float, applied_rad_s: float) -> None:
        """Advance by `dt_s` to the next sample; `applied_rad_s` is the command that went out.

        What was cut off is taken back from the integral with the time constant k_p / k_i
        (anti-windup).
        """
        require_between("dt_s", dt_s, 1e-5, 1.0)
        require_finite("applied_rad_s", applied_rad_s)
        params, state = self.params, self._state
        if params.integral_gain > 0.0:
            # What really went out counts: wherever the command is cut, the integral does not wind
            # up.
            cut = applied_rad_s - state.command_rad_s
            back = cut / params.proportional_gain if params.proportional_gain > 0.0 else 0.0
            state.integral_rad_s += dt_s * (state.error_rad + back)
        self._feedforward.update(dt_s)
        self._shaping.update(dt_s)
        self._notch.update(dt_s)
