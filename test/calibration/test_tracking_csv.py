from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import (
    Corrections,
    read_observations,
    read_tracking,
    write_observations,
    write_tracking,
)

NONE = Corrections(light_time=False, troposphere=None, ionosphere=None, range_delay_m=0.0)


@pytest.fixture
def raw(track, raw_pass, table_1):
    return raw_pass(track(5.0), table_1, NONE, 1e-4)


def test_tracking_reads_back_equal(raw, tmp_path):
    good = raw.good.copy()
    good[7] = False
    write_tracking(tmp_path / "a.csv", replace(raw, good=good, range_rate_m_s=None))
    back = read_tracking(tmp_path / "a.csv")
    assert np.array_equal(back.t_s, raw.t_s)
    assert back.elevation_rad == pytest.approx(raw.elevation_rad, rel=1e-15)
    assert (back.range_rate_m_s, back.station, bool(back.good[7])) == (None, "gs1", False)


def test_observations_read_back_equal(campaign, table_1, tmp_path):
    data = campaign(table_1, passes=2)
    write_observations(tmp_path / "o.csv", data)
    back = read_observations(tmp_path / "o.csv")
    assert np.array_equal(back.pass_id, data.pass_id)
    for name in ("true_azimuth_rad", "azimuth_acceleration_rad_s2", "sigma_elevation_rad", "range_m"):
        assert getattr(back, name) == pytest.approx(getattr(data, name), rel=1e-14)
    assert "true_azimuth_deg" in (tmp_path / "o.csv").read_text()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("elevation_deg", "elevation_rad"), "line 4: unknown column 'elevation_rad'"),
        (lambda t: t.replace(",good", ""), "line 5: 6 values, must be 5"),
        (lambda t: t.replace("# station: gs1\n", ""), "line 3: the note '# station"),
        (lambda t: "\n".join([*t.splitlines()[:6], "1,2,nan,4,5,1"]), "line 7: elevation_deg=nan must be finite"),
        (lambda t: "\n".join([*t.splitlines()[:6], "1,2,x,4,5,1"]), "line 7: elevation_deg='x' must be a number"),
        (lambda t: "\n".join(t.splitlines()[:4]), "line 4: no rows"),
        (lambda t: "\n".join([*t.splitlines()[:4], "1,2,3,4,5,7"]), "good must hold 0 or 1"),
    ],
)
def test_a_damaged_table_is_refused_with_its_line(raw, tmp_path, change, message):
    path = tmp_path / "a.csv"
    write_tracking(path, raw)
    path.write_text(change(path.read_text()))
    with pytest.raises(ValueError, match=message):
        read_tracking(path)


def test_a_byte_order_mark_of_a_spreadsheet_is_no_part_of_the_table(raw, tmp_path):
    path = tmp_path / "a.csv"
    write_tracking(path, raw)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert np.array_equal(read_tracking(path).t_s, raw.t_s)
