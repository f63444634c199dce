"""OMM in four notations and both dialects against the TLE of the same object, and refusals by field."""

import json
import math
import re

import numpy as np
import pytest
from sgp4 import omm
from sgp4.api import Satrec

from rf_pointing.core.whole_file import DEEPEST
from rf_pointing.ephemeris import Elements, read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.element_messages import omm_text, read_omm_kvn
from test.ephemeris.omm_text import FIELDS, as_csv, as_kvn, as_strings, as_xml

NOTATIONS = {
    "json numbers": lambda fields: json.dumps([fields]), "json strings": as_strings, "json object": json.dumps,
    "xml": as_xml, "csv": as_csv, "kvn": as_kvn,
}  # fmt: skip


@pytest.mark.parametrize("notation", NOTATIONS)
def test_every_notation_gives_the_elements_of_the_tle(notation: str, cbers: Elements) -> None:
    (found,) = read_elements(NOTATIONS[notation](FIELDS))
    assert found.name == "CBERS 2"
    assert tle_lines(found) == tle_lines(cbers)
    assert found.epoch_t_s == pytest.approx(cbers.epoch_t_s, abs=1e-5)


@pytest.mark.parametrize("notation", NOTATIONS)
def test_catalogue_numbers_beyond_a_tle_are_kept_and_refused_only_by_the_tle(notation: str) -> None:
    (found,) = read_elements(NOTATIONS[notation]({**FIELDS, "NORAD_CAT_ID": 799501234}))
    assert found.catalogue_number == 799501234
    assert found.satrec().sgp4_tsince(0.0)[0] == 0
    with pytest.raises(ValueError, match=r"catalogue_number=799501234 must be in .* use OMM"):
        tle_lines(found)


@pytest.mark.parametrize("notation", ["json numbers", "json strings", "xml", "csv", "kvn"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"MEAN_MOTION": "fast"}, r"OMM 1 \(CBERS 2\): MEAN_MOTION='fast' is not a number"),
        ({"NORAD_CAT_ID": "T0001"}, "NORAD_CAT_ID='T0001' is not a number"),
        ({"NORAD_CAT_ID": "12.5"}, "NORAD_CAT_ID=12.5 must be a whole number"),
        ({"EPOCH": "yesterday"}, "date='yesterday' must read"),
        ({"EPHEMERIS_TYPE": 4}, "EPHEMERIS_TYPE=.4.? must be one of 0, 2|EPHEMERIS_TYPE=4 must"),
        ({"MEAN_ELEMENT_THEORY": "SGP4-XP"}, "MEAN_ELEMENT_THEORY='SGP4-XP' must be one of SGP4"),
        ({"INCLINATION": 198.4}, r"INCLINATION=198.4 must be in \[0, 180\]"),
        ({"RA_OF_ASC_NODE": 1234}, r"RA_OF_ASC_NODE=1234.* must be in \[-360, 360\]"),
        ({"MEAN_MOTION": 160.0}, r"MEAN_MOTION=160.0 must be in \[0.001, 20\]"),
        ({"NORAD_CAT_ID": "1e999"}, "NORAD_CAT_ID=inf must be in"),
        ({"EPOCH": "2006-06-26T18:52:60"}, "has second 60, must be < 60"),
        ({"EPOCH": "2006-366T18:52:04"}, "has day 366 of 2006, must be >= 1 and < 366"),
        ({"CENTER_NAME": "MARS"}, "CENTER_NAME='MARS' must be one of EARTH"),
        ({"ECCENTRICITY": 1.5}, r"ECCENTRICITY=1.5 must be in \[0, 0.9999999\]"),
    ],
)
def test_a_bad_field_is_named(notation: str, change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_elements(NOTATIONS[notation]({**FIELDS, **change}))


UNITS = {"INCLINATION": ("deg", "rad"), "MEAN_MOTION": ("rev/day", "rad/min"), "BSTAR": ("1/ER", "m**2/kg")}


@pytest.mark.parametrize("key", UNITS)
def test_a_unit_beside_a_number_must_be_the_standards(key: str) -> None:
    right, wrong = UNITS[key]
    for unit in (right, right.upper()):
        line = f"{key:20s} = {FIELDS[key]}"
        in_kvn = as_kvn(FIELDS).replace(" [deg]", "").replace(line, f"{line} [{unit}]")
        in_xml = as_xml(FIELDS).replace(f"<{key}>", f'<{key} units="{unit}">')
        assert read_elements(in_kvn) == read_elements(in_xml) == read_elements(as_csv(FIELDS))
    message = rf"{key}={FIELDS[key]} has the unit \[{re.escape(wrong)}\], must have \[{re.escape(right)}\]"
    for text in (in_kvn.replace(f"[{unit}]", f"[{wrong}]"), in_xml.replace(f'"{unit}"', f'"{wrong}"')):
        with pytest.raises(ValueError, match=message):
            read_elements(text)


def test_what_is_said_twice_is_refused() -> None:
    twice = {
        "json": json.dumps(FIELDS)[:-1] + ', "INCLINATION": 10.0}',
        "xml": as_xml(FIELDS).replace("<INCLINATION>", "<INCLINATION>10.0</INCLINATION><INCLINATION>"),
        "csv": as_csv(FIELDS).replace("OBJECT_ID", "INCLINATION"),
        "kvn": as_kvn(FIELDS) + "\nINCLINATION = 10.0",
    }
    for text in twice.values():
        with pytest.raises(ValueError, match="INCLINATION is given twice"):
            read_elements(text)


def test_an_object_without_a_name_goes_by_its_number_and_brackets_belong_to_a_name() -> None:
    (unnamed,) = read_elements(json.dumps({**FIELDS, "OBJECT_NAME": None, "OBJECT_ID": None}))
    assert (unnamed.name, unnamed.international_designator) == ("28057", "")
    (bracketed,) = read_elements(as_kvn({**FIELDS, "OBJECT_NAME": "STARLINK-11072 [DTC]"}))
    assert bracketed.name == "STARLINK-11072 [DTC]"


@pytest.mark.parametrize("key", ["EPOCH", "MEAN_MOTION", "NORAD_CAT_ID", "BSTAR", "ECCENTRICITY"])
def test_a_missing_field_is_refused_never_zero(key: str) -> None:
    without = {name: value for name, value in FIELDS.items() if name != key}
    for text in (json.dumps(without), as_xml(without), as_csv(without), as_kvn(without)):
        with pytest.raises(ValueError, match=f"{key} is missing"):
            read_elements(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[{"NORAD_CAT_ID": 5,', "OMM JSON is malformed"),
        ('[{"MEAN_MOTION": NaN}]', "NaN, which is not a number"), ("[]", "no elements"),
        ("<omm><body>", "OMM XML is malformed"), ("<omm></omm>", "no elements"),
        ("NORAD_CAT_ID,MEAN_MOTION\n1,5,6", "not as many columns"),
        ("CCSDS_OMM_VERS = 2.0\nEPOCH 2006", "line 2: 'EPOCH 2006' must read KEYWORD = value"),
        ("CCSDS_OMM_VERS = 2.0\nBSTAR = 1\nBSTAR = 2", "line 3: BSTAR is given twice"),
        (
            "CCSDS_OPM_VERS = 2.0\nEPOCH = 1",
            "looks like another CCSDS message than an OMM or OEM: .* CCSDS_OPM_VERS|it starts with .CCSDS_OPM",
        ),
        ('{"BSTAR": 0, "NORAD_CAT_ID": 1' + 400 * "0" + "}", "NORAD_CAT_ID=10{400} must be in"),
        ("COMMENT x\nBSTAR = 1", "line 2: BSTAR comes before CCSDS_OMM_VERS"),
    ],
)  # fmt: skip
def test_malformed_messages_are_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_elements(text)


ISS_TLE = """ISS (ZARYA)
1 25544U 98067A   26171.41461525  .00008813  00000+0  16600-3 0  9990
2 25544  51.6327 284.1189 0004557 208.5194 151.5545 15.49333088572250
"""
"""GP data of celestrak.org for the ISS at 2026-06-20T09:57:02.757600."""
ISS = {
    "OBJECT_NAME": "ISS (ZARYA)", "OBJECT_ID": "1998-067A", "EPOCH": "2026-06-20T09:57:02.757600",
    "MEAN_MOTION": "15.49333088", "ECCENTRICITY": ".0004557", "INCLINATION": "51.6327", "RA_OF_ASC_NODE": "284.1189",
    "ARG_OF_PERICENTER": "208.5194", "MEAN_ANOMALY": "151.5545", "EPHEMERIS_TYPE": "0", "CLASSIFICATION_TYPE": "U",
    "NORAD_CAT_ID": "25544", "ELEMENT_SET_NO": "999", "REV_AT_EPOCH": "57225", "BSTAR": ".166E-3",
    "MEAN_MOTION_DOT": ".8813E-4", "MEAN_MOTION_DDOT": "0",
}  # fmt: skip
CELESTRAK_XML = """<?xml version="1.0" encoding="UTF-8"?>
<ndm xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
     xsi:noNamespaceSchemaLocation="https://sanaregistry.org/r/ndmxml_unqualified/ndmxml-2.0.0-master-2.0.xsd">
<omm id="CCSDS_OMM_VERS" version="2.0"><header><CREATION_DATE/><ORIGINATOR/></header><body><segment>
<metadata>{metadata}<CENTER_NAME>EARTH</CENTER_NAME><REF_FRAME>TEME</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM>
<MEAN_ELEMENT_THEORY>SGP4</MEAN_ELEMENT_THEORY></metadata>
<data><meanElements>{elements}</meanElements><tleParameters>{parameters}</tleParameters></data>
</segment></body></omm>
</ndm>
"""
SPACE_TRACK = {
    "CCSDS_OMM_VERS": "3.0", "COMMENT": "GENERATED VIA SPACE-TRACK.ORG API", "CREATION_DATE": "2026-06-20T12:46:10",
    "ORIGINATOR": "18 SPCS", "CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC",
    "MEAN_ELEMENT_THEORY": "SGP4", "SEMIMAJOR_AXIS": "6797.012", "PERIOD": "92.943", "APOAPSIS": "421.975",
    "PERIAPSIS": "415.780", "OBJECT_TYPE": "PAYLOAD", "RCS_SIZE": "LARGE", "COUNTRY_CODE": None, "LAUNCH_DATE": None,
    "DECAY_DATE": None, "FILE": "4512345", "GP_ID": "281234567", "TLE_LINE0": "0 ISS (ZARYA)",
}  # fmt: skip


def celestrak_xml(fields: dict[str, str]) -> str:
    leaves = [f"<{key}>{value}</{key}>" for key, value in fields.items()]
    return CELESTRAK_XML.format(
        metadata="".join(leaves[:2]), elements="".join(leaves[2:9]), parameters="".join(leaves[9:])
    )


@pytest.mark.parametrize(
    "text",
    [
        json.dumps([{key: json.loads(value) if re.fullmatch(r"\d+(\.\d+)?", value) else value for key, value in ISS.items()}]),
        as_csv(ISS), celestrak_xml(ISS),
        "".join(f"{key:<18} = {value}\n" for key, value in {"CCSDS_OMM_VERS": "2.0", "CREATION_DATE": "", "ORIGINATOR": "",
                                                            **ISS}.items()) + "\n",
        json.dumps([{**SPACE_TRACK, **ISS}]), "0 " + ISS_TLE,
    ],
    ids=["CelesTrak JSON", "CelesTrak CSV", "CelesTrak XML", "CelesTrak KVN", "Space-Track JSON", "Space-Track 3LE"],
)  # fmt: skip
def test_the_layouts_of_the_sources_give_the_same_orbit(text: str) -> None:
    (found,), (wanted,) = read_elements(text), read_elements(ISS_TLE)
    assert found.name == "ISS (ZARYA)"
    assert tle_lines(found) == tle_lines(wanted)


def test_celestraks_xml_is_that_of_the_sgp4_reader() -> None:
    import io

    (fields,) = omm.parse_xml(io.StringIO(celestrak_xml(ISS)))
    wanted = Satrec()
    omm.initialize(wanted, fields)
    (found,) = read_elements(celestrak_xml(ISS))
    assert found.satrec().sgp4_tsince(720.0)[1] == pytest.approx(wanted.sgp4_tsince(720.0)[1], abs=1e-6)


@pytest.mark.parametrize("notation", NOTATIONS)
def test_every_number_of_a_message_has_its_place_and_its_unit(notation: str) -> None:
    """Of the derivatives a message holds a half and a sixth, as the columns of a TLE do."""
    stated = {
        **FIELDS, "MEAN_MOTION": 13.5, "ECCENTRICITY": 0.0123, "INCLINATION": 97.5, "RA_OF_ASC_NODE": 31.25,
        "ARG_OF_PERICENTER": -62.5, "MEAN_ANOMALY": 271.75, "BSTAR": -0.00075, "MEAN_MOTION_DOT": 2.5e-4,
        "MEAN_MOTION_DDOT": -3.5e-7, "ELEMENT_SET_NO": 183, "REV_AT_EPOCH": 14055, "NORAD_CAT_ID": 123456789,
    }  # fmt: skip
    (found,) = read_elements(NOTATIONS[notation](stated))
    turn, day_s = 2.0 * math.pi, 86400.0
    assert found.mean_motion_rad_s == pytest.approx(13.5 * turn / day_s)
    assert found.mean_motion_dot_rad_s2 == pytest.approx(2.0 * 2.5e-4 * turn / day_s**2)
    assert found.mean_motion_ddot_rad_s3 == pytest.approx(6.0 * -3.5e-7 * turn / day_s**3)
    assert (found.eccentricity, found.drag_per_earth_radius) == (0.0123, -0.00075)
    assert math.degrees(found.inclination_rad) == pytest.approx(97.5)
    assert math.degrees(found.ascending_node_rad) == pytest.approx(31.25)
    assert math.degrees(found.argument_of_perigee_rad) == pytest.approx(-62.5)
    assert math.degrees(found.mean_anomaly_rad) == pytest.approx(271.75)
    assert (found.catalogue_number, found.element_set_number, found.revolution_number) == (123456789, 183, 14055)
    assert found.international_designator == "2003-049A"


@pytest.mark.parametrize("value", [True, None, "", "1_0", "0x10", "1,5", "--5", "e5", ".", [5.0]])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match="INCLINATION(=.* is not a number| is missing)"):
        read_elements(json.dumps({**FIELDS, "INCLINATION": value}))


def test_xml_is_read_to_its_bound_of_depth_and_with_its_comments() -> None:
    (plain,) = read_elements(as_xml(FIELDS))
    for depth, taken in ((DEEPEST - 5, True), (DEEPEST + 1, False)):
        nested = as_xml(FIELDS).replace("<body>", "<!-- deep -->" + "<a>" * depth + "</a>" * depth + "<body>")
        if taken:
            assert read_elements(nested) == [plain]
        else:
            with pytest.raises(ValueError, match=f"OMM XML is nested more than {DEEPEST} deep"):
                read_elements(nested)
    for declared in ("<!DOCTYPE ndm>", '<!ENTITY x "y">'):
        with pytest.raises(ValueError, match="OMM XML must not define entities or a document type"):
            read_elements(as_xml(FIELDS).replace("<ndm>", declared + "<ndm>"))


def test_elements_come_back_from_a_written_message() -> None:
    for one in verification_elements():
        (found,) = read_omm_kvn(omm_text(one, originator="TEST", created_t_s=0.0))
        assert isinstance(found, Elements), found
        assert (found.name, found.catalogue_number) == (one.name, one.catalogue_number)
        ours, wanted = (np.array(each.satrec().sgp4_tsince(60.0)[1]) for each in (found, one))
        assert np.linalg.norm(ours - wanted) < 1e-4
