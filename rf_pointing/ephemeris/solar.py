"""The Sun over a station, for the exclusion zone of the beam; renewed often enough for a tick.

An operator may permit once, by name, for one band and until a time, that the beam looks into it.  A
permission is an order to a running station: no file holds one, and a restart forgets it.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Pair, Params, parameter, require_name, utc_text
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.ephemeris.celestial import sun
from rf_pointing.ephemeris.sites import SITES, Site
from rf_pointing.ephemeris.track import TopocentricTrack

# The Sun moves 42 mdeg in this time.
RENEWAL_S = 10.0
# Its path is sampled, interpolated in steps (to 1 mdeg), and renewed after a time.
SAMPLE_S, PATH_STEP_S, PATH_S = 60.0, 10.0, 600.0
LONGEST_PERMIT_S = 12.0 * 3600.0
"""Longest permission: from sunrise to sunset in spring."""


@dataclass(frozen=True, kw_only=True)
class SunParams(Params):
    """Whose Sun it is."""

    watched: bool = parameter(True, "whether the beam keeps away from the Sun")
    site: Site = parameter(SITES["Goldstone DSS-13"], "where the antenna stands")


@dataclass(frozen=True, slots=True, kw_only=True)
class SunPermit:
    """Permission of the operator `by` for the beam of a band to look into the Sun until a time."""

    by: str
    until_t_s: float
    band: str

    def check(self, t_s: float, band: str) -> None:
        """Raise ValueError for one that cannot be given at `t_s` to an antenna on `band`."""
        require_name("by", self.by)
        if not self.by.strip():
            raise ValueError("by='' must name who permits it")
        if band and self.band != band:
            raise ValueError(f"band={self.band!r} must be {band!r}, the band in use")
        ahead_s = self.until_t_s - t_s
        if not 0.0 < ahead_s <= LONGEST_PERMIT_S:
            bound = f"must be > 0 and <= {LONGEST_PERMIT_S:.0f} s"
            raise ValueError(f"until={utc_text(self.until_t_s)} is {ahead_s:.0f} s ahead, {bound}")

    @property
    def text(self) -> str:
        """Say who permits what until when."""
        until = utc_text(self.until_t_s)
        return f"{self.by} lets the {self.band} beam look into the Sun until {until}"


class SolarDirection:
    """Apparent direction of the Sun, None where it is not known; `unknown` says why.

    It is given in the angles of a mount's axes: azimuth and elevation unless another one is named.
    """

    def __init__(self, params: SunParams, mount: Kinematics = LEVEL) -> None:
        self.site, self._mount = params.site, mount
        self._track = TopocentricTrack(sun(), params.site) if params.watched else None
        self.unknown = "" if params.watched else "it is not watched"
        self._renewed_s = -math.inf
        self._direction: Pair | None = None
        self._path: tuple[Array, Array] = np.empty(0), np.empty((0, 2))
        self.permit: SunPermit | None = None

    def permitted(self, t_s: float) -> SunPermit | None:
        """Return the permission that lets the beam look into the Sun at `t_s`, None without one."""
        permit = self.permit
        return permit if permit is not None and t_s < permit.until_t_s else None

    def avoided(self, t_s: float) -> Pair | None:
        """Return the direction to keep away from, None where it is unknown or permitted."""
        return None if self.permitted(t_s) else self.at(t_s)

    def ahead(self, t_s: float, span_s: float) -> tuple[Array, Array]:
        """Return times (n,) from `t_s` on and the directions (n, 2) then; n = 0 if unknown."""
        if self._track is None:
            return np.empty(0), np.empty((0, 2))
        known_s, path = self._path
        if not (len(known_s) and known_s[0] <= t_s <= t_s + span_s <= known_s[-1]):
            count = math.ceil((span_s + PATH_S) / SAMPLE_S) + 1
            known_s = np.asarray(t_s + SAMPLE_S * np.arange(count), dtype=np.float64)
            try:
                seen = self._track.sample(known_s)
            except ValueError:
                return np.empty(0), np.empty((0, 2))
            path, still = np.column_stack([np.unwrap(seen.azimuth_rad), seen.elevation_rad]), np.zeros((count, 2))
            path = self._mount.to_axes(path, still, still)[0]
            self._path = known_s, path
        steps = np.arange(math.floor(span_s / PATH_STEP_S) + 1)
        times = np.asarray(t_s + PATH_STEP_S * steps, dtype=np.float64)
        return times, np.column_stack([np.interp(times, known_s, each) for each in path.T])

    def at(self, t_s: float) -> Pair | None:
        """Return azimuth and elevation at `t_s`, at most `RENEWAL_S` old."""
        # Not renewed within RENEWAL_S, but at once when time went back.
        if self._track is not None and not 0.0 <= t_s - self._renewed_s < RENEWAL_S:
            self._renewed_s = t_s
            try:
                look = self._track.target_at(t_s)
            except ValueError as error:
                self._direction, self.unknown = None, str(error)
            else:
                self._direction = self._mount.axes_at(look.azimuth_rad, look.elevation_rad)
                self.unknown = ""
        return self._direction
