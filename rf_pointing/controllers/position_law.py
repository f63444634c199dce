"""Parts of every position law around its feedback: the filters, the feedforward, the rate limit.

    u = N(s) [ S(s) feedback + k_f F(s) r' ]

The feedforward takes the rate of the command from the trajectory (never by differencing) through a
low-pass at the band limit; optionally the acceleration, led by the lag of the drive.
"""

import copy
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

from rf_pointing.controllers.filters import FilterState, RateFeedforward, Section, SectionParams
from rf_pointing.core import require_finite


class LawParams(Protocol):
    """The parameters that every law has."""

    @property
    def feedforward_gain(self) -> float: ...
    @property
    def feedforward_lead_s(self) -> float: ...
    @property
    def rate_limit_rad_s(self) -> float: ...


@dataclass(slots=True, kw_only=True)
class LawState:
    """Latest error and command; in a copy also the feedforward, the section and the notch."""

    error_rad: float = 0.0
    command_rad_s: float = 0.0
    filters: tuple[FilterState, ...] = ()


P = TypeVar("P", bound=LawParams)
S = TypeVar("S", bound=LawState)


class PositionLaw(ABC, Generic[P, S]):
    """One axis' law: `output(...)`, then `update(dt_s, applied)` with the command that went out."""

    def __init__(
        self, params: P, state: S, shaping: SectionParams, notch: SectionParams, band_hz: float, dt_s: float
    ) -> None:
        self.params = params
        self._state = state
        self._shaping, self._notch = Section(shaping, dt_s), Section(notch, dt_s)
        self._feedforward = RateFeedforward(band_hz, dt_s)

    @property
    def state(self) -> S:
        """A copy of the complete state."""
        filters = self._feedforward.state, self._shaping.state, self._notch.state
        return copy.deepcopy(replace(self._state, filters=filters))

    @state.setter
    def state(self, state: S) -> None:
        self._state = copy.deepcopy(state)
        self._feedforward.state, shaping, notch = self._state.filters
        for section, kept in ((self._shaping, shaping), (self._notch, notch)):
            # The constants belong to the step of the state.
            section.update(kept.dt_s)
            section.state = kept

    @abstractmethod
    def retune(self, params: P) -> None:
        """Take new parameters without a jump of the command."""

    @abstractmethod
    def _settled(self, error_rad: float, command_rad_s: float, fed_rad_s: float) -> S:
        """Return the state in which the feedback gives the command less what is fed forward."""

    @abstractmethod
    def _feedback(self) -> float:
        """Return the feedback (rad/s) on the latest error."""

    @abstractmethod
    def _advance(self, dt_s: float, applied_rad_s: float) -> None:
        """Advance the feedback by `dt_s`; the command that went out counts, not the one given."""

    def reset(self, position_rad: float, velocity_rad_s: float, measured_rad: float, command_rad_s: float) -> None:
        """Start as if the law had been giving `command_rad_s`: the next output equals it."""
        require_finite("position_rad", position_rad)
        require_finite("measured_rad", measured_rad)
        fed = self.params.feedforward_gain * velocity_rad_s
        self._state = self._settled(position_rad - measured_rad, command_rad_s, fed)
        self._feedforward.reset(velocity_rad_s)
        self._shaping.reset(command_rad_s - fed)
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
        if not math.isfinite(position_rad + velocity_rad_s + measured_rad + acceleration_rad_s2):
            require_finite("position_rad", position_rad)
            require_finite("velocity_rad_s", velocity_rad_s)
            require_finite("measured_rad", measured_rad)
            require_finite("acceleration_rad_s2", acceleration_rad_s2)
        params, state = self.params, self._state
        state.error_rad = position_rad - measured_rad
        fed = self._feedforward.output(velocity_rad_s + params.feedforward_lead_s * acceleration_rad_s2)
        shaped = self._shaping.output(self._feedback())
        state.command_rad_s = command = self._notch.output(shaped + params.feedforward_gain * fed)
        limit = params.rate_limit_rad_s
        return -limit if command < -limit else command if command < limit else limit

    def update(self, dt_s: float, applied_rad_s: float) -> None:
        """Advance by `dt_s` to the next sample; `applied_rad_s` is the command that went out."""
        if not math.isfinite(applied_rad_s):
            require_finite("applied_rad_s", applied_rad_s)
        self._advance(dt_s, applied_rad_s)
        self._feedforward.update(dt_s)
        self._shaping.update(dt_s)
        self._notch.update(dt_s)
