"""The Sun over a station, for the exclusion zone of the beam; renewed often enough for a tick."""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter
from rf_pointing.ephemeris.celestial import sun
from rf_pointing.ephemeris.sites import SITES, Site
from rf_pointing.ephemeris.track import TopocentricTrack

# The Sun moves 42 mdeg in this time.
RENEWAL_S = 10.0


@dataclass(frozen=True, kw_only=True)
class SunParams(Params):
    """Whose Sun it is."""

    watched: bool = parameter(True, "whether the beam keeps away from the Sun")
    site: Site = parameter(SITES["Goldstone DSS-13"], "where the antenna stands")


class SolarDirection:
    """Apparent azimuth and elevation of the Sun, None where it is not known; `unknown` says why."""

    def __init__(self, params: SunParams) -> None:
        self.site = params.site
        self._track = TopocentricTrack(sun(), params.site) if params.watched else None
        self.unknown = "" if params.watched else "it is not watched"
        self._renewed_s = -math.inf
        self._direction: tuple[float, float] | None = None

    def at(self, t_s: float) -> tuple[float, float] | None:
        """Return azimuth and elevation at `t_s`, at most `RENEWAL_S` old."""
        # Not renewed within RENEWAL_S, but at once when time went back.
        if self._track is not None and not 0.0 <= t_s - self._renewed_s < RENEWAL_S:
            self._renewed_s = t_s
            try:
                look = self._track.target_at(t_s)
            except ValueError as error:
                self._direction, self.unknown = None, str(error)
            else:
                self._direction = (look.azimuth_rad, look.elevation_rad)
                self.unknown = ""
        return self._direction
