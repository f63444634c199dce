"""Which tracking mode the controller was in, and what it believed, at any time of the recording.

A mode holds from the stamp of one status to the stamp of the next.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.report.recording import Recording

__all__ = ["RF_MODES", "TRACKING_MODES", "Interval", "Timeline", "timeline"]

RF_MODES = ("monopulse", "conscan", "steptrack")
"""Modes in which a sensor closes the loop."""
TRACKING_MODES = ("program_track", "search", *RF_MODES, "coast")
"""Modes in which the beam is meant to be on the target."""
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """One stretch of one mode, stamps in nanoseconds."""

    mode: str
    start_ns: int
    end_ns: int
    reason: str

    @property
    def seconds(self) -> float:
        """Length in simulated seconds."""
        return (self.end_ns - self.start_ns) * 1e-9


@dataclass(frozen=True)
class Timeline:
    """Status of the controller in order of its stamps, each stamp once."""

    stamp_ns: Ints
    columns: dict[str, NDArray[Any]]

    def mode_at(self, stamp_ns: Ints) -> NDArray[np.str_]:
        """Return the mode at each stamp, "" before the first status."""
        modes = self._held("mode", stamp_ns)
        return np.where(stamp_ns < self.stamp_ns[0], "", modes)

    def beamwidth_rad_at(self, stamp_ns: Ints) -> Floats:
        """Return the half-power beamwidth at each stamp; NaN where the controller named none."""
        width = self._held("beamwidth", stamp_ns).astype(np.float64)
        return np.where(width > 0.0, width, np.nan)

    def offset_rad_at(self, stamp_ns: Ints) -> Floats:
        """Return the tracking offset (n, 2) in cross-elevation and elevation, interpolated between statuses."""
        # Stamps differ from the first one by seconds: subtracting first keeps nanoseconds in a float.
        at, known = ((s - self.stamp_ns[0]) * 1e-9 for s in (stamp_ns, self.stamp_ns))
        names = ("cross_elevation_offset", "elevation_offset")
        return np.stack([np.interp(at, known, self.columns[name]) for name in names], axis=-1)

    def intervals(self) -> list[Interval]:
        """Return the stretches of equal mode in order; the last status counts for one usual period."""
        mode = self.columns["mode"]
        starts = np.flatnonzero(np.concatenate([[True], mode[1:] != mode[:-1]]))
        period = int(np.median(np.diff(self.stamp_ns))) if len(self.stamp_ns) > 1 else 0
        edges = [*(int(self.stamp_ns[i]) for i in starts), int(self.stamp_ns[-1]) + period]
        reasons = self.columns["reason"]
        return [
            Interval(str(mode[i]), start, end, str(reasons[i]))
            for i, start, end in zip(starts, edges[:-1], edges[1:], strict=True)
        ]

    def is_tracking_at(self, stamp_ns: Ints) -> NDArray[np.bool_]:
        """Return whether the beam was meant to be on the target at each stamp."""
        return np.isin(self.mode_at(stamp_ns), TRACKING_MODES)

    def _held(self, column: str, stamp_ns: Ints) -> NDArray[Any]:
        index = np.searchsorted(self.stamp_ns, stamp_ns, side="right") - 1
        return self.columns[column][np.maximum(index, 0)]


def timeline(recording: Recording) -> Timeline | None:
    """Return the timeline of `recording`, None when it holds no tracking status."""
    status = recording.get("tracking_status")
    if status is None or status.stamp_ns is None:
        return None
    stamps, index = np.unique(status.stamp_ns, return_index=True)
    return Timeline(stamps, {name: values[index] for name, values in status.columns.items()})
