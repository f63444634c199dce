"""Orbit mean-elements messages (OMM, CCSDS 502.0-B): JSON, XML, CSV and KVN.

Each reader yields the elements of the good messages and a ValueError for every bad one, which
begins with its line.  Two dialects are in use, numbers written as numbers and numbers written as
strings; both are read.  The catalogue number is a plain integer of up to nine digits.  Only
elements of the SGP4 theory in TEME and UTC are accepted: the same numbers mean another orbit in any
other theory.  A unit that is written with a number must be the standard's, and a keyword that is
given twice is an error.
"""

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rf_pointing.core import DAY_S, from_utc_text, name_of, to_utc_text
from rf_pointing.core.kvn import key_and_value, without_unit
from rf_pointing.core.whole_file import DEEPEST, parse_json
from rf_pointing.ephemeris.elements import MEAN_MOTIONS, Elements
from rf_pointing.ephemeris.tle import SGP4_XP, read_tle, tle_columns

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Fields = Mapping[str, Any]

# What SGP4 needs; a message that leaves one out means the same (CelesTrak's JSON and CSV do).
_MUST_BE = {
    "CENTER_NAME": ("EARTH",), "REF_FRAME": ("TEME",), "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP/SGP4", "SGP"), "EPHEMERIS_TYPE": ("0", "2", ""),
}  # fmt: skip
_ANGLES = ("INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY")
_UNITS = {
    **dict.fromkeys(_ANGLES, "deg"), "MEAN_MOTION": "rev/day", "SEMI_MAJOR_AXIS": "km",
    "BSTAR": "1/ER", "MEAN_MOTION_DOT": "rev/day**2", "MEAN_MOTION_DDOT": "rev/day**3",
}  # fmt: skip
# Beyond any number of an OMM, and still a whole number of a float.
_LARGEST = 1e15
_MOST_ECCENTRIC = 0.9999999
_TURN_DEG = (-360.0, 360.0)


# A flat object of JSON; in a damaged text one without a look at the quotes, whose brace must be
# where one of a list ends: it may stand in place of a digit.
_OBJECT = re.compile(r'\{(?:[^{}"]|"(?:[^"\\\n]|\\.)*")*\}')
_DAMAGED_OBJECT = re.compile(r"\{[^{}]*(?:\}(?=\s*(?:[,\]]|\Z)))?")
# N2YO has the name in an object of its own.
_NAMES = ("tle0", "tle_line0", "line0", "object_name", "satname", "name", "info")
_OURS = {"MEAN_MOTION", "ECCENTRICITY", "BSTAR", "RA_OF_ASC_NODE", "MEAN_ANOMALY"}
# SGP4's own, of WGS 72, as its mean motion is.
_MU_KM3_S2 = 398600.8

Finding = Elements | ValueError | UserWarning
Found = Iterator[Finding]


def read_json(text: str, _name: str = "") -> Found:
    """Yield the elements of every object in JSON that has those of an OMM, or lines of a TLE."""
    wrong = ""
    try:
        parsed = parse_json(text, parse_constant=float)
    except json.JSONDecodeError as error:
        wrong, parsed = f"line {error.lineno}: OMM JSON is malformed: {error.msg}", None
    ours = clean = 0
    pattern, rest = _OBJECT, text
    # From the innermost objects outwards: a flat one is read, and stands as its name from then on.
    for _ in range(DEEPEST):
        names: list[str] = []
        for line, piece in _pieces(rest, pattern):
            found, name = _of_object(line, piece, ours + 1)
            names.append(name)
            for one in found:
                ours += 1
                clean += not isinstance(one, ValueError)
                yield one
        if wrong and not names and pattern is _OBJECT:
            # Whole objects first: what is left of a damaged one may reach into its neighbours.
            pattern = _DAMAGED_OBJECT
            continue
        if not names or rest.count("{") == len(names):
            break
        label = iter(names)
        rest = pattern.sub(lambda flat: json.dumps(next(label)) + "\n" * flat[0].count("\n"), rest)  # noqa: B023
    # The damage may be around the objects; one that it has hit is listed already.
    if wrong and clean == ours:
        yield ValueError(wrong)
    if not ours and not wrong:
        # Lists in lists.
        yield from read_tle("\n".join(_texts(parsed)))


def _of_object(line: int, piece: str, number: int) -> tuple[list[Finding], str]:
    """Return what one flat object of JSON holds, nothing for one of another kind, and its name."""
    try:
        fields = parse_json(piece, parse_constant=_no_constant, object_pairs_hook=_once)
    except ValueError as error:
        # Damage to an object of another kind is nobody's concern.
        ours = any(key in piece for key in _OURS) or tle_columns(piece)
        reason = getattr(error, "msg", error)
        wrong = ValueError(f"line {line}: OMM JSON {number} is malformed: {reason}")
        return [wrong] if ours else [], ""
    if _OURS & fields.keys():
        return [_omm(line, number, fields)], ""
    named = {key.casefold(): value for key, value in fields.items() if isinstance(value, str)}
    name = next((named[key] for key in _NAMES if named.get(key)), "")
    # Lines of their own, or all of them in one text.
    texts = [text for text in named.values() if any(map(tle_columns, text.splitlines()))]
    found = read_tle("\n".join([name, *texts])) if texts else ()
    return [ValueError(f"line {line}: {one}") if isinstance(one, ValueError) else one for one in found], name


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    for each in value if isinstance(value, list) else ():
        yield from _texts(each)


def read_omm_xml(text: str, _name: str = "") -> Found:
    """Yield the elements of an <omm> or of an <ndm> that holds several."""
    number = 0
    for line, segment in xml_segments(text, "OMM"):
        if isinstance(segment, ValueError):
            yield segment
            continue
        number += 1
        try:
            fields = _once([_key_and_text(leaf) for leaf in segment.iter() if len(leaf) == 0])
        except ValueError as error:
            yield ValueError(f"line {line}: OMM XML: {error}")
            continue
        yield _omm(line, number, fields)


def xml_segments(text: str, kind: str) -> Iterator[tuple[int, "Element | ValueError"]]:
    """Yield line and tree of every <segment>; of malformed XML, of those that are whole."""
    pieces = list(_pieces(text, _SEGMENT))
    from xml.etree.ElementTree import ParseError

    from rf_pointing.core.xml_text import local_name, parse_xml

    try:
        root = parse_xml(text, kind)
    except ParseError as error:
        bad = 0
        for line, piece in pieces:
            try:
                yield line, parse_xml(re.sub(r"(?<=[<\s/])\w+:(?=[A-Za-z_]\w*[\s>/=])", "", piece), kind)
            except ParseError as reason:
                bad += 1
                yield line, ValueError(f"line {line + reason.position[0] - 1}: {kind} XML is malformed: {reason}")
        if not bad:
            yield 1, ValueError(f"line {error.position[0]}: {kind} XML is malformed: {error}")
        return
    segments = [e for e in root.iter() if local_name(e.tag) == "segment"]
    lines = [line for line, _ in pieces] if len(pieces) == len(segments) else [1] * len(segments)
    yield from zip(lines, segments, strict=True)


_SEGMENT = re.compile(r"<(\w+:)?segment\b(?:(?!</?(\w+:)?segment\b).)*(</(\w+:)?segment\s*>)?", re.DOTALL)


def _pieces(text: str, pattern: re.Pattern[str]) -> Iterator[tuple[int, str]]:
    """Yield every match of a pattern with the line on which it begins."""
    line, read = 1, 0
    for match in pattern.finditer(text):
        line, read = line + text.count("\n", read, match.start()), match.start()
        yield line, match[0]


def read_omm_csv(text: str, _name: str = "") -> Found:
    """Yield the elements of a table whose first line names the columns."""
    lines = text.strip().splitlines()
    # Spreadsheets of many countries separate by semicolons.
    between = min(",;\t", key=lambda sign: -lines[0].count(sign))
    # A line at a time: a quote that is lost must not swallow the lines below it.
    names = next(csv.reader(lines[:1], delimiter=between))
    _once([(name, "") for name in names])
    for number, line in enumerate(lines[1:], start=1):
        if not line.strip():
            continue
        try:
            row = next(csv.reader([line], strict=True, delimiter=between))
        except csv.Error as error:
            yield ValueError(f"line {number + 1}: OMM CSV is malformed: {error}")
            continue
        if len(row) != len(names):
            yield ValueError(f"line {number + 1}: OMM {number} has not as many columns as the first line names")
        else:
            yield _omm(number + 1, number, dict(zip(names, row, strict=True)))


def read_omm_kvn(text: str, _name: str = "") -> Found:
    """Yield the elements of KEY = value text; every CCSDS_OMM_VERS starts a new message."""
    fields: dict[str, str] | None = None
    first, count, wrong = 0, 0, ""
    for number, line in enumerate([*text.splitlines(), "CCSDS_END = "], start=1):
        try:
            key, value = key_and_value(line, number) or ("", "")
        except ValueError as error:
            key, value, wrong = "", "", wrong or str(error)
        if key.startswith("CCSDS_"):
            if fields is not None or wrong:
                count += 1
                yield ValueError(wrong) if wrong else _omm(first, count, fields or {})
            fields, first, wrong = {}, number, ""
            if key not in ("CCSDS_OMM_VERS", "CCSDS_END"):
                wrong = f"line {number}: {key} must be CCSDS_OMM_VERS"
        elif key and fields is None:
            wrong = wrong or f"line {number}: {key} comes before CCSDS_OMM_VERS"
        elif key and fields is not None:
            if key in fields and key != "COMMENT":
                wrong = wrong or f"line {number}: {key} is given twice"
            fields[key] = value


def omm_text(elements: Elements, *, originator: str, created_t_s: float) -> str:
    """Return the elements as an OMM in KVN; `read_omm_kvn` is the inverse."""
    per_day = 2.0 * math.pi / DAY_S
    angles = (
        elements.inclination_rad, elements.ascending_node_rad, elements.argument_of_perigee_rad,
        elements.mean_anomaly_rad,
    )  # fmt: skip
    number, dot = elements.catalogue_number, elements.mean_motion_dot_rad_s2 / per_day * DAY_S
    fields = {
        "CCSDS_OMM_VERS": "2.0", "CREATION_DATE": to_utc_text(created_t_s), "ORIGINATOR": originator,
        "OBJECT_NAME": elements.name, "OBJECT_ID": elements.international_designator or number,
        "CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC",
        "MEAN_ELEMENT_THEORY": "SGP4", "EPOCH": to_utc_text(elements.epoch_t_s),
        "MEAN_MOTION": f"{elements.mean_motion_rad_s / per_day:.12f}",
        "ECCENTRICITY": f"{elements.eccentricity:.12f}",
        **{name: f"{math.degrees(value):.10f}" for name, value in zip(_ANGLES, angles, strict=True)},
        "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": elements.classification, "NORAD_CAT_ID": number,
        "ELEMENT_SET_NO": elements.element_set_number, "REV_AT_EPOCH": elements.revolution_number,
        "BSTAR": f"{elements.drag_per_earth_radius:.10e}", "MEAN_MOTION_DOT": f"{0.5 * dot:.10e}",
        "MEAN_MOTION_DDOT": f"{elements.mean_motion_ddot_rad_s3 / 6.0 / per_day * DAY_S**2:.10e}",
    }  # fmt: skip
    return "".join(f"{key} = {value}\n" for key, value in fields.items())


def _omm(line: int, number: int, fields: Fields) -> Elements | ValueError:
    """Return the elements of one message, or why it has none."""
    try:
        return _elements(fields)
    except ValueError as error:
        label = fields.get("OBJECT_NAME") or fields.get("NORAD_CAT_ID") or "unnamed"
        return ValueError(f"line {line}: OMM {number} ({label}): {error}")


def _once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of one message; a keyword given twice is an error."""
    fields: dict[str, Any] = {}
    for key, value in pairs:
        if key in fields and key not in ("COMMENT", "USER_DEFINED"):
            of = fields.get("OBJECT_NAME") or fields.get("NORAD_CAT_ID")
            raise ValueError(f"{f'{of}: ' if of else ''}{key} is given twice")
        fields[key] = value
    return fields


def _key_and_text(leaf: "Element") -> tuple[str, str]:
    """Return keyword and text of an XML leaf, its unit behind it as in KVN."""
    from rf_pointing.core.xml_text import local_name

    unit = leaf.get("units")
    return local_name(leaf.tag), f"{leaf.text or ''} [{unit}]" if unit else leaf.text or ""


def _elements(fields: Fields) -> Elements:
    for key, allowed in _MUST_BE.items():
        if key in fields and str(fields[key]).strip().upper() not in allowed:
            xp = " (4 is SGP4-XP, another theory)" if str(fields[key]).strip() == SGP4_XP else ""
            raise ValueError(f"{key}={fields[key]!r} must be one of {', '.join(filter(None, allowed))}{xp}")
    per_day = 2.0 * math.pi / DAY_S
    catalogue_number = _integer(fields, "NORAD_CAT_ID")
    return Elements(
        name=name_of(_text(fields, "OBJECT_NAME")) or str(catalogue_number),
        catalogue_number=catalogue_number,
        international_designator=_text(fields, "OBJECT_ID"),
        classification=_text(fields, "CLASSIFICATION_TYPE") or "U",
        epoch_t_s=from_utc_text(_required(fields, "EPOCH")),
        mean_motion_rad_s=_mean_motion_per_day(fields) * per_day,
        eccentricity=_number(fields, "ECCENTRICITY", 0.0, _MOST_ECCENTRIC),
        inclination_rad=math.radians(_number(fields, "INCLINATION", 0.0, 180.0)),
        ascending_node_rad=math.radians(_number(fields, "RA_OF_ASC_NODE", *_TURN_DEG)),
        argument_of_perigee_rad=math.radians(_number(fields, "ARG_OF_PERICENTER", *_TURN_DEG)),
        mean_anomaly_rad=math.radians(_number(fields, "MEAN_ANOMALY", *_TURN_DEG)),
        drag_per_earth_radius=_number(fields, "BSTAR"),
        # Publishers copy the columns of the TLE, which hold half and a sixth of the derivatives.
        # SGP4 uses neither, and version 3 does without.
        mean_motion_dot_rad_s2=2.0 * _number(fields, "MEAN_MOTION_DOT", missing=0.0) * per_day / DAY_S,
        mean_motion_ddot_rad_s3=6.0 * _number(fields, "MEAN_MOTION_DDOT", missing=0.0) * per_day / DAY_S**2,
        element_set_number=_integer(fields, "ELEMENT_SET_NO", missing=0.0),
        revolution_number=_integer(fields, "REV_AT_EPOCH", missing=0.0),
    )


def _mean_motion_per_day(fields: Fields) -> float:
    """Return revolutions a day, where only the semi-major axis is given by Kepler's third law."""
    if not _given(fields, "MEAN_MOTION") and _given(fields, "SEMI_MAJOR_AXIS"):
        axis_km = _number(fields, "SEMI_MAJOR_AXIS", 5740.0, 4.2e6)
        return math.sqrt(_MU_KM3_S2 / axis_km**3) * DAY_S / (2.0 * math.pi)
    return _number(fields, "MEAN_MOTION", *MEAN_MOTIONS)


def _given(fields: Fields, key: str) -> bool:
    return fields.get(key) is not None and fields[key] != ""


def _text(fields: Fields, key: str) -> str:
    """Return a text, empty where the message has none (JSON: null)."""
    return str(fields.get(key) or "").strip()


def _required(fields: Fields, key: str) -> str:
    if not _given(fields, key):
        raise ValueError(f"{key} is missing")
    return str(fields[key])


def _number(
    fields: Fields, key: str, low: float = -_LARGEST, high: float = _LARGEST, *, missing: float | None = None
) -> float:
    if missing is not None and not _given(fields, key):
        return missing
    _required(fields, key)
    value = fields[key]
    if isinstance(value, str):
        value, unit = without_unit(value)
        wanted = _UNITS.get(key, "")
        if unit and unit.casefold() != wanted.casefold():
            raise ValueError(f"{key}={value} has the unit [{unit}], must have " + (f"[{wanted}]" if wanted else "none"))
        if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", value):
            raise ValueError(f"{key}={value!r} is not a number")
        value = float(value)
    # JSON's true is an int to Python and no number to anybody else.
    elif not isinstance(value, (int, float)) or isinstance(value, bool):
        raise ValueError(f"{key}={value!r} is not a number")
    if not low <= value <= high:
        raise ValueError(f"{key}={value} must be in [{low:.9g}, {high:.9g}]")
    return float(value)


def _integer(fields: Fields, key: str, missing: float | None = None) -> int:
    value = _number(fields, key, missing=missing)
    # 28057.0 of a spreadsheet is a whole number, 28057.5 is a damaged one.
    if value != int(value):
        raise ValueError(f"{key}={value} must be a whole number")
    return int(value)


def _no_constant(name: str) -> float:
    raise ValueError(f"OMM JSON holds {name}, which is not a number")
