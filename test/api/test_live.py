"""What a request makes of a live run: nodes, parameters, files and folders, and what is reported at its end."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rf_pointing_msgs.action import TrackPass

import rf_pointing.report
from rf_pointing.api import live, requests
from rf_pointing.commands import calibrate, identify_antenna, track
from rf_pointing.core.dates import parse_utc
from rf_pointing.identification import Recording
from rf_pointing.report import calibration_report
from rf_pointing.ros.campaign_run import CalibrationOutcome
from rf_pointing.ros.experiment_run import EndedEarlyError
from rf_pointing.ros.graph import ARRAY_NODES, DRIVE_NODES, NODES
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.station.description import read_station
from test.api.test_live_requests import REAL, changed
from test.ros.fake_station import FakeStation, fake

__all__ = ["fake"]


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def request(line: str) -> Any:
    return track.request_of(line.split())


def setup_of(line: str, tmp_path: Path) -> Any:
    found = request(line)
    window = found.window
    begin_s = math.floor(window.aos_t_s) - found.before_pass_s(window)
    return live.run_setup("track", found, tmp_path, begin_s, window.name)


def parameters(line: str, tmp_path: Path) -> dict[str, dict[str, Any]]:
    """Return what the file of a run says to every node."""
    sections = yaml.safe_load(setup_of(line, tmp_path).parameter_files[0].read_text())
    return {name.removeprefix("/**/"): section["ros__parameters"] for name, section in sections.items()}


def test_nodes_of_an_array_run_where_the_band_has_one(tmp_path: Path) -> None:
    assert live.nodes_of(request("")) == NODES
    assert live.nodes_of(request("--station rotator_2m")) == (*NODES, *ARRAY_NODES)
    # A real array has receivers of its own, and what tracks by no signal needs no tracker.
    real = live.nodes_of(request(changed(tmp_path, REAL, "rotator_2m")))
    assert real == (*(name for name in DRIVE_NODES if name != "monopulse_tracker"), *ARRAY_NODES[1:])
    yagi = live.nodes_of(request(changed(tmp_path, REAL, "vhf_uhf_yagi")))
    assert yagi == tuple(name for name in DRIVE_NODES if not name.endswith("_tracker"))


def test_the_request_reaches_the_nodes_as_parameters(tmp_path: Path) -> None:
    line = "--seed 5 --speed 10 --mask 40 --min-peak 41 --band Ka --ephemeris-error 2 --interpolation lagrange 9"
    given = parameters(f"{line} {changed(tmp_path, {'wind.gust_limit_m_s': 21.0})}", tmp_path)
    assert set(given) == set(NODES)
    own = {(values["station"], values["band"]) for node, values in given.items() if node != "simulation_clock"}
    assert own == {(str(tmp_path / "station.yaml"), "Ka")}
    station = read_station(tmp_path / "station.yaml")
    assert station.parameters("ephemeris_publisher", "Ka")["publisher.mask_deg"] == 40.0
    assert station.content.wind.gust_limit_m_s == 21.0
    assert given["antenna_servo"]["antenna.seed"] == given["rf_receiver"]["signal.seed"] == 5
    assert given["simulation_clock"]["speed"] == 10.0
    assert given["pointing_controller"]["certificate_folder"] == str(tmp_path)
    for node in ("ephemeris_publisher", "rf_receiver"):
        values = given[node]
        # A catalogue number stays a text.
        assert values["source.satellite"] == "28057"
        assert (values["source.interpolation"], values["source.interpolation_degree"]) == ("LAGRANGE", 9)
    # The error of the ephemeris is that of the receiver alone.
    name = "source.along_track_offset_s"
    assert [node for node, values in given.items() if name in values] == ["rf_receiver"]
    assert given["rf_receiver"][name] == 2.0


def test_what_is_not_given_has_its_default_in_every_node(tmp_path: Path) -> None:
    given = parameters("--models=", tmp_path)
    assert given["antenna_servo"]["antenna.seed"] == given["rf_receiver"]["signal.seed"] == 1
    key = str(tmp_path / "command.key")
    assert given["antenna_servo"]["command_key_file"] == given["pointing_controller"]["command_key_file"] == key
    assert given["bias_calibrator"]["calibrator.folder"] == ""
    assert given["bias_calibrator"]["calibrator.keep_observations"] is False
    assert given["ephemeris_publisher"]["source.elements"] == ""
    assert "source.along_track_offset_s" not in given["rf_receiver"]
    found = request("")
    start_s = np.floor(found.window.aos_t_s) - 150.0
    # Floats, as the clock declares them.
    assert given["simulation_clock"] == {"start_s": start_s, "speed": 0.0, "tick_s": 0.1}
    assert read_station(tmp_path / "station.yaml").digest == read_station("dss13").digest


@pytest.mark.parametrize(("speed", "tick_s", "punctual"), [("1", 0.02, True), ("max", 0.1, False), ("50", 0.1, False)])
def test_near_real_time_the_clock_ticks_with_the_servo(
    speed: str, tick_s: float, punctual: bool, tmp_path: Path
) -> None:
    assert parameters(f"--speed {speed}", tmp_path)["simulation_clock"]["tick_s"] == tick_s
    assert setup_of(f"--speed {speed}", tmp_path).punctual == punctual


def test_controller_and_tracker_are_told_the_same_scan(tmp_path: Path) -> None:
    given = parameters("--sensor conscan --band Ka --scan-sigma 0.6", tmp_path)
    station = read_station(given["conscan_tracker"]["station"])
    first, second = (
        {key: value for key, value in station.parameters(node, "Ka").items() if key.startswith("conscan.")}
        for node in ("pointing_controller", "conscan_tracker")
    )
    assert first == second
    assert first["conscan.period_s"] == pytest.approx(4.0)


def test_a_real_drive_runs_without_clock_and_receiver_and_remembers_its_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests.time, "time", lambda: parse_utc("2006-06-27T04:00:00"))
    setup = setup_of(f"{changed(tmp_path, REAL)} --namespace roof --reset-fault", tmp_path)
    assert (setup.simulated, setup.reset_fault, setup.punctual, setup.nodes) == (False, True, True, DRIVE_NODES)
    assert setup.notes == {"station": "Goldstone DSS-13", "band": "X", "sensor": "monopulse", "drive": "hamlib"}
    sections = yaml.safe_load(setup.parameter_files[0].read_text())
    servo = sections["/**/antenna_servo"]["ros__parameters"]
    assert set(sections) == {f"/**/{name}" for name in DRIVE_NODES}
    assert servo["state_file"].startswith(str(tmp_path / "state" / "rf_pointing"))
    assert servo["wrap_file"].endswith("/roof/azimuth_turn.json")
    assert "antenna.seed" not in servo


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("", {"speed": "max", "seed": "1", "sensor": "monopulse"}),
        ("--speed 2 --seed 0 --sensor program", {"speed": "2", "seed": "0", "sensor": "program"}),
    ],
)
def test_a_bag_has_notes_on_its_run(line: str, wanted: dict[str, str], tmp_path: Path) -> None:
    assert setup_of(line, tmp_path).notes == {"station": "Goldstone DSS-13", "band": "X", **wanted}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("simulation_clock: {ros__parameters: {tick_s: 0.1}}", "simulation_clock tick_s: given by the command line"),
        ("ephemeris_publisher: {ros__parameters: {band: S}}", "ephemeris_publisher band: given by the command line"),
        ("antenna_srvo: {ros__parameters: {wind.mean_speed_m_s: 1.0}}", "antenna_srvo is not a node; there are"),
        ("rf_receiver: {ros__parameters: {signal: {seed: 3}}}", "rf_receiver signal.seed: given by the command line"),
        (
            "pointing_controller: {ros__parameters: {limits: {elevation_min_deg: 1.0}}}",
            "limits.elevation_min_deg is given by the station description: mount.elevation.travel_deg",
        ),
    ],
)
def test_what_a_parameter_file_says_is_in_force_or_refused(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(f"/**/{text}")
    with pytest.raises(ValueError, match=complaint):
        live.check_files(request(f"--params-file {file}"))
    for node in ("/**/antenna_servo", "/**"):
        file.write_text(f"{node}: {{ros__parameters: {{wind.mean_speed_m_s: 3.0}}}}")
        live.check_files(request(f"--params-file {file}"))
    # Over all others.
    assert setup_of(f"--params-file {file}", tmp_path).parameter_files[-1] == file


def test_a_folder_is_new_or_has_no_bag(tmp_path: Path) -> None:
    (tmp_path / "old" / "bag").mkdir(parents=True)
    for line, complaint in (("--record old --output out", "record=old exists already"),
                            ("--output old", "output=old holds a bag already")):  # fmt: skip
        with pytest.raises(ValueError, match=complaint):
            live.output_folder(request(line), "run")
    assert not (tmp_path / "out").exists()
    deep = request("--output a/b")
    assert [live.output_folder(deep, "run") for _ in range(2)] == [Path("a/b")] * 2
    elsewhere = request("--output old --record mine")
    assert live.output_folder(elsewhere, "run") == Path("old")
    assert live.run_setup("track", elsewhere, Path("old"), 0.0, "").bag == Path("mine")
    # Every run without a folder gets one of its own.
    assert [str(live.output_folder(request(""), "run")) for _ in range(2)] == ["runs/run-01", "runs/run-02"]


# A pass


@pytest.fixture
def reports(fake: FakeStation, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path, Path]]:
    """Let a station fly a pass; return bag and folder of every report."""
    made: list[tuple[Path, Path]] = []
    monkeypatch.setattr(rf_pointing.report, "write_report", lambda bag, folder: made.append((bag, folder)))
    fake.results["track_pass"] = TrackPass.Result(success=True, message="loss of signal", predicted_loss=-1.0)
    return made


def track_main(line: str) -> int:
    with pytest.raises(SystemExit) as ended:
        track.main(line.split())
    assert isinstance(ended.value.code, int)
    return ended.value.code


@pytest.mark.parametrize("success", [True, False])
def test_a_pass_is_flown_and_reported(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str], success: bool
) -> None:
    fake.results["track_pass"].success = success
    assert track_main("--sensor conscan --band Ka --scan-sigma 0.6") == (0 if success else 1)
    folder = Path("runs/28057-20060627T045843-01")
    first, scan, *_, report, outcome = capsys.readouterr().err.splitlines()
    assert first == (
        "track: CBERS 2 over Goldstone DSS-13, Ka band, conscan: AOS 2006-06-27T04:58:43.813Z, 715 s, peak 44.3 deg"
    )
    assert scan == "track: scan of 1.55 mdeg in 4.0 s, an estimate over 8.0 s"
    assert report == f"track: report {folder}/report.html, bag {folder}/bag"
    assert outcome.startswith(f"track: {'' if success else 'NOT '}tracked: loss of signal; 0 s held")
    assert reports == [(folder / "bag", folder)]
    ((_, goal),) = fake.goals
    assert (goal.sensor, goal.target_pass.target) == ("conscan", "CBERS 2")
    # Time runs when the goal is certified, and stops with the nodes.
    assert fake.log[-5:-1] == ["track_pass", ("activate", NODES[:1]), "stop", "bag closed"]


def test_a_pass_that_did_not_start_ends_with_2_and_has_no_report(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    fake.results["track_pass"] = None
    assert track_main("") == 2
    assert "the goal was refused: the last line of pointing_controller" in capsys.readouterr().err
    assert (reports, fake.recorder.closed) == ([], True)


# A calibration


@pytest.fixture(scope="module")
def small() -> Any:
    """Return the schedule of a small campaign."""
    return calibrate.request_of(["--longest", "600", "--fewest", "2", "--shadow", "2"]).schedule()


@pytest.fixture
def ready(small: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> live.Calibration:
    monkeypatch.setattr("rf_pointing.api.requests.schedule_calibration", lambda *_: small)
    return live.prepare_calibration(calibrate.request_of(["--output", "out", "--shadow", "2"]))


def test_the_satellites_and_numbers_of_a_calibration_are_in_its_folder(
    ready: live.Calibration, small: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    sky = Path("out/satellites.tle").read_text().splitlines()
    assert sky[::3] == [one.name for one in small.elements]
    given = yaml.safe_load(Path("out/run.yaml").read_text())
    publisher, calibrator = (
        given[f"/**/{name}"]["ros__parameters"] for name in ("ephemeris_publisher", "bias_calibrator")
    )
    assert publisher["source.elements"] == str(Path("out/satellites.tle").resolve())
    assert publisher["source.satellite"] == str(small.elements[0].catalogue_number)
    assert calibrator["calibrator.keep_observations"]
    assert given["/**/rf_receiver"]["ros__parameters"]["source.along_track_offset_s"] == 0.0
    assert [path.name for path in ready.setup.parameter_files] == ["run.yaml", "calibrator.yaml"]
    assert (ready.setup.awaited, ready.setup.program) == ("the first pass", "calibrate")
    assert ready.setup.begin_s < small.windows[0].aos_t_s - 150.0 + 1e-6


FIT: Any = ("points", "fit")


@pytest.mark.parametrize(
    ("outcome", "kept", "report", "said"),
    [
        (CalibrationOutcome("new", FIT, True, "better"), True,
         ("points", "fit", "new", ["In the shadow of the model in force: better"]), []),
        (CalibrationOutcome("new", FIT, False, "no better"), True,
         ("points", "fit", "new", ["In the shadow of the model in force: no better"]), ["kept in observations.csv"]),
        (CalibrationOutcome("new", FIT), False, ("points", "fit", "new", []), []),
        (CalibrationOutcome(fault="drive: overload", why=("it ended",)), True, ("kept", ("it ended",)),
         ["kept in observations.csv", "NOT calibrated: drive: overload"]),
        # Where nothing was kept there is nothing to resume.
        (CalibrationOutcome(why=("it ended",)), False, (None, ("it ended",)), []),
    ],
)  # fmt: skip
def test_every_outcome_of_a_calibration_is_reported(
    outcome: CalibrationOutcome,
    kept: bool,
    report: Any,
    said: list[str],
    ready: live.Calibration,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    written: list[Any] = []

    def calibration(_folder: Path, points: Any, fit: Any, *, name: str, remarks: list[str]) -> str:
        written.append((points, fit, name, remarks))
        return "report.html"

    monkeypatch.setattr(live, "run_to_end", lambda _program, make, work: work(make()))
    monkeypatch.setattr(live, "CalibrationRun", lambda *_, **__: SimpleNamespace(calibrate=lambda: outcome))
    journal = SimpleNamespace(points="kept" if kept else None, path="observations.csv")
    monkeypatch.setattr(live, "journal_of", lambda *_: journal)
    monkeypatch.setattr(calibration_report, "write_calibration_report", calibration)
    monkeypatch.setattr(
        calibration_report, "write_campaign_report", lambda _folder, *given: written.append(given) or "campaign.html"
    )
    found = ready.observe()
    assert (found.code, found.outcome) == (0 if outcome.settled else 1, outcome)
    assert written == [report]
    shown = capsys.readouterr().err
    assert [text for text in ("kept in observations.csv", "NOT calibrated: drive: overload") if text in shown] == said
    assert f"calibrate: report {found.report}" in shown


# An identification


def recording_of(axis: str) -> Recording:
    random = np.random.default_rng(2)
    rates = random.normal(0.0, 1e-3, (2, 64))
    encoders = np.zeros((2, 64, 2))
    encoders[..., 0] = np.cumsum(rates, axis=1) * 0.02
    return Recording(axis, 0.02, rates, encoders)


class Experiments:
    """Runs whose axes are recorded at once, or fail with `error`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.error: Exception | None = None
        self.started: list[Any] = []
        monkeypatch.setattr(live, "ExperimentRun", lambda *_: self)
        monkeypatch.setattr(live, "run_to_end", self._run)
        self.record = recording_of

    def _run(self, _program: str, make: Any, work: Any) -> int:
        try:
            return int(work(make()))
        except NotStartedError:
            return 2

    def start_antenna(self, servo: Any, files: Any, output: Path) -> None:
        self.started.append((servo, files, output))

    def find_antenna(self) -> None:
        if self.error is not None:
            raise self.error

    def say(self, text: str) -> None:
        print(text)


@pytest.fixture
def experiments(monkeypatch: pytest.MonkeyPatch) -> Experiments:
    return Experiments(monkeypatch)


def identify_main(line: str) -> int:
    with pytest.raises(SystemExit) as ended:
        identify_antenna.main(
            [*["--sequences", "2", "--held-out", "1", "--samples", "64", "--output", "out"], *line.split()]
        )
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_the_models_of_both_axes_are_left_with_the_recordings(
    experiments: Experiments, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    studied: list[Any] = []
    monkeypatch.setattr(live, "study", lambda *given: studied.append(given) or [])
    assert identify_main("--simulated --tick 0.05 --band S --params-file mine.yaml") == 0
    with np.load("out/recordings.npz") as saved:
        assert saved["elevation_input_rad_s"].shape == (2, 64)
    ((recordings, held_out),) = studied
    assert (sorted(recordings), held_out) == (["azimuth", "elevation"], 1)
    assert Path("out/models.json").is_file()
    assert "valid band" in capsys.readouterr().out
    servo = {"station": str(read_station("dss13").path.resolve()), "band": "S", "wind.mean_speed_m_s": 0.3,
             "antenna.tick_s": 0.05}  # fmt: skip
    assert experiments.started == [(servo, [Path("mine.yaml")], Path("out"))]


def test_recordings_without_a_model_are_kept(
    experiments: Experiments, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: Any) -> None:
        raise ValueError("azimuth: no coherence")

    monkeypatch.setattr(live, "study", refuse)
    assert identify_main("") == 1
    assert [path.name for path in Path("out").iterdir()] == ["recordings.npz"]
    assert "identify_antenna: no model: azimuth: no coherence" in capsys.readouterr().err
    assert experiments.started == []


@pytest.mark.parametrize(("error", "code"), [(EndedEarlyError("in the wind"), 1), (NotStartedError("nobody"), 2)])
def test_an_experiment_that_did_not_end_leaves_nothing(experiments: Experiments, error: Exception, code: int) -> None:
    experiments.error = error
    assert identify_main("") == code
    assert list(Path("out").iterdir()) == []
