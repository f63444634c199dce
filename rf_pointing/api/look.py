"""Where a target is at one time, and what the bias model adds to point there."""

from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import TopocentricTrack


@dataclass(frozen=True, kw_only=True)
class Look:
    """Apparent direction of a target (refraction and light time included), rates and range.

    `azimuth_correction_deg` and `elevation_correction_deg` are what the bias model adds so that the
    beam of the real mount points there.
    """

    t_s: float
    utc: str
    azimuth_deg: float
    elevation_deg: float
    azimuth_rate_deg_s: float
    elevation_rate_deg_s: float
    range_m: float
    azimuth_correction_deg: float
    elevation_correction_deg: float

    @classmethod
    def of(cls, track: TopocentricTrack, model: BiasModel, t_s: float) -> "Look":
        """Return the direction on a track at a time, UTC in s since 1970."""
        look = track.sample([t_s])
        motion = (
            look.azimuth_rad, look.elevation_rad, look.azimuth_rate_rad_s, look.elevation_rate_rad_s,
            look.azimuth_acceleration_rad_s2, look.elevation_acceleration_rad_s2,
        )  # fmt: skip
        rows = np.degrees([*motion[:4], *model.offset_rad(*motion)])[:, 0].tolist()
        azimuth, elevation, azimuth_rate, elevation_rate, azimuth_correction, elevation_correction = rows
        return cls(
            t_s=t_s, utc=utc_text(t_s), azimuth_deg=azimuth, elevation_deg=elevation, azimuth_rate_deg_s=azimuth_rate,
            elevation_rate_deg_s=elevation_rate, range_m=float(look.range_m[0]),
            azimuth_correction_deg=azimuth_correction, elevation_correction_deg=elevation_correction,
        )  # fmt: skip
