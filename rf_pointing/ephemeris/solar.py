"""The Sun over a station, for the exclusion zone of the beam; renewed often enough for a tick."""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter
from rf_pointing.ephemeris.celestial import sun
from rf_pointing.ephemeris.sites import site
from rf_pointing.ephemeris.track import TopocentricTrack

# The Sun moves 42 mdeg in this time.
RENEWAL_S = 10.0


@dataclass(frozen=True, kw_only=True)
class SunParams(Params):
    """Whose Sun it is."""

    station: str = parameter("Goldstone DSS-13", "station over which the Sun stands; empty: the Sun is not looked at")


class SolarDirection:
    """Apparent azimuth and elevation of the Sun, None where it is not known; `unknown` says why."""

    def __init__(self, params: SunParams) -> None:
        self.station = params.station
        self._track = TopocentricTrack(sun(), site(params.station)) if params.station else None
        self.unknown = "" if params.station else "no station is named"
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
