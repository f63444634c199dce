"""Where the beam really was: encoder angles against a commanded direction, at the time of a radio measurement.

Both arrive as streams of their own and are interpolated linearly.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import JointReading
from rf_pointing.core.time_buffer import TimeBuffer

__all__ = ["BeamPosition"]

Array = NDArray[np.float64]


class BeamPosition:
    """Offset of the beam from the commanded direction, on the sky, over the last seconds."""

    def __init__(self) -> None:
        self._joints, self._centre = TimeBuffer(), TimeBuffer()

    def clear(self) -> None:
        """Forget everything, for a new pass."""
        self._joints.clear()
        self._centre.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints.add(reading.t_s, reading.position_rad)

    def take_centre(self, t_s: float, direction_rad: Array) -> None:
        """Note the commanded direction (2,), axis angles."""
        self._centre.add(t_s, direction_rad)

    def too_old(self, t_s: float) -> bool:
        """Whether `t_s` lies before all that is known, so that its offset will never be."""
        return any(bool(series.times) and t_s < series.times[0] for series in (self._joints, self._centre))

    def offset(self, t_s: float) -> Array | None:
        """Return cross-elevation and elevation (2,) of the beam from the direction, None when `t_s` is not covered."""
        joints, centre = self._joints.at(t_s), self._centre.at(t_s)
        if joints is None or centre is None:
            return None
        away: Array = (joints - centre) * np.array([math.cos(float(joints[1])), 1.0])
        return away
