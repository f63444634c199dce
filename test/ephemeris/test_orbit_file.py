"""Files of orbits in the formats in use: read where they stand, or named; a damaged set costs itself."""

import dataclasses
import json
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

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
from rf_pointing.ephemeris.damaged_states import damaged_state
from rf_pointing.ephemeris.elements import from_row
from rf_pointing.ephemeris.orbit_file import FORMATS, OrbitFile, decoded, read_elements, read_orbit_file, read_orbits
from rf_pointing.ephemeris.source import SourceParams, load_target, read_source
from test.ephemeris.omm_text import FIELDS, as_csv, as_kvn
from test.ephemeris.omm_text import as_xml as omm_xml

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
    "observations of SatNOGS": json.dumps([
        {"id": 1, "tle": f"0 {name}\n{first}\n{second}", "demoddata": [{"payload_demod": "x"}]}
        for name, first, second in LINES
    ]),
    "Stellarium": json.dumps({"creator": "Satellites plugin version 0.11", "hintColor": [0.0, 0.4], "satellites": {
        first[2:7]: {"name": name, "tle1": first, "tle2": second, "comms": [{"hz": 1}, {"hz": 2}]}
        for name, first, second in LINES
    }}, indent=2),
    "lists of JSON": json.dumps(LINES),
    "N2YO": json.dumps([
        {"info": {"satname": name, "satid": 5}, "tle": f"{first}\r\n{second}"} for name, first, second in LINES
    ]),
    "TOML": joined('[[satellite]]\nname = "{name}"\nline1 = "{first}"\nline2 = "{second}"\n\n'),
    "block of YAML": joined("  - name: {name}\n    tle: |\n      {first}\n      {second}\n"),
    "dump of SQL": joined("INSERT INTO tle VALUES (1,'{name}','{first}','{second}');\n"),
    "XML of its own": joined("<tle><name>{name}</name>\n<line1>{first}</line1><line2>{second}</line2></tle>\n"),
    "table of a wiki": joined("| {name} | {first} | {second} |\n"),
    "no checksums": joined("{name}\n{first:.68}\n{second:.68}\n"),
}  # fmt: skip


@pytest.mark.parametrize("form", TLE_FORMS)
def test_every_dress_of_a_tle_gives_the_same_orbits(form: str) -> None:
    found = read_orbits(TLE_FORMS[form])
    assert not found.refused
    assert [dataclasses.replace(one, name="") for one in found.elements] == [
        dataclasses.replace(one, name="") for one in read_elements(joined("{first}\n{second}\n"))
    ]
    assert [one.name for one in found.elements] == [one.name for one in SETS]
    assert bool(found.notes) == (form == "no checksums")


FOREIGN = {
    "a web page": "<!DOCTYPE html><html>log in</html>",
    "another CCSDS message than an OMM or OEM": "CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\n",
    "an STK ephemeris": "stk.v.11.0\nBEGIN Ephemeris\n",
    "RINEX": " " * 5 + "3.04           N: GNSS NAV DATA    M: MIXED".ljust(55) + "RINEX VERSION / TYPE\n",
    "a YUMA almanac": "******** Week 238 almanac for PRN-01 ********\nID: 01\n",
    "a SPICE kernel": "KPL/MK\n",
    "AMSAT's elements in words": "Satellite: AO-07\nCatalog number: 07530\nEpoch time:      26329.12345678\n",
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


MANY = [{**FIELDS, "NORAD_CAT_ID": number, "OBJECT_NAME": f"SAT {number}"} for number in range(1, 6)]
NOTATIONS = {
    "JSON on one line": json.dumps(MANY), "JSON on many lines": json.dumps(MANY, indent=1),
    "CSV": as_csv(*MANY), "quoted CSV": as_csv(*MANY, quote='"'),
    "CSV by semicolons": as_csv(*MANY, between=";"), "CSV by tabs": as_csv(*MANY, between="\t"),
    "XML": omm_xml(*MANY), "XML with prefixes": omm_xml(*MANY, prefix="n:"), "KVN": as_kvn(*MANY),
}  # fmt: skip
DAMAGES = {"MEAN_ANOMALY": "MEAN}ANOMALY", "271.9322": "null", "98.4283": "198.4283", "2006-06": "06-06"}


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


@pytest.mark.parametrize("form", ["JSON", "TLE"])
def test_what_is_kept_of_a_large_file_is_what_it_holds(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, random: np.random.Generator
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    messages = [{**FIELDS, "NORAD_CAT_ID": k, "OBJECT_NAME": f"SAT {k} ü"} for k in range(1, 2001)]
    lines = (line for one in read_elements(as_csv(*messages)) for line in (one.name, *tle_lines(one)))
    text = json.dumps(messages) if form == "JSON" else "\n".join(lines)
    # One set is damaged: it is listed the second time as well.
    at = text.index("SAT 1000")
    path, place = tmp_path / "large.txt", text.index("98.4283", at)
    path.write_text(text[:place] + "x" + text[place + 1 :])
    first, read = read_source(str(path)), read_orbits(decoded(path.read_bytes()))
    assert (len(first.elements), len(first.problems), first.elements) == (1999, 1, read.elements)
    (kept,) = (tmp_path / "cache" / "rf_pointing" / "catalogues").iterdir()
    damaged = bytearray(whole := kept.read_bytes())
    damaged[at := int(random.integers(len(whole)))] ^= 1 << int(random.integers(8))
    for content in (whole, bytes(damaged), whole[:at]):
        kept.write_bytes(content)
        assert read_orbit_file(path) == (first.rows, [], read.problems)
        assert kept.read_bytes() == whole
    # Another satellite in a file of the same name, size and time.
    status = path.stat()
    path.write_text(path.read_text().replace("SAT 77 ", "SAT 7X "))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert from_row(read_orbit_file(path).rows[76]).name == "SAT 7X ü"


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


ANY = "".join(map(chr, range(32, 127))) + "\n\t\ufffd"


def orbit(one: Elements) -> tuple[float, ...]:
    return one.satrec().sgp4_tsince(100.0)[1]


def refused(text: str, *, reason: str = "") -> OrbitFile | None:
    try:
        return read_orbits(text)
    except ValueError as error:
        if not re.search(reason, str(error)):
            raise
        return None


# A digit for a digit is beyond any reader where there is no checksum.
CHECKED = sorted(TLE_FORMS.keys() - {"no checksums"})


@settings(max_examples=300)
# A hash makes a comment of a line.
@given(st.sampled_from(CHECKED).flatmap(lambda form: mutants(TLE_FORMS[form], ANY.replace("#", ""))))
def test_no_byte_of_a_tle_makes_another_orbit(text: str) -> None:
    """The checksum finds most; the columns find what it counts as nothing."""
    wanted = {one.catalogue_number: orbit(one) for one in SETS}
    found = refused(text, reason=r"line \d|holds no elements")
    for one in found.elements if found else ():
        assert orbit(one) == pytest.approx(wanted[one.catalogue_number], abs=1e-5)
    assert found is None or len(found.elements) + len(found.refused) >= len(SETS)
    assert found is None or all(reason.startswith("line ") for reason in found.refused)


FRAMED = [name for name in sorted(NOTATIONS) if "CSV" not in name or "quoted" in name]


@example(json.dumps(MANY, indent=1).replace("594e-05", "}594e-05", 1))
@given(st.sampled_from(FRAMED).flatmap(lambda name: mutants(NOTATIONS[name], "xX{}<>\"',;:=\n ")))
def test_no_byte_of_the_frame_of_an_omm_makes_another_orbit(text: str) -> None:
    """A digit for a digit, or one less, is beyond any reader: these notations have no checksum."""
    wanted, found = orbit(read_elements(NOTATIONS["CSV"])[0]), refused(text)
    for one in found.elements if found else ():
        assert orbit(one) == pytest.approx(wanted, rel=1e-3)


def as_meme(rows: list[list[str]], meta: dict[str, str]) -> str:
    """Axes that stand still in place of the message's, which turn with the Earth."""
    lines = ["created:2026-11-25 00:00:00 UTC", "ephemeris_start:x step_size:60", "ephemeris_source:blend", "UVW"]
    for row in rows:
        date, clock = row[0].split("T")
        day = (np.datetime64(date) - np.datetime64(f"{date[:4]}-01-01")).astype(int) + 1
        values = np.array(row[1:], dtype=float)
        turn, spin = 7.292115e-5 * from_utc_text(row[0]), np.array([0.0, 0.0, 7.292115e-5])
        turned = Rotation.from_rotvec([0.0, 0.0, turn]).apply([values[:3], values[3:] + np.cross(spin, values[:3])])
        lines.append(f"{date[:4]}{day:03d}{clock.replace(':', '')[:10]} {' '.join(f'{x:.9f}' for x in turned.ravel())}")
        lines += [" ".join(["1.0e-03"] * 7)] * 3
    return "\n".join(lines) + "\n"


def eccentric(step_s: float, place: int, turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions, velocities [m] of an orbit of e = 0.7 about its perigee, or of a circle, J2 included."""
    low = 6.9e6 + 1e5 * place
    speed = math.sqrt(398600.4418e9 / low * (1.0 + 0.7 * (place % 2)))
    state = np.array([low, 0.0, 0.0, 0.0, speed * math.cos(turn), speed * math.sin(turn)])

    def pull(_: float, s: np.ndarray) -> np.ndarray:
        far = np.linalg.norm(s[:3])
        flat = 1.5 * 1.0826e-3 * (6378137.0 / far) ** 2 * (5.0 * (s[2] / far) ** 2 - np.array([1.0, 1.0, 3.0]))
        return np.hstack([s[3:], -398600.4418e9 / far**3 * s[:3] * (1.0 - flat)])

    times = step_s * np.arange(-10.0, 11.0)
    back = solve_ivp(pull, (0.0, times[0]), state, rtol=1e-10, atol=1e-3).y[:, -1]
    found = solve_ivp(pull, (times[0], times[-1]), back, t_eval=times, rtol=1e-10, atol=1e-3).y.T
    return times, found[:, :3], found[:, 3:]


ORBITS = st.builds(eccentric, st.floats(10.0, 240.0), st.integers(0, 350), st.floats(0.0, 3.1))


@settings(max_examples=30)
@example(eccentric(135.0, 1, 1.6), 4, True, 0.0, 1.0)
@example(eccentric(200.0, 1, 1.6), 4, True, 0.0, 1.0)
@given(ORBITS, st.integers(0, 20), st.booleans(), st.floats(0.0, 6.3), st.floats(1.0, 100.0))
def test_one_state_off_its_orbit_is_found_and_an_orbit_is_not(
    orbit: tuple[np.ndarray, np.ndarray, np.ndarray], row: int, moving: bool, way: float, factor: float
) -> None:
    times, position, velocity = orbit
    speeds = velocity if moving else None
    assert damaged_state(times, position, speeds, turning=False)[0] == -1
    low = 398600.4418e9 / np.linalg.norm(position, axis=1).min() ** 3
    truncated = 2.0 * 30.0 * (math.sqrt(2.0 * low) * 2.0 * (times[1] - times[0])) ** 5 * 4e7 / 240.0
    position[row] += (300.0 + truncated) * factor * np.array([math.cos(way), math.sin(way), 0.0])
    assume(np.linalg.norm(position[row]) > 0.9 * 6378137.0)  # is refused without its neighbours
    assert damaged_state(times, position, speeds, turning=False)[0] == row


@settings(max_examples=30)
@example(eccentric(114.0, 0, 0.0), 6, 1.0, 3.0)
@example(eccentric(60.0, 2, 1.08), 16, 0.0, 34.2)
@given(ORBITS, st.integers(3, 17), st.floats(0.0, 1.0), st.floats(0.001, 300.0))
def test_a_manoeuvre_is_not_a_damaged_state(
    orbit: tuple[np.ndarray, np.ndarray, np.ndarray], row: int, share: float, speed: float
) -> None:
    times, position, velocity = orbit
    h = times[1] - times[0]
    position[row:] += speed * h * (np.arange(len(times) - row) + share)[:, None] * np.array([0.0, 0.6, 0.8])
    velocity[row:] += speed * np.array([0.0, 0.6, 0.8])
    assert damaged_state(times, position, velocity, turning=False)[0] == -1


def ephemerides(oem: str) -> dict[str, str]:
    parts = parts_of(oem)
    return {"OEM": oem, "MEME": as_meme(*parts), **{form: write(*parts) for form, (write, _) in TABLES.items()}}


@pytest.fixture(scope="module", params=["OEM", "OEM in XML", "MEME", "CPF", "SP3"])
def ephemeris(request: pytest.FixtureRequest, oem: str) -> str:
    return ephemerides(oem)[request.param]


def test_every_format_that_is_read_is_among_those_whose_bytes_are_damaged(oem: str) -> None:
    texts = [*TLE_FORMS.values(), *(NOTATIONS[name] for name in FRAMED), *ephemerides(oem).values()]
    assert {read_orbits(text).format for text in texts} == {form.name for form in FORMATS if form.read}


@settings(max_examples=30)
@given(data=st.data())
def test_no_byte_of_an_ephemeris_makes_another_orbit(data: st.DataObject, ephemeris: str) -> None:
    """A digit that moves a state by more than 0.1 km is found by its neighbours."""
    (wanted,) = read_orbits(ephemeris).segments
    damaged = data.draw(mutants(ephemeris, ANY))
    found = refused(damaged, reason=r"line \d|must be|must read|holds no elements|lacks|whole")
    if found is None:
        return
    one = OemTarget([wanted])
    ((first, last),) = one.spans_t_s
    for segment in found.segments:
        if not segment.method or segment.frame[:4] not in ("ITRF", "EME2"):
            continue  # refused where it is used
        other = OemTarget([segment])
        for t_s in np.linspace(first, last, 25).tolist():
            if any(low <= t_s <= high for low, high in other.spans_t_s):
                gap = np.linalg.norm(np.subtract(one.motion_at(t_s).position, other.motion_at(t_s).position))
                assert gap < 400.0, (segment.tai_s, t_s)
