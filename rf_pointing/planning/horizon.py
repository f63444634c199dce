"""The horizon that an antenna does not look below.

The mask is the lowest elevation at every azimuth: straight lines between surveyed points, closed
over north.
"""

import bisect
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import TURN, Array, Params, parameter

# Note of a recording with the points of the horizon.
HORIZON_NOTE = "horizon_deg"


@dataclass(frozen=True, kw_only=True)
class HorizonMask(Params):
    """Surveyed points of the horizon; one point is a flat horizon.

    The gate holds the axes above the points themselves.  Passes begin and end `clearance_rad` above
    them, so that the errors of the mount, a search at the rise and the last commands before the set
    stay above them too.
    """

    azimuth_rad: tuple[float, ...] = parameter((0.0,), "azimuths of the horizon's points, rising", 0.0, TURN)
    elevation_rad: tuple[float, ...] = parameter((math.radians(-10.0),), "lowest elevation at each of them", -0.2, 1.5)
    clearance_rad: float = parameter(
        math.radians(1.0), "passes begin and end this far above the horizon", math.radians(0.01), 0.2
    )

    def check_together(self) -> None:
        """Refuse lists of different lengths and azimuths that do not rise within one turn."""
        if len(self.azimuth_rad) != len(self.elevation_rad) or not self.azimuth_rad:
            raise ValueError(
                f"azimuth_rad has {len(self.azimuth_rad)} points and elevation_rad {len(self.elevation_rad)}, "
                "must have the same number, at least 1"
            )
        steps = np.diff(self.azimuth_rad)
        if np.any(steps <= 0.0) or self.azimuth_rad[-1] - self.azimuth_rad[0] >= TURN:
            raise ValueError(f"azimuth_rad={self.azimuth_rad} must rise from point to point within one turn")

    def lowest_rad(self, azimuth_rad: float) -> float:
        """Return the horizon's elevation at an azimuth on any turn; plain floats."""
        points, heights = self.azimuth_rad, self.elevation_rad
        count = len(points)
        if count == 1:
            return heights[0]
        azimuth = (azimuth_rad - points[0]) % TURN + points[0]
        after = bisect.bisect_right(points, azimuth)
        low, high = after - 1, after % count
        width = points[high] - points[low] + (TURN if high == 0 else 0.0)
        return heights[low] + (heights[high] - heights[low]) * (azimuth - points[low]) / width

    def above(self, least_rad: float) -> Callable[[Array], Array]:
        """Return where passes begin and end, (n,) over azimuths (n,), nowhere below `least_rad`."""
        return lambda azimuth_rad: np.maximum(self.lowest_all(azimuth_rad) + self.clearance_rad, least_rad)

    def lowest_all(self, azimuth_rad: ArrayLike) -> Array:
        """Return the horizon's elevation at azimuths of any shape."""
        points = np.array([*self.azimuth_rad, self.azimuth_rad[0] + TURN])
        heights = np.array([*self.elevation_rad, self.elevation_rad[0]])
        folded = (np.asarray(azimuth_rad, dtype=np.float64) - points[0]) % TURN + points[0]
        return np.asarray(np.interp(folded, points, heights))


def horizon_to_notes(mask: HorizonMask) -> dict[str, str]:
    """Return what a recording keeps of a horizon: nothing of one without hills."""
    points = zip(mask.azimuth_rad, mask.elevation_rad, strict=True)
    rows = [[round(math.degrees(each), 4) for each in point] for point in points]
    return {HORIZON_NOTE: json.dumps(rows)} if max(mask.elevation_rad) > 0.0 else {}


def horizon_from_notes(notes: Mapping[str, str]) -> HorizonMask | None:
    """Return the horizon of a recording; None for one without hills, or with a damaged note."""
    try:
        azimuth_deg, elevation_deg = zip(*json.loads(notes[HORIZON_NOTE]), strict=True)
        radians = tuple(map(math.radians, azimuth_deg)), tuple(map(math.radians, elevation_deg))
        return HorizonMask(azimuth_rad=radians[0], elevation_rad=radians[1])
    except (KeyError, ValueError, TypeError):
        return None
