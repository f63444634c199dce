"""The command's rate on its way to the drive: F(s) = 1 / (1 + s / w_b), by the bilinear transform.

The band limit w_b is part of the loop: it moves every stability limit of the radio loop around it (docs/math).
"""

import math
from dataclasses import dataclass

from rf_pointing.core import require_between

__all__ = ["FeedforwardState", "RateFeedforward"]


@dataclass(slots=True)
class FeedforwardState:
    """Filtered rate and input of the sample before, the same of the present sample, and the step between them."""

    filtered: float = 0.0
    input: float = 0.0
    pending_filtered: float = 0.0
    pending_input: float = 0.0
    dt_s: float = 0.02


class RateFeedforward:
    """Low-pass of the rate: `output` at a sample, then `update` with the time to the next one."""

    def __init__(self, band_hz: float, dt_s: float = 0.02) -> None:
        self.state = FeedforwardState(dt_s=dt_s)
        self.retune(band_hz)

    def retune(self, band_hz: float) -> None:
        """Take a new band limit from the next sample on."""
        require_between("band_hz", band_hz, 1e-3, 1e4)
        self._band_hz = band_hz

    def reset(self, rate_rad_s: float) -> None:
        """Settle on a constant rate."""
        self.state = FeedforwardState(rate_rad_s, rate_rad_s, rate_rad_s, rate_rad_s, self.state.dt_s)

    def output(self, rate_rad_s: float) -> float:
        """Return the filtered rate of this sample."""
        state = self.state
        half = math.pi * self._band_hz * state.dt_s
        total = state.input + rate_rad_s
        state.pending_filtered = ((1.0 - half) * state.filtered + half * total) / (1.0 + half)
        state.pending_input = rate_rad_s
        return state.pending_filtered

    def update(self, dt_s: float) -> None:
        """Commit the sample; the next one comes `dt_s` later."""
        state = self.state
        state.filtered, state.input, state.dt_s = state.pending_filtered, state.pending_input, dt_s
