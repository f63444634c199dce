"""A list of targets to plan for: names or catalogue numbers, with priority and least peak.

A list is a text file, one target a line; `#` between blanks begins a comment:

    25544, priority=5, peak=20    # ISS, passes that peak above 20 deg
    CBERS 2
    Moon, priority=-1             # in the gaps; Sun and radio sources as well
    TERRA, band=X                 # in this band of the station
    AQUA, contact=30              # of a network: 30 min a day at least
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rf_pointing.api.target import Target, of_elements
from rf_pointing.api.target import elements as elements_of
from rf_pointing.core.whole_file import read_whole
from rf_pointing.ephemeris import Elements, find_elements
from rf_pointing.ephemeris.source import BODIES, load_catalogue

PRIORITIES = (-1000, 1000)
_NUMBERS = {"peak": ("min_peak_deg", 90.0, "deg"), "contact": ("contact_minutes", 1440.0, "min")}
"""Numbers of a line: the field of the target, the largest value, and its unit."""
MOST_ERRORS = 10
"""Errors of one list that are reported at once."""


def satellites(where: str, named: Sequence[str], *, min_peak_deg: float = 0.0) -> list[Target]:
    """Return the targets that names, catalogue numbers and list files name.

    Parameters
    ----------
    where : file, folder or address of the elements; "" for the verification set.
    named : what is wanted; a name of a file stands for the lines in it.
    min_peak_deg : least peak of passes where a line states none.

    Raises
    ------
    ValueError
        Everything that is wrong, with the line of the list.
    """
    catalogue = load_catalogue(where)
    by_number = {one.catalogue_number: one for one in catalogue}
    by_name: dict[str, list[Elements]] = {}
    for one in catalogue:
        by_name.setdefault(one.name.casefold(), []).append(one)
    found: dict[int | str, Target] = {}
    errors: list[str] = []
    for place, text in _entries(named):
        try:
            name, wanted = _entry(text, min_peak_deg)
            if name.casefold() in BODIES:
                body = elements_of("", satellite=name, **wanted)
                if found.setdefault(body.name, body) is not body:
                    raise ValueError(f"satellite={name!r} is named twice")
                continue
            same = by_name.get(name.casefold(), [])
            if name.isdecimal() and int(name) in by_number:
                same = [by_number[int(name)]]
            if not same and len(errors) >= MOST_ERRORS:
                # To look for what is near takes long, and nobody reads it.
                raise ValueError(f"satellite={name!r} is unknown")
            # An unknown name, or one of several objects, is refused there with what is near.
            elements = same[0] if len(same) == 1 else find_elements(catalogue, name)
            if elements.catalogue_number in found:
                raise ValueError(f"satellite={name!r} is named twice")
            found[elements.catalogue_number] = of_elements(where, elements, **wanted)
        except ValueError as error:
            errors.append(f"{place}{error}")
    if errors:
        more = [f"and {len(errors) - MOST_ERRORS} more"] if len(errors) > MOST_ERRORS else []
        raise ValueError("\n".join([*errors[:MOST_ERRORS], *more]))
    if not found:
        raise ValueError(f"satellites={' '.join(named)} names no satellite")
    return list(found.values())


def _entries(named: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Give every satellite that is named, with the place of a line of a file."""
    for one in named:
        path = Path(one)
        if not path.is_file():
            yield "", one
            continue
        try:
            lines = read_whole(path, encoding="utf-8-sig").splitlines()
        except ValueError as error:
            raise ValueError(f"{one} is not a list of satellites: {error}") from error
        for number, line in enumerate(lines, start=1):
            # A name may hold a `#` of its own, as FENGYUN #2 does; a comment has blanks around it.
            text = re.sub(r"(^|\s)#\s.*|^#.*", "", line).strip()
            if text:
                yield f"{path.name}, line {number}: ", text


def _entry(text: str, least_peak_deg: float) -> tuple[str, dict[str, Any]]:
    """Return name or number, and the fields of its target, of NAME, priority=N, peak=DEG, ..."""
    parts = text.split(",")
    # A name may hold commas; a part with an equals sign is an option.
    cut = next((k for k, part in enumerate(parts) if "=" in part and k > 0), len(parts))
    wanted: dict[str, Any] = {"min_peak_deg": least_peak_deg}
    for part in parts[cut:]:
        key, _, value = (word.strip() for word in part.partition("="))
        if key == "priority":
            if not re.fullmatch(r"-?\d{1,9}", value) or not PRIORITIES[0] <= int(value) <= PRIORITIES[1]:
                raise ValueError(f"priority={value} must be a whole number from {PRIORITIES[0]} to {PRIORITIES[1]}")
            wanted["priority"] = int(value)
        elif key in _NUMBERS:
            name, most, unit = _NUMBERS[key]
            if not re.fullmatch(r"\d{1,4}(\.\d*)?", value) or float(value) > most:
                raise ValueError(f"{key}={value} must be a number from 0 to {most:g} {unit}")
            wanted[name] = float(value)
        elif key == "band":
            wanted["band"] = value
        else:
            raise ValueError(
                f"{part.strip()!r} is unknown: after the satellite come priority=N, peak=DEG and "
                "band=NAME, of a network contact=MIN"
            )
    return ",".join(parts[:cut]).strip(), wanted
