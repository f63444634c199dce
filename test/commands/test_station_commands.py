"""What `check_station` and `new_station` promise besides their golden lines (test/data/command_lines/stations.txt)."""

import difflib
from pathlib import Path

import pytest

from rf_pointing.commands import check_station, new_station
from rf_pointing.station.description import read_station, shipped_stations

WORDS = dict(enumerate(("ten", "eleven", "twelve", "thirteen", "fourteen", "fifteen"), start=10))
MINE = [
    "--name", 'My "best" dish: 1', "--latitude", "48.1", "--longitude", "11.6", "--height", "520",
    "--diameter", "3.7",
]  # fmt: skip


@pytest.mark.parametrize("name", shipped_stations())
def test_check_station_prints_every_band_of_a_shipped_station(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for band in read_station(name).bands:
        with pytest.raises(SystemExit) as ended:
            check_station.main([name, "--band", band, "--all"])
        assert ended.value.code == 0
        printed = capsys.readouterr().out
        assert f"derived for band {band}:" in printed
        assert "plant.azimuth.inertia_kg_m2" in printed


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


def check(capsys: pytest.CaptureFixture[str], *line: str) -> list[str]:
    """Return the lines that `check_station` prints of a description that can be used."""
    with pytest.raises(SystemExit) as ended:
        check_station.main(list(line))
    assert ended.value.code == 0
    return capsys.readouterr().out.splitlines()


def test_a_band_without_sensors_has_program_track_and_what_is_missing_is_to_know(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new_station.main([*MINE, "--bands", "S"])
    path = tmp_path / "mine.yaml"
    path.write_text(capsys.readouterr().out.replace("sensors: [", "sensors: [] # ["))
    lines = check(capsys, str(path))
    (band,) = (line for line in lines if line.startswith("band"))
    assert "tracks with program track alone, bias model none (default)" in band
    assert any("there is no horizon mask" in line for line in lines[lines.index("to know:") :])


def test_a_station_without_remarks_ends_with_its_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    station = read_station("dss13")
    monkeypatch.setattr(check_station, "remarks", lambda _station, _band: iter(()))
    lines = list(check_station.report(station, "X", everything=False))
    assert not any("to know" in line for line in lines)
    assert " = " in lines[-1]
