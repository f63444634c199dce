"""What `track` makes of its command line, before anything is started."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from rf_pointing.calibration import read_model
from rf_pointing.commands import track_options
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements

ROOT = Path(__file__).parents[2]
RUNS = ["--min-peak", "40"]


def test_the_default_is_the_first_pass_of_cbers_2_above_40_degrees() -> None:
    window = track_options.choose_pass(track_options.arguments([]))
    assert window.name == "CBERS 2"
    assert math.degrees(window.peak_elevation_rad) == pytest.approx(44.31, abs=0.01)
    assert window.aos_t_s == pytest.approx(1_151_384_323.8, abs=0.1)


def test_a_later_start_gives_a_later_pass() -> None:
    first = track_options.choose_pass(track_options.arguments(RUNS))
    later = track_options.choose_pass(track_options.arguments([*RUNS, "--start", "2006-06-27T06:00:00"]))
    assert later.aos_t_s > first.los_t_s


@pytest.mark.parametrize(
    ("text", "t_s"),
    [
        ("2006-06-27T04:00:00", 1_151_380_800.0),
        ("2006-06-27T04:00:00Z", 1_151_380_800.0),
        ("2006-06-27T06:00:00+02:00", 1_151_380_800.0),
    ],
)
def test_a_start_without_a_zone_is_utc(text: str, t_s: float) -> None:
    assert parse_utc(text) == t_s


@pytest.mark.parametrize("text", ["tomorrow", "27.6.2006", ""])
def test_a_start_that_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="must be an ISO time such as"):
        parse_utc(text)


@pytest.mark.parametrize("text", ["-1", "1.5", "x", "2147483648"])
def test_a_seed_that_the_nodes_would_refuse_is_refused_on_the_command_line(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        track_options.arguments(["--seed", text])
    assert f"argument --seed: {text} must be a whole number from 0 to 2147483647" in capsys.readouterr().err
    assert track_options.arguments(["--seed", "2147483647"]).seed == 2**31 - 1


def test_a_speed_is_a_factor_or_max() -> None:
    assert track_options.speed_factor("max") == 0.0
    assert track_options.speed_factor("2.5") == 2.5


def test_a_pass_begins_above_the_horizon_that_the_controller_is_given(tmp_path: Path) -> None:
    hill = tmp_path / "hill.yaml"
    hill.write_text(
        "/**/pointing_controller:\n  ros__parameters:\n    mask: {azimuth_deg: [120.0, 147.0, 170.0], "
        "elevation_deg: [0.0, 12.0, 0.0]}\n"
    )
    plain, options = (
        track_options.choose_pass(track_options.arguments([])),
        track_options.arguments(["--params-file", str(hill)]),
    )
    cut = track_options.choose_pass(options)
    assert plain.aos_t_s + 60.0 < cut.aos_t_s < plain.tca_t_s
    hill_deg = np.interp(math.degrees(cut.aos_azimuth_rad), [120.0, 147.0, 170.0], [0.0, 12.0, 0.0])
    assert math.degrees(cut.aos_elevation_rad) == pytest.approx(hill_deg + 1.0, abs=1e-3), "a degree clear of the hill"
    assert cut.los_t_s == pytest.approx(plain.los_t_s, abs=1e-3)
    said = track_options.overrides(options, cut, tmp_path)["/**/ephemeris_publisher"]["ros__parameters"]
    assert said["mask.azimuth_deg"] == pytest.approx([120.0, 147.0, 170.0])
    assert said["mask.clearance_deg"] == pytest.approx(1.0)
    servo = track_options.overrides(options, cut, tmp_path)["/**/antenna_servo"]["ros__parameters"]
    assert servo["safety.mask.azimuth_deg"] == [120.0, 147.0, 170.0]
    assert servo["safety.mask.elevation_deg"] == [0.0, 12.0, 0.0]
    assert said["mask.elevation_deg"] == pytest.approx([0.0, 12.0, 0.0])


def test_the_interpolation_of_an_ephemeris_reaches_every_node_that_reads_it(tmp_path: Path) -> None:
    options = track_options.arguments(["--interpolation", "lagrange", "9"])
    said = track_options.overrides(options, track_options.choose_pass(options), tmp_path)
    for node in ("ephemeris_publisher", "rf_receiver"):
        values = said[f"/**/{node}"]["ros__parameters"]
        assert (values["source.interpolation"], values["source.interpolation_degree"]) == ("LAGRANGE", 9)
    with pytest.raises(ValueError, match="interpolation=LAGRANGE 'x': the degree must be a whole number"):
        track_options.choose_pass(track_options.arguments(["--interpolation", "LAGRANGE", "x"]))


def scan_of(tmp_path: Path, *line: str) -> tuple[dict[str, float], dict[str, float]]:
    options = track_options.arguments(["--sensor", "conscan", "--band", "Ka", *line])
    sections = track_options.overrides(options, track_options.choose_pass(options), tmp_path)
    said = [sections.get(f"/**/{node}", {"ros__parameters": {}})["ros__parameters"]
            for node in ("pointing_controller", "conscan_tracker")]  # fmt: skip
    found = [{key: value for key, value in values.items() if key.startswith("conscan.")} for values in said]
    return found[0], found[1]


def test_the_scan_follows_from_the_accuracy_wanted_and_the_link(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Controller and tracker are told the same; a weaker link makes the scan slower, then wider."""
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    assert scan_of(tmp_path) == ({}, {})
    weak = tmp_path / "weak.yaml"
    weak.write_text("/**/pointing_controller:\n  ros__parameters: {link.zenith_carrier_to_noise_db_hz: 38.0}\n")
    commanded, estimated = scan_of(tmp_path, "--scan-sigma", "0.6")
    slower, _ = scan_of(tmp_path, "--scan-sigma", "0.6", "--params-file", str(weak))
    wider, _ = scan_of(tmp_path, "--scan-sigma", "0.4", "--params-file", str(weak))
    assert commanded == estimated
    assert commanded["conscan.radius_deg"] == pytest.approx(0.00155, abs=1e-5)
    assert commanded["conscan.period_s"] == pytest.approx(4.0)
    assert 4.0 < slower["conscan.period_s"] < 32.0
    assert slower["conscan.radius_deg"] == pytest.approx(commanded["conscan.radius_deg"])
    assert wider["conscan.period_s"] == pytest.approx(32.0)
    assert wider["conscan.radius_deg"] > slower["conscan.radius_deg"]


@pytest.mark.parametrize(
    ("wanted", "complaint"),
    [("0", "scan-sigma=0.0 mdeg must be > 0"), ("nan", "scan-sigma=nan"), ("0.001", "wanted_sigma_rad")],
)
def test_an_accuracy_that_no_scan_has_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, wanted: str, complaint: str
) -> None:
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    with pytest.raises(ValueError, match=complaint):
        scan_of(tmp_path, "--scan-sigma", wanted)


def test_a_horizon_of_the_servo_s_own_stays(tmp_path: Path) -> None:
    both = tmp_path / "both.yaml"
    both.write_text(
        "/**/pointing_controller:\n  ros__parameters:\n    mask: {azimuth_deg: [0.0], elevation_deg: [3.0]}\n"
        "/**/antenna_servo:\n  ros__parameters:\n    safety: {mask: {azimuth_deg: [0.0], elevation_deg: [2.0]}}\n"
    )
    options = track_options.arguments(["--params-file", str(both)])
    said = track_options.overrides(options, track_options.choose_pass(options), tmp_path)
    assert not [name for name in said["/**/antenna_servo"]["ros__parameters"] if name.startswith("safety.mask")]


@pytest.mark.parametrize("text", ["fast", "0", "-1", "nan", "inf", "1e9"])
def test_another_speed_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"speed=.* must be"):
        track_options.speed_factor(text)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        (["--satellite", "99999"], "satellite='99999' is not among"),
        (["--satellite", "Sputnik"], "satellite='Sputnik' is not among"),
        (["--station", "Atlantis"], "Atlantis"),
        (["--min-peak", "89.99"], r"has no pass above 89\.99 deg in 48\.00 h"),
        (["--satellite", "14128"], "has no pass above .* none rises above the mask"),
        (["--start", "2006-08-01T00:00:00"], r"(?i)days|outside|after"),
        (["--start", "1990-01-01T00:00:00"], r"(?i)days|outside|before"),
        (["--elements", "/nowhere.tle"], "elements_file='/nowhere.tle' does not exist"),
    ],
)
def test_what_gives_no_pass_is_refused(line: list[str], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        track_options.choose_pass(track_options.arguments(line))


def test_a_file_of_elements_is_used(tmp_path: Path) -> None:
    path = tmp_path / "x.tle"
    path.write_text("MY BIRD\n" + "\n".join(tle_lines(find_elements(verification_elements(), "28057"))))
    window = track_options.choose_pass(track_options.arguments(["--elements", str(path), "--satellite", "MY BIRD"]))
    assert window.name == "MY BIRD"


def test_the_command_line_reaches_the_nodes_as_parameters(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    options = track_options.arguments(["--seed", "5", "--speed", "10", "--mask", "40", "--band", "Ka"])
    window = track_options.choose_pass(options)
    sections = track_options.overrides(options, window, tmp_path)
    values = {name.rsplit("/", 1)[-1]: section["ros__parameters"] for name, section in sections.items()}
    assert values["antenna_servo"]["antenna.seed"] == values["rf_receiver"]["signal.seed"] == 5
    assert values["simulation_clock"]["speed"] == 10.0
    assert values["simulation_clock"]["start_s"] < window.aos_t_s - 100.0
    assert values["ephemeris_publisher"]["publisher.mask_deg"] == 40.0
    assert values["bias_calibrator"]["calibrator.band"] == "Ka"
    assert values["pointing_controller"]["certificate_folder"] == str(tmp_path.resolve())
    assert yaml.safe_load(yaml.safe_dump(sections)) == sections
    assert all(name.startswith("/**/") for name in sections)


@pytest.mark.parametrize(
    ("station", "band"), [("Goldstone DSS-13", "S"), ("Goldstone DSS-13", "X"), ("Mauritius ISTRAC", "X")]
)
def test_the_commissioning_model_belongs_to_the_station_and_band_asked_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, station: str, band: str
) -> None:
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    options = track_options.arguments(["--station", station, "--band", band, "--min-peak", "20"])
    window = track_options.choose_pass(options)
    said = track_options.overrides(options, window, tmp_path)["/**/bias_calibrator"]["ros__parameters"]
    assert (said["calibrator.station"], said["calibrator.band"]) == (station, band)
    file = read_model(said["calibrator.model_file"])
    file.check_for(station, band, window.aos_t_s)
    assert file.model == read_model(ROOT / "config" / "bias_model_dss13.yaml").model


def test_a_catalogue_number_stays_text_in_the_parameter_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    options = track_options.arguments(RUNS)
    sections = yaml.safe_load(
        yaml.safe_dump(track_options.overrides(options, track_options.choose_pass(options), tmp_path))
    )
    assert sections["/**/ephemeris_publisher"]["ros__parameters"]["source.satellite"] == "28057"


def test_near_real_time_the_clock_ticks_with_the_servo(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(track_options, "get_package_share_directory", lambda _: str(ROOT))
    ticks = {}
    for speed in ("1", "max", "50"):
        options = track_options.arguments([*RUNS, "--speed", speed])
        sections = track_options.overrides(options, track_options.choose_pass(options), tmp_path)
        ticks[speed] = sections["/**/simulation_clock"]["ros__parameters"]["tick_s"]
    assert ticks == {"1": 0.02, "max": 0.1, "50": 0.1}


def test_an_existing_bag_is_refused_and_nothing_is_made(tmp_path: Path) -> None:
    bag = tmp_path / "mine"
    bag.mkdir()
    options = track_options.arguments(["--record", str(bag), "--output", str(tmp_path / "out")])
    with pytest.raises(ValueError, match="exists already"):
        track_options.output_folder(options, "run")
    assert not (tmp_path / "out").exists()


def test_an_output_that_holds_a_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    options = track_options.arguments(["--output", str(tmp_path)])
    with pytest.raises(ValueError, match="holds a bag already"):
        track_options.output_folder(options, "run")


def test_every_run_gets_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = track_options.arguments([])
    window = track_options.choose_pass(options)
    first, second = (track_options.output_folder(options, track_options.run_stem(options, window)) for _ in range(2))
    assert first != second
    assert str(first) == "runs/28057-20060627T045843-01"


def test_the_namespace_is_taken_with_and_without_its_slash() -> None:
    assert track_options.arguments(["--namespace", "gs2"]).namespace == "/gs2"
    assert track_options.arguments(["--namespace", "/site/gs2"]).namespace == "/site/gs2"


@pytest.mark.parametrize("name", ["bad//name", "/2nd", "with space", "/gs1/"])
def test_a_namespace_that_ros_would_refuse_is_refused_at_once(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        track_options.arguments(["--namespace", name])
    assert f"{name!r} is no ROS namespace: Invalid namespace: namespace must not" in capsys.readouterr().err


def test_the_root_is_no_antenna(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        track_options.arguments(["--namespace", "/"])
    assert "'/' must name the antenna" in capsys.readouterr().err


def test_time_begins_early_enough_for_the_slew_to_the_pass() -> None:
    """The first pass of 26 June begins 175 s of slewing away: the 150 s of every other pass refused it."""
    options = track_options.arguments([])
    assert track_options.before_pass_s(options, track_options.choose_pass(options)) == track_options.SLEW_TIME_S
    far = track_options.arguments(["--start", "2006-06-26T00:00:00"])
    window = track_options.choose_pass(far)
    needed_s = track_options.before_pass_s(far, window)
    assert 175.0 + track_options.SETTLE_S <= needed_s < 300.0
    start_s = track_options.overrides(far, window, Path())["/**/simulation_clock"]["ros__parameters"]["start_s"]
    assert start_s == math.floor(window.aos_t_s) - needed_s
    assert isinstance(start_s, float), "as the clock declares it"


def test_a_slower_antenna_or_one_that_starts_elsewhere_begins_earlier(tmp_path: Path) -> None:
    slow = tmp_path / "slow.yaml"
    slow.write_text(
        "/**/pointing_controller: {ros__parameters: {machine: {rate_limit_deg_s: [0.5, 0.5]}}}\n"
        "/**/antenna_servo: {ros__parameters: {antenna: {start_azimuth_deg: -200.0}}}\n"
    )
    options = track_options.arguments(["--params-file", str(slow)])
    assert track_options.before_pass_s(options, track_options.choose_pass(options)) > 300.0
