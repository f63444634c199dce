"""Draws for the passes of an ensemble: noise, wind and the errors of the elements.

Everything is drawn from a stream that is named after the pass and the trial, so that a pass is the
same whoever flies it, alone or among thousands.

    wind speed       Rayleigh about the station's mean       direction   even
    along track      sigma_along(age) / speed of the orbit   across      sigma_cross(age) / range
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.core import random_stream
from rf_pointing.ephemeris import ElementUncertainty, Pass

STRONGEST_M_S = 30.0
"""Largest mean speed that is drawn: in more an antenna is stowed."""
ORBIT_SPEED_M_S = 7500.0
"""Speed of a low orbit, by which an error in metres along the track becomes one in time."""
LARGEST_RAD, LARGEST_S = 0.09, 60.0
RAYLEIGH_OF_MEAN = math.sqrt(2.0 / math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """One trial of one pass: seed of all noise, wind, and how far the target is off its elements.

    `cross_track_rad` is the angle at the station where the target is nearest.
    """

    seed: int
    wind_m_s: float
    wind_from_rad: float
    along_track_s: float
    cross_track_rad: float

    @classmethod
    def of(
        cls, window: Pass, trial: int, seed: int, mean_wind_m_s: float,
        law: ElementUncertainty, age_s: float,
    ) -> "Draw":  # fmt: skip
        """Return the draw of a trial of a pass, with elements of an age in the `law`."""
        random = random_stream(seed, f"{window.name} {window.aos_t_s:.0f} {trial}")
        rayleigh, turn, along, across = (
            random.rayleigh(),
            *random.random(1),
            *random.standard_normal(2),
        )
        along_m, cross_m, _ = law.sigmas_m(age_s)
        reach = max(window.smallest_range_m, 1.0)
        return cls(
            seed=int(random.integers(2**31 - 1)),
            wind_m_s=min(mean_wind_m_s * RAYLEIGH_OF_MEAN * float(rayleigh), STRONGEST_M_S),
            wind_from_rad=math.pi * (2.0 * float(turn) - 1.0),
            along_track_s=float(np.clip(along_m / ORBIT_SPEED_M_S * along, -LARGEST_S, LARGEST_S)),
            cross_track_rad=float(np.clip(cross_m / reach * across, -LARGEST_RAD, LARGEST_RAD)),
        )

    @property
    def changes(self) -> dict[str, dict[str, Any]]:
        """The same as changes of a station's parameters, by node and dotted name."""
        return {
            "antenna_servo": {
                "wind.mean_speed_m_s": self.wind_m_s,
                "wind.from_azimuth_deg": math.degrees(self.wind_from_rad),
            },
            "rf_receiver": {
                "source.along_track_offset_s": self.along_track_s,
                "source.cross_track_offset_deg": math.degrees(self.cross_track_rad),
            },
        }
