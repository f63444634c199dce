"""Notch filter in the rate command, retunable while it runs.

    G_f(s) = (s^2 + w^2) / (s^2 + 2 delta w s + w^2)                                            (BWG eq. 8)

discretised by the bilinear transform prewarped at w, so the zero stays at w at any sampling rate (unwarped it would
sit at 1.87 Hz for 2.12 Hz at 10 Hz).  The two states are the low-pass and band-pass outputs of a state-variable
filter: they keep their meaning when the frequency, the damping or the step changes, so a retune makes no jump.
"""

import math
from dataclasses import dataclass

from rf_pointing.geometry import Params, parameter, require_between, require_finite

__all__ = ["Notch", "NotchParams", "NotchState"]


@dataclass(frozen=True, kw_only=True)
class NotchParams(Params):
    """Centre, width and switch of the notch."""

    enabled: bool = parameter(True, "whether the notch acts")
    frequency_hz: float = parameter(2.12, "notch frequency", low=0.01, high=500.0)
    damping: float = parameter(0.2, "width delta: the -3 dB band is 2 delta times the frequency", low=0.001, high=2.0)


@dataclass(slots=True)
class NotchState:
    """Band-pass and low-pass memory, the latest input, and the step at whose end the next output falls."""

    band: float = 0.0
    low: float = 0.0
    input: float = 0.0
    dt_s: float = 0.02


class Notch:
    """Notch filter: `output(x)` at a sample, then `update(dt_s)` with the time to the next one."""

    def __init__(self, params: NotchParams, dt_s: float = 0.02) -> None:
        self.state = NotchState()
        self._params = params
        self._prepare(params, dt_s)

    @property
    def params(self) -> NotchParams:
        """The parameter set in force."""
        return self._params

    def retune(self, params: NotchParams) -> None:
        """Take new parameters; refused, with the old ones kept, if the notch is at or above half the sampling rate."""
        self._prepare(params, self.state.dt_s)
        self._params = params

    def reset(self, value: float) -> None:
        """Settle on a constant input."""
        require_finite("value", value)
        self.state = NotchState(0.0, value, value, self.state.dt_s)

    def output(self, value: float) -> float:
        """Return the filtered value; remembers the input for `update`."""
        self.state.input = value
        if not self._params.enabled:
            return value
        return value - 2.0 * self._params.damping * self._band_output()

    def update(self, dt_s: float) -> None:
        """Commit the sample given to `output`; the next one comes `dt_s` later."""
        state = self.state
        if self._params.enabled:
            band = self._band_output()
            low = state.low + self._g * band
            state.band, state.low = 2.0 * band - state.band, low + self._g * band
        else:
            state.band, state.low = 0.0, state.input
        if dt_s != state.dt_s:
            self._prepare(self._params, dt_s)

    def _band_output(self) -> float:
        state = self.state
        return (self._g * (state.input - state.low) + state.band) * self._h

    def _prepare(self, params: NotchParams, dt_s: float) -> None:
        require_between("dt_s", dt_s, 1e-5, 10.0)
        nyquist_hz = 0.5 / dt_s
        if params.enabled and params.frequency_hz >= nyquist_hz:
            raise ValueError(f"frequency_hz={params.frequency_hz} must be < {nyquist_hz} (half the sampling rate)")
        self._g = math.tan(math.pi * params.frequency_hz * dt_s) if params.enabled else 0.0
        self._h = 1.0 / (1.0 + self._g * (self._g + 2.0 * params.damping))
        self.state.dt_s = dt_s
