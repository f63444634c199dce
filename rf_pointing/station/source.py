"""From the operator's words to a track: which elements, which satellite, which station."""

from dataclasses import dataclass
from pathlib import Path

from rf_pointing.ephemeris import (
    Elements,
    TopocentricTrack,
    find_elements,
    read_elements,
    site,
    verification_elements,
)
from rf_pointing.geometry import Params, parameter

__all__ = ["SourceParams", "load_elements", "load_track"]

DAY_S = 86400.0


@dataclass(frozen=True, kw_only=True)
class SourceParams(Params):
    """Target and station; the offsets move the target against its elements."""

    elements_file: str = parameter("", "file of orbital elements; empty: the verification set of the sgp4 package")
    satellite: str = parameter("28057", "catalogue number or name of the satellite in the elements")
    station: str = parameter("Goldstone DSS-13", "station name")
    along_track_offset_s: float = parameter(0.0, "target ahead of its elements by", low=-60.0, high=60.0)
    cross_track_offset_rad: float = parameter(0.0, "target right of its elements by", low=-0.1, high=0.1)
    hold: bool = parameter(False, "the target stands still on the sky where it was when this was set")
    max_age_days: float = parameter(14.0, "age from the epoch at which elements are expired", low=0.01, high=3650.0)


def load_elements(params: SourceParams) -> Elements:
    """Return the wanted satellite's elements; errors name the file or the satellite."""
    if not params.elements_file:
        return find_elements(verification_elements(), params.satellite)
    path = Path(params.elements_file)
    if not path.is_file():
        raise ValueError(f"elements_file={params.elements_file!r} does not exist")
    try:
        return find_elements(read_elements(path.read_text()), params.satellite)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error


def load_track(params: SourceParams, hold_t_s: float | None = None) -> TopocentricTrack:
    """Return the satellite as seen from the station, standing still where it is at `hold_t_s` if that is given."""
    return TopocentricTrack(
        load_elements(params),
        site(params.station),
        along_track_offset_s=params.along_track_offset_s,
        cross_track_offset_rad=params.cross_track_offset_rad,
        hold_t_s=hold_t_s,
        max_age_s=params.max_age_days * DAY_S,
    )
