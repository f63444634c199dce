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


def check(capsys: pytest.CaptureFixture[str], *line: str) -> list[str]:
    """Return the lines that `check_station` prints of a description that can be used."""
    with pytest.raises(SystemExit) as ended:
        check_station.main(list(line))
    assert ended.value.code == 0
    return capsys.readouterr().out.splitlines()


def test_check_station_prints_site_bands_and_what_follows_for_the_band_of_the_station(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = check(capsys, "dss13")
    assert lines[0].startswith("Goldstone DSS-13: ")
    assert lines[1] == "site      35.24716 deg north, -116.79446 deg east, 1070.44 m"
    assert [line for line in lines if line.startswith("band")] == [
        f"band {name:<4} {megahertz} MHz, half-power beamwidth {width} deg, tracks with monopulse, conscan, steptrack, "
        f"bias model bias_model_dss13_{name.lower()}.yaml{default}"
        for name, megahertz, width, default in (
            ("S", 2300, 0.264, ""), ("X", 8450, 0.065, " (default)"), ("Ka", 32000, 0.017, ""),
        )
    ]  # fmt: skip
    assert "derived for band X:" in lines
    derived = [line.split()[0] for line in lines if line.startswith("  ") and " = " in line]
    assert len(derived) == len(set(derived))
    assert not any(name.startswith(("plant.", "loops.azimuth.", "loops.lqg_")) for name in derived)
    for number in (
        "conscan.fewest_samples = 40 ",
        "conscan.radius_deg = 0.00593 deg ",
        "mount.*.rate_deg_s = [2, 2] deg/s ",
        "bands.*.half_power_beamwidth_deg = 0.065 deg ",
        "conscan.drift = True ",
    ):
        assert any(line.startswith(f"  {number}") for line in lines), number
    (given,) = (line for line in lines if "loops.preprocessor.travel_max_deg" in line)
    assert given.split(" deg  ")[1].strip() == "given by tuning.loops.preprocessor.travel_max_deg"
    assert not any("->" in line for line in lines)


def test_check_station_prints_every_parameter_with_its_nodes_when_all_is_wanted(
    capsys: pytest.CaptureFixture[str],
) -> None:
    usual, everything = check(capsys, "dss13"), check(capsys, "dss13", "--all")
    assert len(everything) > len(usual) + 50
    (radius,) = (line for line in everything if line.startswith("  conscan.radius_deg "))
    assert "  -> " in radius
    assert "pointing_controller" in radius.partition("  -> ")[2]
    # Under its own name, not that of the key that gives it.
    assert any(line.startswith("  machine.half_power_beamwidth_deg = ") for line in everything)
    assert any(line.startswith("  plant.azimuth.") for line in everything)


def test_check_station_prints_the_urdf_alone(capsys: pytest.CaptureFixture[str]) -> None:
    lines = check(capsys, "dss13", "--urdf")
    assert lines[0].startswith("<")
    assert "</robot>" in lines


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
    monkeypatch.setattr(type(station), "remarks", lambda _self, _band: iter(()))
    lines = list(check_station.report(station, "X", everything=False))
    assert not any("to know" in line for line in lines)
    assert " = " in lines[-1]


@pytest.mark.parametrize("left_out", ["--name", "--latitude", "--longitude"])
def test_a_new_station_has_a_name_and_a_place(left_out: str, capsys: pytest.CaptureFixture[str]) -> None:
    place = MINE.index(left_out)
    with pytest.raises(SystemExit) as ended:
        new_station.main([*MINE[:place], *MINE[place + 2 :]])
    assert ended.value.code == 2
    assert f"required: {left_out}" in capsys.readouterr().err


def test_a_new_station_has_height_0_and_band_s_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    new_station.main([*MINE[:6], *MINE[8:]])
    lines = capsys.readouterr().out.splitlines()
    assert "site: {latitude_deg: 48.1, longitude_deg: 11.6, height_m: 0.0}" in lines
    assert "dish: {diameter_m: 3.7}" in lines
    assert [line for line in lines if "frequency_mhz" in line] == ["    frequency_mhz: 2250.0"]
    assert not any("half_power_beamwidth_deg" in line for line in lines)


def test_an_antenna_without_a_dish_has_no_diameter(capsys: pytest.CaptureFixture[str]) -> None:
    new_station.main([*MINE[:8], "--bands", "UHF", "--beamwidth", "40"])
    assert "diameter" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "problems"),
    [
        # One problem is named once: a band that is not known is no missing band as well.
        (["--bands", "Q"], ["bands='Q' must be one of VHF, UHF, L, S, C, X, Ku, Ka"]),
        (["--bands", "Q,S,Z"], ["bands='Q' must be", "bands='Z' must be"]),
        (["--bands", ","], ["bands"]),
        (["--latitude", "91"], ["site.latitude_deg=91.0 must be <= 90.0"]),
    ],
)
def test_each_problem_of_a_new_station_is_a_line(
    line: list[str], problems: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        new_station.main([*MINE, *line])
    assert ended.value.code == 2
    lines = capsys.readouterr().err.removeprefix("new_station: ").splitlines()
    assert len(lines) == len(problems)
    for text, problem in zip(lines, problems, strict=True):
        assert text.startswith(problem)
