"""Mean elements read from text: TLE, or orbit mean-elements messages (OMM, CCSDS 502.0-B).

An OMM comes as JSON, XML, CSV or KVN; the form is recognised from the text.  Two dialects are in
use, numbers written as numbers and numbers written as strings; both are read.  The catalogue number
is a plain integer of up to nine digits.  Only elements of the SGP4 theory in TEME and UTC are
accepted: the same numbers mean another orbit in any other theory.  A unit that is written with a
number must be the standard's, and a keyword that is given twice is an error.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from rf_pointing.core.checks import name_of
from rf_pointing.core.dates import DAY_S, from_utc_text
from rf_pointing.core.kvn import key_and_value, without_unit
from rf_pointing.core.whole_file import DEEPEST, parse_json
from rf_pointing.ephemeris.elements import MEAN_MOTIONS, Elements
from rf_pointing.ephemeris.tle import read_tle

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Fields = Mapping[str, Any]

# What SGP4 needs; a message that leaves one out means the same (CelesTrak's JSON and CSV do).
_MUST_BE = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP/SGP4", "SGP"),
    "EPHEMERIS_TYPE": ("0", "2", ""),
}
_UNITS = {
    "MEAN_MOTION": "rev/day",
    "INCLINATION": "deg",
    "RA_OF_ASC_NODE": "deg",
    "ARG_OF_PERICENTER": "deg",
    "MEAN_ANOMALY": "deg",
    "BSTAR": "1/ER",
    "MEAN_MOTION_DOT": "rev/day**2",
    "MEAN_MOTION_DDOT": "rev/day**3",
}
# Beyond any number of an OMM, and still a whole number of a float.
_LARGEST = 1e15
_MOST_ECCENTRIC = 0.9999999
_TURN_DEG = (-360.0, 360.0)


def read_elements(text: str) -> list[Elements]:
    """Return all elements in TLE, 3LE or OMM (JSON, XML, CSV, KVN) text; none is an error."""
    # Windows editors put a byte order mark in front, which is not a blank.
    content = text.removeprefix("\ufeff").strip()
    found = _reader(content)(content)
    if not found:
        raise ValueError(f"text holds no elements; it starts with {content[:40]!r}")
    return found


def _reader(content: str) -> Callable[[str], list[Elements]]:
    first_line = content.split("\n", 1)[0]
    if content.startswith(("{", "[")):
        return read_omm_json
    if content.startswith("<"):
        return read_omm_xml
    if "," in first_line and "MEAN_MOTION" in first_line:
        return read_omm_csv
    # A KVN message may begin with comments.
    if content.startswith(("CCSDS_OMM_VERS", "COMMENT")):
        return read_omm_kvn
    if content.startswith("CCSDS_"):
        raise ValueError(
            f"{first_line.split('=')[0].strip()} must be CCSDS_OMM_VERS, or CCSDS_OEM_VERS of an ephemeris"
        )
    return read_tle


def read_omm_json(text: str) -> list[Elements]:
    """Return the elements of one JSON object or an array of them."""
    try:
        parsed = parse_json(text, parse_constant=_no_constant, object_pairs_hook=partial(_once, "OMM JSON"))
    except json.JSONDecodeError as error:
        raise ValueError(f"OMM JSON is malformed: {error}") from None
    messages = parsed if isinstance(parsed, list) else [parsed]
    for number, message in enumerate(messages, start=1):
        if not isinstance(message, dict):
            raise ValueError(f"OMM {number} must be a JSON object, is {message!r}")
    return _elements_of(messages)


def read_omm_xml(text: str) -> list[Elements]:
    """Return the elements of an <omm> or of an <ndm> that holds several."""
    from xml.etree import ElementTree

    if "<!" in text.replace("<!--", ""):
        raise ValueError("OMM XML must not define entities or a document type")
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    root, depth = ElementTree.Element("none"), 0
    try:
        parser.feed(text.strip())
        parser.close()
        for event, element in parser.read_events():
            root = element if depth == 0 and event == "start" else root
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise ValueError(f"OMM XML is nested more than {DEEPEST} deep")
    except ElementTree.ParseError as error:
        raise ValueError(f"OMM XML is malformed: {error}") from None
    segments = [e for e in root.iter() if _local_name(e.tag) == "segment"]
    messages = [_once("OMM XML", [_key_and_text(leaf) for leaf in s.iter() if len(leaf) == 0]) for s in segments]
    return _elements_of(messages)


def read_omm_csv(text: str) -> list[Elements]:
    """Return the elements of a table whose first line names the columns."""
    import csv
    import io

    try:
        table = csv.DictReader(io.StringIO(text.strip(), newline=None))
        rows = list(table)
    except csv.Error as error:
        raise ValueError(f"OMM CSV is malformed: {error}") from None
    _once("OMM CSV", [(name, "") for name in table.fieldnames or ()])
    for number, row in enumerate(rows, start=1):
        # csv fills what is missing with None; an empty field is an empty text.
        if None in row or None in row.values():
            raise ValueError(f"OMM {number}: its line has not as many columns as the first line names")
    return _elements_of(rows)


def read_omm_kvn(text: str) -> list[Elements]:
    """Return the elements of KEY = value text; every CCSDS_OMM_VERS starts a new message."""
    messages: list[dict[str, str]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        pair = key_and_value(line, number)
        if pair is None:
            continue
        key, value = pair
        if key == "CCSDS_OMM_VERS":
            messages.append({})
        if not messages:
            raise ValueError(f"line {number}: {key} comes before CCSDS_OMM_VERS")
        if key in messages[-1]:
            raise ValueError(f"line {number}: {key} is given twice")
        messages[-1][key] = value
    return _elements_of(messages)


def _once(what: str, pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of one message; a keyword given twice is an error."""
    fields: dict[str, Any] = {}
    for key, value in pairs:
        if key in fields and key not in ("COMMENT", "USER_DEFINED"):
            of = fields.get("OBJECT_NAME") or fields.get("NORAD_CAT_ID")
            raise ValueError(f"{what}{f' of {of}' if of else ''}: {key} is given twice")
        fields[key] = value
    return fields


def _key_and_text(leaf: "Element") -> tuple[str, str]:
    """Return keyword and text of an XML leaf, its unit behind it as in KVN."""
    unit = leaf.get("units")
    return _local_name(leaf.tag), f"{leaf.text or ''} [{unit}]" if unit else leaf.text or ""


def _elements_of(messages: Iterable[Fields]) -> list[Elements]:
    found = []
    for number, fields in enumerate(messages, start=1):
        try:
            found.append(_elements(fields))
        except ValueError as error:
            label = fields.get("OBJECT_NAME") or fields.get("NORAD_CAT_ID") or "unnamed"
            raise ValueError(f"OMM {number} ({label}): {error}") from None
    return found


def _elements(fields: Fields) -> Elements:
    for key, allowed in _MUST_BE.items():
        if key in fields and str(fields[key]).strip().upper() not in allowed:
            raise ValueError(f"{key}={fields[key]!r} must be one of {', '.join(filter(None, allowed))}")
    per_day = 2.0 * math.pi / DAY_S
    catalogue_number = _integer(fields, "NORAD_CAT_ID")
    return Elements(
        name=name_of(_text(fields, "OBJECT_NAME")) or str(catalogue_number),
        catalogue_number=catalogue_number,
        international_designator=_text(fields, "OBJECT_ID"),
        classification=_text(fields, "CLASSIFICATION_TYPE") or "U",
        epoch_t_s=from_utc_text(str(_present(fields, "EPOCH"))),
        mean_motion_rad_s=_number(fields, "MEAN_MOTION", *MEAN_MOTIONS) * per_day,
        eccentricity=_number(fields, "ECCENTRICITY", 0.0, _MOST_ECCENTRIC),
        inclination_rad=math.radians(_number(fields, "INCLINATION", 0.0, 180.0)),
        ascending_node_rad=math.radians(_number(fields, "RA_OF_ASC_NODE", *_TURN_DEG)),
        argument_of_perigee_rad=math.radians(_number(fields, "ARG_OF_PERICENTER", *_TURN_DEG)),
        mean_anomaly_rad=math.radians(_number(fields, "MEAN_ANOMALY", *_TURN_DEG)),
        drag_per_earth_radius=_number(fields, "BSTAR"),
        # Publishers copy the columns of the TLE, which hold half and a sixth of the derivatives.
        mean_motion_dot_rad_s2=2.0 * _number(fields, "MEAN_MOTION_DOT") * per_day / DAY_S,
        mean_motion_ddot_rad_s3=6.0 * _number(fields, "MEAN_MOTION_DDOT") * per_day / DAY_S**2,
        element_set_number=_integer(fields, "ELEMENT_SET_NO") if fields.get("ELEMENT_SET_NO") else 0,
        revolution_number=_integer(fields, "REV_AT_EPOCH") if fields.get("REV_AT_EPOCH") else 0,
    )


def _present(fields: Fields, key: str) -> Any:
    value = fields.get(key)
    if value is None or value == "":
        raise ValueError(f"{key} is missing")
    return value


def _text(fields: Fields, key: str) -> str:
    """Return a text, empty where the message has none (JSON: null)."""
    return str(fields.get(key) or "").strip()


def _number(fields: Fields, key: str, low: float = -_LARGEST, high: float = _LARGEST) -> float:
    value = _present(fields, key)
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


def _integer(fields: Fields, key: str) -> int:
    value = _number(fields, key)
    # 28057.0 of a spreadsheet is a whole number, 28057.5 is a damaged one.
    if value != int(value):
        raise ValueError(f"{key}={value} must be a whole number")
    return int(value)


def _local_name(tag: str) -> str:
    return tag.rsplit("}", 1)[-1]


def _no_constant(name: str) -> float:
    raise ValueError(f"OMM JSON holds {name}, which is not a number")
