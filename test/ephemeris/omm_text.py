"""Orbit mean-elements messages for the tests: one object's fields, and any messages in every notation."""

import json
from collections.abc import Mapping

FIELDS = {
    "OBJECT_NAME": "CBERS 2", "OBJECT_ID": "2003-049A", "EPOCH": "2006-06-26T18:52:04.079712",
    "MEAN_MOTION": 14.35478080, "ECCENTRICITY": 0.0000884, "INCLINATION": 98.4283,
    "RA_OF_ASC_NODE": 247.6961, "ARG_OF_PERICENTER": 88.1964, "MEAN_ANOMALY": 271.9322,
    "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": 28057, "ELEMENT_SET_NO": 183,
    "REV_AT_EPOCH": 14055, "BSTAR": 0.00003594, "MEAN_MOTION_DOT": 6e-7, "MEAN_MOTION_DDOT": 0,
}  # fmt: skip
Fields = Mapping[str, object]


def as_xml(*messages: Fields, prefix: str = "") -> str:
    made = ""
    for fields in messages:
        leaves = "".join(f"<{key}>{value}</{key}>\n" for key, value in fields.items())
        body = f"<body><segment>\n{leaves}</segment></body>"
        made += f'<{prefix}omm id="CCSDS_OMM_VERS">\n{body}</{prefix}omm>\n'
    space = f" xmlns:{prefix[:-1]}='x'" if prefix else ""
    return f'<?xml version="1.0"?><{prefix}ndm{space}>{made}</{prefix}ndm>'


def as_csv(*messages: Fields, between: str = ",", quote: str = "") -> str:
    rows = (between.join(f"{quote}{value}{quote}" for value in fields.values()) for fields in messages)
    return "\r\n".join([between.join(messages[0]), *rows, ""])


def as_kvn(*messages: Fields) -> str:
    head = "CCSDS_OMM_VERS = 2.0\nCOMMENT made up\nREF_FRAME = TEME\nTIME_SYSTEM = UTC\n"
    return "".join(
        head + "".join(f"{key:20s} = {value}{' [deg]' * (key == 'INCLINATION')}\n" for key, value in fields.items())
        for fields in messages
    )


def as_strings(*messages: Fields) -> str:
    return json.dumps([{key: str(value) for key, value in fields.items()} for fields in messages])
