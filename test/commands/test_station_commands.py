"""`new_station` prints what `check_station` takes; both name every problem at once."""

import difflib
from pathlib import Path

import pytest

from rf_pointing.commands import check_station, new_station
from rf_pointing.station.description import read_station, shipped_stations

WORDS = dict(enumerate(("ten", "eleven", "twelve", "thirteen", "fourteen", "fifteen"), start=10))
MINE = [
    "--name",
    'My "best" dish: 1',
    "--latitude",
    "48.1",
    "--longitude",
    "11.6",
    "--height",
    "520",
    "--diameter",
    "3.7",
]


def test_a_new_station_can_be_used_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    new_station.main([*MINE, "--bands", "S,X"])
    path = tmp_path / "my_dish.yaml"
    path.write_text(capsys.readouterr().out)
    station = read_station(path)
    assert station.name == 'My "best" dish: 1'
    assert station.bands == ("S", "X")
    with pytest.raises(SystemExit) as ended:
        check_station.main([str(path)])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    assert "conscan.radius_deg = 0.217 deg" in printed
    assert "0.0912 h: 0.1 dB of loss" in printed
    assert "there is no horizon mask" in printed


def test_a_new_station_without_a_dish_needs_a_beamwidth(capsys: pytest.CaptureFixture[str]) -> None:
    without = [*MINE[:8], "--bands", "VHF,UHF"]
    with pytest.raises(SystemExit):
        new_station.main(without)
    assert "its beamwidth" in capsys.readouterr().err
    new_station.main([*without, "--beamwidth", "40"])
    assert "half_power_beamwidth_deg: 40" in capsys.readouterr().out


def test_new_station_names_every_problem(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        new_station.main(
            ["--name", "x", "--latitude", "91", "--longitude", "east", "--diameter", "0.01", "--bands", "S,Q"]
        )
    assert ended.value.code == 2
    said = capsys.readouterr().err
    for text in (
        "latitude_deg=91.0 must be <= 90.0",
        "longitude_deg=east must be a number",
        "diameter_m=0.01",
        "bands='Q'",
    ):
        assert text in said


@pytest.mark.parametrize("name", shipped_stations())
def test_check_station_prints_every_band_of_a_shipped_station(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for band in read_station(name).bands:
        with pytest.raises(SystemExit) as ended:
            check_station.main([name, "--band", band, "--all"])
        assert ended.value.code == 0
        printed = capsys.readouterr().out
        assert f"derived for band {band}:" in printed
        assert "plant.azimuth.inertia_kg_m2" in printed


def test_check_station_ends_with_all_problems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(
        "version: 1\nname: bad\nsite: {latitude_deg: 91, longitude_deg: 0}\nbands: {X: {frequency_mhz: no}}\n"
    )
    with pytest.raises(SystemExit) as ended:
        check_station.main([str(path)])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert f"{path}:3: site.latitude_deg=91.0 must be <= 90.0" in said
    assert f"{path}:4: bands.X.frequency_mhz=no must be a number" in said
    assert f"{path}:1: mount is missing" in said


def test_a_dish_of_ones_own_is_one_file_with_at_most_15_lines_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new_station.main(["--name", "My dish", *MINE[2:], "--bands", "S,X"])
    generated = capsys.readouterr().out.splitlines()
    page = (Path(__file__).parents[2] / "docs" / "my_station.md").read_text()
    mine = page.partition("<!-- my dish -->\n```yaml\n")[2].partition("```")[0].splitlines()
    # A comment that a user leaves out or takes in is no number to set.
    changed = [line for line in difflib.ndiff(generated, mine) if line.startswith("+ ") and line.strip("+ ")]
    assert 5 <= len(changed) <= 15, changed
    assert f"These are the {WORDS[len(changed)]} lines" in page
    path = tmp_path / "my_dish.yaml"
    path.write_text("\n".join(mine))
    station = read_station(path)
    assert station.default_band == "X"
    assert station.parameters("pointing_controller")["machine.half_power_beamwidth_deg"] == pytest.approx(
        0.6586, abs=1e-4
    )
