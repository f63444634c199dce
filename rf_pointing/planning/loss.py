"""What a crossing of the zenith costs: time off the target, signal, decibels."""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.planning.crossing import Crossing, Gain

__all__ = ["DEEPEST_DB", "HALF_POWER_DB", "PassLoss"]

HALF_POWER_DB = 3.0
DEEPEST_DB = 60.0
"""Loss beyond which only "more than" is meant; a Gaussian beam has no sidelobes."""
OFF_TARGET = 0.05
"""Share of the largest error from which the beam counts as off the target."""


@dataclass(frozen=True, slots=True)
class PassLoss:
    """Seconds off the target, below half power, and of signal lost (integral of 1 - gain); peak and mean loss in dB."""

    off_s: float = 0.0
    below_s: float = 0.0
    signal_s: float = 0.0
    peak_db: float = 0.0
    mean_db: float = 0.0

    @classmethod
    def of(cls, crossing: Crossing | None, duration_s: float, gain: Gain) -> "PassLoss":
        """Return the loss of a pass of this duration."""
        if crossing is None:
            return cls()
        step_s = float(crossing.t_s[1] - crossing.t_s[0])
        received = gain(crossing.error_rad)
        signal_s = float(np.sum(1.0 - received) * step_s)
        return cls(
            off_s=float(np.sum(crossing.error_rad > OFF_TARGET * np.max(crossing.error_rad)) * step_s),
            below_s=float(np.sum(received < 10.0 ** (-HALF_POWER_DB / 10.0)) * step_s),
            signal_s=signal_s,
            peak_db=-10.0 * math.log10(max(float(received.min()), 10.0 ** (-DEEPEST_DB / 10.0))),
            mean_db=-10.0 * math.log10(max(1.0 - signal_s / duration_s, 1e-6)),
        )
