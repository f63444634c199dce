"""Every problem of a description is named with its line, and nothing that it says is lost."""

from pathlib import Path
from typing import Any

import fastjsonschema
import pytest
import yaml

from rf_pointing.core import Sensor
from rf_pointing.ephemeris import Site
from rf_pointing.station.description import STATIONS, StationError, owner, read_station, shipped_stations, station_from
from rf_pointing.station.description.schema import SCHEMA, schema, schema_text

GOOD = """\
version: 1
name: My dish
site: {latitude_deg: 48.1, longitude_deg: 11.6, height_m: 520}
dish: {diameter_m: 3.7}
mount:
  azimuth: {travel_deg: [-270, 270], rate_deg_s: 6}
  elevation: {travel_deg: [0, 90], rate_deg_s: 6}
bands:
  X: {frequency_mhz: 8.2e3}
"""


def problems(text: str, tmp_path: Path) -> list[tuple[int, str]]:
    """Return the problems of a description."""
    with pytest.raises(StationError) as caught:
        station_from(tmp_path / "s.yaml", text)
    return caught.value.problems


def test_a_small_description_is_enough() -> None:
    station = station_from(Path("s.yaml"), GOOD)
    assert (station.name, station.bands, station.default_band) == ("My dish", ("X",), "X")
    assert station.site == Site.from_degrees(48.1, 11.6, 520.0)
    assert station.chosen_sensor() == Sensor.CONSCAN
    assert station.bias_model_file() is None
    # 66 deg * 36.56 mm / 3.7 m.
    assert station.parameters("pointing_controller")["conscan.half_power_beamwidth_deg"] == pytest.approx(
        0.6522, abs=1e-4
    )


def test_what_may_be_commanded_ends_half_way_to_a_stop_that_is_near() -> None:
    near = GOOD.replace("[0, 90], rate", "[5, 90], hard_stop_deg: [4.94, 90.1], rate")
    found = station_from(Path("s.yaml"), near).parameters("antenna_servo")
    ends = [found[f"loops.preprocessor.travel_{end}_deg"] for end in ("min", "max")]
    assert [end[1] for end in ends] == pytest.approx([4.97, 90.05])


def test_one_key_reaches_every_node_that_needs_it() -> None:
    station = station_from(
        Path("s.yaml"), GOOD.replace("bands:", "  horizon_deg: [[0, 3], [90, 5], [180, 12], [270, 4]]\nbands:")
    )
    heights = {
        node: station.parameters(node)[f"{prefix}mask.elevation_deg"]
        for node, prefix in (("antenna_servo", "safety."), ("pointing_controller", ""), ("ephemeris_publisher", ""))
    }
    assert all(each == pytest.approx((3.0, 5.0, 12.0, 4.0)) for each in heights.values())
    widths = [
        value for node in ("pointing_controller", "conscan_tracker", "monopulse_tracker", "rf_receiver")
        for name, value in station.parameters(node).items() if name.endswith("half_power_beamwidth_deg")
    ]  # fmt: skip
    assert len(widths) == 11
    assert len(set(widths)) == 1


@pytest.mark.parametrize(
    ("change", "line", "said"),
    [
        (("48.1", "91"), 3, "site.latitude_deg=91.0 must be <= 90.0"),
        (("site: {latitude_deg: 48.1, longitude_deg: 11.6, height_m: 520}", "site: Atlantis"), 3,
            "site='Atlantis' must be coordinates or one of"),
        (("rate_deg_s: 6}\n  elev", "rate_deg: 6}\n  elev"), 6, "mount.azimuth.rate_deg: no such key of mount.azimuth; "
            "did you mean rate_deg_s?"),
        (("rate_deg_s: 6}\n  elev", "rate_deg: 6}\n  elev"), 6, "mount.azimuth.rate_deg_s is missing: largest rate of the "
            "drive [deg/s]"),
        (("[0, 90]", "[0, 90, 1]"), 7, "mount.elevation.travel_deg has 3 values, must have 2"),
        (("[0, 90]", "[90, 0]"), 7, "mount.elevation.travel_deg=[90.0, 0.0] must rise"),
        (("[0, 90]", "[0, 300]"), 7, "must lie within [-12, 192]"),
        (("rate_deg_s: 6}\nbands", "rate_deg_s: 6, resolution_deg: 0.1, encoder_bits: 12}\nbands"), 7, "leave one out"),
        (("rate_deg_s: 6}\nbands", "rate_deg_s: 6, command_rate_deg_s: 7}\nbands"), 7, "must be <= 6.0, what the drive can do"),
        (("rate_deg_s: 6}\nbands", "rate_deg_s: 6, hard_stop_deg: [1, 95]}\nbands"), 7, "must lie outside travel_deg"),
        (("bands:", "  park_deg: [0, 95]\nbands:"), 8, "mount.park_deg=[0.0, 95.0]: elevation 95.0 must lie within"),
        (("bands:", "  stow_elevation_deg: 120\nbands:"), 8, "mount.stow_elevation_deg=120.0 must lie within"),
        (("bands:", "  pass_elevation_deg: 0\nbands:"), 8, "mount.pass_elevation_deg=0.0 must be > 0.0"),
        (("bands:", "  horizon_deg: [[0, 5], [180, 5], [200, 5], [290, 5]]\nbands:"), 8, "180 deg after the point before"),
        (("bands:", "  horizon_deg: [[0, 5], [80, 5], [70, 5], [160, 5], [150, 5]]\nbands:"), 8, "azimuth 70.0 must be > 80.0"),
        (("[0, 90]", "[0, 40]}\n  horizon_deg: [[0, 45]]\n  x: {a: 0"), 8, "the travel is smaller than the mask allows"),
        (("bands:", "  horizon_file: nowhere.txt\nbands:"), 8, "mount.horizon_file='nowhere.txt' cannot be read"),
        (("  X: {frequency_mhz: 8.2e3}\n", "  {}\n"), 8, "bands must have at least one band"),
        (("bands:\n  X: {frequency_mhz: 8.2e3}\n", ""), 1, "bands is missing"),
        (("8.2e3", "8.2e3, half_power_beamwidth_deg: 0.5"), 9, "must be within 20 % of 0.6522"),
        (("8.2e3", "8.2e3, sensors: [radar]"), 9, "bands.X.sensors[0]='radar' must be one of monopulse, conscan, steptrack"),
        (("8.2e3", "8.2e3, bias_model: no.yaml"), 9, "bands.X.bias_model='no.yaml': "),
        (("8.2e3", "8.2e3, bias_model: " + str(STATIONS / "bias_model_dss13_x.yaml")), 9, "is of station 'Goldstone DSS-13'"),
        (("bands:", "default_band: S\nbands:"), 8, "default_band='S' must be one of X"),
        (("8.2e3", "8.2e3, acquisition_band: X"), 9, "bands.X.acquisition_band='X' must be empty: no band has a lower"),
        (("bands:", "tuning: {conscan.radius: 1}\nbands:"), 8, "did you mean conscan.radius_deg?"),
        (("bands:", "tuning: {conscan: {radius_deg: 99}}\nbands:"), 8, "tuning.conscan.radius_deg=99 must be <= 5.7"),
        (("bands:", "tuning: {mask.clearance_deg: 2}\nbands:"), 8, "is given by mount.horizon_clearance_deg: change it there"),
        (("bands:", "tuning: {antenna.seed: 2}\nbands:"), 8, "is a parameter of antenna_servo, not of the station"),
        (("bands:", "tuning: {loops.azimuth.proportional_gain: 0.0}\nbands:"), 10,
            "band X, antenna_servo: loops.azimuth.proportional_gain=0.0 must be >"),
        (("bands:", "simulation: {mount_errors: {drop_deg: 1}}\nbands:"), 8, "did you mean droop_deg?"),
        (("name: My dish", "name: My dish\nname: Yours"), 3, "name is given twice"),
        (("bands:", "drive: {type: gs-232}\nbands:"), 8, "drive.type='gs-232' must be one of simulated, topic, "),
        (("version: 1", "version: 2"), 1, "version=2 must be <= 1"),
    ],
)  # fmt: skip
def test_a_problem_is_named_with_its_line(change: tuple[str, str], line: int, said: str, tmp_path: Path) -> None:
    found = problems(GOOD.replace(*change), tmp_path)
    assert any(at == line and said in text for at, text in found), found


def test_all_problems_come_in_one_list_in_the_order_of_the_lines(tmp_path: Path) -> None:
    text = GOOD.replace("48.1", "91").replace("[-270, 270]", "[270, -270]").replace("bands:", "bands: 7\nnoise:")
    found = problems(text, tmp_path)
    assert [line for line, _ in found] == sorted(line for line, _ in found)
    assert len({line for line, _ in found}) >= 4
    with pytest.raises(ValueError, match=r"s\.yaml:3: site\.latitude_deg=91\.0 must be <= 90\.0\n"):
        station_from(tmp_path / "s.yaml", text)


def test_a_mask_file_is_read_and_its_bad_lines_are_named(tmp_path: Path) -> None:
    text = GOOD.replace("bands:", "  horizon_file: mask.txt\nbands:")
    (tmp_path / "mask.txt").write_text("# az el\n0 3\n80, 4\n160;5\n240 6\n320 7\n360 3\n")
    mask = station_from(tmp_path / "s.yaml", text).parameters("pointing_controller")
    assert mask["mask.azimuth_deg"] == pytest.approx((0.0, 80.0, 160.0, 240.0, 320.0))
    (tmp_path / "mask.txt").write_text("0 3\n80 nan\n160 5 6\n240 6\n")
    said = [text for _, text in problems(text, tmp_path)]
    assert any("mask.txt:2: '80 nan'" in each for each in said)
    assert any("mask.txt:3: '160 5 6'" in each for each in said)


def test_the_digest_follows_every_number_and_no_comment(tmp_path: Path) -> None:
    first = station_from(Path("s.yaml"), GOOD)
    assert station_from(Path("t.yaml"), "# mine\n" + GOOD.replace("8.2e3", "8200.0")).digest == first.digest
    assert station_from(Path("s.yaml"), GOOD.replace("48.1", "48.2")).digest != first.digest
    text = GOOD.replace("bands:", "  horizon_file: mask.txt\nbands:")
    (tmp_path / "mask.txt").write_text("0 3\n")
    low = station_from(tmp_path / "s.yaml", text).digest
    (tmp_path / "mask.txt").write_text("0 4\n")
    assert station_from(tmp_path / "s.yaml", text).digest != low


@pytest.mark.parametrize(
    ("node", "parameter", "key"),
    [
        ("pointing_controller", "limits.azimuth_min_deg", "mount.azimuth.travel_deg"),
        ("antenna_servo", "safety.mask.elevation_deg", "mount.horizon_deg"),
        ("rf_receiver", "source.site.latitude_deg", "site.latitude_deg"),
        ("rf_receiver", "source.station", "site"),
        ("conscan_tracker", "conscan.radius_deg", "tuning.conscan.radius_deg"),
        ("bias_calibrator", "calibrator.model_file", "bands.*.bias_model"),
        ("bias_calibrator", "calibrator.folder", ""),
        ("pointing_controller", "pointing.period_s", ""),
        ("antenna_servo", "antenna.seed", ""),
        ("antenna_servo", "mount.droop_deg", ""),
        ("ephemeris_publisher", "source.satellite", ""),
        ("rf_receiver", "signal.dropouts.count", ""),
        ("simulation_clock", "speed", ""),
    ],
)
def test_each_parameter_has_one_place(node: str, parameter: str, key: str) -> None:
    assert owner(node, parameter) == key


def test_a_name_that_is_neither_a_file_nor_shipped_is_refused() -> None:
    with pytest.raises(StationError, match="no such file, and no shipped station; did you mean dss13"):
        read_station("dss14")


def test_the_published_schema_is_that_of_the_declarations() -> None:
    assert (STATIONS / SCHEMA).read_text() == schema_text(), "python3 -m rf_pointing.station.description.schema"


@pytest.mark.parametrize("name", shipped_stations())
def test_the_schema_takes_every_shipped_station(name: str) -> None:
    fastjsonschema.validate(schema(), _plain(STATIONS / f"{name}.yaml"))


def test_the_schema_refuses_what_the_reader_refuses() -> None:
    check = fastjsonschema.compile(schema())
    good = yaml.safe_load(GOOD.replace("8.2e3", "8200.0"))
    check(good)
    for change in (
        {"site": "Atlantis"},
        {"site": {"latitude_deg": 91, "longitude_deg": 0}},
        {"mounts": {}},
        {"bands": {}},
    ):
        with pytest.raises(fastjsonschema.JsonSchemaValueException):
            check(good | change)


def _plain(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def test_the_rate_loops_of_a_larger_dish_are_slower_in_proportion(tmp_path: Path) -> None:
    """20 rad/s up to 34 m, as the 34-m antenna's; a structure twice as large resonates at half."""
    found = []
    for diameter_m in (20.0, 34.0, 68.0):
        text = GOOD.replace("diameter_m: 3.7", f"diameter_m: {diameter_m}").replace("rate_deg_s: 6", "rate_deg_s: 0.8")
        station = station_from(tmp_path / "s.yaml", text)
        found.append(station.parameters("antenna_servo")["safety.drive.bandwidth_hz"])
    assert found == pytest.approx([20.0 / 6.2832, 20.0 / 6.2832, 10.0 / 6.2832], rel=0.01)
