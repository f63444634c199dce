"""Orbit mean-elements messages (CCSDS 502.0-B): JSON, XML, CSV and KVN.

Two dialects are in use: numbers written as numbers and numbers written as strings; both are read.  The catalogue
number is a plain integer of up to nine digits.  Only elements of the SGP4 theory in TEME and UTC are accepted: the
same numbers mean another orbit in any other theory.
"""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.kvn import key_and_value
from rf_pointing.ephemeris.time_scales import DAY_S, posix_from_calendar

__all__ = ["read_omm_csv", "read_omm_json", "read_omm_kvn", "read_omm_xml"]

Fields = Mapping[str, Any]

_MUST_BE = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP/SGP4", "SGP"),
    "EPHEMERIS_TYPE": ("0", "2", ""),
}
"""What SGP4 needs; a message that leaves one out means the same (CelesTrak's JSON and CSV do)."""


def read_omm_json(text: str) -> list[Elements]:
    """Return the elements of one JSON object or an array of them."""
    try:
        parsed = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise ValueError(f"OMM JSON is malformed: {error}") from None
    messages = parsed if isinstance(parsed, list) else [parsed]
    for number, message in enumerate(messages, start=1):
        if not isinstance(message, dict):
            raise ValueError(f"OMM {number} must be a JSON object, is {message!r}")
    return [_elements(number, message) for number, message in enumerate(messages, start=1)]


def read_omm_xml(text: str) -> list[Elements]:
    """Return the elements of an <omm> or of an <ndm> that holds several."""
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(text.strip())
    except ElementTree.ParseError as error:
        raise ValueError(f"OMM XML is malformed: {error}") from None
    segments = [e for e in root.iter() if _local_name(e.tag) == "segment"]
    messages = [{_local_name(leaf.tag): leaf.text or "" for leaf in s.iter() if len(leaf) == 0} for s in segments]
    return [_elements(number, message) for number, message in enumerate(messages, start=1)]


def read_omm_csv(text: str) -> list[Elements]:
    """Return the elements of a table whose first line names the columns."""
    import csv
    import io

    rows = list(csv.DictReader(io.StringIO(text.strip())))
    for number, row in enumerate(rows, start=1):
        if None in row or None in row.values():
            raise ValueError(f"OMM {number}: its line has not as many columns as the first line names")
    return [_elements(number, row) for number, row in enumerate(rows, start=1)]


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
    return [_elements(number, message) for number, message in enumerate(messages, start=1)]


def _elements(number: int, fields: Fields) -> Elements:
    label = f"OMM {number} ({fields.get('OBJECT_NAME') or fields.get('NORAD_CAT_ID') or 'unnamed'})"
    try:
        return _checked_elements(fields)
    except ValueError as error:
        raise ValueError(f"{label}: {error}") from None


def _checked_elements(fields: Fields) -> Elements:
    for key, allowed in _MUST_BE.items():
        if key in fields and str(fields[key]).strip().upper() not in allowed:
            raise ValueError(f"{key}={fields[key]!r} must be one of {', '.join(filter(None, allowed))}")
    per_day = 2.0 * math.pi / DAY_S
    catalogue_number = _integer(fields, "NORAD_CAT_ID")
    return Elements(
        name=str(fields.get("OBJECT_NAME", "")).strip() or str(catalogue_number),
        catalogue_number=catalogue_number,
        international_designator=str(fields.get("OBJECT_ID", "")).strip(),
        classification=str(fields.get("CLASSIFICATION_TYPE", "")).strip() or "U",
        epoch_t_s=posix_from_calendar(str(_present(fields, "EPOCH"))),
        mean_motion_rad_s=_number(fields, "MEAN_MOTION") * per_day,
        eccentricity=_number(fields, "ECCENTRICITY"),
        inclination_rad=math.radians(_number(fields, "INCLINATION")),
        ascending_node_rad=math.radians(_number(fields, "RA_OF_ASC_NODE")),
        argument_of_perigee_rad=math.radians(_number(fields, "ARG_OF_PERICENTER")),
        mean_anomaly_rad=math.radians(_number(fields, "MEAN_ANOMALY")),
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


def _number(fields: Fields, key: str) -> float:
    value = _present(fields, key)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, str) or not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", value):
        raise ValueError(f"{key}={value!r} is not a number")
    return float(value)


def _integer(fields: Fields, key: str) -> int:
    value = _number(fields, key)
    if value != int(value):
        raise ValueError(f"{key}={value} must be a whole number")
    return int(value)


def _local_name(tag: str) -> str:
    return tag.rsplit("}", 1)[-1]


def _no_constant(name: str) -> float:
    raise ValueError(f"OMM JSON holds {name}, which is not a number")
