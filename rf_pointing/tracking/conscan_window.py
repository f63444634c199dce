"""One window of conscan samples: carrier power, and where the beam really was when it was measured."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["SMALLEST_INFORMATION", "ConscanWindow", "is_singular", "rank_fault", "rank_reason"]

Array = NDArray[np.float64]

SMALLEST_INFORMATION = 1e-13
"""Least eigenvalue of an information matrix, its diagonal scaled to one, that determines the unknowns.

Rounding makes 1e-15 of an exact zero, of either sign and different on every processor.  To invert first
and judge the result afterwards would leave the verdict to it.  At 1e-13 the inverse is good to 1 %.
"""


@dataclass(frozen=True, slots=True)
class ConscanWindow:
    """Samples of one estimate: rows (n, 6) of time, power, sigma, beam cross-elevation, beam elevation, C/N0.

    Time is the middle of the integration; beam offsets are from the scan's origin.
    """

    rows: Array

    @classmethod
    def empty(cls) -> "ConscanWindow":
        """Return a window without samples."""
        return cls(np.empty((0, 6)))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def t_s(self) -> Array:
        """Times (n,)."""
        return self.rows[:, 0]

    @property
    def power_w(self) -> Array:
        """Carrier powers (n,)."""
        return self.rows[:, 1]

    @property
    def sigma_w(self) -> Array:
        """Standard deviations of the powers (n,)."""
        return self.rows[:, 2]

    @property
    def beam_cross_elevation_rad(self) -> Array:
        """Cross-elevation of the beam (n,)."""
        return self.rows[:, 3]

    @property
    def beam_elevation_rad(self) -> Array:
        """Elevation of the beam (n,)."""
        return self.rows[:, 4]

    @property
    def beam_rad(self) -> Array:
        """Beam positions (n, 2), cross-elevation and elevation."""
        return self.rows[:, 3:5]

    @property
    def carrier_to_noise_db_hz(self) -> Array:
        """C/N0 of the samples (n,)."""
        return self.rows[:, 5]

    def with_sample(self, sample: tuple[float, ...], most: int, oldest_s: float) -> "ConscanWindow":
        """Return the window with `sample` added, at most `most` samples and none before `oldest_s`."""
        keep = self.rows[-(most - 1) :]
        if len(keep) and keep[0, 0] < oldest_s:
            keep = keep[keep[:, 0] >= oldest_s]
        return ConscanWindow(np.concatenate([keep, np.array([sample])]))

    def without(self, row: int) -> "ConscanWindow":
        """Return the window without one of its samples."""
        return ConscanWindow(np.delete(self.rows, row, axis=0))

    def moved(self, cross_elevation_rad: float, elevation_rad: float) -> "ConscanWindow":
        """Return the window seen from an origin moved by this much."""
        rows = self.rows.copy()
        rows[:, 3] -= cross_elevation_rad
        rows[:, 4] -= elevation_rad
        return ConscanWindow(rows)


def is_singular(information: Array) -> bool:
    """Return whether one of these symmetric matrices (..., k, k) leaves an unknown undetermined."""
    scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    if not (np.all(scale > 0.0) and np.all(np.isfinite(scale))):
        return True
    least = np.linalg.eigvalsh(information / (scale[..., :, None] * scale[..., None, :]))[..., 0]
    return not bool(np.all(least > SMALLEST_INFORMATION))


def rank_fault(positions_rad: Array, smallest_spread_rad: float) -> str:
    """Return why these beam positions (n, 2) do not determine both axes, empty if they do.

    Both axes and the power need three distinct positions that do not lie on a line: along the axis of least spread the
    beam must have moved by at least `smallest_spread_rad` rms.
    """
    least = math.sqrt(max(float(np.linalg.eigvalsh(np.cov(positions_rad.T, bias=True))[0]), 0.0))
    return "" if least >= smallest_spread_rad else rank_reason(positions_rad, smallest_spread_rad)


def rank_reason(positions_rad: Array, smallest_spread_rad: float) -> str:
    """Name what beam positions (n, 2) that lie on a line, or on two points, leave undetermined."""
    centred = positions_rad - positions_rad.mean(axis=0)
    distinct = len(np.unique(np.round(centred / smallest_spread_rad), axis=0))
    if distinct < 3:
        return f"{distinct} distinct beam positions, must be at least 3"
    (xx, xy), (_, yy) = centred.T @ centred
    blind = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    name = {0: "cross-elevation", 2: "elevation"}.get(round(blind / (0.25 * math.pi)) % 4, "one diagonal")
    return f"{name} is not determined: the beam positions lie on a line"
