"""What `track` makes of its command line, before anything is started."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from rf_pointing.commands import track_options
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import Pass, find_elements, tle_lines, verification_elements
from rf_pointing.ros.graph import ARRAY_NODES, DRIVE_NODES, NODES
from rf_pointing.station.description import read_station

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
    assert track_options.speed_factor("max") == track_options.speed_factor(None) == 0.0
    assert [track_options.speed_factor(text) for text in ("0.1", "2.5", "1000")] == [0.1, 2.5, 1000.0]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (
            "",
            {
                "elements": "", "satellite": "28057", "station": "dss13", "band": None, "start": None, "mask": None,
                "min_peak": 40.0, "sensor": None, "scan_sigma": None, "speed": None, "seed": None, "reset_fault": False,
                "ephemeris_error": None, "models": "runs/models", "namespace": "/gs1", "params_file": [], "record": None,
                "output": None, "keep_observations": False,
            },
        ),
        (
            "--min-peak 0 --sensor program --scan-sigma 0.5 --speed 2 --seed 3 --reset-fault --ephemeris-error -60",
            {
                "min_peak": 0.0, "sensor": "program", "scan_sigma": 0.5, "speed": "2", "seed": 3, "reset_fault": True,
                "ephemeris_error": -60.0,
            },
        ),
        (
            "--min-peak 90 --ephemeris-error 60 --models m --params-file a --params-file b --record r --output o",
            {
                "min_peak": 90.0, "ephemeris_error": 60.0, "models": "m", "params_file": ["a", "b"], "record": "r",
                "output": "o",
            },
        ),
    ],
)  # fmt: skip
def test_the_command_line_means_what_it_says(line: str, wanted: dict[str, Any]) -> None:
    options = vars(track_options.arguments(line.split()))
    assert {name: options[name] for name in wanted} == wanted


@pytest.mark.parametrize(
    "line",
    ["--min-peak 91", "--min-peak -1", "--ephemeris-error 61", "--ephemeris-error -61", "--sensor nose", "--mask 95"],
)
def test_what_is_out_of_range_ends_with_2(line: str) -> None:
    with pytest.raises(SystemExit) as ended:
        track_options.arguments(line.split())
    assert ended.value.code == 2


def test_a_tracker_of_another_package_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    choices = dict(track_options.SENSOR_CHOICES)
    monkeypatch.setattr(track_options, "SENSOR_CHOICES", choices)
    monkeypatch.setattr(track_options, "load_trackers", lambda: choices.update(nose="nose"))
    assert track_options.arguments(["--sensor", "nose"]).sensor == "nose"


def test_elements_that_are_stale_are_reported_with_the_pass(capsys: pytest.CaptureFixture[str]) -> None:
    """Two days after their epoch; those of the first pass are 10 h old."""
    track_options.choose_pass(track_options.arguments([]))
    assert capsys.readouterr().err == ""
    track_options.choose_pass(track_options.arguments(["--start", "2006-07-01T00:00:00"]))
    assert "track: elements of CBERS 2 are stale: 4." in capsys.readouterr().err


def changed(tmp_path: Path, changes: dict[str, Any]) -> list[str]:
    """Return the options of a station like DSS-13 but for `changes` by key."""
    path = tmp_path / "mine.yaml"
    read_station("dss13").write(path, changes)
    return ["--station", str(path)]


def parameters(tmp_path: Path, *line: str) -> dict[str, dict[str, Any]]:
    options = track_options.arguments([*line])
    return track_options.parameters(options, track_options.choose_pass(options), tmp_path)


def test_a_pass_begins_above_the_horizon_of_the_station(tmp_path: Path) -> None:
    hill = changed(
        tmp_path,
        {
            "mount.horizon_deg": [
                [0.0, 0.0],
                [60.0, 0.0],
                [120.0, 0.0],
                [147.0, 12.0],
                [170.0, 0.0],
                [250.0, 0.0],
                [310.0, 0.0],
            ]
        },
    )
    plain = track_options.choose_pass(track_options.arguments([]))
    cut = track_options.choose_pass(track_options.arguments(hill))
    assert plain.aos_t_s + 60.0 < cut.aos_t_s < plain.tca_t_s
    hill_deg = np.interp(math.degrees(cut.aos_azimuth_rad), [120.0, 147.0, 170.0], [0.0, 12.0, 0.0])
    assert math.degrees(cut.aos_elevation_rad) == pytest.approx(hill_deg + 1.0, abs=1e-3), "a degree clear of the hill"
    assert cut.los_t_s == pytest.approx(plain.los_t_s, abs=1e-3)


def test_every_node_of_the_station_runs_on_the_same_description(tmp_path: Path) -> None:
    given = parameters(tmp_path, *changed(tmp_path, {"wind.gust_limit_m_s": 21.0}), "--band", "S")
    assert {(values["station"], values["band"]) for node, values in given.items() if node != "simulation_clock"} == {
        (str(tmp_path / "station.yaml"), "S")
    }
    assert set(given) == set(NODES)
    assert read_station(tmp_path / "station.yaml").digest == read_station(tmp_path / "mine.yaml").digest


def test_the_interpolation_of_an_ephemeris_reaches_every_node_that_reads_it(tmp_path: Path) -> None:
    given = parameters(tmp_path, "--interpolation", "lagrange", "9")
    for node in ("ephemeris_publisher", "rf_receiver"):
        values = given[node]
        assert (values["source.interpolation"], values["source.interpolation_degree"]) == ("LAGRANGE", 9)
    with pytest.raises(ValueError, match="interpolation=LAGRANGE 'x': the degree must be a whole number"):
        track_options.choose_pass(track_options.arguments(["--interpolation", "LAGRANGE", "x"]))


def scan_of(tmp_path: Path, *line: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the scan of controller and tracker in the station of a run."""
    given = parameters(tmp_path, "--sensor", "conscan", "--band", "Ka", *line)
    station = read_station(given["conscan_tracker"]["station"])
    found = [station.parameters(node, "Ka") for node in ("pointing_controller", "conscan_tracker")]
    first, second = ({key: each[key] for key in each if key.startswith("conscan.")} for each in found)
    return first, second


def test_the_scan_follows_from_the_accuracy_wanted_and_the_link(tmp_path: Path) -> None:
    """Controller and tracker are told the same; a weaker link makes the scan slower, then wider."""
    weak = changed(tmp_path, {"bands.Ka.zenith_carrier_to_noise_db_hz": 38.0})
    commanded, estimated = scan_of(tmp_path, "--scan-sigma", "0.6")
    slower, _ = scan_of(tmp_path, "--scan-sigma", "0.6", *weak)
    wider, _ = scan_of(tmp_path, "--scan-sigma", "0.4", *weak)
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
def test_an_accuracy_that_no_scan_has_is_refused(tmp_path: Path, wanted: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        scan_of(tmp_path, "--scan-sigma", wanted)


def test_the_sensor_is_one_that_the_band_has(tmp_path: Path) -> None:
    line = changed(tmp_path, {"bands.X.sensors": ["steptrack", "conscan"]})
    assert track_options.sensor_of(track_options.arguments(line)) == "steptrack"
    assert track_options.sensor_of(track_options.arguments([*line, "--sensor", "program"])) == "program"
    with pytest.raises(
        ValueError, match="sensor=monopulse: X band of Goldstone DSS-13 has steptrack, conscan, auto, pro"
    ):
        track_options.sensor_of(track_options.arguments([*line, "--sensor", "monopulse"]))


@pytest.mark.parametrize("text", ["fast", "0", "0.09", "-1", "nan", "inf", "1001", "1e9"])
def test_another_speed_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"speed=.* must be"):
        track_options.speed_factor(text)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        (["--satellite", "99999"], "satellite='99999' is not among"),
        (["--satellite", "Sputnik"], "satellite='Sputnik' is not among"),
        (["--station", "Atlantis"], "Atlantis:1: no such file, and no shipped station"),
        (["--min-peak", "89.99"], r"has no pass above 89\.99 deg in 48\.00 h"),
        (["--satellite", "14128"], "has no pass above .* none rises above the mask"),
        (["--start", "2006-08-01T00:00:00"], r"(?i)days|outside|after"),
        (["--start", "1990-01-01T00:00:00"], r"(?i)days|outside|before"),
        (["--elements", "/nowhere.tle"], "elements='/nowhere.tle' does not exist"),
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


def test_the_command_line_reaches_the_nodes_as_parameters(tmp_path: Path) -> None:
    options = track_options.arguments(["--seed", "5", "--speed", "10", "--mask", "40", "--band", "Ka"])
    window = track_options.choose_pass(options)
    values = track_options.parameters(options, window, tmp_path)
    assert values["antenna_servo"]["antenna.seed"] == values["rf_receiver"]["signal.seed"] == 5
    assert values["simulation_clock"]["speed"] == 10.0
    assert values["simulation_clock"]["start_s"] < window.aos_t_s - 100.0
    assert values["bias_calibrator"]["band"] == "Ka"
    station = read_station(values["ephemeris_publisher"]["station"])
    assert station.parameters("ephemeris_publisher", "Ka")["publisher.mask_deg"] == 40.0
    assert values["pointing_controller"]["certificate_folder"] == str(tmp_path.resolve())
    (written,) = track_options.parameter_files(options, values, tmp_path)
    sections = yaml.safe_load(written.read_text())
    # A catalogue number stays a text.
    assert sections["/**/ephemeris_publisher"]["ros__parameters"]["source.satellite"] == "28057"
    assert all(name.startswith("/**/") for name in sections)


def test_the_error_of_the_ephemeris_is_that_of_the_receiver_alone(tmp_path: Path) -> None:
    name = "source.along_track_offset_s"
    given = parameters(tmp_path, "--ephemeris-error", "2")
    assert [node for node, values in given.items() if name in values] == ["rf_receiver"]
    assert given["rf_receiver"][name] == 2.0
    assert name not in parameters(tmp_path)["rf_receiver"]


def test_what_is_not_given_has_its_default_in_every_node(tmp_path: Path) -> None:
    given = parameters(tmp_path, "--models", "")
    assert given["antenna_servo"]["antenna.seed"] == given["rf_receiver"]["signal.seed"] == 1
    key = str((tmp_path / "command.key").resolve())
    assert given["antenna_servo"]["command_key_file"] == given["pointing_controller"]["command_key_file"] == key
    assert given["bias_calibrator"]["calibrator.folder"] == ""
    assert given["bias_calibrator"]["calibrator.keep_observations"] is False
    assert given["ephemeris_publisher"]["source.elements"] == ""
    assert given["simulation_clock"]["speed"] == 0.0


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("", {"speed": "max", "seed": "1", "sensor": "monopulse"}),
        ("--speed 2 --seed 0 --sensor program", {"speed": "2", "seed": "0", "sensor": "program"}),
    ],
)
def test_a_bag_has_notes_on_its_run(line: str, wanted: dict[str, str]) -> None:
    notes = track_options.notes(track_options.arguments(line.split()))
    assert notes == {"station": "Goldstone DSS-13", "band": "X", **wanted}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "/**/simulation_clock: {ros__parameters: {tick_s: 0.1}}",
            "simulation_clock tick_s: given by the command line",
        ),
        (
            "/**/ephemeris_publisher: {ros__parameters: {band: S}}",
            "ephemeris_publisher band: given by the command line",
        ),
        ("/**/antenna_srvo: {ros__parameters: {wind.mean_speed_m_s: 1.0}}", "antenna_srvo is no node; there are"),
        (
            "/**/rf_receiver: {ros__parameters: {signal: {seed: 3}}}",
            "rf_receiver signal.seed: given by the command line",
        ),
        (
            "/**/pointing_controller: {ros__parameters: {limits: {elevation_min_deg: 1.0}}}",
            "limits.elevation_min_deg is given by the station description: mount.elevation.travel_deg",
        ),
    ],
)
def test_what_a_parameter_file_says_is_in_force_or_refused(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    options = track_options.arguments(["--params-file", str(file)])
    with pytest.raises(ValueError, match=complaint):
        track_options.check_files(options)
    for node in ("antenna_servo", "**"):
        file.write_text(f"/**/{node}: {{ros__parameters: {{wind.mean_speed_m_s: 3.0}}}}".replace("/**/**", "/**"))
        track_options.check_files(options)
    values = track_options.parameters(options, track_options.choose_pass(options), tmp_path)
    assert track_options.parameter_files(options, values, tmp_path)[-1] == file


def test_near_real_time_the_clock_ticks_with_the_servo(tmp_path: Path) -> None:
    speeds = ("1", "max", "50")
    ticks = {speed: parameters(tmp_path, *RUNS, "--speed", speed)["simulation_clock"]["tick_s"] for speed in speeds}
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


def test_an_output_may_be_deep_or_used_again_with_a_bag_elsewhere(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b"
    options = track_options.arguments(["--output", str(deep)])
    assert [track_options.output_folder(options, "run") for _ in range(2)] == [deep, deep]
    assert track_options.bag_folder(options, deep) == deep / "bag"
    (deep / "bag").mkdir()
    elsewhere = track_options.arguments(["--output", str(deep), "--record", str(tmp_path / "mine")])
    assert track_options.output_folder(elsewhere, "run") == deep
    assert track_options.bag_folder(elsewhere, deep) == tmp_path / "mine"


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


def test_time_begins_early_enough_for_the_slew_to_the_pass(tmp_path: Path) -> None:
    """The first pass of 26 June begins 175 s of slewing away: the 150 s of every other pass refused it."""
    options = track_options.arguments([])
    assert track_options.before_pass_s(options, track_options.choose_pass(options)) == track_options.SLEW_TIME_S
    far = track_options.arguments(["--start", "2006-06-26T00:00:00"])
    window = track_options.choose_pass(far)
    needed_s = track_options.before_pass_s(far, window)
    assert 175.0 + track_options.SETTLE_S <= needed_s < 300.0
    start_s = track_options.parameters(far, window, tmp_path)["simulation_clock"]["start_s"]
    assert start_s == math.floor(window.aos_t_s) - needed_s
    assert isinstance(start_s, float), "as the clock declares it"


def test_a_slower_antenna_or_one_that_starts_elsewhere_begins_earlier(tmp_path: Path) -> None:
    slow = tmp_path / "slow.yaml"
    slow.write_text("/**/antenna_servo: {ros__parameters: {antenna: {start_azimuth_deg: -200.0}}}\n")
    station = changed(tmp_path, {f"mount.{axis}.command_rate_deg_s": 0.5 for axis in ("azimuth", "elevation")})
    options = track_options.arguments([*station, "--params-file", str(slow)])
    assert track_options.before_pass_s(options, track_options.choose_pass(options)) > 300.0


@pytest.mark.parametrize(
    ("highest_deg", "start_deg", "rise_deg", "needed_s"),
    [
        # The nearer turn of the cables: 110 deg to -170, not 250 deg to 190.
        (89.5, (-60.0, 80.0), 190.0, 251.0),
        # Down to the rise alone: 75 deg.
        (89.5, (10.0, 80.0), 10.0, 181.0),
        # A pass may begin over the top: 180 deg of azimuth, to an elevation of 175 deg.
        (100.0, (10.0, 80.0), 10.0, 391.0),
        (176.0, (10.0, 80.0), 10.0, 391.0),
        # Or not, which then takes longer.
        (176.0, (10.0, 80.0), 190.0, 391.0),
        # Over the top the elevation takes longer: 165 deg.
        (176.0, (130.0, 10.0), 10.0, 361.0),
        # Over the top is near by another turn of the cables; the other way is 160 deg.
        (176.0, (-150.0, 80.0), 10.0, 351.0),
    ],
)
def test_the_slew_to_a_pass_is_that_of_the_slower_axis_at_its_rate(
    tmp_path: Path, highest_deg: float, start_deg: tuple[float, float], rise_deg: float, needed_s: float
) -> None:
    """At 0.5 deg/s and 0.8 deg/s^2, with 30 s to settle, in whole seconds; the pass rises at 5 deg."""
    changes: dict[str, Any] = {f"mount.{axis}.command_rate_deg_s": 0.5 for axis in ("azimuth", "elevation")}
    if highest_deg > 90.0:
        changes["mount.elevation.travel_deg"] = [4.0, highest_deg]
        changes["mount.elevation.hard_stop_deg"] = [2.0, highest_deg + 2.0]
    start = tmp_path / "start.yaml"
    values = f"{{start_azimuth_deg: {start_deg[0]}, start_elevation_deg: {start_deg[1]}}}"
    start.write_text(f"/**/antenna_servo: {{ros__parameters: {{antenna: {values}}}}}")
    options = track_options.arguments([*changed(tmp_path, changes), "--params-file", str(start)])
    low, high = math.radians(rise_deg), math.radians(rise_deg + 10.0)
    window = Pass(
        name="bird", aos_t_s=1_151_384_323.8, tca_t_s=1_151_384_680.3, los_t_s=1_151_385_038.5, peak_elevation_rad=0.77,
        aos_azimuth_rad=low, aos_elevation_rad=math.radians(5.0), los_azimuth_rad=high, azimuth_min_rad=low,
        azimuth_max_rad=high, peak_azimuth_rate_rad_s=0.01, peak_elevation_rate_rad_s=0.003,
        peak_azimuth_acceleration_rad_s2=6e-5, smallest_range_m=1e6, rises_before=False, sets_after=False,
    )  # fmt: skip
    assert track_options.before_pass_s(options, window) == needed_s


def test_nodes_of_an_array_run_where_the_band_has_one() -> None:
    simulated = track_options.nodes_of(track_options.arguments(["--station", "rotator_2m"]))
    assert simulated == (*NODES, *ARRAY_NODES)
    assert track_options.nodes_of(track_options.arguments([])) == NODES


# A drive that is not simulated

REAL = {"drive.type": "hamlib", "wind.anemometer": False}


def test_a_real_drive_runs_without_clock_and_receiver_and_remembers_its_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    given = parameters(tmp_path, *changed(tmp_path, REAL), "--start", "2006-06-27T04:00:00", "--namespace", "roof")
    assert set(given) == set(NODES) - {"simulation_clock", "rf_receiver"}
    assert given["antenna_servo"]["state_file"].startswith(str(tmp_path / "state" / "rf_pointing"))
    assert given["antenna_servo"]["wrap_file"].endswith("/roof/azimuth_turn.json")
    assert "antenna.seed" not in given["antenna_servo"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--speed 2", "speed=2: drive.type=hamlib of .* moves a device, in real time; it is for a simulated drive"),
        ("--seed 3", "seed=3: drive.type=hamlib"),
        ("--ephemeris-error 1", "ephemeris-error=1.0: drive.type=hamlib"),
        ("--start 2006-06-27T04:00:00", "start=2006-06-27T04:00:00 was [0-9]+ s ago: .* the present is the default"),
    ],
)
def test_what_only_a_simulation_has_is_refused_for_a_real_drive(tmp_path: Path, line: str, words: str) -> None:
    options = track_options.arguments([*changed(tmp_path, REAL), *line.split()])
    with pytest.raises(ValueError, match=words):
        track_options.check_time(options)


def test_a_real_array_has_receivers_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    read_station("rotator_2m").write(path, REAL)
    nodes = track_options.nodes_of(track_options.arguments(["--station", str(path)]))
    assert nodes == (*DRIVE_NODES, *(name for name in ARRAY_NODES if name != "array_receiver"))


def test_a_pass_of_a_real_antenna_is_that_of_the_present(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = parse_utc("2006-06-27T04:00:00")
    monkeypatch.setattr(track_options, "time", SimpleNamespace(time=lambda: now_s))
    real = changed(tmp_path, REAL)
    assert track_options.choose_pass(track_options.arguments(real)).aos_t_s == pytest.approx(1_151_384_323.8, abs=0.1)
    later = track_options.arguments([*real, "--start", "2006-06-27T06:00:00"])
    assert track_options.choose_pass(later).aos_t_s > parse_utc("2006-06-27T06:00:00")
    track_options.check_time(later)
    with pytest.raises(ValueError, match="was 0 s ago"):
        track_options.check_time(track_options.arguments([*real, "--start", "2006-06-27T03:59:59.6"]))


def test_any_start_and_a_speed_in_range_are_for_a_simulation() -> None:
    track_options.check_time(track_options.arguments(["--start", "2006-06-27T04:00:00", "--speed", "2", "--seed", "3"]))
    with pytest.raises(ValueError, match="speed=2000.0 must be between"):
        track_options.check_time(track_options.arguments(["--speed", "2000"]))


def test_the_notes_of_a_real_antenna_name_its_drive(tmp_path: Path) -> None:
    notes = track_options.notes(track_options.arguments(changed(tmp_path, REAL)))
    assert notes["drive"] == "hamlib"
    assert "seed" not in notes


def test_a_real_antenna_with_a_slow_elevation_is_given_time_for_it(tmp_path: Path) -> None:
    """From 4 to 89.5 deg at 0.3 deg/s, and the time to settle."""
    slow = changed(tmp_path, REAL | {"mount.elevation.command_rate_deg_s": 0.3})
    options = track_options.arguments([*slow, "--start", "2006-06-27T04:00:00"])
    assert track_options.before_pass_s(options, track_options.choose_pass(options)) == 315.0


def test_a_real_antenna_is_given_time_for_its_longest_slew(tmp_path: Path) -> None:
    """It may stand anywhere: 440 deg of azimuth at 2 deg/s, and the time to settle."""
    line = ["--start", "2006-06-27T04:00:00"]
    options = track_options.arguments([*changed(tmp_path, REAL), *line])
    window = track_options.choose_pass(options)
    station = track_options.station_of(options)
    low, high = station.content.mount.azimuth.travel_deg
    rate = station.parameters("pointing_controller", "X")["machine.rate_limit_deg_s"][0]
    assert track_options.before_pass_s(options, window) == math.ceil((high - low) / rate + 30.0)
