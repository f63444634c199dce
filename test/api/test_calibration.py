"""A fit of the front door is that of the points, whether they come as arrays or as files."""

from pathlib import Path

import pytest

import rf_pointing as rp
from rf_pointing.core import MDEG
from test.commands.planted_campaign import PLANTED, points, write_campaign

OFFSETS = ("azimuth_offset", "elevation_offset")


def test_points_and_raw_data_of_files_give_the_planted_model_and_read_back(tmp_path: Path) -> None:
    write_campaign(tmp_path)
    station = rp.Station("dss13", band="X")
    arrays = rp.fit(points(), station, terms=OFFSETS, name="mine")
    files = rp.fit(tmp_path / "points.csv", station, terms=OFFSETS)
    assert files.model.coefficients == pytest.approx(arrays.model.coefficients, rel=1e-6, abs=1e-9)
    raw = rp.fit(
        sorted(tmp_path.glob("raw*.csv")), station, terms=OFFSETS, elements=tmp_path / "cbers.tle",
        ionosphere_tecu=50.0, carrier_hz=2.25e9,
    )  # fmt: skip
    raw.write_tdm(tmp_path / "raw.tdm")
    again = rp.fit(
        tmp_path / "raw.tdm", station, terms=OFFSETS, elements=tmp_path / "cbers.tle", ionosphere_tecu=50.0,
        carrier_hz=2.25e9,
    )  # fmt: skip
    without = rp.fit(tmp_path / "raw.tdm", station, terms=OFFSETS, elements=tmp_path / "cbers.tle")
    for name in OFFSETS:
        assert raw.model.coefficients[name] == pytest.approx(PLANTED.coefficients[name], abs=1.0 * MDEG)
        assert again.model.coefficients[name] == pytest.approx(raw.model.coefficients[name], abs=1e-3 * MDEG)
    # Without it, what the ionosphere bends is a larger share of the refraction, and the mount stays as it is.
    (share,), ((square,),) = without.result.nuisance_values, without.result.nuisance_covariance
    assert share > 4.0 * square**0.5
    for name in OFFSETS:
        sigma = without.result.sigma_of(name)
        assert without.model.coefficients[name] == pytest.approx(PLANTED.coefficients[name], abs=3.0 * sigma)
    assert sigma > 3.0 * raw.result.sigma_of("elevation_offset")
    page = arrays.write(tmp_path / "mine.yaml")
    assert page == tmp_path / "mine_report" / "report.html"
    kept = rp.read_model(tmp_path / "mine.yaml")
    assert (kept.name, kept.station, kept.band, kept.fitted) == ("mine", station.name, "X", OFFSETS)
    assert kept.model.coefficients == pytest.approx(arrays.model.coefficients, rel=1e-9)
    assert rp.Station(model=tmp_path / "mine.yaml").model == kept.model
    assert str(arrays).startswith("720 observations of 12 passes, 0 edited out") or "edited out" in str(arrays)
    with pytest.raises(ValueError, match="calibration points only, no raw data to write"):
        arrays.write_tdm(tmp_path / "no.tdm")
    with pytest.raises(ValueError, match="need --elements FILE"):
        rp.fit(tmp_path / "raw0.csv", station)
