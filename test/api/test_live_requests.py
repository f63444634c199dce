"""Requests of the live commands: what a command line means, what is refused, and what follows from a request."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.api import requests
from rf_pointing.api.requests import CalibrateRequest, IdentifyRequest, RunRequest, TrackRequest
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target, elements
from rf_pointing.commands import calibrate, identify_antenna, track
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.ephemeris import Pass, tle_lines
from rf_pointing.station.campaign.plan import beacons
from rf_pointing.station.description import read_station

COMMANDS: dict[str, Callable[..., Any]] = {
    "track": track.request_of, "calibrate": calibrate.request_of, "identify_antenna": identify_antenna.request_of,
}  # fmt: skip
MAINS = {"track": track.main, "calibrate": calibrate.main, "identify_antenna": identify_antenna.main}
DSS13 = Station("dss13")
EPOCH = "2006-06-27T04:00:00"
REAL = {"drive.type": "hamlib", "wind.anemometer": False}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def changed(tmp_path: Path, changes: dict[str, Any], like: str = "dss13") -> str:
    """Return the option of a station that differs in `changes` by key."""
    path = tmp_path / "mine.yaml"
    read_station(like).write(path, changes)
    return f"--station {path}"


def request(line: str, command: str = "track") -> Any:
    return COMMANDS[command](line.split())


# Golden command lines


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("track", {
            "band": "X", "sensor": "monopulse", "start_s": None, "speed": None, "seed": 1,
            "ephemeris_error_s": None, "reset_fault": False, "models": "runs/models", "keep_observations": False,
            "namespace": "/gs1", "parameter_files": [], "record": None, "output": None, "min_peak_deg": 40.0,
            "mask_deg": None, "scan_sigma_mdeg": None,
        }),
        ("track --band Ka --min-peak 0 --mask 40 --sensor program --scan-sigma 0.5 --speed 2 --seed 3 --reset-fault", {
            "band": "Ka", "min_peak_deg": 0.0, "mask_deg": 40.0, "sensor": "program", "scan_sigma_mdeg": 0.5,
            "speed": 2.0, "seed": 3, "reset_fault": True,
        }),
        ("track --min-peak 90 --ephemeris-error -60 --models m --params-file a --params-file b --record r --output o", {
            "min_peak_deg": 90.0, "ephemeris_error_s": -60.0, "models": "m", "parameter_files": [Path("a"), Path("b")],
            "record": Path("r"), "output": Path("o"),
        }),
        ("track --seed 2147483647 --speed 0.1 --namespace roof", {
            "seed": 2**31 - 1, "speed": 0.1, "namespace": "/roof",
        }),
        ("track --speed 1000 --namespace /site/gs2", {"speed": 1000.0, "namespace": "/site/gs2"}),
        (f"track --start {EPOCH}Z", {"start_s": 1_151_380_800.0}),
        ("track --start 2006-06-27T06:00:00+02:00", {"start_s": 1_151_380_800.0}),
        ("calibrate", {
            "longest_s": 4800.0, "fewest": 25, "acceptance_passes": 3, "orbit_prior_m": 5.0, "resume": False,
            "models": "runs/models",
            "ephemeris_error_s": 0.0, "keep_observations": True, "sensor": "monopulse", "start_s": None,
        }),
        ("calibrate --sensor auto --fewest 40 --ephemeris-error 2 --orbit-prior 0.01 --shadow 2 --longest 60 --resume", {
            "sensor": "auto", "fewest": 40, "ephemeris_error_s": 2.0, "orbit_prior_m": 0.01, "acceptance_passes": 2,
            "longest_s": 60.0, "resume": True,
        }),
        ("calibrate --shadow 20 --longest 86400 --orbit-prior 1e6", {"acceptance_passes": 20, "longest_s": 86400.0}),
        ("identify_antenna", {
            "axes": ["azimuth", "elevation"], "sequences": 8, "held_out": 4, "seed": 1, "namespace": "/gs1",
            "output": Path("runs/identification"), "simulated": False, "parameter_files": [], "band": "X",
        }),
        ("identify_antenna --axes elevation --sequences 2 --held-out 1 --simulated --params-file a --output o --band S", {
            "axes": ["elevation"], "sequences": 2, "held_out": 1, "simulated": True, "parameter_files": [Path("a")],
            "output": Path("o"), "band": "S",
        }),
    ],
)  # fmt: skip
def test_a_command_line_means_a_request(line: str, wanted: dict[str, Any]) -> None:
    name, *words = line.split()
    found = COMMANDS[name](words)
    assert {name: found.station.band if name == "band" else getattr(found, name) for name in wanted} == wanted


def test_without_options_the_experiment_is_the_published_one() -> None:
    params = request("", "identify_antenna").excitation
    assert params == IdentifyRequest(station=DSS13).excitation
    assert (params.kind, params.samples, params.sample_s, params.high_hz) == ("white", 8192, 0.02, 12.0)
    rates = (params.mean_rad_s, params.rms_rad_s, params.peak_rad_s, params.idle_rate_rad_s)
    assert np.degrees(rates) == pytest.approx([0.056, 0.028, 0.2, 1.84e-4])
    # A slow control period bounds the band by half its rate.
    assert request("--tick 0.1 --kind multisine", "identify_antenna").excitation.high_hz == pytest.approx(5.0)


REFUSED = [
    ("track --min-peak 91", "91 must be between 0 and 90"),
    ("track --sensor nose", "'nose' must be one of program"),
    ("track --seed 1.5", "argument --seed: 1.5 must be a whole number from 0 to 2147483647"),
    ("track --seed 2147483648", "2147483648 must be a whole number"),
    ("track --speed fast", "speed='fast' must be a factor or max"),
    ("track --speed 0", "speed=0.0 must be between 0.1 and 1000"),
    ("track --start tomorrow", "must be an ISO time such as"),
    ("track --scan-sigma 0", "scan-sigma=0.0 mdeg must be > 0"),
    ("track --sensor conscan --band Ka --scan-sigma 0.001", "wanted_sigma_rad"),
    ("track --interpolation LAGRANGE x", "interpolation=LAGRANGE 'x': the degree must be a whole number"),
    ("track --satellite 99999", "satellite='99999' is not among"),
    ("track --station Atlantis", "Atlantis: no such file, and no shipped station"),
    ("track --band Q", "Goldstone DSS-13: band='Q' must be one of S, X, Ka"),
    ("track --min-peak 89.99", "has no pass above 89.99 deg in 48.00 h"),
    ("track --satellite 14128", "none rises above the mask"),
    ("track --start 2006-08-01T00:00:00", "days"),
    ("track --elements /nowhere.tle", "elements='/nowhere.tle' does not exist"),
    ("track --namespace bad//name", "'bad//name' is not a ROS namespace: Invalid namespace: namespace must not"),
    ("track --namespace /2nd", "'/2nd' is not a ROS namespace"),
    ("track --namespace /", "'/' must name the antenna"),
    ("track --params-file nobody.yaml", "params-file: nobody is not a node; there are simulation_clock, "),
    ("calibrate --shadow 1", "argument --shadow: invalid choice: 1"),
    ("calibrate --longest -5", "-5 must be between 60 and 86400"),
    ("calibrate --orbit-prior 0", "0 must be between 0.01 and 1e+06"),
    ("calibrate --fewest 0", "fewest=0 must be >= 1"),
    ("calibrate --models=", "models='' must name a folder"),
    ("calibrate --start yesterday", "yesterday"),
    ("calibrate --band S --resume", "no observations of Goldstone DSS-13 in band S to resume from in runs/models"),
    ("identify_antenna --held-out 0", "held_out=0 must be >= 1 and < sequences=8"),
    ("identify_antenna --tick 0.0009", "0.0009 must be between 0.001 and 0.1"),
    ("identify_antenna --peak-deg-s 0.01", "together must be <="),
]


@pytest.mark.parametrize(("line", "reason"), REFUSED, ids=[line for line, _ in REFUSED])
def test_what_is_refused_ends_with_2_before_anything_is_written(
    line: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("nobody.yaml").write_text("/**/nobody: {ros__parameters: {a: 1}}")
    name, *words = line.split()
    with pytest.raises(SystemExit) as ended:
        MAINS[name](words)
    assert ended.value.code == 2
    assert reason in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["nobody.yaml"]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("--speed 2", "speed=2.0: drive.type=hamlib of .* moves a device, in real time; it is for a simulated drive"),
        ("--speed max", "speed=max: drive.type=hamlib"),
        ("--seed 0", "seed=0: drive.type=hamlib"),
        ("--ephemeris-error 0", "ephemeris-error=0.0: drive.type=hamlib"),
        (f"--start {EPOCH}", f"start={EPOCH}.000Z was [0-9]+ s ago: .* the present is the default"),
    ],
)
def test_what_only_a_simulation_has_is_refused_for_a_real_drive(tmp_path: Path, line: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        request(f"{changed(tmp_path, REAL)} {line}")


def test_a_tracker_of_another_package_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    choices = dict(track.SENSOR_CHOICES)
    monkeypatch.setattr(track, "SENSOR_CHOICES", choices)
    monkeypatch.setattr(track, "load_trackers", lambda: choices.update(nose="nose"))
    assert request("--sensor nose").sensor == "nose"


# Properties

NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=60, deadline=None)
@given(speed=NUMBERS, error_s=NUMBERS, peak_deg=NUMBERS, mask_deg=NUMBERS, sigma_mdeg=NUMBERS)
def test_a_request_is_within_its_ranges_or_refused_by_name(
    speed: float, error_s: float, peak_deg: float, mask_deg: float, sigma_mdeg: float
) -> None:
    values = {"speed": speed, "ephemeris_error_s": error_s, "min_peak_deg": peak_deg, "mask_deg": mask_deg,
              "scan_sigma_mdeg": sigma_mdeg}  # fmt: skip
    ranges = {"speed": (0.1, 1000.0), "ephemeris_error_s": (-60.0, 60.0), "min_peak_deg": (0.0, 90.0),
              "mask_deg": (0.0, 89.0), "scan_sigma_mdeg": (5e-324, 1.8e308)}  # fmt: skip
    wrong = [name for name, (low, high) in ranges.items() if not low <= values[name] <= high]
    if not wrong:
        found = TrackRequest(station=DSS13, **values)
        assert found.speed == speed
    else:
        with pytest.raises(ValueError, match="|".join(name.removesuffix("_mdeg").replace("_", ".") for name in wrong)):
            TrackRequest(station=DSS13, **values)


@settings(max_examples=30, deadline=None)
@given(
    band=st.sampled_from(DSS13.bands), sensor=st.sampled_from(["monopulse", "conscan", "steptrack", "auto", "program"])
)
def test_a_request_made_of_a_request_is_the_same(band: str, sensor: str) -> None:
    """What was chosen by default stays chosen."""
    station = Station("dss13", band)
    whole = RunRequest(station=station, sensor=sensor)
    assert RunRequest(station=station, sensor=whole.sensor) == whole


# The pass


def test_the_default_is_the_first_pass_of_cbers_2_above_40_degrees() -> None:
    window = request("").window
    assert window.name == "CBERS 2"
    assert math.degrees(window.peak_elevation_rad) == pytest.approx(44.31, abs=0.01)
    assert window.aos_t_s == pytest.approx(1_151_384_323.8, abs=0.1)
    assert request("--start 2006-06-27T06:00:00").window.aos_t_s > window.los_t_s


def test_a_pass_that_was_chosen_is_the_one() -> None:
    one = DSS13.passes(elements("CBERS 2"), days=2, min_peak_deg=40.0)[0]
    assert TrackRequest(station=DSS13, target=one.target, chosen=one.window).window is one.window


def test_elements_that_are_stale_are_reported_with_the_pass() -> None:
    """Two days after their epoch; those of the first pass are 10 h old."""
    assert request("").stale_warning == ""
    assert request("--start 2006-07-01T00:00:00").stale_warning.startswith("elements of CBERS 2 are stale: 4.")


def test_a_pass_begins_above_the_horizon_of_the_station(tmp_path: Path) -> None:
    rows = [[0, 0], [60, 0], [120, 0], [147, 12], [170, 0], [250, 0], [310, 0]]
    plain = request("").window
    cut = request(changed(tmp_path, {"mount.horizon_deg": [[float(a), float(b)] for a, b in rows]})).window
    assert plain.aos_t_s + 60.0 < cut.aos_t_s < plain.tca_t_s
    hill_deg = np.interp(math.degrees(cut.aos_azimuth_rad), [120.0, 147.0, 170.0], [0.0, 12.0, 0.0])
    assert math.degrees(cut.aos_elevation_rad) == pytest.approx(hill_deg + 1.0, abs=1e-3), "a degree clear of the hill"
    assert cut.los_t_s == pytest.approx(plain.los_t_s, abs=1e-3)


def test_a_pass_of_a_real_antenna_is_that_of_the_present(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests.time, "time", lambda: parse_utc(EPOCH))
    real = changed(tmp_path, REAL)
    assert request(real).window.aos_t_s == pytest.approx(1_151_384_323.8, abs=0.1)
    later = request(f"{real} --start 2006-06-27T06:00:00")
    assert later.window.aos_t_s > parse_utc("2006-06-27T06:00:00")
    with pytest.raises(ValueError, match="was 0 s ago"):
        request(f"{real} --start 2006-06-27T03:59:59.6")


def test_the_sensor_is_one_that_the_band_has(tmp_path: Path) -> None:
    line = changed(tmp_path, {"bands.X.sensors": ["steptrack", "conscan"]})
    assert request(line).sensor == "steptrack"
    assert request(f"{line} --sensor program").sensor == "program"
    words = "sensor=monopulse: X band of Goldstone DSS-13 has steptrack, conscan, auto, pro"
    with pytest.raises(ValueError, match=words):
        request(f"{line} --sensor monopulse")


def test_the_scan_follows_from_the_accuracy_wanted_and_the_link(tmp_path: Path) -> None:
    """A weaker link makes the scan slower, then wider."""
    weak = changed(tmp_path, {"bands.Ka.zenith_carrier_to_noise_db_hz": 38.0})
    line = "--sensor conscan --band Ka --scan-sigma"
    usual, slower, wider = (request(each).scan for each in (f"{line} 0.6", f"{line} 0.6 {weak}", f"{line} 0.4 {weak}"))
    assert math.degrees(usual.radius_rad) == pytest.approx(0.00155, abs=1e-5)
    assert usual.period_s == pytest.approx(4.0)
    assert 4.0 < slower.period_s < 32.0
    assert slower.radius_rad == pytest.approx(usual.radius_rad)
    assert wider.period_s == pytest.approx(32.0)
    assert wider.radius_rad > slower.radius_rad
    assert request("").scan is None


# The time before it


def pass_from(rise_deg: float) -> Pass:
    low, high = math.radians(rise_deg), math.radians(rise_deg + 10.0)
    return Pass(
        name="bird", aos_t_s=1_151_384_323.8, tca_t_s=1_151_384_680.3, los_t_s=1_151_385_038.5, peak_elevation_rad=0.77,
        aos_azimuth_rad=low, aos_elevation_rad=math.radians(5.0), los_azimuth_rad=high, azimuth_min_rad=low,
        azimuth_max_rad=high, peak_azimuth_rate_rad_s=0.01, peak_elevation_rate_rad_s=0.003,
        peak_azimuth_acceleration_rad_s2=6e-5, smallest_range_m=1e6, rises_before=False, sets_after=False,
    )  # fmt: skip


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
    values = f"{{start_azimuth_deg: {start_deg[0]}, start_elevation_deg: {start_deg[1]}}}"
    Path("start.yaml").write_text(f"/**/antenna_servo: {{ros__parameters: {{antenna: {values}}}}}")
    found = request(f"{changed(tmp_path, changes)} --params-file start.yaml")
    assert found.before_pass_s(pass_from(rise_deg)) == needed_s


def test_a_near_pass_is_given_the_time_of_any_and_a_far_one_its_slew() -> None:
    """The first pass of 26 June begins 175 s of slewing away."""
    near, far = request(""), request("--start 2006-06-26T00:00:00")
    assert near.before_pass_s(near.window) == 150.0
    assert 205.0 <= far.before_pass_s(far.window) < 300.0


@pytest.mark.parametrize(("changes", "needed_s"), [({}, 250.0), ({"mount.elevation.command_rate_deg_s": 0.3}, 315.0)])
def test_a_real_antenna_is_given_time_for_its_longest_slew(
    tmp_path: Path, changes: dict[str, Any], needed_s: float
) -> None:
    """It may stand anywhere: 440 deg of azimuth at 2 deg/s or 85.5 deg of elevation, and 30 s to settle."""
    found = request(changed(tmp_path, REAL | changes))
    assert found.before_pass_s(pass_from(10.0)) == needed_s


# Calibration


def test_a_calibration_is_planned_on_beacons_or_on_the_satellites_that_are_given(tmp_path: Path) -> None:
    Path("sky.tle").write_text(
        "\n".join(line for one in beacons(parse_utc("2006-06-25"))[::9] for line in tle_lines(one))
    )
    given = request("--longest 7200 --fewest 5 --elements sky.tle", "calibrate")
    # Satellites of the user's do not come every ten minutes.
    assert given.campaign.acceptance_span_s == 7200.0
    assert request("--shadow 4", "calibrate").campaign.acceptance_span_s == 2400.0
    schedule = given.schedule()
    assert schedule.windows[0].aos_t_s > parse_utc(requests.CALIBRATION_START)
    assert {one.catalogue_number for one in schedule.elements} == {90001 + 9 * each for each in range(50)}


def test_a_real_antenna_is_calibrated_on_real_satellites_within_a_day_from_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Station(changed(tmp_path, REAL).split()[1])
    with pytest.raises(ValueError, match="elements='' must name satellites: the beacons of a simulated sky"):
        CalibrateRequest(station=real)
    monkeypatch.setattr(requests, "read_source", lambda _: type("Sky", (), {"elements": ["sky"]}))
    seen: list[Any] = []
    monkeypatch.setattr(requests, "schedule_calibration", lambda *given: seen.append(given))
    monkeypatch.setattr(requests.time, "time", lambda: 1.9e9)
    given = CalibrateRequest(station=real, target=Target(location="sky.tle"))
    given.schedule()
    ((_, sky, start_s, campaign, kept),) = seen
    assert (sky, start_s, campaign.longest_s, kept, given.ephemeris_error_s) == (["sky"], 1.9e9, 86400.0, None, None)
    assert utc_text(start_s).startswith("2030")
