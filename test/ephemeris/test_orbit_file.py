"""Files of orbits in the formats in use: read where they stand, or named; a damaged set costs itself."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.dates import from_utc_text
from rf_pointing.ephemeris import (
    Elements,
    OemTarget,
    Site,
    TopocentricTrack,
    oem_text,
    tle_lines,
    verification_elements,
)
from rf_pointing.ephemeris.orbit_file import OrbitFile, decoded, read_elements, read_orbits
from rf_pointing.ephemeris.source import SourceParams, load_target

DATA = Path(__file__).parent / "data" / "orbits"
SETS = verification_elements()[:3]
SETS = [dataclasses.replace(one, name=name) for one, name in zip(SETS, ("AO-07", "ISS (ZARYA)", "X 1, Y"), strict=True)]
LINES = [(one.name, *tle_lines(one)) for one in SETS]


def file(name: str) -> OrbitFile:
    return read_orbits(decoded((DATA / name).read_bytes()), name)


@pytest.mark.parametrize(
    ("name", "plain"), [("satnogs.json", "odd.tle"), ("gpredict.txt", "odd.tle"), ("indented.tle", "decay.tle")]
)
def test_lines_of_a_tle_are_read_where_they_stand(name: str, plain: str) -> None:
    wanted = {one.catalogue_number: one for one in file(plain).elements}
    found = file(name).elements
    assert found
    assert all(one == wanted[one.catalogue_number] for one in found)


def test_a_damaged_set_costs_itself_and_is_listed_with_its_line() -> None:
    found = file("one_bad.tle")
    assert [one.catalogue_number for one in found.elements] == list(range(90001, 90010))
    assert found.refused == ["line 29: checksum of object 90099 is 1, the line states 9"]


def test_an_omm_needs_no_derivatives_and_takes_the_semi_major_axis() -> None:
    (plain,) = file("omm_no_derivatives.kvn").elements
    (by_axis,) = file("omm_semi_major_axis.kvn").elements
    for minutes in (0.0, 90.0, 1440.0):
        moving = dataclasses.replace(plain, mean_motion_dot_rad_s2=1e-12, mean_motion_ddot_rad_s3=1e-20)
        assert moving.satrec().sgp4_tsince(minutes) == plain.satrec().sgp4_tsince(minutes)
    assert by_axis.mean_motion_rad_s**2 * 6885.3**3 == pytest.approx(398600.8, rel=1e-12)


def test_an_oem_in_xml_is_the_one_in_text_and_needs_its_interpolation_named(tmp_path: Path) -> None:
    (text,), (xml,) = file("iss_like.oem").segments, file("iss_like.xml").segments
    assert np.array_equal(text.tai_s, xml.tai_s)
    assert np.array_equal(text.position_m, xml.position_m)
    source = SourceParams(elements=str(DATA / "iss_like.xml"), satellite="STATION ONE")
    with pytest.raises(ValueError, match="--interpolation HERMITE 7"):
        load_target(source)
    target = load_target(source.replace(interpolation="HERMITE", interpolation_degree=7))
    assert isinstance(target, OemTarget)
    assert np.hypot(*target.motion_at(target.spans_t_s[0][0] + 130.0).position[:2]) < 6.9e6


def test_an_operators_ephemeris_is_read_with_its_covariance() -> None:
    (found,) = file("meme.txt").segments
    assert (found.name, found.frame, found.method, found.degree) == ("meme", "EME2000", "HERMITE", 7)
    assert len(found.covariances) == len(found.tai_s) == 30
    assert found.covariances[3].frame == "UVW"
    assert found.covariances[3].matrix == pytest.approx(np.full((6, 6), 0.1))
    named = read_orbits((DATA / "meme.txt").read_text(), "MEME_44713_STARLINK-1007_3291200_Operational.txt")
    assert (named.segments[0].name, named.segments[0].object_id) == ("STARLINK-1007", "44713")


def joined(form: str) -> str:
    return "".join(form.format(name=name, first=first, second=second) for name, first, second in LINES)


AMSAT = """SB KEPS @ AMSAT $ORBS-123.N
2Line Orbital Elements 123.AMSAT
DECODE 2-LINE ELSETS WITH THE FOLLOWING KEY:
1 AAAAAU 00  0  0 BBBBB.BBBBBBBB  .CCCCCCCC  00000-0  00000-0 0 DDDZ
2 AAAAA EEE.EEEE FFF.FFFF GGGGGGG HHH.HHHH III.IIII JJ.JJJJJJJJKKKKKZ
KEY: A-CATALOGNUM B-EPOCHTIME C-DECAY D-ELSETNUM E-INCLINATION F-RAAN
TO ALL RADIO AMATEURS BT

"""
TLE_FORMS = {
    "AMSAT bulletin": AMSAT + joined("{name}\n{first}\n{second}\n") + "/EX\n",
    "quoted in a mail": joined("> {name}\n> {first}\n> {second}\n"),
    "table": "name,line1,line2\n" + joined('"{name}","{first}","{second}"\n'),
    "double-spaced": joined("{name}\n\n{first}\n\n{second}\n\n"),
    "Gpredict with more keys": joined("[Satellite]\nNAME={name}\nTLE1={first}\nTLE2={second}\nWEBSITE=http://x\n"),
    "keys of YAML": joined("- {name}\n  line1: '{first}'\n  line2: '{second}'\n"),
    "list of Python": joined('("{name}",\n"{first}",\n"{second}"),\n'),
    "text after column 69": joined("{name}\n{first}   0.0\n{second}     0.00      4320.0        360.00\n"),
    "Space-Track TLE in JSON": json.dumps([
        {"NORAD_CAT_ID": "1", "TLE_LINE0": f"0 {name}", "TLE_LINE1": first, "TLE_LINE2": second}
        for name, first, second in LINES
    ]),
    "members of a TLE service": json.dumps({"@id": "x", "totalItems": 3, "member": [
        {"satelliteId": 5, "name": name, "date": "2026-01-01", "line1": first, "line2": second}
        for name, first, second in LINES
    ]}),
    "pages of SatNOGS": json.dumps({"count": 3, "next": None, "results": [
        {"tle0": name, "tle1": first, "tle2": second, "tle_source": "{Space-Track}"} for name, first, second in LINES
    ]}, indent=2),
    "no checksums": joined("{name}\n{first:.68}\n{second:.68}\n"),
}  # fmt: skip


@pytest.mark.parametrize("form", TLE_FORMS)
def test_every_dress_of_a_tle_gives_the_same_orbits(form: str) -> None:
    found = read_orbits(TLE_FORMS[form])
    assert not found.refused
    assert [dataclasses.replace(one, name="") for one in found.elements] == [
        dataclasses.replace(one, name="") for one in read_elements(joined("{first}\n{second}\n"))
    ]
    if form not in ("table", "list of Python", "quoted in a mail", "keys of YAML"):
        assert [one.name for one in found.elements] == [one.name for one in SETS]
    assert bool(found.notes) == (form == "no checksums")


def test_both_lines_in_one_text_of_json_are_read() -> None:
    """As the service of N2YO sends them."""
    name, first, second = LINES[0]
    text = json.dumps({"info": {"satname": name, "satid": 5}, "tle": f"{first}\r\n{second}"})
    assert [one.catalogue_number for one in read_elements(text)] == [SETS[0].catalogue_number]


FOREIGN = {
    "a web page": "<!DOCTYPE html><html>log in</html>",
    "another CCSDS message than an OMM or OEM": "CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\n",
    "an STK ephemeris": "stk.v.11.0\nBEGIN Ephemeris\n",
    "RINEX": " " * 5 + "3.04           N: GNSS NAV DATA    M: MIXED".ljust(55) + "RINEX VERSION / TYPE\n",
    "a YUMA almanac": "******** Week 238 almanac for PRN-01 ********\nID: 01\n",
    "a SPICE kernel": "KPL/MK\n",
    "a calendar": "BEGIN:VCALENDAR\n",
    "a PDF": "%PDF-1.7\n",
    "compressed": decoded(b"\x1f\x8b\x08\x00rest"),
    "a station description": "# Degrees\nversion: 1\nname: Hill\n",
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_file_of_another_kind_is_named(kind: str) -> None:
    with pytest.raises(ValueError, match=f"it looks like {kind}"):
        read_orbits(FOREIGN[kind])


@pytest.mark.parametrize(
    "text", ["what lies here", "[5]", '{"type": "FeatureCollection"}', "90021\n90022, priority=5\n"]
)
def test_a_text_without_elements_is_told_by_its_beginning(text: str) -> None:
    with pytest.raises(ValueError, match="holds no elements; it starts with"):
        read_orbits(text)


OMM = {
    "OBJECT_NAME": "ONE", "OBJECT_ID": "2026-001A", "EPOCH": "2026-06-26T18:52:04.079712", "MEAN_MOTION": 14.3547808,
    "ECCENTRICITY": 0.0000884, "INCLINATION": 98.4283, "RA_OF_ASC_NODE": 247.6961, "ARG_OF_PERICENTER": 88.1964,
    "MEAN_ANOMALY": 271.9322, "EPHEMERIS_TYPE": 0, "NORAD_CAT_ID": 28057, "BSTAR": 0.00003594,
}  # fmt: skip
MANY = [{**OMM, "NORAD_CAT_ID": number, "OBJECT_NAME": f"SAT {number}"} for number in range(1, 6)]


def in_xml(fields: dict[str, object], prefix: str = "") -> str:
    leaves = "\n".join(f"<{key}>{value}</{key}>" for key, value in fields.items())
    return f"<{prefix}omm>\n<body><segment>\n{leaves}\n</segment></body></{prefix}omm>\n"


NOTATIONS = {
    "JSON on one line": json.dumps(MANY),
    "JSON on many lines": json.dumps(MANY, indent=1),
    "CSV": "\n".join([",".join(OMM), *(",".join(map(str, one.values())) for one in MANY)]),
    "quoted CSV": "\n".join([",".join(OMM), *(",".join(f'"{v}"' for v in one.values()) for one in MANY)]),
    "XML": f"<ndm>{''.join(map(in_xml, MANY))}</ndm>",
    "XML with prefixes": f"<n:ndm xmlns:n='x'>{''.join(in_xml(one, 'n:') for one in MANY)}</n:ndm>",
    "KVN": "".join("\n".join(["CCSDS_OMM_VERS = 3.0", *(f"{k} = {v}" for k, v in one.items()), ""]) for one in MANY),
}


DAMAGES = {"MEAN_ANOMALY": "MEAN}ANOMALY", "271.9322": "null", "98.4283": "198.4283", "2026-06": "26-06"}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("notation", NOTATIONS)
def test_one_damaged_message_of_many_costs_one(notation: str, damage: str) -> None:
    text = NOTATIONS[notation]
    assert len(read_elements(text)) == 5
    if damage == "MEAN_ANOMALY" and "CSV" in notation:
        damage = "271.9322"
    at = text.index(damage, text.index("SAT 3"))
    found = read_orbits(text[:at] + DAMAGES[damage] + text[at + len(damage) :])
    assert [one.catalogue_number for one in found.elements] == [1, 2, 4, 5]
    assert len(found.refused) == 1
    assert found.refused[0].startswith("line ")


def test_ten_thousand_sets_with_one_damaged_are_one_less() -> None:
    one, first, second = LINES[0]
    text = "\n".join([f"{one}\n{first}\n{second}"] * 10000)
    at = text.index(second, len(text) // 2) + 12
    found = read_orbits(text[:at] + "x" + text[at + 1 :])
    assert (len(found.elements), len(found.refused)) == (9999, 1)


@pytest.fixture(scope="module")
def oem(goldstone: Site) -> str:
    """A low orbit in ITRF, a minute apart."""
    track = TopocentricTrack(SETS[1], goldstone)
    first_s = math.ceil(SETS[1].epoch_t_s / 60.0) * 60.0
    return oem_text(track.target, "2026-001A", first_s, first_s + 1440.0, originator="test", created_t_s=0.0)


def as_xml(rows: list[list[str]], meta: dict[str, str]) -> str:
    names = ("EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
    states = "".join(
        f"<stateVector>{''.join(f'<{n}>{v}</{n}>' for n, v in zip(names, row, strict=True))}</stateVector>"
        for row in rows
    )
    head = "".join(f"<{key}>{value}</{key}>" for key, value in meta.items())
    return f"<oem><body><segment><metadata>{head}</metadata><data>{states}</data></segment></body></oem>"


def as_cpf(rows: list[list[str]], meta: dict[str, str]) -> str:
    """Version 2: name after source, date and two sequence numbers; reference frame 0 is the Earth's."""
    head = "H1 CPF  2  TST 2026 11 25 12  001 01 iss-like      None\nH2  2600101 1234    25544 2006 06 26 00 00 00 "
    lines = [head + "2006 06 27 00 00 00    60 1 1  0 0 0 0", "H9"]
    for row in rows:
        t_s = from_utc_text(row[0])
        metres = " ".join(f"{1e3 * float(value):.6f}" for value in row[1:4])
        lines.append(f"10 0 {40587 + int(t_s // 86400)} {t_s % 86400:.6f}  0 {metres}")
    return "\n".join([*lines, "99", ""])


def as_sp3(rows: list[list[str]], meta: dict[str, str], *, gap: int | None = None) -> str:
    lines = [f"#dP2006  6 26  0  0  0.00000000 {len(rows):7d} ORBIT IGS14 FIT  TST", "%c L  cc UTC ccc cccc cccc cccc"]
    for k, row in enumerate(rows):
        date, clock = row[0].split("T")
        year, month, day = date.split("-")
        hour, minute, second = clock.split(":")
        lines.append(f"*  {year} {int(month):2d} {int(day):2d} {hour} {minute} {float(second):11.8f}")
        known = [0.0] * 3 if k == gap else map(float, row[1:4])
        lines.append("PL01" + "".join(f"{value:14.6f}" for value in known) + " 999999.999999")
    return "\n".join([*lines, "EOF", ""])


TABLES = {"OEM in XML": (as_xml, 1e-3), "CPF": (as_cpf, 0.05), "SP3": (as_sp3, 0.05)}


def parts_of(text: str) -> tuple[list[list[str]], dict[str, str]]:
    meta = text[text.index("META_START") : text.index("META_STOP")].splitlines()[1:]
    rows = [line.split() for line in text[text.index("META_STOP") :].splitlines()[1:] if line]
    return rows, dict(line.split(" = ", 1) for line in meta)  # type: ignore[misc]


@pytest.mark.parametrize("form", TABLES)
def test_a_table_of_states_gives_the_positions_of_the_message(form: str, oem: str) -> None:
    """Ten positions a minute apart carry a low orbit to centimetres, states with velocities to millimetres."""
    write, metres = TABLES[form]
    text = write(*parts_of(oem))
    (wanted,), (found,) = read_orbits(oem).segments, read_orbits(text).segments
    one, other = OemTarget([wanted]), OemTarget([found])
    ((first, last),) = one.spans_t_s
    assert other.spans_t_s[0] == pytest.approx((first, last), abs=1e-3)
    for t_s in np.linspace(first + 240.0, last - 240.0, 7).tolist():
        assert np.linalg.norm(np.subtract(one.motion_at(t_s).position, other.motion_at(t_s).position)) < metres


def test_a_position_that_sp3_does_not_know_is_a_gap(oem: str) -> None:
    found = read_orbits(as_sp3(*parts_of(oem), gap=12)).segments
    assert [len(segment.tai_s) for segment in found] == [12, 12]
    with pytest.raises(ValueError, match="outside the usable span"):
        OemTarget(found).motion_at(0.5 * (found[0].usable_to_s + found[1].usable_from_s) - 33.0)


@pytest.mark.parametrize("form", ["CPF", "SP3"])
def test_a_table_that_is_cut_off_is_refused(form: str, oem: str) -> None:
    text = TABLES[form][0](*parts_of(oem))
    with pytest.raises(ValueError, match="is the message whole"):
        read_orbits("\n".join(text.splitlines()[:-9]))


def mutants(text: str, alphabet: str) -> st.SearchStrategy[str]:
    def damaged(place: int, byte: str, kind: str) -> str:
        if alphabet != ANY and text[place] in "0123456789.-e":
            # A blank in place of the first digit, or of the last, leaves a number.
            kind = "insert" if byte.isspace() else "change"
        return text[:place] + {"change": byte, "insert": byte + text[place], "delete": ""}[kind] + text[place + 1 :]

    kinds = st.sampled_from(("change", "insert", "delete"))
    return st.builds(damaged, st.integers(0, len(text) - 1), st.sampled_from(alphabet), kinds)


TWO = "\n".join("\n".join(lines) for lines in LINES[:2]) + "\n"
ANY = "".join(map(chr, range(32, 127))) + "\n\t\ufffd"


def orbit(one: Elements) -> tuple[float, ...]:
    return one.satrec().sgp4_tsince(100.0)[1]


def refused(text: str) -> OrbitFile | None:
    try:
        return read_orbits(text)
    except ValueError:
        return None


@given(mutants(TWO, ANY))
def test_no_byte_of_a_tle_makes_another_orbit(text: str) -> None:
    """The checksum finds most; the columns find what it counts as nothing."""
    wanted = {one.catalogue_number: orbit(one) for one in SETS}
    found = refused(text)
    for one in found.elements if found else ():
        assert orbit(one) == pytest.approx(wanted[one.catalogue_number], abs=1e-5)
    assert found is None or len(found.elements) + len(found.refused) >= 2
    assert found is None or all(reason.startswith("line ") for reason in found.refused)


FRAMED = [name for name in sorted(NOTATIONS) if name != "CSV"]


@given(st.sampled_from(FRAMED).flatmap(lambda name: mutants(NOTATIONS[name], "xX{}<>\"',;:=\n ")))
def test_no_byte_of_the_frame_of_an_omm_makes_another_orbit(text: str) -> None:
    """A digit for a digit, or one less, is beyond any reader: these notations have no checksum."""
    wanted, found = orbit(read_elements(NOTATIONS["CSV"])[0]), refused(text)
    for one in found.elements if found else ():
        assert orbit(one) == pytest.approx(wanted, rel=1e-3)
