"""From the operator's words to a track: elements, ephemeris message or body, and the station.

`TargetMemory` keeps what was chosen over a restart of the publisher.  Its file belongs to one
configuration (elements, satellite, station, offsets at the start): when that has changed, the file
is out of date and the configuration counts.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rf_pointing.core import Params, parameter
from rf_pointing.core.dates import DAY_S
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.core.whole_file import DATA_BYTES, KeptState, read_whole
from rf_pointing.ephemeris import (
    RADIO_SOURCES,
    Elements,
    OemTarget,
    Site,
    TargetSource,
    TopocentricTrack,
    find_elements,
    moon,
    radio_source,
    read_elements,
    read_oem,
    site,
    sun,
    verification_elements,
)
from rf_pointing.ephemeris.oem import METHODS

T = TypeVar("T")
# Bodies of the sky by their names, case ignored.
BODIES: dict[str, Callable[[], TargetSource]] = {
    "sun": sun,
    "moon": moon,
    **{name.casefold(): partial(radio_source, name) for name in RADIO_SOURCES},
}


@dataclass(frozen=True, kw_only=True)
class SourceParams(Params):
    """Target and station; the offsets move the target against its elements."""

    elements_file: str = parameter(
        "", "file of orbital elements (TLE, OMM) or ephemeris (OEM); empty: the verification set of the sgp4 package"
    )
    satellite: str = parameter(
        "28057", "catalogue number or name of the satellite in the file, or Sun, Moon or a radio source"
    )
    station: str = parameter("Goldstone DSS-13", "station name")
    along_track_offset_s: float = parameter(0.0, "target ahead of its elements by", low=-60.0, high=60.0)
    cross_track_offset_rad: float = parameter(0.0, "target right of its elements by", low=-0.1, high=0.1)
    interpolation: str = parameter(
        "", "method for an OEM that declares none; empty: such an OEM is refused", choices=("", *METHODS)
    )
    interpolation_degree: int = parameter(7, "its degree", low=1, high=15)
    hold: bool = parameter(False, "the target stands still on the sky where it was when this was set")
    max_age_days: float = parameter(14.0, "age from the epoch at which elements are expired", low=0.01, high=3650.0)
    refraction: str = parameter(
        "standard", "weather of the refraction: mean of the altitude, measured, or a vacuum",
        choices=("standard", "measured", "none"),
    )  # fmt: skip
    weather: RadioRefraction = parameter(RadioRefraction(), "weather measured at the antenna")


def load_target(params: SourceParams) -> Elements | TargetSource:
    """Return the wanted object; errors name the file or the object."""
    body = BODIES.get(params.satellite.casefold())
    if body is not None:
        return body()
    if not params.elements_file:
        return find_elements(verification_elements(), params.satellite)
    return _read(params.elements_file, partial(_object_in, params))


def load_catalogue(elements_file: str) -> list[Elements]:
    """Return the newest elements of every object in a file, "" for the verification set."""
    elements = _read(elements_file, read_elements) if elements_file else verification_elements()
    # Sorted by epoch, so the newest of an object with several sets is the one that stays.
    return list({one.catalogue_number: one for one in sorted(elements, key=lambda e: e.epoch_t_s)}.values())


def load_elements(params: SourceParams) -> Elements:
    """Return the wanted satellite's elements; ValueError for a target without any."""
    target = load_target(params)
    if not isinstance(target, Elements):
        raise ValueError(f"{target.name} is not tracked from mean elements")
    return target


def load_track(params: SourceParams, hold_t_s: float | None = None) -> TopocentricTrack:
    """Return the object as seen from the station, held where it is at `hold_t_s` if given."""
    station = site(params.station)
    return TopocentricTrack(
        load_target(params),
        station,
        along_track_offset_s=params.along_track_offset_s,
        cross_track_offset_rad=params.cross_track_offset_rad,
        hold_t_s=hold_t_s,
        refraction=refraction_at(params, station),
        max_age_s=params.max_age_days * DAY_S,
    )


def refraction_at(params: SourceParams, station: Site) -> RadioRefraction | None:
    """Return the refraction that the parameters ask for."""
    kinds = {"measured": params.weather, "none": None}
    return kinds.get(params.refraction, RadioRefraction.standard(station.altitude_m))


def first_time_s(params: SourceParams) -> float:
    """Return the epoch of the elements or the beginning of the ephemeris; ValueError for bodies."""
    target = load_target(params)
    if isinstance(target, Elements):
        return target.epoch_t_s
    if isinstance(target, OemTarget):
        return target.spans_t_s[0][0]
    raise ValueError(f"{target.name} has no epoch: say when to look for it (start)")


def _read(name: str, reader: Callable[[str], T]) -> T:
    """Return what `reader` makes of the text of a file; errors name the file."""
    path = Path(name)
    if not path.is_file():
        raise ValueError(f"elements_file={name!r} does not exist")
    text = read_whole(path, DATA_BYTES, "utf-8-sig")
    try:
        return reader(text)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error


def _object_in(params: SourceParams, text: str) -> Elements | OemTarget:
    wanted = params.satellite
    if not text.lstrip().startswith("CCSDS_OEM_VERS"):
        return find_elements(read_elements(text), wanted)
    segments = read_oem(text)
    # An OEM names its object and its designator; either is accepted.
    key = wanted.strip().casefold()
    found = [segment for segment in segments if key in (segment.name.casefold(), segment.object_id.casefold())]
    if not found:
        names = sorted({f"{segment.name} ({segment.object_id})" for segment in segments})
        raise ValueError(f"satellite={wanted!r} is not among the objects of the ephemeris: {', '.join(names)}")
    method = (params.interpolation, params.interpolation_degree) if params.interpolation else None
    return OemTarget(found, interpolation=method)


class TargetMemory:
    """The state file of one publisher; an empty name remembers nothing."""

    def __init__(self, name: str, configured: SourceParams) -> None:
        self._state, self._configured = KeptState(name), configured
        kept = self._state.recover()
        # Another configuration: what was kept belongs to another target.
        mine = kept.get("configured") == dataclasses.asdict(configured)
        self._kept: dict[str, Any] = kept if mine else {}
        try:
            # Whatever is in it is read now: later it would end a node.
            _ = self.source, self.peak_rad, self.hold_t_s
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"state file {name} cannot be used: {error}") from error

    @property
    def source(self) -> SourceParams:
        """The source as it was last, or as configured."""
        kept = dict(self._kept.get("source", {}))
        # JSON kept the weather as a table; the parameter set is made anew from it.
        if "weather" in kept:
            kept["weather"] = self._configured.weather.replace(**kept["weather"])
        return self._configured.replace(**kept)

    @property
    def peak_rad(self) -> float:
        """Least peak of the passes that are wanted."""
        return float(self._kept.get("peak_rad", 0.0))

    @property
    def hold_t_s(self) -> float | None:
        """Instant at which the target is held, None when it moves."""
        held_s = self._kept.get("hold_t_s")
        return None if held_s is None else float(held_s)

    def keep(self, source: SourceParams, peak_rad: float, hold_t_s: float | None) -> None:
        """Write what has changed."""
        configured = dataclasses.asdict(self._configured)
        self._kept = {"source": dataclasses.asdict(source), "peak_rad": peak_rad, "hold_t_s": hold_t_s}
        self._state.keep({"configured": configured, **self._kept})

    @property
    def problem(self) -> str:
        """Why the file does not hold what it should, empty when it does."""
        return self._state.problem
