"""What the link promises of the carrier: whether a pass is strong enough for a sensor, and whether a lock is a false one."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import PointingError
from rf_pointing.ephemeris import Pass
from rf_pointing.rf import LinkParams
from rf_pointing.tracking import AutotrackParams, LockWatch, LockWatchParams

__all__ = ["CarrierWatch", "link_level_db_hz"]

Array = NDArray[np.float64]


class CarrierWatch:
    """Holds the monopulse errors of a pass against the link; `faults` false locks so far, `last_fault` in words."""

    def __init__(self, watch: LockWatchParams, link: LinkParams) -> None:
        self._watch, self._link = LockWatch(watch), link
        self.restart()

    def restart(self) -> None:
        """Begin a pass."""
        self.faults, self.last_fault = 0, ""
        self._watched_s = -math.inf
        self._watch.reset()

    def forget(self) -> None:
        """Begin with a new mode."""
        self._watch.reset()

    def level_db_hz(self, range_m: float) -> float:
        """Return the C/N0 of a beam on the target: the link's at the zenith over this distance."""
        return link_level_db_hz(self._link, range_m)

    def require_level(self, window: Pass, sensor: str, gates: AutotrackParams) -> None:
        """Refuse a sensor whose gate the carrier of a pass never opens; the link is that of a beam on the target.

        A pass that does not say how near it comes is not refused.
        """
        nearest_m = window.smallest_range_m
        if nearest_m <= 0.0 or sensor == "program":
            return
        needed = gates.monopulse_on_db_hz if sensor == "monopulse" else gates.carrier_on_db_hz
        level = self.level_db_hz(nearest_m)
        if level < needed:
            raise ValueError(
                f"sensor={sensor} needs a carrier of {needed:.1f} dB-Hz; the link gives at most {level:.1f} dB-Hz on this "
                f"pass, {nearest_m / 1e3:.0f} km away"
            )

    def false_lock(self, error: PointingError, beam_rad: Array, range_m: float, faint_db_hz: float) -> str:
        """Return why a monopulse error must not be followed, empty while it may.

        `beam_rad` (2,) is how far the beam was from the prediction then; below `faint_db_hz` nothing is judged.
        """
        if error.carrier_to_noise_db_hz < faint_db_hz or error.t_s <= self._watched_s:
            return ""
        self._watched_s = error.t_s
        fault = self._watch.add(error, float(beam_rad[0]), float(beam_rad[1]), self.level_db_hz(range_m))
        if fault:
            self.faults, self.last_fault = self.faults + 1, fault
        return fault


def link_level_db_hz(link: LinkParams, range_m: float) -> float:
    """Return the C/N0 of a beam on the target: the link's at the zenith over this distance."""
    return link.zenith_carrier_to_noise_db_hz - 20.0 * math.log10(range_m / link.reference_range_m)
