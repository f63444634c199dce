import re
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import RawTracking, read_tdm, write_tdm
from rf_pointing.core import Kinematics, wrap_rad

ROUNDING_RAD = 1e-11


@pytest.fixture
def raw(track, raw_pass, table_1):
    long = raw_pass(track(5.0), table_1, None, 1e-4)
    names = ("t_s", "azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s", "good")
    short = {name: getattr(long, name)[:20] for name in names}
    return replace(long, **short)


@pytest.fixture
def lines(raw, tmp_path):
    write_tdm(tmp_path / "a.tdm", [raw, raw], originator="test", created_t_s=1.7e9)
    return (tmp_path / "a.tdm").read_text().splitlines()


def read_changed(tmp_path, lines):
    (tmp_path / "b.tdm").write_text("\n".join(lines) + "\n")
    return read_tdm(tmp_path / "b.tdm")


def test_written_segments_read_back_equal(raw, lines, tmp_path):
    back = read_changed(tmp_path, lines)
    assert len(back) == 2
    assert (back[0].station, back[0].target, back[0].band) == ("gs1", "bird", "S")
    assert back[0].t_s == pytest.approx(raw.t_s, abs=1e-6)
    turns = (back[0].azimuth_rad - raw.azimuth_rad) / (2.0 * np.pi)
    assert np.max(np.abs(turns - np.round(turns))) < ROUNDING_RAD
    assert back[0].elevation_rad == pytest.approx(raw.elevation_rad, abs=ROUNDING_RAD)
    assert back[0].range_m == pytest.approx(raw.range_m, abs=1e-5)
    assert back[0].range_rate_m_s == pytest.approx(raw.range_rate_m_s, abs=1e-8)


def test_bad_samples_are_not_written(raw, tmp_path):
    good = raw.good.copy()
    good[3:5] = False
    write_tdm(tmp_path / "a.tdm", [replace(raw, good=good)], originator="test", created_t_s=1.7e9)
    assert len(read_tdm(tmp_path / "a.tdm")[0]) == 18


def test_a_pass_without_a_good_sample_is_left_out_and_a_message_without_any_is_refused(raw, tmp_path):
    bad = replace(raw, good=np.zeros(len(raw), dtype=bool))
    write_tdm(tmp_path / "a.tdm", [bad, raw], originator="test", created_t_s=1.7e9)
    assert len(read_tdm(tmp_path / "a.tdm")) == 1
    with pytest.raises(ValueError, match="no good sample to write in 1 passes"):
        write_tdm(tmp_path / "b.tdm", [bad], originator="test", created_t_s=1.7e9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("ANGLE_1 =", "ANGLE1 =", 1), r"line 19: ANGLE1 is not a data keyword"),
        (lambda t: t.replace("TIME_SYSTEM = UTC", "TIME_SYSTEM = TAI", 1), "line 6: TIME_SYSTEM=TAI must be UTC"),
        (lambda t: t.replace("ANGLE_TYPE = AZEL", "ANGLE_TYPE = RADEC", 1), "ANGLE_TYPE=RADEC must be AZEL"),
        (lambda t: t.replace("PATH = 2,1", "PATH = 2,2", 1), "PATH=2,2 must join station and target"),
        (
            lambda t: t.replace("PATH = 2,1", "TIMETAG_REF = TRANSMIT\nPATH = 2,1", 1),
            "TIMETAG_REF=TRANSMIT must be RECEIVE",
        ),
        (lambda t: t.replace("RECEIVE_BAND = S\n", "", 1), "line 5: RECEIVE_BAND is missing"),
        (lambda t: t.replace("PARTICIPANT_2 = bird\n", "", 1), "line 5: PARTICIPANT_2 is missing"),
        (lambda t: t.replace("DATA_STOP", "", 1), "META_START does not belong here"),
        (lambda t: t.rsplit("DATA_STOP", 1)[0], "data section is not closed"),
        (lambda t: t.replace("CCSDS_TDM_VERS = 2.0", "CCSDS_TDM_VERS = 9.0"), "CCSDS_TDM_VERS=9.0 must be"),
        (lambda t: t.replace("META_STOP", "META_STOP extra", 1), "must read KEYWORD = value"),
        (lambda t: t.replace("DATA_START", "DATA_START\nANGLE_1 = 2001-13-01T00:00:00 5.0", 1), "line 19: .*time"),
        (lambda t: t.replace("DATA_START", "DATA_START\nANGLE_1 = 2001-01-01T00:00:00 nan", 1), "must be finite"),
        (lambda t: t.replace("MODE = SEQ", "TIME_SYSTEM = UTC\nMODE = SEQ", 1), "TIME_SYSTEM is given twice"),
        (lambda t: t.replace("ORIGINATOR", "AUTHOR", 1), "line 3: AUTHOR is not a header keyword"),
        (lambda t: t.replace("ORIGINATOR = test", "ORIGINATOR =", 1), "line 3: ORIGINATOR has no value"),
        (lambda t: t.replace("MODE =", "MODUS =", 1), "line 11: MODUS is not a metadata keyword"),
        (
            lambda t: t.replace("MODE = SEQUENTIAL", "MODE = SINGLE_DIFF", 1),
            "line 11: MODE=SINGLE_DIFF must be SEQUENTIAL",
        ),
        (
            lambda t: t.replace("MODE", "DATA_QUALITY = FINE\nMODE", 1),
            "line 11: DATA_QUALITY=FINE must be RAW or VALIDATED or DEGRADED",
        ),
        (
            lambda t: t.replace("META_STOP", "META_STOP\nMODE = SEQUENTIAL", 1),
            "line 17: MODE outside a metadata or data",
        ),
        (lambda t: t.replace("DATA_STOP", "DATA_STOP\nANGLE_1 = 2 3", 1), "ANGLE_1 outside a metadata or data"),
        (lambda t: "\n".join(t.splitlines()[:3]), "no segment"),
        (lambda t: "\n".join(t.splitlines()[:16]), "line 16: the described section is not closed"),
        (lambda t: t.replace("DATA_START", "DATA_START\nANGLE_1 = 2001-09-09T01:46:40 5.0 6.0", 1), "has 3 words"),
        (lambda t: re.sub(r"\nANGLE_1 = [^\n]*", "", t), "line 5: the segment has no ANGLE_1"),
        (lambda t: re.sub(r"\nANGLE_2 = [^\n]*", "", t), "line 5: the segment has no ANGLE_2"),
        (
            lambda t: t.replace("PATH = 2,1", "PARTICIPANT_3 = relay\nPATH = 2,3,1", 1),
            "PATH=2,3,1 must join station and target",
        ),
        (lambda t: t.replace("PATH = 2,1\n", "", 1), "line 5: PATH is missing"),
        (lambda t: t.replace("ANGLE_TYPE = AZEL\n", "", 1), "line 5: ANGLE_TYPE is missing"),
    ],
)
def test_a_damaged_message_is_refused_with_its_line(lines, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        read_changed(tmp_path, change("\n".join(lines)).splitlines())


def test_repeated_epoch_names_both_lines(lines, tmp_path):
    first = next(line for line in lines if line.startswith("ANGLE_1"))
    where = lines.index(first)
    with pytest.raises(ValueError, match=rf"line {where + 2}: ANGLE_1 .* repeats line {where + 1}"):
        read_changed(tmp_path, [*lines[: where + 1], first, *lines[where + 1 :]])


def test_angles_of_a_two_way_pass_are_read_and_its_range_is_left_out_with_a_note(raw, lines, tmp_path):
    text = "\n".join(lines).replace("PATH = 2,1", "PATH = 1,2,1", 1)
    two_way, one_way = read_changed(tmp_path, text.splitlines())
    assert (two_way.station, two_way.target) == ("gs1", "bird")
    assert two_way.elevation_rad == pytest.approx(raw.elevation_rad, abs=ROUNDING_RAD)
    assert (two_way.range_m, two_way.range_rate_m_s) == (None, None)
    assert two_way.notes == tuple(
        f"{key}: left out of PATH=1,2,1, only one-way is read" for key in ("RANGE", "DOPPLER_INSTANTANEOUS")
    )
    assert one_way.range_m is not None
    assert one_way.notes == ()


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (
            lambda t: t.replace("RANGE_UNITS = km", "RANGE_UNITS = s", 1),
            "RANGE: left out in RANGE_UNITS=s, only km is read",
        ),
        (
            lambda t: re.sub(r"\nRANGE = [^\n]*", "", t, count=1),
            "RANGE: left out, its times are not those of the angles",
        ),
    ],
)
def test_a_range_that_cannot_be_used_costs_no_angles(raw, lines, tmp_path, change, note):
    first = read_changed(tmp_path, change("\n".join(lines)).splitlines())[0]
    assert first.azimuth_rad.shape == raw.azimuth_rad.shape
    assert first.range_m is None
    assert first.range_rate_m_s == pytest.approx(raw.range_rate_m_s, abs=1e-8)
    assert first.notes == (note,)


def test_the_band_is_the_one_received_and_degraded_data_are_not_good(lines, tmp_path):
    text = "\n".join(lines)
    uplink = text.replace("RECEIVE_BAND = S", "TRANSMIT_BAND = X").replace("PATH = 2,1", "PATH = 1,2,1", 1)
    (tmp_path / "b.tdm").write_text(uplink)
    assert [one.band for one in read_tdm(tmp_path / "b.tdm", band="Ka")] == ["Ka", "X"]
    first, second = read_changed(tmp_path, text.replace("MODE", "DATA_QUALITY = DEGRADED\nMODE", 1).splitlines())
    assert not np.any(first.good)
    assert np.all(second.good)


def test_names_that_a_message_cannot_hold_are_refused(raw, tmp_path):
    with pytest.raises(ValueError, match="must be ASCII"):
        write_tdm(tmp_path / "a.tdm", [replace(raw, station="Kårholmen")], originator="test", created_t_s=1.7e9)
    assert not (tmp_path / "a.tdm").exists()


def test_bytes_that_are_not_ascii_are_refused(tmp_path):
    (tmp_path / "c.tdm").write_bytes(b"CCSDS_TDM_VERS = 2.0\n\xff\xfe")
    with pytest.raises(ValueError, match="byte 21 is not ASCII"):
        read_tdm(tmp_path / "c.tdm")


def test_random_damage_gives_data_or_a_clear_error_and_nothing_else(lines, tmp_path, random):
    text, messages = "\n".join(lines), []
    for _ in range(200):
        start = int(random.integers(0, len(text)))
        end = start + int(random.integers(0, 40))
        middle = "".join(chr(c) for c in random.integers(32, 127, int(random.integers(0, 8))))
        (tmp_path / "d.tdm").write_text(text[:start] + middle + text[end:])
        try:
            tracks = read_tdm(tmp_path / "d.tdm")
        except ValueError as error:
            messages.append(str(error))
        else:
            assert all(np.all(np.isfinite(track.azimuth_rad)) for track in tracks)
    assert [m for m in messages if "line" not in m and "CCSDS_TDM_VERS" not in m] == []
    assert len(messages) > 50


@pytest.mark.parametrize(("applied", "share"), [("NO", 1.0), ("YES", 0.0)])
def test_each_correction_is_added_in_its_unit_unless_it_was_already(raw, lines, tmp_path, applied, share):
    given = "CORRECTION_ANGLE_1 = -0.25\nCORRECTION_ANGLE_2 = 0.5\nCORRECTION_RANGE = 1.5\nCORRECTION_DOPPLER = -0.002"
    text = "\n".join(lines).replace("META_STOP", f"{given}\nCORRECTIONS_APPLIED = {applied}\nMETA_STOP", 1)
    found, plain = read_changed(tmp_path, text.splitlines())
    assert found.azimuth_rad - plain.azimuth_rad == pytest.approx(np.full(20, share * np.radians(-0.25)), abs=1e-10)
    assert found.elevation_rad - plain.elevation_rad == pytest.approx(np.full(20, share * np.radians(0.5)), abs=1e-10)
    assert found.range_m - plain.range_m == pytest.approx(np.full(20, share * 1500.0), abs=1e-5)
    assert found.range_rate_m_s - plain.range_rate_m_s == pytest.approx(np.full(20, share * -2.0), abs=1e-9)
    with pytest.raises(ValueError, match="CORRECTION_RANGE=far must be a number"):
        read_changed(tmp_path, text.replace("CORRECTION_RANGE = 1.5", "CORRECTION_RANGE = far").splitlines())


@pytest.mark.parametrize(
    ("path", "station", "target"), [("2,1", "gs1", "bird"), ("1,2", "bird", "gs1"), ("2, 1", "gs1", "bird")]
)
def test_the_last_participant_of_a_path_is_the_station(lines, tmp_path, path, station, target):
    first = read_changed(tmp_path, "\n".join(lines).replace("PATH = 2,1", f"PATH = {path}", 1).splitlines())[0]
    assert (first.station, first.target) == (station, target)
    assert first.range_m is not None


@pytest.mark.parametrize(("lost", "other"), [("ANGLE_1", "ANGLE_2"), ("ANGLE_2", "ANGLE_1")])
def test_an_angle_without_the_other_at_its_time_is_refused_with_its_line(lines, tmp_path, lost, other):
    rows = [number for number, line in enumerate(lines) if line.startswith(lost)]
    kept = [line for number, line in enumerate(lines) if number != rows[4]]
    partner = lines[rows[4]].replace(lost, other).rsplit(" ", 1)[0]
    where = next(number for number, line in enumerate(kept, start=1) if line.startswith(partner))
    with pytest.raises(ValueError, match=rf"line {where}: {other} at .* has no {lost} at that time"):
        read_changed(tmp_path, kept)


def test_what_a_message_says_besides_angles_and_ranges_is_no_error(lines, tmp_path):
    """Frequencies and weather, and a first version of the format; a time alone is no value."""
    plain = read_changed(tmp_path, lines)[0]
    text = "\n".join(lines).replace("VERS = 2.0", "VERS = 1.0")
    text = text.replace("DATA_START", "DATA_START\nRECEIVE_FREQ_1 = 2001-09-09T01:46:40 2.2e9\nPRESSURE = x 1013", 1)
    found = read_changed(tmp_path, text.splitlines())[0]
    assert np.array_equal(found.azimuth_rad, plain.azimuth_rad)
    assert found.notes == ()
    assert np.all(found.good)
    short = "\n".join(lines).replace("DATA_START", "DATA_START\nANGLE_1 = 2001-09-09T01:46:40", 1)
    with pytest.raises(ValueError, match="line 19: ANGLE_1 needs a time and a value, has 1 words"):
        read_changed(tmp_path, short.splitlines())


def test_a_correction_is_marked_as_applied_or_not(lines, tmp_path):
    text = "\n".join(lines).replace("META_STOP", "CORRECTION_RANGE = 1.5\nCORRECTIONS_APPLIED = MAYBE\nMETA_STOP", 1)
    with pytest.raises(ValueError, match="line 5: CORRECTION_RANGE needs CORRECTIONS_APPLIED = YES or NO"):
        read_changed(tmp_path, text.splitlines())


@pytest.mark.parametrize(
    ("kind", "lower_axis", "angles_deg"),
    [("XEYN", "north_south", [(30.0, 0.0), (0.0, 30.0)]), ("XSYE", "east_west", [(0.0, 30.0), (-30.0, 0.0)])],
)
def test_an_x_y_mount_writes_the_angles_of_its_axes(tmp_path, kind, lower_axis, angles_deg):
    """30 deg off the zenith to the east, then to the north, by the words of CCSDS 503.0-B-2."""
    mount = Kinematics(type="x_y", lower_axis=lower_axis)
    sky = np.radians([90.0, 0.0]), np.radians([60.0, 60.0])
    first, second = mount.of_directions(*sky)
    raw = RawTracking(
        station="gs1", band="S", target="bird", t_s=np.array([1e9, 1e9 + 1.0]), azimuth_rad=first + 4.0 * np.pi,
        elevation_rad=second, range_m=None, range_rate_m_s=None, good=np.ones(2, dtype=bool),
    )  # fmt: skip
    write_tdm(tmp_path / "a.tdm", [raw], originator="test", created_t_s=1.7e9, mount=mount)
    text = (tmp_path / "a.tdm").read_text()
    assert f"ANGLE_TYPE = {kind}" in text
    found = [float(value) for value in re.findall(r"ANGLE_. = \S+ (\S+)", text)]
    assert found == pytest.approx(np.ravel(angles_deg), abs=1e-9)
    (back,) = read_tdm(tmp_path / "a.tdm")
    assert np.abs(wrap_rad(back.azimuth_rad - sky[0])) == pytest.approx(0.0, abs=ROUNDING_RAD)
    assert back.elevation_rad == pytest.approx(sky[1], abs=ROUNDING_RAD)
