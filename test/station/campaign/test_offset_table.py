"""A table of observed offsets: planted models come back, wrong rows are refused by their line."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.api.calibration import DataFiles, fitted
from rf_pointing.calibration import BiasModel, Ionosphere
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import TopocentricTrack, verification_elements
from rf_pointing.ephemeris.source import BODIES, read_source
from rf_pointing.station.campaign.offline_fit import FitRequest
from rf_pointing.station.campaign.offset_table import terms_of_offsets
from test.commands.planted_campaign import PLANTED, write_campaign

STATION = rp.Station("rotator_2m")
START_S = 1151347200.0
HEADER = "utc,target,azimuth_offset_deg,elevation_offset_deg"


def planted(
    path: Path, truth: dict[str, float], rows: int, random: np.random.Generator, targets: list[str],
    station: rp.Station = STATION, sigma: float = 0.02, *, stated: bool = True,
) -> Path:  # fmt: skip
    """Write offsets of a mount with these terms (deg), each with this error (deg), `stated` in a column or not."""
    model = BiasModel.from_degrees(dict(BiasModel.zero().coefficients) | truth)
    tracks = {name: TopocentricTrack(BODIES[name.casefold()](), station.site) for name in targets}
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*HEADER.split(","), *["sigma_deg"] * stated])
        while rows:
            name, t_s = targets[int(random.integers(len(targets)))], START_S + float(random.uniform(0.0, 86400.0))
            look = tracks[name].sample([t_s])
            if not 0.17 < look.elevation_rad[0] < 1.3:
                continue
            motion = (look.azimuth_rad, look.elevation_rad, *[np.zeros(1)] * 4)
            offset = np.degrees(model.offset_rad(*motion))[:, 0]
            found = offset + random.normal(0.0, sigma, 2) / (math.cos(float(look.elevation_rad[0])), 1.0)
            writer.writerow([utc_text(t_s), name, *(f"{value:.4f}" for value in found), *[sigma] * stated])
            rows -= 1
    return path


@pytest.mark.parametrize("stated", [True, False])
def test_two_offsets_come_back_from_a_handful_of_rows(
    tmp_path: Path, random: np.random.Generator, stated: bool
) -> None:
    """Whatever the beam is: rows without a sigma are taken for as good as a tenth of it, 3 deg."""
    station = STATION if stated else rp.Station("vhf_uhf_yagi")
    truth = {"azimuth_offset": 0.5, "elevation_offset": -0.3}
    found = rp.fit(planted(tmp_path / "a.csv", truth, 3 + 3 * stated, random, ["Sun", "Moon"], stated=stated), station)
    assert set(found.result.names) == set(truth)
    for name, value in truth.items():
        assert math.degrees(found.model.coefficients[name]) == pytest.approx(value, abs=0.05)
    few = planted(tmp_path / "b.csv", truth, 2, random, ["Sun"], stated=stated)
    with pytest.raises(ValueError, match="2 rows, must have >= 3"):
        rp.fit(few, STATION)


def test_a_tilted_mount_is_found_where_the_rows_show_it(tmp_path: Path, random: np.random.Generator) -> None:
    truth = {"azimuth_offset": 0.5, "elevation_offset": -0.3, "mislevel_east": 0.3, "mislevel_north": -0.2}
    file = planted(tmp_path / "a.csv", truth, 30, random, ["Sun", "Moon", "Cassiopeia A"])
    found = rp.fit(file, STATION)
    assert set(truth) <= set(found.result.names)
    for name, value in truth.items():
        sigma = math.degrees(math.sqrt(found.result.covariance[list(found.result.names).index(name)][
            list(found.result.names).index(name)]))  # fmt: skip
        assert abs(math.degrees(found.model.coefficients[name]) - value) < max(4.0 * sigma, 0.03)
    # From one side of the sky a tilt is an offset.
    points = DataFiles(paths=[file]).read(STATION).points
    assert points is not None
    east = points.select(points.true_azimuth_rad % math.tau < math.pi)
    assert terms_of_offsets(east)[:2] == ("azimuth_offset", "elevation_offset")
    assert "mislevel_east" not in terms_of_offsets(east)


def test_offsets_and_passes_are_one_fit_that_knows_more_than_the_passes(
    tmp_path: Path, random: np.random.Generator
) -> None:
    write_campaign(tmp_path)
    station, terms = rp.Station("dss13", band="X"), ["azimuth_offset", "elevation_offset"]
    truth = {name: math.degrees(PLANTED.coefficients[name]) for name in terms}
    targets = ["Sun", "Moon", "Cassiopeia A"]
    rows = planted(tmp_path / "scans.csv", truth, 40, random, targets, station, 0.0003)
    passes = [tmp_path / f"raw{number}.csv" for number in range(4)]
    given = {"elements": read_source(str(tmp_path / "cbers.tle")).elements,
             "ionosphere": Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9)}  # fmt: skip
    request = FitRequest(
        station=station.name, band="X", site=station.site, terms=tuple(terms), time_error_s=0.0,
        elements=given["elements"],
    )  # fmt: skip
    alone, both = (
        fitted(request, DataFiles(paths=paths, **given).read(station)).result for paths in (passes, [*passes, rows])
    )
    # What independent rows know of the elevation adds up.
    of_rows = 40.0 / math.radians(0.0003) ** 2
    assert both.sigma[1] ** -2 == pytest.approx(alone.sigma[1] ** -2 + of_rows, rel=0.2)
    for name, value, sigma in zip(both.names, both.values, both.sigma, strict=True):
        assert abs(math.degrees(value) - truth[name]) < 4.0 * math.degrees(sigma)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("yesterday,Sun,0.1,0.2", "line 2: .*yesterday"),
        ("2006-06-27T12:00:00,Sun,a,0.2", "line 2: azimuth_offset_deg='a' must be a number"),
        ("2006-06-27T12:00:00,Sun,nan,0.2", "line 2: azimuth_offset_deg=nan must be -11 to 11 deg"),
        ("2006-06-27T12:00:00,Sun,0.1,45", "line 2: elevation_offset_deg=45 must be -11 to 11 deg"),
        ("2006-06-27T12:00:00,CBERS 2,0.1,0.2", "line 2: target='CBERS 2' needs --elements FILE"),
        ("2006-06-27T12:00:00,Sun,0.1", "line 2: "),
    ],
)
def test_a_wrong_row_is_refused_by_its_line(tmp_path: Path, row: str, words: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{HEADER}\n{row}\n")
    with pytest.raises(ValueError, match=words):
        DataFiles(paths=[file]).read(STATION)


def test_a_satellite_is_taken_from_the_elements(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{HEADER}\n2006-06-27T12:00:00,28057,0.1,0.2\n")
    points = DataFiles(paths=[file], elements=verification_elements()).read(STATION).points
    assert points is not None
    assert np.degrees(points.residual_elevation_rad) == pytest.approx([0.2])
    file.write_text("utc,target,azimuth_offset_deg\n")
    with pytest.raises(ValueError, match="the columns must be utc,target,azimuth_offset_deg,elevation_offset_deg"):
        DataFiles(paths=[file]).read(STATION)
