"""What the mount's lags make of corrections: the beam stays behind an offset as it does behind the target.

For the target's own motion the lags are commanded along (`axis_path`).  An offset o that the loop or a search adds is
commanded as o + lag(o), with the history of its own rates.  Without that the beam stands beside where it was sent by up to
a fifth of o for a lag of 1.9 s and T = 5 s, and swings for half a minute.  The encoders are read against the prediction with
lag(o) in it.  The rates are averaged over T: no quick correction shakes the antenna.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel, LagHistory, LagState
from rf_pointing.core import Motion

__all__ = ["CorrectionLag"]

Array = NDArray[np.float64]


class CorrectionLag:
    """Follows the offsets that are commanded, in axis angles; `averaging_s` of 0 leads nothing."""

    def __init__(self, averaging_s: float) -> None:
        self.averaging_s = averaging_s
        self.restart()

    def restart(self) -> None:
        """Begin a pass: the axes wait on the prediction."""
        self._commanded: LagState | None = None

    def lead(self, times: Array, rate_rad_s: Array, model: BiasModel) -> Motion:
        """Return what to add (n, 2) to the axes' motion for offsets that move at these rates (n, 2) at `times` (n,).

        The rate at the first time is what will be commanded then; the others may change with the next call.
        """
        still = np.zeros_like(rate_rad_s)
        if not self.averaging_s > 0.0 or not model.has_lags:
            return Motion(still, still, still)
        parts, states = LagHistory(model, self.averaging_s).along(times, rate_rad_s, still, self._commanded)
        self._commanded = states[0]
        return Motion(*parts)
