"""Bookkeeping of one pass: how long a sensor held the target, and how well it says it did."""

import math
from dataclasses import dataclass

from rf_pointing.core import Mode, PointingError
from rf_pointing.tracking.sensors import SENSORS

__all__ = ["PassStatistics"]


@dataclass
class PassStatistics:
    """Sums over the periods of a pass, from acquisition to loss of signal."""

    tracked_s: float = 0.0
    lost_s: float = 0.0
    samples: int = 0
    square_cross_elevation_rad2: float = 0.0
    square_elevation_rad2: float = 0.0
    reason: str = ""
    last_mode: str = ""

    def count(self, period_s: float, mode: str, error: PointingError | None, risen: bool) -> None:
        """Add one period; while a sensor tracks, time without a valid error is lost time."""
        if not risen:
            return
        sensor = SENSORS.get(mode)
        # A scan goes on through an invalid estimate; a continuous sensor without a valid error holds nothing.
        held = sensor is not None and (sensor.scans or (error is not None and error.valid))
        if mode == Mode.PROGRAM_TRACK:
            self.tracked_s += period_s
        elif held or mode == Mode.CALIBRATE:
            self.tracked_s += period_s
            self._add(error)
        else:
            self.lost_s += period_s

    def end(self, reason: str, mode: str) -> None:
        """Note why the pass ended and in which mode."""
        self.reason, self.last_mode = reason, mode

    @property
    def share(self) -> float:
        """Share of the risen time that was tracked."""
        total = self.tracked_s + self.lost_s
        return self.tracked_s / total if total > 0.0 else 0.0

    @property
    def rms_rad(self) -> tuple[float, float]:
        """Root mean square of the sensed errors, cross-elevation and elevation; zero without any."""
        count = max(self.samples, 1)
        return math.sqrt(self.square_cross_elevation_rad2 / count), math.sqrt(self.square_elevation_rad2 / count)

    def _add(self, error: PointingError | None) -> None:
        if error is not None and error.valid:
            self.samples += 1
            self.square_cross_elevation_rad2 += error.cross_elevation_rad**2
            self.square_elevation_rad2 += error.elevation_rad**2
