"""Passes of a whole catalogue over one site.

Objects of similar speed are propagated together on an even grid, turned into the site's axes and
searched together by `stays_above`.  Positions are polynomials through ten grid points: with a step
of 0.45 rad of circular motion the error is 0.00024 (0.45)^10 r, 0.6 m in a low orbit, 0.1 ms of its
motion.  `find_passes` gives the rates of a chosen pass.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from sgp4.api import Satrec, SatrecArray

from rf_pointing.core import DAY_S, azel_from_unit_vector, require_between, require_choice, utc_text
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.core.types import Array, BoolArray
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.look_angles import SENSES
from rf_pointing.ephemeris.passes import Pass, find_passes, part_searched
from rf_pointing.ephemeris.sgp4_orbit import GMST_RATE_RAD_S, LEAST_RADIUS_KM, earth_fixed_from_teme
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.state_vector import StateVector
from rf_pointing.ephemeris.stays import LEAN, Horizon, SkyMotion, Stays, mask_of, parts_above, stays_above
from rf_pointing.ephemeris.time_scales import POSIX_EPOCH_JD, leap_seconds
from rf_pointing.ephemeris.track import TargetSource, TopocentricTrack

_CIRCULAR_STEP_RAD, _ECCENTRIC_STEP_RAD = 0.45, 0.25
# Largest eccentricity of the long step: the series of an eccentric orbit around its perigee
# converges slower.
_CIRCULAR = 0.05
# Steps are rounded down to a ladder, so that thousands of objects share twenty grids.
_LADDER_S = (60, 90, 120, 150, 180, 210, 240, 270, 300, 330, 360, 390, 420, 450, 480, 600, 900, 1200, 1800, 2700)
# Parts of a step at which turning points are looked for.
_PARTS = 4
_HORIZON_STEP_S = 2.0
# Parts of each half of a pass at which the azimuth is looked at.
_AZIMUTH_PARTS = 6
# More at once gains no speed and fills the memory: 64 objects over 31 days are 0.3 GB.
_CHUNK = 64


@dataclass(frozen=True, slots=True)
class CataloguePass:
    """One stay of one object above the mask; angles apparent, azimuths in [0, 2 pi)."""

    target: Elements | TargetSource
    """Mean elements; an ephemeris or a body where `of_window` made the pass."""
    aos_t_s: float
    tca_t_s: float
    los_t_s: float
    peak_elevation_rad: float
    aos_azimuth_rad: float
    tca_azimuth_rad: float
    los_azimuth_rad: float
    azimuth_path_rad: tuple[float, float, float, float]
    """At rise, smallest, largest, and at set: continuous over the pass."""
    aos_elevation_rad: float
    los_elevation_rad: float
    tca_azimuth_rate_rad_s: float
    """Near the zenith the fastest azimuth rate of the pass."""
    tca_range_m: float
    rises_before: bool
    sets_after: bool

    @classmethod
    def of_window(cls, target: Elements | TargetSource, track: TopocentricTrack, window: Pass) -> "CataloguePass":
        """Return a pass that the search of one object has found."""
        looks = track.sample([window.aos_t_s, window.tca_t_s, window.los_t_s])
        rise, highest, fall = (looks.azimuth_rad % math.tau).tolist()
        return cls(
            target, window.aos_t_s, window.tca_t_s, window.los_t_s, window.peak_elevation_rad, rise, highest, fall,
            (window.aos_azimuth_rad, window.azimuth_min_rad, window.azimuth_max_rad, window.los_azimuth_rad),
            float(looks.elevation_rad[0]), float(looks.elevation_rad[2]), abs(float(looks.azimuth_rate_rad_s[1])),
            float(looks.range_m[1]), window.rises_before, window.sets_after,
        )  # fmt: skip

    @property
    def name(self) -> str:
        """Name of the object."""
        return self.target.name

    @property
    def catalogue_number(self) -> int | None:
        """Number of the object; a body of the sky has none."""
        return self.target.catalogue_number if isinstance(self.target, Elements) else None

    @property
    def label(self) -> str:
        """The catalogue number, else the name: it tells the objects of a plan apart."""
        return self.name if self.catalogue_number is None else str(self.catalogue_number)

    @property
    def duration_s(self) -> float:
        """Time above the mask."""
        return self.los_t_s - self.aos_t_s


@dataclass(frozen=True, slots=True)
class CatalogueSearch:
    """All passes in order of rise, and what was searched in part or not at all, with the reason."""

    passes: tuple[CataloguePass, ...]
    unsearched: tuple[tuple[Elements, str], ...]


def find_catalogue_passes(
    elements: Sequence[Elements], site: Site, start_t_s: float, duration_s: float,
    min_elevation_rad: float | Horizon, *,
    refraction: RadioRefraction | Literal["standard"] | None = "standard",
    light_time: str = "receive", max_age_s: float = 14.0 * DAY_S,
    orientation: IersEarthOrientation | None = None,
) -> CatalogueSearch:  # fmt: skip
    """Return the passes of all `elements` above an elevation or a horizon (apparent) in a time.

    Options are as for `TopocentricTrack`.  Objects that are too old are listed, and those that
    decay in the interval, which are searched one by one up to there.
    """
    require_between("duration_s", duration_s, 60.0, 31.0 * DAY_S)
    require_choice("light_time", light_time, SENSES)
    # The grid is even in UTC; a leap second in it would shift half of the orbit by 8 km.
    _refuse_leap_second(start_t_s, duration_s)
    air = RadioRefraction.standard(site.altitude_m) if refraction == "standard" else refraction
    # The grid knows true elevations: the mask goes through the refraction once, not every sample.
    horizon, sine = mask_of(min_elevation_rad, air)
    source = orientation or IersEarthOrientation()
    options: dict[str, Any] = {"refraction": air, "light_time": light_time, "max_age_s": max_age_s}
    options["orientation"] = source
    passes: list[CataloguePass] = []
    usable, unsearched = _usable(elements, start_t_s, duration_s, max_age_s)
    for chunk, step_s in _chunks(usable, duration_s):
        enu_m, codes = _sampled(chunk, site, start_t_s, duration_s, step_s, SENSES[light_time], source)
        for one in (e for e, code in zip(chunk, codes, strict=True) if code):
            try:
                track = TopocentricTrack(one, site, **options)
                windows = find_passes(track, start_t_s, duration_s, min_elevation_rad)
                passes += [CataloguePass.of_window(one, track, window) for window in windows]
                unsearched.append((one, part_searched(track, start_t_s, duration_s)))
            except ValueError as error:
                unsearched.append((one, f"was not searched: {error}"))
        searched = [one for one, code in zip(chunk, codes, strict=True) if not code]
        if searched:
            motion = SkyMotion.through(enu_m[codes == 0], start_t_s, step_s)
            stays = stays_above(motion, sine, step_s / _PARTS)
            if horizon:
                stays = parts_above(stays, partial(_clearance, motion, air, horizon), _HORIZON_STEP_S)
            passes += _described(stays, searched, motion, air)
    return CatalogueSearch(tuple(sorted(passes, key=lambda p: p.aos_t_s)), tuple(unsearched))


class CatalogueSky:
    """True directions of many objects at a few times, those within `max_age_s` of their epoch."""

    def __init__(self, elements: Sequence[Elements], site: Site, t_s: float, max_age_s: float = 14.0 * DAY_S) -> None:
        self.elements, _ = _usable(elements, t_s, 0.0, max_age_s)
        self._site, self._orientation = site, IersEarthOrientation()
        self._records = [_record(one, t_s) for one in self.elements]

    def directions(self, t_s: Array, rows: Sequence[int] | None = None) -> tuple[Array, BoolArray]:
        """Return unit vectors (objects, times, 3) east, north, up, and which objects are known."""
        records = self._records if rows is None else [self._records[row] for row in rows]
        if not records:
            return np.zeros((0, len(t_s), 3)), np.zeros(0, dtype=np.bool_)
        orbit, codes = _orbits(records, t_s, self._orientation)
        seen = _seen(orbit, self._site, SENSES["receive"]) @ np.array(self._site.axes).T
        known = (codes == 0) & np.all(np.isfinite(seen), axis=(1, 2))
        # Rows that cannot be propagated point down, where nothing is looked for.
        seen[~known] = (0.0, 0.0, -1.0)
        return seen / np.linalg.norm(seen, axis=-1, keepdims=True), known


def _clearance(motion: SkyMotion, air: RadioRefraction | None, horizon: Horizon, t_s: Array) -> Array:
    azimuth, elevation = azel_from_unit_vector(motion.at(t_s, 1)[0].T)
    return np.asarray((air.apply(elevation) if air else elevation) - horizon(azimuth))


def _refuse_leap_second(start_t_s: float, duration_s: float) -> None:
    ends = (start_t_s - 2.0 * DAY_S, start_t_s + duration_s + 2.0 * DAY_S)
    if leap_seconds().tai_minus_utc_s(ends[0]) != leap_seconds().tai_minus_utc_s(ends[1]):
        near = f"a leap second lies within 2 days of the interval from {utc_text(start_t_s)}"
        breaks = "where the even grid of the catalogue search breaks; use find_passes"
        raise ValueError(f"start_t_s={start_t_s}: {near}, {breaks}")


def _usable(
    elements: Sequence[Elements], start_t_s: float, duration_s: float, max_age_s: float
) -> tuple[list[Elements], list[tuple[Elements, str]]]:
    usable: list[Elements] = []
    unsearched: list[tuple[Elements, str]] = []
    for one in elements:
        # Both ends count: a search may begin before the epoch and end after it.
        age_s = max(abs(start_t_s - one.epoch_t_s), abs(start_t_s + duration_s - one.epoch_t_s))
        if age_s <= max_age_s:
            usable.append(one)
            continue
        off = f"{age_s / DAY_S:.2f} days from its epoch, must be <= {max_age_s / DAY_S:.2f} days"
        unsearched.append((one, f"was not searched: {off}"))
    return usable, unsearched


def _chunks(elements: list[Elements], duration_s: float) -> Iterator[tuple[list[Elements], float]]:
    """Yield objects that share a grid, its step 0.45 rad (0.25 if eccentric) at their perigee."""
    by_step: dict[int, list[Elements]] = {}
    for one in elements:
        e = one.eccentricity
        # The rate at perigee decides: there the direction turns fastest.
        fastest_rad_s = one.mean_motion_rad_s * (1.0 + e) ** 2 / (1.0 - e * e) ** 1.5
        longest_s = (_CIRCULAR_STEP_RAD if e < _CIRCULAR else _ECCENTRIC_STEP_RAD) / fastest_rad_s
        wanted_s = next((s for s in reversed(_LADDER_S) if s <= longest_s), _LADDER_S[0])
        by_step.setdefault(wanted_s, []).append(one)
    for wanted_s, group in by_step.items():
        step_s = duration_s / math.ceil(duration_s / wanted_s)
        for first in range(0, len(group), _CHUNK):
            yield group[first : first + _CHUNK], step_s


def _sampled(
    elements: list[Elements], site: Site, start_t_s: float, duration_s: float, step_s: float,
    sense: float, orientation: IersEarthOrientation,
) -> tuple[Array, NDArray[np.uint8]]:  # fmt: skip
    """Return positions (objects, times, 3) east-north-up, `LEAN` more times, and SGP4 errors."""
    count = round(duration_s / step_s)
    t_s = start_t_s + step_s * np.arange(-LEAN[0], count + LEAN[1], dtype=np.float64)
    orbit, codes = _orbits([_record(one, start_t_s) for one in elements], t_s, orientation)
    return _seen(orbit, site, sense) @ np.array(site.axes).T, codes


def _orbits(
    records: list[Satrec], t_s: Array, orientation: IersEarthOrientation
) -> tuple[StateVector, NDArray[np.uint8]]:
    """Return Earth-fixed motions (objects, times) and the SGP4 error code of each object."""
    days = np.floor(t_s / DAY_S)
    codes, position_km, velocity_km_s = SatrecArray(records).sgp4(POSIX_EPOCH_JD + days, (t_s - days * DAY_S) / DAY_S)
    (x, y, z), (vx, vy, vz) = np.moveaxis(position_km, -1, 0) * 1e3, np.moveaxis(velocity_km_s, -1, 0) * 1e3
    # Only position and velocity are used here; whoever interpolates has derivatives of its own.
    none = (0.0, 0.0, 0.0)
    orbit = earth_fixed_from_teme(StateVector((x, y, z), (vx, vy, vz), none, none), t_s, orientation)
    # On its way down SGP4 gives places without an error, of millions of kilometres at the end.
    low = np.einsum("otc,otc->ot", position_km, position_km).min(axis=1) < LEAST_RADIUS_KM**2
    return orbit, codes.max(axis=1) | low.astype(np.uint8)


def _seen(orbit: StateVector, site: Site, sense: float) -> Array:
    """Return the Earth-fixed vector (objects, times, 3) from the antenna to each object's image."""
    east, north, _ = antenna = np.array(site.position_m)
    relative: Array = np.stack(orbit.position, axis=-1) - antenna
    if sense == 0.0:
        return relative
    relative_velocity = np.stack(orbit.velocity, axis=-1) - GMST_RATE_RAD_S * np.array([-north, east, 0.0])
    distance = np.sqrt(np.einsum("otc,otc->ot", relative, relative))
    rate = np.einsum("otc,otc->ot", relative, relative_velocity) / distance
    # To first order in the light time: the second is 2 mm at a geostationary satellite.
    light_time_s = distance / (SPEED_OF_LIGHT_M_S + sense * rate)
    seen: Array = relative - sense * light_time_s[..., None] * relative_velocity
    return seen


def _record(elements: Elements, t_s: float) -> Satrec:
    """Return the record with the leap seconds from epoch to `t_s` moved into its epoch."""
    table = leap_seconds()
    inserted_s = table.tai_minus_utc_s(t_s) - table.tai_minus_utc_s(elements.epoch_t_s)
    if inserted_s != 0.0:
        elements = dataclasses.replace(elements, epoch_t_s=elements.epoch_t_s - inserted_s)
    return elements.satrec()


def _described(
    stays: Stays, elements: list[Elements], motion: SkyMotion, air: RadioRefraction | None
) -> list[CataloguePass]:
    """Return the passes with apparent angles."""
    times = stays.rise, stays.highest(motion)[0], stays.fall
    row = motion.objects_at(stays.rise)
    (rise, (place, velocity), fall) = (motion.at(t_s, 2) for t_s in times)
    angles = [azel_from_unit_vector(each.T) for each in (rise[0], place, fall[0])]
    low, peaks, down = (air.apply(elevation) if air else elevation for _, elevation in angles)
    across = np.abs(place[1] * velocity[0] - place[0] * velocity[1])
    columns = (
        *(t_s - row * motion.period_s for t_s in times), peaks, *(azimuth for azimuth, _ in angles),
        _azimuth_paths(times, motion), low, down,
        across / np.maximum(place[0] ** 2 + place[1] ** 2, 1.0), np.linalg.norm(place, axis=0),
        *stays.cut_off,
    )  # fmt: skip
    plain = (column if isinstance(column, list) else column.tolist() for column in columns)
    rows = zip(row.tolist(), *plain, strict=True)
    return [CataloguePass(elements[number], *values) for number, *values in rows]


def _azimuth_paths(ends: tuple[Array, Array, Array], motion: SkyMotion) -> list[tuple[float, ...]]:
    """Return azimuths at rise, smallest, largest and at set, continuous from [0, 2 pi) at rise."""
    # In equal parts before and after the culmination: near the zenith half a turn is made there.
    parts = np.linspace(0.0, 1.0, _AZIMUTH_PARTS + 1)
    rise, top, fall = (one[:, None] for one in ends)
    times = np.concatenate([rise + (top - rise) * parts, top + (fall - top) * parts[1:]], axis=1)
    places = motion.at(times.ravel(), 1)[0].T
    azimuth = np.unwrap(azel_from_unit_vector(places)[0].reshape(times.shape), axis=1)
    columns = (azimuth[:, 0], azimuth.min(axis=1), azimuth.max(axis=1), azimuth[:, -1])
    return list(zip(*(column.tolist() for column in columns), strict=True))
