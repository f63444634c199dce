"""Where the beam really was: encoder angles against the commanded scan centre, at the time of a radio measurement.

Both arrive as streams of their own and are interpolated linearly.  `ConscanPositions` lets a carrier power wait until
both are known on either side of the middle of its integration.
"""

import math
from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.geometry import CarrierPower, JointReading, PointingError
from rf_pointing.tracking import ConscanTracker

__all__ = ["BeamPosition", "ConscanPositions"]

Array = NDArray[np.float64]
KEPT_S = 2.0
IDLE_EVERY = 2
"""While the scan does not run, every second power is passed on for its C/N0."""


@dataclass
class _Series:
    """A two-axis quantity over the last seconds, interpolated linearly."""

    times: list[float] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)

    def add(self, t_s: float, value: Array) -> None:
        if self.times and t_s <= self.times[-1]:
            self.clear()
        self.times.append(t_s)
        self.values.append(value)
        while self.times[-1] - self.times[0] > KEPT_S:
            del self.times[0], self.values[0]

    def clear(self) -> None:
        self.times.clear()
        self.values.clear()

    def at(self, t_s: float) -> Array | None:
        """Return the value, None when `t_s` is not covered."""
        after = bisect_left(self.times, t_s)
        if after >= len(self.times) or (after == 0 and self.times[0] > t_s):
            return None
        if self.times[after] == t_s:
            return self.values[after]
        before = after - 1
        share = (t_s - self.times[before]) / (self.times[after] - self.times[before])
        mixed: Array = self.values[before] + share * (self.values[after] - self.values[before])
        return mixed


class BeamPosition:
    """Offset of the beam from the scan centre, on the sky, over the last seconds."""

    def __init__(self) -> None:
        self._joints, self._centre = _Series(), _Series()

    def clear(self) -> None:
        """Forget everything, for a new pass."""
        self._joints.clear()
        self._centre.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints.add(reading.t_s, reading.position_rad)

    def take_centre(self, t_s: float, scan_centre_rad: Array) -> None:
        """Note the commanded scan centre (2,), axis angles."""
        self._centre.add(t_s, scan_centre_rad)

    def too_old(self, t_s: float) -> bool:
        """Whether `t_s` lies before all that is known, so that its offset will never be."""
        return any(bool(series.times) and t_s < series.times[0] for series in (self._joints, self._centre))

    def offset(self, t_s: float) -> Array | None:
        """Return cross-elevation and elevation (2,) of the beam from the centre, None when `t_s` is not covered."""
        joints, centre = self._joints.at(t_s), self._centre.at(t_s)
        if joints is None or centre is None:
            return None
        away: Array = (joints - centre) * np.array([math.cos(float(joints[1])), 1.0])
        return away


class ConscanPositions:
    """Feeds a `ConscanTracker` from the three streams of a station; only while the scan runs."""

    def __init__(self, tracker: ConscanTracker) -> None:
        self.tracker = tracker
        self._beam = BeamPosition()
        self._waiting: list[CarrierPower] = []
        self._scanning = False
        self._idle = 0

    @property
    def scanning(self) -> bool:
        """Whether the scan runs; encoder angles matter only then."""
        return self._scanning

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles, while the scan runs."""
        if self._scanning:
            self._beam.take_joints(reading)

    def take_status(self, t_s: float, scan_centre_rad: Array, mode: str) -> None:
        """Note the commanded scan centre (2,), axis angles, and whether the scan runs."""
        scanning = mode == "conscan"
        if scanning != self._scanning:
            self._scanning = scanning
            self._waiting.clear()
            self._beam.clear()
            self.tracker.reset()
        self._beam.take_centre(t_s, scan_centre_rad)

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        """Take one carrier power; return an error for every one that could be placed, usable or not.

        One from before the scan is dropped: where the beam was then is not known and never will be.
        A window that is not full yet gives an invalid error that says so and carries the C/N0.
        """
        if not self._scanning:
            self._idle += 1
            return [_not_usable(power, "the scan does not run")] if self._idle % IDLE_EVERY == 0 else []
        self._waiting.append(power)
        errors = []
        while self._waiting:
            beam_s = self.tracker.beam_time_s(self._waiting[0])
            if self._beam.too_old(beam_s):
                del self._waiting[0]
                continue
            offset = self._beam.offset(beam_s)
            if offset is None:
                break
            placed = self._waiting.pop(0)
            filled = len(self.tracker.state.samples) + 1
            error = self.tracker.add(placed, float(offset[0]), float(offset[1]))
            errors.append(error or _not_usable(placed, f"window holds {filled} of {self._window} samples"))
        del self._waiting[: max(0, len(self._waiting) - self._window)]
        return errors

    @property
    def _window(self) -> int:
        return self.tracker.params.window_samples


def _not_usable(power: CarrierPower, reason: str) -> PointingError:
    return PointingError(
        t_s=power.t_s,
        sensor="conscan",
        cross_elevation_rad=0.0,
        elevation_rad=0.0,
        carrier_to_noise_db_hz=power.carrier_to_noise_db_hz,
        valid=False,
        reason=reason,
    )
