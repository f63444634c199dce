"""Position loop of one axis: PI on the encoder, rate feedforward, notch, anti-windup.

    u = N(s) [ S(s) (k_p e + k_i int(e)) + F(s) r' ],   e = r - measured        (BWG Fig. 1, 16)

with N the notch and S, beyond the paper and off by default, a second-order section for the feedback
alone.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers.filters import LawMatrices, Section, SectionParams, before_sections, notch_section
from rf_pointing.controllers.position_law import LawState, PositionLaw
from rf_pointing.core import Params, parameter, require_between

FEEDFORWARD_LAG_S = 1.0 / (2.0 * math.pi * 10.0)
"""Lag of the low-pass of the feedforward, which the feedforward leads as well."""


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
    peak_sensitivity: float = parameter(
        0.0, "peak of |S| tuned for; 1.25 times as much is refused; 0: unknown", low=0.0, high=10.0
    )
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

    def matrices(self, sample_s: float) -> LawMatrices:
        """Return the loop from error to rate command, sampled; its feedforward lies outside."""
        integral, direct = np.array([[self.integral_gain]]), np.array([[self.proportional_gain]])
        law = np.eye(1), np.array([[sample_s]]), integral, direct
        return before_sections(law, (self.shaping, self.notch), sample_s)


@dataclass(slots=True, kw_only=True)
class PositionLoopState(LawState):
    """State of every law, and the integral (rad s)."""

    integral_rad_s: float = 0.0


class PositionLoop(PositionLaw[PositionLoopParams, PositionLoopState]):
    """One axis' position loop; starts with everything at zero."""

    def __init__(self, params: PositionLoopParams, dt_s: float = 0.02) -> None:
        state = PositionLoopState()
        super().__init__(params, state, params.shaping, params.notch, params.feedforward_band_hz, dt_s)

    def retune(self, params: PositionLoopParams) -> None:
        """Take new parameters without a jump of the command; all of them or, with ValueError, none.

        The integral is shifted so that k_p e + k_i int(e) stays what it was, plus what the
        feedforward no longer gives; with k_i = 0 nothing is shifted.
        """
        # The notch may be refused after the section was changed: both are tried before either is
        # taken.
        for section in (params.shaping, params.notch):
            Section(section, self._notch.state.dt_s)
        self._shaping.retune(params.shaping)
        self._notch.retune(params.notch)
        self._feedforward.retune(params.feedforward_band_hz)
        state, old = self._state, self.params
        if params.integral_gain > 0.0:
            # The sum of both parts stays; only their shares change.
            held = (old.proportional_gain - params.proportional_gain) * state.error_rad
            taken = (old.feedforward_gain - params.feedforward_gain) * self._feedforward.state.memory[0]
            state.integral_rad_s = (old.integral_gain * state.integral_rad_s + held + taken) / params.integral_gain
            self._shaping.shift(taken)
        self.params = params

    def _settled(self, error_rad: float, command_rad_s: float, fed_rad_s: float) -> PositionLoopState:
        params = self.params
        rest = command_rad_s - params.proportional_gain * error_rad - fed_rad_s
        # Without integral gain only the filters are settled; the output is that of the proportional
        # part.
        integral = rest / params.integral_gain if params.integral_gain > 0.0 else 0.0
        return PositionLoopState(error_rad=error_rad, command_rad_s=command_rad_s, integral_rad_s=integral)

    def _feedback(self) -> float:
        params, state = self.params, self._state
        return params.proportional_gain * state.error_rad + params.integral_gain * state.integral_rad_s

    def _advance(self, dt_s: float, applied_rad_s: float) -> None:
        if not 1e-5 <= dt_s <= 1.0:
            require_between("dt_s", dt_s, 1e-5, 1.0)
        params, state = self.params, self._state
        if params.integral_gain > 0.0:
            # What was cut off is taken back with the time constant k_p / k_i: wherever the command
            # is cut, the integral does not wind up.
            cut = applied_rad_s - state.command_rad_s
            back = cut / params.proportional_gain if params.proportional_gain > 0.0 else 0.0
            state.integral_rad_s += dt_s * (state.error_rad + back)
