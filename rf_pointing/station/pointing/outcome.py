"""Outcome of a pass so far, as far as axes, sensor and carrier tell the controller.

The error of the beam is, in this order,

    in a crossing of the zenith    what the certificate plans, and the axis error
    a sensor tracks                its valid error; a scan's is that of its centre
    a carrier is reported          the error at which it is as much weaker than the link's
    ephemeris only                 the axis error: nothing else is known

and never less than the axis error.  Where none of these is known the target counts as lost.  What
held, tracked and lost mean is defined in `core/pass_outcome.py` alone.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core import Array, Pair, PointingError
from rf_pointing.core.pass_outcome import PassOutcome, error_of_power_rad, is_held
from rf_pointing.station.pointing.antenna_watch import AxisState
from rf_pointing.tracking.sensors import NO_SENSOR, SENSORS

# One second of two sensors that report ten times a second.
KEPT_LEVELS = 20


class CarrierLevels:
    """C/N0 that any sensor has reported lately, whether or not the pass may use it."""

    def __init__(self) -> None:
        self._levels: deque[PointingError] = deque(maxlen=KEPT_LEVELS)

    def clear(self) -> None:
        """Begin a pass."""
        self._levels.clear()

    def take(self, error: PointingError) -> None:
        """Note the level of a report."""
        if error.sensor in SENSORS:
            self._levels.append(error)

    def power(self, newest_t_s: float, oldest_t_s: float, axis_db_hz: float) -> float | None:
        """Return the mean power over that on the beam's axis, None without a report or a link."""
        ratios = [
            10.0 ** (0.1 * min(level.carrier_to_noise_db_hz - axis_db_hz, 0.0))
            for level in self._levels
            if oldest_t_s <= level.t_s <= newest_t_s
        ]
        # One report is noise of a decibel at a weak carrier; their mean is not.
        return float(np.mean(ratios)) if ratios and math.isfinite(axis_db_hz) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamEvidence:
    """Evidence of the beam in one period; None for what is not known.

    `sensed` is the valid error of the sensor that tracks.  `off_centre_rad` (2,) is how far the
    encoders are from the centre of its scan, cross-elevation and elevation.  `power` is that of the
    carrier over that on the axis.  `planned_rad` is by how much the certificate leaves the target.
    """

    sensor: str
    axes: AxisState
    sensed: PointingError | None = None
    off_centre_rad: Array | None = None
    power: float | None = None
    planned_rad: float = 0.0

    def error_rad(self, beamwidth_rad: float) -> float | None:
        """Return the error of the beam, None where nothing tells it."""
        axes = self.axes
        if axes.error_rad is None or axes.doubt.startswith("joint_states"):
            return None
        if self.planned_rad > 0.0:
            return self.planned_rad + axes.distance_rad
        if self.sensed is not None:
            off = np.array([self.sensed.cross_elevation_rad, self.sensed.elevation_rad])
            if self.off_centre_rad is not None:
                off += self.off_centre_rad
            return float(np.hypot(*off))
        if self.power is not None:
            return max(error_of_power_rad(self.power, beamwidth_rad), axes.distance_rad)
        return axes.distance_rad if self.sensor == NO_SENSOR else None


@dataclass
class PassStatistics:
    """Outcome of the pass so far, rms of the sensed errors, and why it ended.

    `fault` is what must be mended before the next pass.  `held` and `held_t_s` say whether the
    target is held now, and when it last was; `begun_t_s` since when the pass is counted.
    """

    outcome: PassOutcome = field(default_factory=PassOutcome)
    samples: int = 0
    square_rad2: Array = field(default_factory=lambda: np.zeros(2))
    reason: str = ""
    fault: str = ""
    held: bool = False
    held_t_s: float = -math.inf
    begun_t_s: float = -math.inf
    counted_t_s: float = -math.inf

    def count(self, t_s: float, period_s: float, error_rad: float | None, beamwidth_rad: float) -> None:
        """Add what has passed since the last call; of more than a period nobody saw the rest."""
        passed_s = period_s if self.counted_t_s == -math.inf else max(t_s - self.counted_t_s, 0.0)
        self.begun_t_s = t_s if self.begun_t_s == -math.inf else self.begun_t_s
        seen_s = min(passed_s, 1.5 * period_s)
        self.counted_t_s = t_s
        if error_rad is None:
            self.held, seen_s = False, 0.0
        else:
            self.held = bool(is_held(error_rad, beamwidth_rad))
            self.outcome += PassOutcome.of(error_rad, beamwidth_rad, seen_s)
        if passed_s > seen_s:
            self.outcome += PassOutcome.unseen(passed_s - seen_s)
        if self.held:
            self.held_t_s = t_s

    def note(self, sensed: PointingError | None) -> None:
        """Add a valid error to the rms."""
        if sensed is not None:
            self.samples += 1
            self.square_rad2 += np.square([sensed.cross_elevation_rad, sensed.elevation_rad])

    @property
    def rms_rad(self) -> Pair:
        """RMS of the sensed errors, cross-elevation and elevation; zero without any."""
        right, up = np.sqrt(self.square_rad2 / max(self.samples, 1)).tolist()
        return right, up
