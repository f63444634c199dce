"""What a description answers: sensors and bands, remarks, what a parameter file may repeat, and another file of it."""

from pathlib import Path

import pytest
import yaml

from rf_pointing.station.description import read_station, station_from
from rf_pointing.station.description.description import StationDescription
from rf_pointing.station.description.remarks import remarks as remarks_of

TEXT = """\
version: 1
name: Mine
site: {latitude_deg: 48.1, longitude_deg: 11.6}  # at home
dish: {diameter_m: 3.7}
array: {}
mount:
  azimuth: {travel_deg: [-270, 270], rate_deg_s: 6}
  elevation: {travel_deg: [0, 90], rate_deg_s: 6}
wind: {anemometer: true}
bands:
  S: {frequency_mhz: 2.2e3, sensors: [steptrack, conscan]}
  X: {frequency_mhz: 8.2e3, sensors: [conscan, monopulse, array]}
  UHF: {frequency_mhz: 436, sensors: []}
  L: {frequency_mhz: 1500, sensors: [array]}
"""
DRIVE = "drive: {type: gs232}\nbands:"


def made(*change: str) -> StationDescription:
    return station_from(Path("s.yaml"), TEXT.replace(*change) if change else TEXT)


def test_the_first_band_counts_unless_one_is_named() -> None:
    station = made()
    assert (station.bands, station.default_band, station.chosen_sensor()) == (("S", "X", "UHF", "L"), "S", "steptrack")
    other = made("bands:", "default_band: X\nbands:")
    assert (other.default_band, other.chosen_sensor(), other.chosen_sensor(band="S")) == ("X", "conscan", "steptrack")
    assert station.sensors("UHF") == ()
    assert station.chosen_sensor(band="UHF") == "program"
    with pytest.raises(ValueError, match="Mine: band='Ka' must be one of S, X, UHF, L"):
        station.sensors("Ka")


@pytest.mark.parametrize(
    ("band", "choice", "sensor"),
    [
        # Automatic with both, with one, with none that is automatic.
        ("X", "auto", "auto"), ("S", "auto", "conscan"), ("L", "auto", "array"), ("X", "array", "array"),
        ("S", "conscan", "conscan"), ("UHF", "program", "program"), ("X", "own_tracker", "own_tracker"),
        ("S", "monopulse", "sensor=monopulse: S band of Mine has steptrack, conscan, auto, program"),
        ("UHF", "conscan", "sensor=conscan: UHF band of Mine has program"),
        ("UHF", "auto", "sensor=auto: UHF band of Mine has no sensor, only program"),
    ],
)  # fmt: skip
def test_what_the_operator_s_choice_means_in_a_band(band: str, choice: str, sensor: str) -> None:
    station = made()
    if ":" in sensor:
        with pytest.raises(ValueError) as caught:
            station.chosen_sensor(choice, band)
        assert str(caught.value) == sensor
    else:
        assert station.chosen_sensor(choice, band) == sensor


def test_a_station_is_simulated_unless_its_drive_is_a_device() -> None:
    assert made().simulated
    assert made().drive["type"] == "simulated"
    assert made("bands:", "drive: {type: simulated_rotator}\nbands:").simulated
    device = made("bands:", DRIVE)
    assert not device.simulated
    assert device.drive == {"type": "gs232"}
    assert made("bands:", "drive: {rotator: {latency_s: 0.3}}\nbands:").drive["type"] == "simulated"


REMARKS = {
    "mask": "mount: there is no horizon mask; the antenna may look at hills, houses and people",
    "model": "bands.S: there is no bias model; errors of the mount are not corrected",
    "turns": "mount.azimuth.travel_deg: 180 deg of azimuth can be reached on two turns",
}


def remarks(station: StationDescription, band: str | None = None) -> list[str]:
    return list(remarks_of(station, band))


def test_remarks_are_those_of_the_band_and_of_the_mount() -> None:
    assert remarks(made()) == [REMARKS["turns"], REMARKS["mask"], REMARKS["model"]]
    assert remarks(made(), "X")[-1].startswith("bands.X: there is no bias model")
    masked = station_from(Path("s.yaml"), TEXT.replace("wind:", "  horizon_deg: [[0, 3]]\nwind:"))
    assert remarks(masked) == [REMARKS["turns"], REMARKS["model"]]
    # A clearance is no mask.
    clear = station_from(Path("s.yaml"), TEXT.replace("wind:", "  horizon_clearance_deg: 3\nwind:"))
    assert REMARKS["mask"] in remarks(clear)
    assert "mount.azimuth.travel_deg: 20 deg of the sky cannot be reached" in remarks(
        made("[-270, 270]", "[-170, 170]")
    )
    assert remarks(made("[-270, 270]", "[-180, 180]")) == [REMARKS["mask"], REMARKS["model"]]
    assert "wind.anemometer: the station has none; wind does not stow the antenna" in remarks(
        made("{anemometer: true}", "{}")
    )
    assert "sun.radius_deg: the beam may look into the Sun" in remarks(made("wind:", "sun: {radius_deg: 0}\nwind:"))
    assert not any("bias model" in each for each in remarks(read_station("dss13")))


def test_steps_of_more_than_a_tenth_of_the_beamwidth_are_remarked() -> None:
    """h = 66 deg * 136.27 mm / 3.7 m = 2.4307 deg in S band."""
    for step_deg, said in ((0.24, []), (0.25, ["0.10"]), (1.2, ["0.49"])):
        station = made("rate_deg_s: 6}\nwind", f"rate_deg_s: 6, resolution_deg: {step_deg}}}\nwind")
        found = [each for each in remarks(station) if "encoder step" in each]
        assert found == [
            f"mount: an encoder step is {share} of the beamwidth; a tenth costs 0.03 dB, a half 0.75 dB"
            for share in said
        ]


def test_a_parameter_file_may_repeat_the_description_and_say_nothing_else_of_it() -> None:
    station = made()
    given = station.parameters("pointing_controller", "X")
    station.check_file("pointing_controller", given, "X")
    station.check_file("pointing_controller", {"limits.azimuth_min_deg": -270.0, "pointing.period_s": 0.2})
    station.check_file(
        "pointing_controller", {name: list(v) if isinstance(v, tuple) else v for name, v in given.items()}, "X"
    )
    with pytest.raises(ValueError) as caught:
        station.check_file("pointing_controller", {"limits.azimuth_min_deg": -200.0})
    assert str(caught.value) == (
        "pointing_controller: limits.azimuth_min_deg is given by the station description: mount.azimuth.travel_deg"
    )
    # What the description leaves at its default is the description's as well.
    with pytest.raises(ValueError, match=r"given by the station description: tuning\.autotrack\.coast_s"):
        station.check_file("pointing_controller", {"autotrack.coast_s": 7.0})
    station.check_file("pointing_controller", {"autotrack.coast_s": 5.0})
    with pytest.raises(ValueError, match="no such parameter limits.azimut_min_deg"):
        station.check_file("pointing_controller", {"limits.azimut_min_deg": 0.0})


def test_a_description_is_written_anew_with_changes_and_with_its_files_by_whole_paths(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text("0 3\n")
    (tmp_path / "s.yaml").write_text(TEXT.replace("wind:", "  horizon_file: m.txt\nwind:"))
    station, other = read_station(tmp_path / "s.yaml"), tmp_path / "elsewhere" / "t.yaml"
    other.parent.mkdir()
    station.write(other, {"name": "Other", "simulation.wind.mean_speed_m_s": 4.5, "mount.park_deg": (10.0, 20.0),
                          "simulation.lag_averaging_s": 2.0})  # fmt: skip
    found = yaml.safe_load(other.read_text())
    assert found["simulation"] == {"wind": {"mean_speed_m_s": 4.5}, "lag_averaging_s": 2.0}
    assert found["mount"]["horizon_file"] == str(tmp_path / "m.txt")
    assert "2.2e3" in other.read_text()
    again = read_station(other)
    assert (again.name, again.content.mount.park_deg, again.mask) == ("Other", (10.0, 20.0), station.mask)
    assert again.content.mount.azimuth == station.content.mount.azimuth
    read_station("dss13").write(other, {"bands.X.model_error_deg": 0.2})
    again = read_station(other)
    for band in again.bands:
        assert again.bias_model_file(band) == read_station("dss13").bias_model_file(band)
    assert again.content.bands["X"].model_error_deg == 0.2
    assert again.digest != read_station("dss13").digest


def test_the_digest_is_that_of_the_models_content(tmp_path: Path) -> None:
    station = read_station("dss13")
    station.write(tmp_path / "s.yaml", {})
    same = read_station(tmp_path / "s.yaml")
    assert same.digest == station.digest
    model = station.bias_model_file("X")
    assert model is not None
    changed = tmp_path / "x.yaml"
    changed.write_text(model.read_text() + "# another\n")
    station.write(tmp_path / "t.yaml", {"bands.X.bias_model": str(changed)})
    assert read_station(tmp_path / "t.yaml").digest != station.digest


def test_numbers_that_a_node_refuses_together_are_named_with_band_and_node(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"band S, pointing_controller: autotrack\.carrier_off_db_hz=25\.0 must be <"):
        station_from(tmp_path / "s.yaml", TEXT.replace("wind:", "tuning: {autotrack.carrier_off_db_hz: 25.0}\nwind:"))
