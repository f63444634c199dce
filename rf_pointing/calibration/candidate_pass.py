"""A pass that could be observed: its geometry and how well it would be measured."""

from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.reference import ReferenceTrack

__all__ = ["CandidatePass"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidatePass:
    """A predicted pass: `track` at the times at which points would be taken, one sigma for each axis."""

    name: str
    track: ReferenceTrack
    sigma_azimuth_rad: float
    sigma_elevation_rad: float

    @property
    def start_t_s(self) -> float:
        """Return the time of the first point."""
        return float(self.track.t_s[0])

    @property
    def end_t_s(self) -> float:
        """Return the time of the last point."""
        return float(self.track.t_s[-1])

    def observations(self, station: str, band: str, pass_id: int) -> Observations:
        """Return the points as they would come without noise and bias, for the fit's partial derivatives."""
        track, count = self.track, len(self.track.t_s)
        return Observations(
            station=station,
            band=band,
            t_s=track.t_s,
            pass_id=np.full(count, pass_id),
            observed_azimuth_rad=track.azimuth_rad,
            observed_elevation_rad=track.elevation_rad,
            true_azimuth_rad=track.azimuth_rad,
            true_elevation_rad=track.elevation_rad,
            azimuth_rate_rad_s=track.azimuth_rate_rad_s,
            elevation_rate_rad_s=track.elevation_rate_rad_s,
            azimuth_acceleration_rad_s2=track.azimuth_acceleration_rad_s2,
            elevation_acceleration_rad_s2=track.elevation_acceleration_rad_s2,
            sigma_azimuth_rad=np.full(count, self.sigma_azimuth_rad),
            sigma_elevation_rad=np.full(count, self.sigma_elevation_rad),
            range_m=track.range_m,
            range_rate_m_s=track.range_rate_m_s,
        )
