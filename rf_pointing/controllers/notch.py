"""Notch filter in the rate command, retunable while it runs.

    G_f(s) = (s^2 + w^2) / (s^2 + 2 delta w s + w^2)                                            (BWG eq. 8)

the section whose zeros lie undamped at the frequency of its poles.  Prewarped there: unwarped, a 2.12-Hz notch sampled
at 10 Hz would sit at 1.87 Hz.
"""

from dataclasses import dataclass

from rf_pointing.controllers.section import Section, SectionParams, SectionState
from rf_pointing.core import Params, parameter

__all__ = ["Notch", "NotchParams", "NotchState"]

NotchState = SectionState


@dataclass(frozen=True, kw_only=True)
class NotchParams(Params):
    """Centre, width and switch of the notch."""

    enabled: bool = parameter(True, "whether the notch acts")
    frequency_hz: float = parameter(2.12, "notch frequency", low=0.01, high=500.0)
    damping: float = parameter(0.2, "width delta: the -3 dB band is 2 delta times the frequency", low=0.001, high=5.0)

    @property
    def section(self) -> SectionParams:
        """The notch as a second-order section."""
        return SectionParams(
            enabled=self.enabled, zero_hz=self.frequency_hz, pole_hz=self.frequency_hz, pole_damping=self.damping
        )


class Notch(Section):
    """Notch filter: `output(x)` at a sample, then `update(dt_s)` with the time to the next one."""

    def __init__(self, params: NotchParams, dt_s: float = 0.02) -> None:
        super().__init__(params.section, dt_s)
        self._notch = params

    @property
    def notch(self) -> NotchParams:
        """The parameter set in force."""
        return self._notch

    def retune_notch(self, params: NotchParams) -> None:
        """Take new parameters; refused, with the old ones kept, if the notch is at or above half the sampling rate."""
        self.retune(params.section)
        self._notch = params
