"""Targets: a satellite of a file, folder, address or the verification set, or a body."""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rf_pointing import __version__
from rf_pointing.core.dates import DAY_S
from rf_pointing.ephemeris import Elements, OemTarget, Site, TargetSource, TopocentricTrack, oem_text
from rf_pointing.ephemeris.element_files import SUFFIXES, element_files, is_address
from rf_pointing.ephemeris.source import SourceParams, load_catalogue, load_target

if TYPE_CHECKING:
    from rf_pointing.station.pointing.multi_satellite_plan import Wish

MAX_AGE_S = SourceParams().max_age_days * DAY_S
"""Age from the epoch beyond which elements are refused."""
ELEMENTS_HELP = "elements: a file, a folder, or an http(s) address, which is requested at most every 2 h"
FIRST_SATELLITE = "28057"
"""The satellite that is meant when neither a place nor a name is given: CBERS-2."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """One satellite or body, and where its elements are; `rp.elements` makes it.

    Attributes
    ----------
    location : file, folder or http(s) address; "" for the verification set of sgp4.
    satellite : catalogue number or name in it, or Sun, Moon, a radio source, `radec` or `azel`.
    interpolation, interpolation_degree : for an OEM that declares none.
    priority, min_peak_deg, band : of its passes in a plan; larger priorities first.
    contact_minutes : in a plan of a network, the contact that it is owed every 24 h.
    """

    location: str = ""
    satellite: str = FIRST_SATELLITE
    interpolation: str = ""
    interpolation_degree: int = 7
    priority: int = 0
    min_peak_deg: float | None = None
    band: str = ""
    contact_minutes: float = 0.0

    @cached_property
    def problem(self) -> str:
        """Why the elements of an address are older than its source allows; "" if they are not.

        The address is requested here, at most every 2 h.
        """
        if not is_address(self.location):
            return ""
        # Not at the top: files and folders do without a network client.
        from rf_pointing.ephemeris.fetching import current_elements

        return current_elements(self.location)

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters of the nodes that predict it; a run has the elements it was planned with."""
        return {
            "source.satellite": self.satellite,
            "source.elements": str(self.file.resolve()) if self.file else "",
            "source.interpolation": self.interpolation,
            "source.interpolation_degree": self.interpolation_degree,
        }

    @cached_property
    def found(self) -> Elements | TargetSource:
        """The elements, the ephemeris or the body; ValueError names the file and what is near."""
        _ = self.problem
        return load_target(SourceParams(
            elements=self.location, satellite=self.satellite,
            interpolation=self.interpolation, interpolation_degree=self.interpolation_degree,
        ))  # fmt: skip

    @property
    def name(self) -> str:
        """Name of the object in its file."""
        return self.found.name

    @property
    def first_t_s(self) -> float:
        """Epoch of the elements or begin of the ephemeris; ValueError for a body without one."""
        if isinstance(self.found, Elements):
            return self.found.epoch_t_s
        if isinstance(self.found, OemTarget):
            return self.found.spans_t_s[0][0]
        raise ValueError(f"{self.name} has no epoch: say when to look for it (start)")

    @property
    def file(self) -> Path | None:
        """File or folder of the elements, the kept file of an address; None without a location."""
        if not self.location:
            return None
        _ = self.problem
        return element_files(self.location)[0] if is_address(self.location) else Path(self.location)

    def wish(self) -> "Wish":
        """Return the target as the plan of many takes it."""
        from rf_pointing.station.pointing.multi_satellite_plan import Wish

        return Wish(
            target=self.found, priority=self.priority, min_peak_rad=math.radians(self.min_peak_deg or 0.0),
            band=self.band, contact_s=60.0 * self.contact_minutes,
        )  # fmt: skip

    def to_oem(self, *, start_t_s: float, duration_s: float, created_t_s: float) -> str:
        """Return its motion over a time as a CCSDS OEM."""
        track = self.track(SourceParams().site)
        named = getattr(self.found, "international_designator", "") or self.satellite
        return oem_text(
            track.target, named, start_t_s, start_t_s + duration_s,
            originator=f"rf_pointing {__version__}", created_t_s=created_t_s,
        )  # fmt: skip

    def track(self, site: Site) -> TopocentricTrack:
        """Return its apparent motion over `site`: angles and rates in rad with `sample(t_s)`."""
        return TopocentricTrack(self.found, site, max_age_s=MAX_AGE_S)


def elements(
    where: str | Path = "",
    *,
    satellite: str | int | None = None,
    priority: int = 0,
    min_peak_deg: float | None = None,
    band: str = "",
    contact_minutes: float = 0.0,
    interpolation: str = "",
    interpolation_degree: int = 7,
) -> Target:
    """Return a satellite of a file, a folder, an http(s) address, or of the verification set.

    Parameters
    ----------
    where : TLE, OMM (JSON, XML, CSV, KVN) or OEM: file, folder or address, which is requested at
        most every 2 h.  Any other text is a name or number in the verification set of sgp4, or
        Sun, Moon, a planet, a radio source, `radec RA DEC` or `azel AZ EL` (true, in deg).
    satellite : its name or catalogue number there; by default the first one.
    priority, min_peak_deg, band : of its passes in a plan; larger priorities win.
    contact_minutes : in `plan_network`, the contact owed every 24 h.
    interpolation, interpolation_degree : HERMITE, LAGRANGE or LINEAR, for an OEM without one.

    Raises
    ------
    ValueError
        A place without elements, or a satellite that is not there, with what is near.

    Warns
    -----
    UserWarning
        The address gave nothing newer, and the elements that are kept are used.

    Examples
    --------
    >>> rp.elements("stations.tle", satellite="ISS (ZARYA)")  # doctest: +SKIP
    >>> rp.elements("CBERS 2").name
    'CBERS 2'
    """
    text = str(where)
    place = bool(text) and (is_address(text) or Path(text).exists() or "/" in text or Path(text).suffix in SUFFIXES)
    if text and not place:
        if satellite is not None:
            raise ValueError(f"elements={text!r} does not exist")
        text, satellite = "", text
    chosen = ("" if place else FIRST_SATELLITE) if satellite is None else str(satellite)
    target = Target(
        location=text, satellite=chosen, interpolation=interpolation, interpolation_degree=interpolation_degree,
        priority=priority, min_peak_deg=min_peak_deg, band=band, contact_minutes=contact_minutes,
    )  # fmt: skip
    _ = target.found
    if target.problem:
        warnings.warn(target.problem, stacklevel=2)
    return target


def catalogue(where: str | Path = "", *, min_peak_deg: float | None = None) -> list[Target]:
    """Return every satellite of a file, folder or address, each by its newest elements.

    Raises ValueError for a place without mean elements.
    """
    warning = Target(location=str(where)).problem
    if warning:
        warnings.warn(warning, stacklevel=2)
    return every_satellite(str(where), min_peak_deg)


def every_satellite(location: str, min_peak_deg: float | None) -> list[Target]:
    """Return the targets of `catalogue`, from elements that have been requested."""
    return [of_elements(location, one, min_peak_deg=min_peak_deg) for one in load_catalogue(location)]


def of_elements(location: str, found: Elements, **wanted: Any) -> Target:
    """Return the target of elements from `location`; `wanted` are fields of it."""
    target = Target(location=location, satellite=str(found.catalogue_number), **wanted)
    # A catalogue of 10 000 satellites is read once and not once for each.
    target.__dict__["found"] = found
    return target
