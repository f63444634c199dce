"""From the operator's words to a track: elements, ephemeris message or body, and the site.

`TargetMemory` keeps what was chosen over a restart of the publisher.  Its file belongs to one
configuration (elements, satellite, site, offsets at the start): when that has changed, the file
is out of date and the configuration counts.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

from rf_pointing.core import DAY_S, KeptState, RadioRefraction, parameter
from rf_pointing.ephemeris import celestial
from rf_pointing.ephemeris.element_files import element_files, version_of
from rf_pointing.ephemeris.elements import Elements, find_elements, from_row
from rf_pointing.ephemeris.oem import METHODS, OemSegment, OemTarget
from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams
from rf_pointing.ephemeris.sites import SITES, Site
from rf_pointing.ephemeris.target_offsets import TargetOffsets
from rf_pointing.ephemeris.tle import verification_elements
from rf_pointing.ephemeris.track import TargetSource, TopocentricTrack

# Bodies of the sky by their names, case ignored.
BODIES: dict[str, Callable[[], TargetSource]] = {
    "sun": celestial.sun,
    "moon": celestial.moon,
    **{name.casefold(): partial(celestial.radio_source, name) for name in celestial.RADIO_SOURCES},
    **{name.casefold(): partial(celestial.planet, name) for name in celestial.PLANETS if name},
}


def body_of(name: str) -> TargetSource | None:
    """Return the body, place `radec ...` or point `azel ...` of a name, else None.

    ValueError if it is malformed.
    """
    word = "".join(name.casefold().split()[:1])
    if word == celestial.OWN_PLACE:
        return celestial.own_place(name).target()
    if word == celestial.OWN_POINT:
        return celestial.FixedPoint(name)
    made = BODIES.get(name.casefold())
    return made() if made else None


@dataclass(frozen=True, kw_only=True)
class SourceParams(TargetOffsets):
    """Target and site; the offsets move the target against its elements."""

    elements: str = parameter(
        "",
        "orbital elements (TLE, OMM) or ephemeris (OEM): a file, a folder of files, or an http(s) address; "
        "empty: the verification set of the sgp4 package",
    )
    satellite: str = parameter(
        "28057",
        "catalogue number or name of the satellite in the file, or Sun, Moon, a planet, a radio source, "
        "a place (radec RA DEC in deg) or a point (azel AZ EL in deg); empty: the first one",
    )
    site: Site = parameter(SITES["Goldstone DSS-13"], "where the antenna stands")
    interpolation: str = parameter(
        "", "method for an OEM that declares none; empty: such an OEM is refused", choices=("", *METHODS)
    )
    interpolation_degree: int = parameter(7, "its degree", 1, 15)
    hold: bool = parameter(False, "the target stands still on the sky where it was when this was set")
    stale_days: float = parameter(2.0, "age from the epoch at which elements are stale: a warning", 0.0, 3650.0)
    max_age_days: float = parameter(14.0, "age from the epoch at which elements are expired", 0.01, 3650.0)
    refraction: str = parameter(
        "standard", "weather of the refraction: mean of the altitude, measured, or a vacuum",
        choices=("standard", "measured", "none"),
    )  # fmt: skip
    weather: RadioRefraction = parameter(RadioRefraction(), "weather measured at the antenna")
    antenna: SatelliteAntennaParams = parameter(SatelliteAntennaParams(), "the satellite's antenna and attitude")


NO_TARGET = SourceParams(satellite="")
"""Where nothing is tracked unless it is named."""


def load_target(params: SourceParams) -> Elements | TargetSource:
    """Return the wanted object; errors name the file or the object."""
    body = body_of(params.satellite)
    if body is not None:
        return body
    if not params.elements and not params.satellite:
        bodies = ", ".join(name.title() for name in BODIES)
        place = "elements='' must be a file, a folder or an address of elements"
        raise ValueError(f"no target is named: {place}, or satellite='' one of {bodies}")
    if not params.elements:
        return find_elements(verification_elements(), params.satellite)
    contents = read_source(params.elements)
    try:
        return contents.find(params)
    except ValueError as error:
        raise ValueError(f"{contents.name}: {error}") from error


def load_catalogue(elements: str) -> list[Elements]:
    """Return the newest elements of each object at a place, "" of the verification set."""
    found = read_source(elements).elements if elements else verification_elements()
    if not found:
        raise ValueError(f"elements={elements!r} holds an ephemeris and no elements")
    # Sorted by epoch, so the newest of an object with several sets is the one that stays.
    return list({one.catalogue_number: one for one in sorted(found, key=lambda e: e.epoch_t_s)}.values())


def load_elements(params: SourceParams) -> Elements:
    """Return the wanted satellite's elements; ValueError for a target without any."""
    target = load_target(params)
    if not isinstance(target, Elements):
        raise ValueError(f"{target.name} is not tracked from mean elements")
    return target


def load_track(params: SourceParams, hold_t_s: float | None = None) -> TopocentricTrack:
    """Return the object as seen from the site, held where it is at `hold_t_s` if given."""
    return TopocentricTrack(
        load_target(params), params.site, hold_t_s=hold_t_s, antenna=params.antenna,
        refraction=refraction_at(params, params.site), max_age_s=params.max_age_days * DAY_S,
        **params.offsets,
    )  # fmt: skip


def refraction_at(params: SourceParams, station: Site) -> RadioRefraction | None:
    """Return the refraction that the parameters ask for."""
    kinds = {"measured": params.weather, "none": None}
    return kinds.get(params.refraction, RadioRefraction.standard(station.altitude_m))


@dataclass(frozen=True)
class SourceContents:
    """Elements of a file or of the files of a folder, by the name of the file or folder.

    `problems` lists the sets and files that are not used, each with its line and the reason.
    """

    name: str
    rows: list[list[Any]]
    """The elements as `from_row` takes them: of 30 000 one is wanted."""
    segments: list[OemSegment]
    problems: list[str]

    @cached_property
    def elements(self) -> list[Elements]:
        """All elements."""
        return [from_row(row) for row in self.rows]

    def find(self, params: SourceParams) -> Elements | OemTarget:
        """Return the wanted object: its elements, or else its ephemeris."""
        first = from_row(self.rows[0]).catalogue_number if self.rows else self.segments[0].name
        wanted = params.satellite.strip() or str(first)
        # An OEM names its object and its designator; either is accepted.
        key = wanted.strip().casefold()
        found = [segment for segment in self.segments if key in (segment.name.casefold(), segment.object_id.casefold())]
        if found:
            method = (params.interpolation, params.interpolation_degree) if params.interpolation else None
            # Where both are in a folder, an ephemeris of the operator is better than mean elements.
            return OemTarget(found, interpolation=method)
        if self.rows:
            return find_elements([from_row(row) for row in self._by_label.get(key, ())] or self.elements, wanted)
        names = sorted({f"{segment.name} ({segment.object_id})" for segment in self.segments})
        raise ValueError(f"satellite={wanted!r} is not among the objects of the ephemeris: {', '.join(names)}")

    @cached_property
    def _by_label(self) -> dict[str, list[list[Any]]]:
        """The rows by name and by number: a search of 30 000 takes milliseconds."""
        found: dict[str, list[list[Any]]] = {}
        for row in self.rows:
            for label in {row[0].casefold(), str(row[1])}:
                found.setdefault(label, []).append(row)
        return found


def read_source(location: str) -> SourceContents:
    """Return what is in a file, folder or address; a place without one good set is an error.

    The newest answer is kept while its files do not change: another satellite, or the list of what
    is not used, costs no second reading of a large catalogue.
    """
    return _read_source(location, version_of(location))


def unused(location: str) -> str:
    """Return "" or which sets and files of a place that was read are not used, and why."""
    try:
        return "; ".join(read_source(location).problems) if location else ""
    except (ValueError, OSError):
        # A body of the sky needs no file.
        return ""


@lru_cache(maxsize=1)
def _read_source(location: str, _version: object) -> SourceContents:
    # Imported here: the readers of all formats, which a node needs once.
    from rf_pointing.ephemeris.orbit_file import read_orbit_file

    files = element_files(location)
    found = SourceContents(files[0].name if len(files) == 1 else Path(location).name, [], [], [])
    for path in files:
        try:
            one = read_orbit_file(path)
        except ValueError as error:
            found.problems.append(f"{path.name}: {error}")
            continue
        found.rows.extend(one.rows)
        found.segments.extend(one.segments)
        found.problems.extend(f"{path.name}: {problem}" for problem in one.problems)
    if not found.rows and not found.segments:
        raise ValueError("; ".join(found.problems))
    return found


class TargetMemory:
    """The state file of one publisher; an empty name remembers nothing.

    `source` is the source as it was last, or as configured, `peak_rad` the least peak of the passes
    that are wanted, `hold_t_s` when the target is held, None while it moves.
    """

    def __init__(self, name: str, configured: SourceParams) -> None:
        self._state, self._configured = KeptState(name), dataclasses.asdict(configured)
        kept = self._state.recover()
        # Another configuration: what was kept belongs to another target.
        if kept.get("configured") != self._configured:
            kept = {}
        try:
            values, held_s = dict(kept.get("source", {})), kept.get("hold_t_s")
            # JSON kept these as tables; the parameter sets are made anew from them.
            for each in {"weather", "site", "antenna"} & values.keys():
                values[each] = getattr(configured, each).replace(**values[each])
            self.source = configured.replace(**values)
            self.peak_rad = float(kept.get("peak_rad", 0.0))
            self.hold_t_s = None if held_s is None else float(held_s)
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"state file {name} cannot be used: {error}") from error

    def keep(self, source: SourceParams, peak_rad: float, hold_t_s: float | None) -> None:
        """Write what has changed."""
        self.source, self.peak_rad, self.hold_t_s = source, peak_rad, hold_t_s
        kept = {"source": dataclasses.asdict(source), "peak_rad": peak_rad, "hold_t_s": hold_t_s}
        self._state.keep({"configured": self._configured, **kept})

    @property
    def problem(self) -> str:
        """Why the file does not hold what it should, empty when it does."""
        return self._state.problem
