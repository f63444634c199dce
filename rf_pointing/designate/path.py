"""The path that an antenna follows: continuous over every correction of the filter.

A correction moves the prediction at once; a beam cannot.  From the last time that was published
the path goes over to the new prediction within `BLEND_S`, by the quintic through both motions
(Earth-fixed position, velocity and acceleration).  What was published before stays as it was.
"""

from collections import deque
from typing import Any

import numpy as np

from rf_pointing.core import Array, Motion, Quintic
from rf_pointing.designate.motion import ReportedMotion
from rf_pointing.ephemeris.state_vector import StateVector

BLEND_S = 2.0
# Corrections that are remembered: those of some seconds.
KEPT_S = 10.0


class DesignatedPath:
    """A `TargetSource` in Earth-fixed axes that do not turn, made of predictions."""

    rotation_rate_rad_s, at_infinity, orientation = 0.0, False, None
    spans_t_s = ((-np.inf, np.inf),)
    node_step_s = 5.0

    def __init__(self, name: str, state: ReportedMotion) -> None:
        self.name, self.state = name, state
        # From when each part counts, its blend from then on, and its prediction.
        self._parts: deque[tuple[float, Quintic | None, ReportedMotion]] = deque(
            [(-np.inf, None, state)]
        )

    def renew(self, from_s: float, state: ReportedMotion) -> None:
        """Follow another prediction from a time on, which is later than all that was used."""
        # Only what is published later may change: a command once sent is being flown.
        end = state.motion_at(from_s + BLEND_S)
        blend = Quintic(self._at(from_s), end, BLEND_S)
        self.state = state
        self._parts.append((from_s, blend, state))
        while len(self._parts) > 1 and self._parts[1][0] < from_s - KEPT_S:
            self._parts.popleft()

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the motion at UTC `t_s`, float or (n,), seconds `ahead_s` of it."""
        if isinstance(t_s, float):
            position, velocity, acceleration = self._at(t_s + ahead_s)
        else:
            rows = [self._at(float(each) + ahead_s) for each in t_s]
            position, velocity, acceleration = (
                np.array(part).T for part in zip(*rows, strict=True)
            )
        # Light from a target of the air is under way for less than a millisecond: no jerk is seen.
        parts = (tuple(part) for part in (position, velocity, acceleration, 0.0 * acceleration))
        return StateVector(*parts)

    def warnings(self, _t_s: float) -> tuple[str, ...]:
        """Return nothing: what is doubtful is in the covariance."""
        return ()

    def covariance_m2(self, t_s: float) -> Array:
        """Return the covariance (3, 3) of the position."""
        return self.state.position_covariance_m2(t_s)

    def _at(self, t_s: float) -> Motion:
        from_s, blend, state = next(
            (part for part in reversed(self._parts) if t_s >= part[0]), self._parts[0]
        )
        if blend is not None and t_s - from_s < BLEND_S:
            return blend.at(t_s - from_s)
        return state.motion_at(t_s)
