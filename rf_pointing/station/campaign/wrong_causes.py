"""Why raw passes do not meet their reference: the known causes are tried, the best one is named.

A fit that is refused says where it ended: a lag of 19 s, no settling, directions far off.  The
cause lies before it.  Each hypothesis gives the angular distance of the samples from the reference,
as a median over all passes; a cause is named only where it takes most of the distance away.

* the time tags are in another scale or of another time zone, or late by any time up to two minutes;
* the azimuth is counted the other way, the axes are swapped, elevations are zenith distances;
* the antenna is elsewhere: by least squares, with two offsets, about the reference of each place.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from rf_pointing.calibration import TrackedPass
from rf_pointing.core import Array, angular_distance_rad, unit_vector_from_azel, wrap_rad
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_elements
from rf_pointing.ephemeris.time_scales import TAI_MINUS_GPS_S, TT_MINUS_TAI_S, leap_seconds

# So many samples of so many passes judge a hypothesis.
_SAMPLES, _PASSES = 40, 12
# A mount and its orbits are off by less; a cause must leave less than this share of the distance.
_UNEXPLAINED_RAD, _LARGEST_SHARE = math.radians(0.25), 0.35
# Lags of the mount look like less than so many seconds.
_LEAST_S, _LATEST_S, _STEP_S, _FINE_S = 4.0, 120.0, 1.0, 0.02
_ZONE_S, _ZONES = 1800.0, 28
_SITE_ROUNDS, _LEAST_SITE_M = 6, 500.0
_SCALE_S = 0.7

Angles = Callable[[Array, Array], tuple[Array, Array]]
_MISREAD: dict[str, Angles] = {
    "the azimuth is counted counterclockwise": lambda azimuth, elevation: (-azimuth, elevation),
    "azimuth and elevation are swapped": lambda azimuth, elevation: (elevation, azimuth),
    "the elevations are zenith distances": lambda azimuth, elevation: (azimuth, 0.5 * np.pi - elevation),
    "azimuths are counted from south": lambda azimuth, elevation: (azimuth + np.pi, elevation),
}


@dataclass(frozen=True, eq=False)
class _Seen:
    """Samples of one pass: times, angles, and the elements of its target."""

    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    elements: Elements


@dataclass(frozen=True, eq=False)
class _Hypotheses:
    passes: Sequence[_Seen]
    site: Site
    refraction: RadioRefraction | Literal["standard"] | None

    def best(self) -> str:
        """Return the cause that explains the distance from the reference, "" where none does."""
        without = self._distance(lambda one: self._look(one, one.t_s))
        if without < _UNEXPLAINED_RAD:
            return ""
        least, cause = min([*self._misread(), *self._times(), *self._elsewhere()])
        if least > _LARGEST_SHARE * without:
            return ""
        then, now = math.degrees(least), math.degrees(without)
        return f"{cause} (the directions are then {then:.2f} deg from the reference, as they are {now:.2f})"

    def _look(self, one: _Seen, t_s: Array, site: Site | None = None) -> tuple[Array, Array, Array]:
        track = TopocentricTrack(one.elements, site or self.site, max_age_s=math.inf, refraction=self.refraction)
        look = track.sample(t_s)
        return look.azimuth_rad, look.elevation_rad, look.range_m

    def _look_late(self, late_s: float, one: _Seen) -> tuple[Array, ...]:
        return self._look(one, one.t_s - late_s)

    def _distance(self, expected: Callable[[_Seen], tuple[Array, ...]], angles: Angles | None = None) -> float:
        found = []
        for one in self.passes:
            seen = (one.azimuth_rad, one.elevation_rad)
            found.append(
                float(np.median(angular_distance_rad(*(angles(*seen) if angles else seen), *expected(one)[:2])))
            )
        return float(np.median(found))

    def _misread(self) -> Iterator[tuple[float, str]]:
        there = {id(one): self._look(one, one.t_s) for one in self.passes}
        for cause, angles in _MISREAD.items():
            yield self._distance(lambda one: there[id(one)], angles), cause

    def _times(self) -> Iterator[tuple[float, str]]:
        for zone in (k for k in range(-_ZONES, _ZONES + 1) if k):
            late_s = zone * _ZONE_S
            hours = f"{abs(late_s) / 3600.0:g} h {'ahead' if late_s > 0.0 else 'behind'}"
            yield self._distance(partial(self._look_late, late_s)), f"the time tags are {hours}: those of a time zone?"
        grids = [(one, np.arange(one.t_s[0] - _LATEST_S - 2.0, one.t_s[-1] + _LATEST_S + 2.0)) for one in self.passes]
        known = {id(one): (t_s, unit_vector_from_azel(*self._look(one, t_s)[:2])) for one, t_s in grids}
        seen = {id(one): unit_vector_from_azel(one.azimuth_rad, one.elevation_rad) for one in self.passes}

        def off(late_s: float) -> float:
            found = []
            for one in self.passes:
                t_s, path = known[id(one)]
                there = np.stack([np.interp(one.t_s - late_s, t_s, column) for column in path.T], axis=1)
                found.append(np.median(np.linalg.norm(there - seen[id(one)], axis=1)))
            return float(np.median(found))

        coarse = min(np.arange(-_LATEST_S, _LATEST_S + _STEP_S, _STEP_S).tolist(), key=off)
        late_s = min(np.arange(coarse - _STEP_S, coarse + _STEP_S, _FINE_S).tolist(), key=off)
        if abs(late_s) < _LEAST_S:
            return
        tai_s = float(leap_seconds().tai_minus_utc_s(float(self.passes[0].t_s[0])))
        scales = {"GPS time": tai_s - TAI_MINUS_GPS_S, "TAI": tai_s, "TT": tai_s + TT_MINUS_TAI_S}
        scale = [name for name, ahead_s in scales.items() if abs(late_s - ahead_s) < _SCALE_S]
        what = f": {scale[0]}, which is {scales[scale[0]]:g} s ahead of UTC?" if scale else ""
        yield off(late_s), f"the time tags are {abs(late_s):.1f} s {'late' if late_s > 0.0 else 'early'}{what}"

    def _elsewhere(self) -> Iterator[tuple[float, str]]:
        """Yield the place from where the passes look as they were seen."""
        place, offsets = self.site, np.zeros(2)
        for _ in range(_SITE_ROUNDS):
            rows, right = [], []
            for one in self.passes:
                azimuth, elevation, range_m = self._look(one, one.t_s, place)
                left = np.stack(
                    [wrap_rad(one.azimuth_rad - azimuth) * np.cos(elevation), one.elevation_rad - elevation]
                )
                zero, share = np.zeros_like(azimuth), np.stack([np.cos(elevation), np.ones_like(azimuth)])
                clockwise = np.stack([np.cos(azimuth), -np.sin(azimuth), zero])
                upward = np.stack([-np.sin(elevation) * np.sin(azimuth), -np.sin(elevation) * np.cos(azimuth),
                                   np.cos(elevation)])  # fmt: skip
                sight = -np.stack([clockwise, upward]) / range_m
                own = np.stack([[share[0], zero], [zero, share[1]]])
                rows.append(np.concatenate([sight, own], axis=1).transpose(0, 2, 1).reshape(-1, 5))
                right.append(left.ravel())
            matrix, wanted = np.concatenate(rows), np.concatenate(right)
            weight = np.ones(len(wanted))
            for _ in range(_SITE_ROUNDS):
                # By the sum of the sizes, not of the squares: one pass may be of another target.
                step: Any = np.linalg.lstsq(matrix * weight[:, np.newaxis], wanted * weight, rcond=None)[0]
                size = np.abs(wanted - matrix @ step)
                weight = np.maximum(size / max(float(np.median(size)), 1e-9), 1.0) ** -0.5
            offsets = step[3:]
            place = moved(place, step[:3])
            if np.linalg.norm(step[:3]) < 1.0:
                break
        east, north, up = away_m(self.site, place)
        size_m = math.hypot(east, north, up)
        if size_m < _LEAST_SITE_M:
            return
        turned: Angles = lambda azimuth, elevation: (azimuth - offsets[0], elevation - offsets[1])  # noqa: E731
        yield (self._distance(lambda one: self._look(one, one.t_s, place), turned),
               f"the antenna is {size_m / 1e3:.1f} km away from the site given: {east / 1e3:+.1f} km east, "
               f"{north / 1e3:+.1f} km north, {up / 1e3:+.1f} km up of it")  # fmt: skip


def moved(place: Site, metres: Array) -> Site:
    """Return the site so many metres east, north and up of `place`."""
    east, north, up = np.asarray(metres).tolist()
    longitude = place.longitude_rad + east / EARTH_RADIUS_M / math.cos(place.latitude_rad)
    return Site(
        latitude_rad=min(max(place.latitude_rad + north / EARTH_RADIUS_M, -0.5 * math.pi), 0.5 * math.pi),
        altitude_m=min(max(place.altitude_m + up, -500.0), 9000.0),
        longitude_rad=(longitude + math.pi) % (2.0 * math.pi) - math.pi,
    )


def away_m(place: Site, other: Site) -> tuple[float, float, float]:
    """Return how far east, north and up of `place` the other site is; the inverse of `moved`."""
    east = float(wrap_rad(other.longitude_rad - place.longitude_rad)) * math.cos(place.latitude_rad)
    north = other.latitude_rad - place.latitude_rad
    return east * EARTH_RADIUS_M, north * EARTH_RADIUS_M, other.altitude_m - place.altitude_m


def cause_of(
    passes: Sequence[TrackedPass], elements: Sequence[Elements], site: Site,
    refraction: RadioRefraction | Literal["standard"] | None,
) -> str:  # fmt: skip
    """Return the cause by which the samples are where they are, "" where none of those known does.

    Passes of targets that `elements` do not have judge nothing.
    """
    names, chosen = {each for one in elements for each in (one.name, str(one.catalogue_number))}, []
    known = [one.raw for one in passes if one.raw.target in names]
    for raw in known[:: max(1, math.ceil(len(known) / _PASSES))]:
        sound = raw.good & np.isfinite(raw.t_s) & np.isfinite(raw.azimuth_rad) & np.isfinite(raw.elevation_rad)
        rows = np.flatnonzero(sound)
        if len(rows) > 1:
            rows = rows[:: max(1, len(rows) // _SAMPLES)]
            order = rows[np.argsort(raw.t_s[rows], kind="stable")]
            chosen.append(_Seen(raw.t_s[order], raw.azimuth_rad[order], raw.elevation_rad[order],
                                find_elements(elements, raw.target)))  # fmt: skip
    return _Hypotheses(chosen, site, refraction).best() if chosen else ""
