"""Powers of a scan with where the beam was: what a client collects, live or headless.

A power waits until encoders and commanded centre are known on either side of the middle of its
integration, as in `tracking/power_tracker.py`.
"""

import math

import numpy as np

from rf_pointing.core import LEVEL, Array, CarrierPower, JointReading, Kinematics, Mode, PointingError, sky_offset_rad
from rf_pointing.core.signals import TimeBuffer
from rf_pointing.radiometry.scan_fit import Samples

# Powers that wait at most: a stream that never comes must not let them grow.
LONGEST_QUEUE = 200


class ScanSamples:
    """Collects while program track is in force; a `CarrierTracker` that reports no error.

    Encoders and centre are angles of the axes of `mount`, the samples offsets on the sky.
    """

    def __init__(self, mount: Kinematics = LEVEL) -> None:
        self._mount = mount
        self._joints, self._centre = TimeBuffer(), TimeBuffer()
        self._waiting, self._scanned = list[CarrierPower](), False
        self._rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints.add(reading.t_s, reading.position_rad)
        self._place()

    def take_status(
        self, t_s: float, scan_centre_rad: Array, _offset_rad: Array, mode: str, _sensor: str, /
    ) -> None:  # fmt: skip
        """Note the centre of the scan, axis angles (2,); another mode ends it."""
        scanned = mode == Mode.PROGRAM_TRACK
        if scanned and not self._scanned:
            # A scan that was interrupted begins again: what it gave before is of no whole pattern.
            self._rows.clear()
            self._waiting.clear()
            self._centre.clear()
        self._scanned = scanned
        if scanned:
            self._centre.add(t_s, scan_centre_rad)
            self._place()

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        """Take one power."""
        if self._scanned and power.power_w > 0.0 and power.sigma_w > 0.0:
            self._waiting.append(power)
            del self._waiting[:-LONGEST_QUEUE]
            self._place()
        return []

    def _place(self) -> None:
        while self._waiting:
            power = self._waiting[0]
            t_s = power.t_s - 0.5 * power.integration_s
            joints, centre = self._joints.at(t_s), self._centre.at(t_s)
            if joints is not None and centre is not None:
                self._rows.append((t_s, power.power_w, power.sigma_w, *self._beam(joints, centre)))
            elif not any(one.times and t_s < one.times[0] for one in (self._joints, self._centre)):
                return
            del self._waiting[0]

    def _beam(self, joints_rad: Array, centre_rad: Array) -> tuple[float, float, float]:
        """Return how far the beam is off the centre on the sky, and its elevation."""
        beam, centre = (self._mount.sky_at(*each.tolist()) for each in (joints_rad, centre_rad))
        # Exact on the sphere: 4 deg across at 50 deg of elevation bend by 0.2 deg.
        right, up = sky_offset_rad(*beam, *centre)
        return float(right), float(up), beam[1]

    def samples(self, strength: Array | None = None, sky: Array | None = None) -> Samples:
        """Return what was collected; `strength` and `sky` (n,) as in the fit, 1 without them."""
        if not self._rows:
            raise ValueError("no power was received while the scan ran: is carrier_power there?")
        ones = np.ones(len(self._rows))
        columns = list(np.array(self._rows).T)[:5]
        given = (ones if each is None else each for each in (strength, sky))
        return Samples._make([*columns, *given])

    @property
    def elevation_rad(self) -> Array:
        """Elevation (n,) of the beam."""
        return np.array([row[5] for row in self._rows])

    @property
    def t_s(self) -> Array:
        """Times (n,) of the samples."""
        return np.array([row[0] for row in self._rows]) if self._rows else np.full(1, math.nan)
