"""The operator's offsets of a target: one set of numbers, applied to its motion on the sky.

Each moves the direction d by a rotation, so that the rates stay the derivatives of the angles:

    time            d(t + dt), orbit and Earth            along track   the orbit alone ahead by dt
    right ascension d turned about the pole               declination   towards the pole
    cross-elevation to the right, along a great circle    cross track   to the right of the motion

Azimuth and elevation are added to the apparent angles.  Positive: later, east, north, up, right.
"""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from rf_pointing.core import KeptState, Params, parameter, require_choice, require_id
from rf_pointing.ephemeris.look_angles import moved_about, moved_across, moved_towards
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.state_vector import StateVector

LARGEST_RAD, LARGEST_S = 0.1, 60.0
UP = (0.0, 0.0, 1.0)
MOST_SETS = 100


def _angle(text: str) -> float:
    found: float = parameter(0.0, text, -LARGEST_RAD, LARGEST_RAD)
    return found


@dataclass(frozen=True, kw_only=True)
class TargetOffsets(Params):
    """Offsets that an operator adds to a target."""

    along_track_offset_s: float = parameter(0.0, "target ahead of its elements by", -LARGEST_S, LARGEST_S)
    cross_track_offset_rad: float = _angle("target right of its elements by")
    time_offset_s: float = parameter(
        0.0, "target where it is so much later, the Earth turned too", -LARGEST_S, LARGEST_S
    )
    azimuth_offset_rad: float = _angle("added to the azimuth")
    elevation_offset_rad: float = _angle("added to the apparent elevation")
    cross_elevation_offset_rad: float = _angle("target right of where it is, on a great circle")
    right_ascension_offset_rad: float = _angle("added to the right ascension of date")
    declination_offset_rad: float = _angle("added to the declination of date")

    @property
    def offsets(self) -> dict[str, Any]:
        """The offsets alone, by name."""
        return {name: getattr(self, name) for name in OFFSETS}

    @property
    def offsets_text(self) -> str:
        """The offsets that are not zero, in deg and s; "" without one."""
        shown = []
        for name, value in self.offsets.items():
            word, _, unit = name.rpartition("_offset_")
            number = f"{value:g} s" if unit == "s" else f"{math.degrees(value):.6g} deg"
            shown += [f"{word.replace('_', ' ')} {number}"] * bool(value)
        return ", ".join(shown)

    def moved(self, enu: StateVector, site: Site) -> StateVector:
        """Return a motion in east, north, up with the offsets that are rotations of the sky."""
        pole = (0.0, math.cos(site.latitude_rad), math.sin(site.latitude_rad))
        # A target at rest has no across; without an offset it must stay usable.
        if self.cross_track_offset_rad:
            enu = moved_across(enu, self.cross_track_offset_rad)
        if self.right_ascension_offset_rad:
            enu = moved_about(enu, self.right_ascension_offset_rad, pole)
        if self.declination_offset_rad:
            enu = moved_towards(enu, self.declination_offset_rad, pole)
        if self.cross_elevation_offset_rad:
            enu = moved_across(enu, self.cross_elevation_offset_rad, UP)
        return enu


OFFSETS = tuple(each.name for each in fields(TargetOffsets))


class OffsetSets:
    """Named sets of offsets of each band, in a file next to the state of the publisher.

    A band of the description is a feed and a receiver; two feeds of one frequency are two bands.
    """

    def __init__(self, state_file: str, band: str) -> None:
        self._path = str(Path(state_file).with_name("offset_sets.json")) if state_file else ""
        self._state, self._band = KeptState(self._path), band
        self._all = self._state.recover()
        for sets in self._all.values():
            for name in sets if isinstance(sets, dict) else ():
                self._read(sets, name)

    @property
    def names(self) -> list[str]:
        """Names of the sets of the band in use."""
        return sorted(self._all.get(self._band, {}))

    def keep(self, name: str, given: TargetOffsets) -> str:
        """Keep offsets under a name and say so; ValueError with the reason."""
        require_id("name", name)
        if not self._path:
            raise ValueError("publisher.state_file='' must name a file: sets are kept next to it")
        if name not in self.names and len(self.names) >= MOST_SETS:
            raise ValueError(f"{len(self.names)} sets of the {self._band} band, must be < {MOST_SETS}")
        self._write({**self._all.get(self._band, {}), name: given.offsets})
        return f"kept as {name}"

    def recall(self, name: str) -> dict[str, float]:
        """Return the offsets kept under a name; ValueError for one that is unknown."""
        require_choice("name", name, self.names)
        return self._read(self._all[self._band], name)

    def forget(self, name: str) -> str:
        """Forget a set and say so; ValueError for one that is unknown."""
        require_choice("name", name, self.names)
        kept = self._all[self._band]
        self._write({each: kept[each] for each in kept if each != name})
        return f"{name} is forgotten"

    def _read(self, sets: dict[str, Any], name: str) -> dict[str, float]:
        try:
            return TargetOffsets(**sets[name]).offsets
        except (ValueError, TypeError) as error:
            raise ValueError(f"{self._path}: set {name!r}: {error}") from error

    def _write(self, sets: dict[str, Any]) -> None:
        wanted = {**self._all, self._band: sets}
        self._state.keep(wanted)
        if self._state.problem:
            raise ValueError(self._state.problem)
        self._all = wanted
