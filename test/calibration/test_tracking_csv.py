"""Tables read back equal, damage is refused with its line; a killed process loses at most the line it was writing."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import ObservationJournal, read_observations, read_tracking
from rf_pointing.calibration.tracking_csv import write_observations
from test.calibration.conftest import write_tracking


@pytest.fixture
def raw(track, raw_pass, table_1):
    return raw_pass(track(5.0), table_1, None, 1e-4)


def test_tracking_reads_back_equal(raw, tmp_path):
    good = raw.good.copy()
    good[7] = False
    write_tracking(tmp_path / "a.csv", replace(raw, good=good, range_rate_m_s=None))
    back = read_tracking(tmp_path / "a.csv")
    assert np.array_equal(back.t_s, raw.t_s)
    assert back.elevation_rad == pytest.approx(raw.elevation_rad, rel=1e-15)
    assert (back.range_rate_m_s, back.station) == (None, "gs1")
    assert np.array_equal(back.good, good)
    assert back.azimuth_rad == pytest.approx(raw.azimuth_rad, rel=1e-15)
    assert np.array_equal(back.range_m, raw.range_m)


def test_a_byte_order_mark_of_a_spreadsheet_is_no_part_of_the_table(raw, tmp_path):
    path = tmp_path / "a.csv"
    write_tracking(path, raw)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert np.array_equal(read_tracking(path).t_s, raw.t_s)


@pytest.fixture
def data(campaign, table_1):
    return campaign(table_1, passes=2)


def journal(tmp_path):
    return ObservationJournal(tmp_path / "c" / "observations.csv", "gs1", "S")


def test_points_appended_one_by_one_are_there_when_opened_again(data, tmp_path):
    first = journal(tmp_path)
    assert first.points is None
    for row in range(len(data)):
        first.append(data.select([row]))
    back = journal(tmp_path).points
    assert np.array_equal(back.pass_id, data.pass_id)
    assert back.observed_azimuth_rad == pytest.approx(data.observed_azimuth_rad, rel=1e-14)


@pytest.mark.parametrize("torn", [1, 7, 60])
def test_a_line_cut_off_by_a_kill_is_dropped_and_the_next_point_follows_cleanly(data, tmp_path, torn):
    first = journal(tmp_path)
    first.append(data.select(np.arange(5)))
    with first.path.open("rb+") as stream:
        stream.truncate(first.path.stat().st_size - torn)
    again = journal(tmp_path)
    assert len(again.points) == 4
    again.append(data.select([5]))
    assert journal(tmp_path).points.t_s == pytest.approx(data.t_s[[0, 1, 2, 3, 5]])


def test_a_file_cut_off_in_its_header_begins_anew(data, tmp_path):
    first = journal(tmp_path)
    first.append(data.select([0]))
    first.path.write_bytes(first.path.read_bytes()[:40])
    again = journal(tmp_path)
    assert again.points is None
    again.append(data)
    assert len(journal(tmp_path).points) == len(data)


def test_other_damage_is_refused_with_its_line_and_left_as_it_is(data, tmp_path):
    first = journal(tmp_path)
    first.append(data.select(np.arange(5)))
    lines = first.path.read_text().splitlines()
    lines[5] = "rubbish"
    first.path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match=r"observations\.csv: line 6: 1 values, must be"):
        journal(tmp_path)
    assert "rubbish" in first.path.read_text()


def test_another_station_or_band_is_refused(data, tmp_path):
    journal(tmp_path).append(data)
    with pytest.raises(ValueError, match="points of station 'gs1', must be of 'gs2'"):
        ObservationJournal(tmp_path / "c" / "observations.csv", "gs2", "S")
    with pytest.raises(ValueError, match="points of band 'S', must be of 'X'"):
        ObservationJournal(tmp_path / "d.csv", "gs1", "X").append(data)


def test_an_old_campaign_is_set_aside_and_never_overwritten(data, tmp_path):
    first = journal(tmp_path)
    assert first.set_aside("old") is None
    first.append(data)
    assert first.set_aside("old").name == "observations-old.csv"
    first.append(data)
    assert first.set_aside("old").name == "observations-old-2.csv"
    assert len(read_observations(first.path.with_name("observations-old.csv"))) == len(data)


def test_a_disk_that_is_full_leaves_the_file_as_it_was(data, tmp_path, monkeypatch):
    first = journal(tmp_path)
    first.append(data.select(np.arange(3)))
    before = first.path.read_bytes()

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("rf_pointing.calibration.tracking_csv.os.fsync", full)
        with pytest.raises(OSError, match="No space left"):
            first.append(data.select([3]))
    assert first.path.read_bytes() == before
    first.append(data.select([3, 4]))
    assert journal(tmp_path).points.t_s == pytest.approx(data.t_s[:5])


def write_changed(path, data, names, change):
    """Write points with `change` done to the cells of these columns."""
    write_observations(path, data)
    lines = path.read_text().splitlines()
    header = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    places = [lines[header].split(",").index(name) for name in names]
    for k, line in enumerate(lines[header + 1 :], header + 1):
        cells = line.split(",")
        for place in places:
            cells[place] = change(cells[place])
        lines[k] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("kind", ["observed", "true"])
def test_points_in_radians_are_refused_by_the_column_that_shows_it(data, tmp_path, kind):
    path = tmp_path / "o.csv"
    names = [f"{kind}_{axis}_deg" for axis in ("azimuth", "elevation")]
    write_changed(path, data, names, lambda cell: repr(np.radians(float(cell)).item()))
    with pytest.raises(ValueError, match=rf"{kind}_elevation_deg is at most .* radians given where degrees"):
        read_observations(path)


@pytest.mark.parametrize(
    ("elevation_deg", "azimuth_deg", "refused"),
    [(1.57, 9.42, True), (-1.57, -9.42, True), (1.58, 9.42, False), (1.57, 9.43, False), (-1.58, 1.0, False)],
)
def test_angles_that_all_are_such_of_radians_are_refused(tmp_path, elevation_deg, azimuth_deg, refused):
    path = tmp_path / "a.csv"
    rows = [f"{k},{azimuth_deg if k == 3 else 1.0},{elevation_deg if k == 5 else 1.0}" for k in range(8)]
    path.write_text(
        "\n".join(["# station: gs1", "# band: S", "# target: bird", "t_s,azimuth_deg,elevation_deg", *rows]) + "\n"
    )
    if refused:
        with pytest.raises(ValueError, match="in all 8 rows; radians given"):
            read_tracking(path)
    else:
        assert len(read_tracking(path)) == 8


HEAD = ("# station: gs1", "# band: S", "# target: bird")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((*HEAD, "t_s,azimuth_deg"), "line 4: column elevation_deg is missing"),
        ((*HEAD, "t_s,azimuth_deg,elevation_deg,t_s", "1,2,3,4"), "line 4: a column is given twice"),
        (HEAD, "line 4: column t_s is missing"),
        ((*HEAD, "t_s,azimuth_deg,elevation_deg", "1,200,30", "", "2,200,30,4"), "line 7: 4 values, must be 3"),
        (
            ("# a remark", *HEAD, "", "t_s,azimuth_deg,elevation_deg", "1,200,x"),
            "line 7: elevation_deg='x' must be a number",
        ),
        (("# station: gs1", "# band:", "# target: bird", "t_s"), "line 4: the note '# band: ...' is missing"),
        (("t_s,azimuth_deg,elevation_deg", *HEAD, "1,200,30"), "line 1: the note '# station: ...' is missing"),
        ((*HEAD, "t_s,azimuth_deg,elevation_deg", "inf,200,30"), "line 5: t_s=inf must be finite"),
        ((*HEAD, "t_s,azimuth_deg,elevation_rad", "1,200,30"), "line 4: unknown column 'elevation_rad'"),
        ((*HEAD, "t_s,azimuth_deg,elevation_deg"), "line 4: no rows"),
        ((*HEAD, "t_s,azimuth_deg,elevation_deg,good", "1,200,30,7"), "good must hold 0 or 1"),
    ],
)
def test_what_is_wrong_with_a_table_is_told_with_its_line(tmp_path, lines, message):
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match=message):
        read_tracking(tmp_path / "a.csv")


def test_remarks_and_empty_lines_are_no_rows(tmp_path):
    lines = (
        "# a remark", HEAD[0], "", *HEAD[1:], "# note: more", " t_s , azimuth_deg,elevation_deg",
        "1,200,30", "", "2,201,31",
    )  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    found = read_tracking(tmp_path / "a.csv")
    assert (found.station, found.band, found.target) == ("gs1", "S", "bird")
    assert found.t_s.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(np.degrees(found.azimuth_rad), [200.0, 201.0])
    assert (found.range_m, found.range_rate_m_s) == (None, None)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("pass_id", "0.5", "column pass_id must hold whole numbers"),
        ("sigma_azimuth_deg", "0.0", r"sigma_azimuth_rad\[0\]=0 must be > 0"),
    ],
)
def test_points_that_are_none_are_refused_with_the_file(data, tmp_path, name, value, message):
    write_changed(tmp_path / "o.csv", data, [name], lambda _: value)
    with pytest.raises(ValueError, match=rf"o\.csv: {message}"):
        read_observations(tmp_path / "o.csv")


@pytest.mark.parametrize("bare", [False, True], ids=["ranges", "temperatures"])
def test_observations_with_and_without_their_optional_columns_read_back(data, tmp_path, bare):
    given = data
    if bare:
        given = replace(data, range_m=None, range_rate_m_s=None, temperature_k=np.linspace(270.0, 300.0, len(data)))
    write_observations(tmp_path / "o.csv", given)
    back = read_observations(tmp_path / "o.csv")
    assert "true_azimuth_deg" in (tmp_path / "o.csv").read_text()
    for name, value in vars(given).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(getattr(back, name), value, rtol=1e-13)
        else:
            assert getattr(back, name) == value
