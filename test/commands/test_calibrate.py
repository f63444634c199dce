"""What `calibrate` plans, how it goes on with an interrupted campaign, and what it does with each outcome.

A run has a graph and a calibrator of the test's own.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import PointingModel
from std_srvs.srv import Trigger

from rf_pointing.calibration import BiasModel, CandidatePass, Observations, SectorRule, read_model
from rf_pointing.commands import calibrate, station_run, track_options
from rf_pointing.commands.calibrate import CalibrationRun, Outcome, Schedule
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import TopocentricTrack, find_passes, site, tle_lines, verification_elements
from rf_pointing.report import calibration_report
from rf_pointing.station.description import read_station


@pytest.fixture
def few_beacons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave every fifth beacon in the sky."""
    whole = calibrate.beacons
    monkeypatch.setattr(calibrate, "beacons", lambda epoch_t_s: whole(epoch_t_s)[::5])


def options(tmp_path: Path, *more: str):
    return calibrate.arguments(["--longest", "1200", "--fewest", "10", "--models", str(tmp_path), *more])


def points_of(one: CandidatePass, number: int) -> Observations:
    """Return what a calibrator would have kept of a piece of a pass."""
    track = one.track
    return Observations(
        station="Goldstone DSS-13", band="X", t_s=track.t_s, pass_id=np.full(len(track.t_s), number),
        observed_azimuth_rad=track.azimuth_rad, observed_elevation_rad=track.elevation_rad,
        true_azimuth_rad=track.azimuth_rad, true_elevation_rad=track.elevation_rad,
        azimuth_rate_rad_s=track.azimuth_rate_rad_s, elevation_rate_rad_s=track.elevation_rate_rad_s,
        azimuth_acceleration_rad_s2=track.azimuth_acceleration_rad_s2,
        elevation_acceleration_rad_s2=track.elevation_acceleration_rad_s2,
        sigma_azimuth_rad=np.full(len(track.t_s), 1e-5), sigma_elevation_rad=np.full(len(track.t_s), 1e-5),
    )  # fmt: skip


def in_sector(points: Observations, sector: int) -> Observations:
    """Return the points all at rest in the middle of one of the 36 sectors."""
    azimuth, low, high = (
        np.radians(30.0 * (sector % 12) + 15.0),
        *np.radians(((10, 30), (30, 60), (60, 80))[sector // 12]),
    )
    angles = {"azimuth_rad": np.full(len(points), azimuth), "elevation_rad": np.full(len(points), 0.5 * (low + high))}
    angles = {f"{kind}_{name}": value for kind in ("observed", "true") for name, value in angles.items()}
    at_rest = {
        f"{axis}_{name}": np.zeros(len(points))
        for axis in ("azimuth", "elevation")
        for name in ("rate_rad_s", "acceleration_rad_s2")
    }
    return replace(points, **angles, **at_rest)


@pytest.mark.usefixtures("few_beacons")
def test_an_interrupted_campaign_goes_on_after_its_last_observation_where_the_sky_is_thin(tmp_path: Path) -> None:
    schedule = calibrate.plan(options(tmp_path))
    whole, windows = schedule.campaign, schedule.windows
    done = whole.passes[: len(whole.passes) // 2]
    assert done
    journal = calibrate.journal_of(options(tmp_path))
    for number, one in enumerate(done):
        journal.append(points_of(one, number))

    resumed = calibrate.plan(options(tmp_path, "--resume"))
    rest, remaining = resumed.campaign, resumed.windows
    kept = calibrate.journal_of(options(tmp_path)).points
    before = SectorRule(fewest=10).coverage(kept.true_azimuth_rad, kept.true_elevation_rad)
    assert remaining[0].aos_t_s > kept.t_s[-1]
    assert windows[0].aos_t_s > parse_utc(calibrate.DEFAULT_START)
    assert set(rest.coverage.thin) < set(before.thin)
    for one in rest.passes:
        seen = SectorRule(fewest=10).coverage(one.track.azimuth_rad, one.track.elevation_rad)
        assert any(seen.counts[sector] for sector in before.thin), "a piece that only fills what is full already"
    assert np.all(rest.coverage.counts >= before.counts)


@pytest.mark.usefixtures("few_beacons")
def test_the_shadow_is_tracked_after_the_campaign(tmp_path: Path) -> None:
    schedule = calibrate.plan(options(tmp_path, "--shadow", "2"))
    assert len(schedule.shadow) == 2
    assert schedule.shadow[0].aos_t_s > schedule.windows[-1].los_t_s
    assert schedule.shadow[1].aos_t_s > schedule.shadow[0].los_t_s
    assert "2 more in the shadow" in calibrate.plan_text(schedule)


@pytest.mark.usefixtures("few_beacons")
def test_a_campaign_that_is_complete_is_resumed_with_the_fit(tmp_path: Path) -> None:
    journal = calibrate.journal_of(options(tmp_path))
    track = calibrate.plan(options(tmp_path)).campaign.passes[0]
    for number, sector in enumerate(range(36)):
        journal.append(in_sector(points_of(track, number).select(np.arange(10)), sector))
    schedule = calibrate.plan(options(tmp_path, "--resume"))
    assert schedule.windows == []
    assert len(schedule.shadow) == 3
    assert calibrate.plan_text(schedule).startswith("36 of 36 sectors are full already; 3 more in the shadow")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--shadow", "1"], "shadow=1 must be >= 2"),
        (["--longest", "-5"], "longest=-5.0 must be >= 60"),
        (["--longest", "nan"], "longest=nan must be finite"),
        (["--orbit-prior", "0"], "orbit_prior=0.0 must be >= 0.01"),
        (["--fewest", "0"], "fewest=0 must be >= 1"),
        (["--models", ""], "models='' must name a folder"),
        (["--start", "yesterday"], "yesterday"),
        (["--speed", "fast"], "speed='fast' must be a factor or max"),
    ],
)
def test_wrong_options_are_refused_in_words_before_anything_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--models", str(tmp_path), "--output", str(tmp_path / "out"), *arguments])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_without_observations_there_is_nothing_to_resume(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no observations of Goldstone DSS-13 in band S to resume from"):
        calibrate.plan(options(tmp_path, "--resume", "--band", "S"))


@pytest.mark.usefixtures("few_beacons")
def test_its_options_are_all_that_a_run_of_the_station_asks_for(tmp_path: Path) -> None:
    """The run is `track`'s: an option that only that one has must have a value here."""
    given = options(tmp_path, "--band", "S", "--seed", "4")
    schedule = calibrate.plan(given)
    given.elements = str(tmp_path / "beacons.tle")
    Path(given.elements).write_text(
        "\n".join(line for one in schedule.elements for line in (one.name, *tle_lines(one)))
    )
    values = track_options.parameters(given, schedule.windows[0], tmp_path)
    assert values["rf_receiver"]["signal.seed"] == 4
    assert values["bias_calibrator"]["calibrator.keep_observations"]
    assert values["bias_calibrator"]["band"] == "S"
    assert track_options.parameter_files(given, values, tmp_path) == [tmp_path / "run.yaml"]
    assert track_options.notes(given)["band"] == "S"
    assert track_options.bag_folder(given, tmp_path) == tmp_path / "bag"


def test_a_real_antenna_is_calibrated_on_real_satellites(tmp_path: Path) -> None:
    station = tmp_path / "roof.yaml"
    read_station("dss13").write(station, {"drive.type": "hamlib", "wind.anemometer": False})
    line = ["--station", str(station), "--start", "2006-06-25T00:00:00", "--longest", "7200"]
    with pytest.raises(ValueError, match="elements='' must name satellites: the beacons of a simulated sky"):
        calibrate.plan(options(tmp_path, *line))
    sky = tmp_path / "sky.tle"
    sky.write_text(
        "\n".join(line for one in calibrate.beacons(parse_utc("2006-06-25"))[::9] for line in tle_lines(one))
    )
    schedule = calibrate.plan(options(tmp_path, *line, "--elements", str(sky)))
    assert schedule.windows
    assert len(schedule.shadow) == 3
    assert {one.catalogue_number for one in schedule.elements} == {90001 + 9 * each for each in range(50)}


START_S = parse_utc(calibrate.DEFAULT_START)
NOW_S = 1.9e9


def window(aos_t_s: float, los_t_s: float) -> Any:
    return SimpleNamespace(aos_t_s=aos_t_s, los_t_s=los_t_s)


class Planner:
    """The sky of a plan: `windows` for the fit, `rest` for the shadow, and what was requested of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.windows = [window(START_S + 500.0 * k, START_S + 500.0 * k + 60.0) for k in range(1, 5)]
        self.rest = [window(START_S + 9000.0 + 500.0 * k, START_S + 9060.0 + 500.0 * k) for k in range(20)]
        self.thin: tuple[int, ...] = (3,)
        self.requests: list[tuple[Any, ...]] = []
        monkeypatch.setattr(calibrate, "planned", self._planned)
        monkeypatch.setattr(calibrate, "windows_of", lambda _options, _elements, campaign: list(campaign.passes))
        monkeypatch.setattr(calibrate, "time", SimpleNamespace(time=lambda: NOW_S))

    def _planned(
        self,
        _options: argparse.Namespace,
        elements: list[Any],
        begin_s: float,
        span_s: float,
        arcs_s: tuple[float, ...],
        rule: SectorRule,
        filled: Any = None,
    ) -> Any:
        self.requests.append((len(elements), begin_s, span_s, arcs_s, rule.fewest, rule.most, filled))
        passes = self.windows if len(self.requests) == 1 else self.rest
        return SimpleNamespace(passes=passes, coverage=SimpleNamespace(thin=self.thin))


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> Planner:
    return Planner(monkeypatch)


def test_without_options_a_simulated_sky_is_filled_in_eighty_minutes(planner: Planner, tmp_path: Path) -> None:
    given = calibrate.arguments(["--models", str(tmp_path)])
    schedule = calibrate.plan(given)
    fit, shadow = planner.requests
    assert fit == (450, START_S + 180.0, 4800.0, (60.0, 120.0, 240.0), 25, 30, None)
    assert shadow == (450, planner.windows[-1].los_t_s + 180.0, 1800.0, (60.0,), 25, 30, None)
    assert schedule.windows == planner.windows
    assert schedule.shadow == planner.rest[:3]
    assert given.ephemeris_error == 0.0


def test_the_options_have_the_values_of_their_help() -> None:
    given = calibrate.arguments([])
    assert (given.fewest, given.shadow, given.orbit_prior) == (25, 3, 5.0)
    assert (given.models, given.namespace, given.station) == ("runs/models", "/gs1", "dss13")
    unset = (given.sensor, given.start, given.longest, given.ephemeris_error, given.output, given.band, given.seed)
    assert unset == (None,) * 7
    assert (given.elements, given.params_file, given.resume) == ("", [], False)
    assert given.keep_observations


def test_options_of_the_user_are_kept(planner: Planner, tmp_path: Path) -> None:
    line = "--sensor auto --fewest 40 --ephemeris-error 2 --orbit-prior 0.01 --shadow 2 --longest 60 --namespace x"
    line += " --start 2006-06-26T00:00:00 --speed 2 --params-file a.yaml --params-file b.yaml"
    given = calibrate.arguments([*line.split(), "--models", str(tmp_path)])
    schedule = calibrate.plan(given)
    fit, shadow = planner.requests
    assert fit == (450, START_S + 86400.0 + 180.0, 60.0, (60.0, 120.0, 240.0), 40, 40, None)
    assert shadow[2] == 1200.0
    assert len(schedule.shadow) == 2
    assert (given.ephemeris_error, given.sensor, given.namespace, given.speed) == (2.0, "auto", "/x", "2")
    assert given.params_file == ["a.yaml", "b.yaml"]


@pytest.mark.parametrize("line", ["--shadow 20", "--longest 86400", "--orbit-prior 1e6", "--ephemeris-error -60"])
def test_the_ends_of_the_ranges_are_taken(line: str, planner: Planner, tmp_path: Path) -> None:
    schedule = calibrate.plan(calibrate.arguments([*line.split(), "--models", str(tmp_path)]))
    assert schedule.windows == planner.windows


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("--shadow 21", "shadow=21 must be <= 20"),
        ("--longest 86401", "longest=86401.0 must be <= 86400"),
        ("--longest 59.9", "longest=59.9 must be >= 60"),
        ("--orbit-prior 1.1e6", "orbit_prior=1100000.0 must be <= 1000000"),
    ],
)
def test_beyond_the_ranges_nothing_is_planned(line: str, complaint: str, planner: Planner, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=complaint):
        calibrate.plan(calibrate.arguments([*line.split(), "--models", str(tmp_path)]))
    assert planner.requests == []


@pytest.mark.parametrize("error", ["-61", "61"])
def test_beacons_are_at_most_a_minute_off(error: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        calibrate.arguments(["--ephemeris-error", error])
    assert ended.value.code == 2
    assert f"{error} must be between -60 and 60" in capsys.readouterr().err


@pytest.mark.parametrize(("start", "begin_s"), [(None, NOW_S), ("2006-06-26T00:00:00", START_S + 86400.0)])
def test_a_real_antenna_has_a_day_from_now(start: str | None, begin_s: float, planner: Planner, tmp_path: Path) -> None:
    station, sky = tmp_path / "roof.yaml", tmp_path / "sky.tle"
    read_station("dss13").write(station, {"drive.type": "hamlib", "wind.anemometer": False})
    sky.write_text("\n".join(line for one in verification_elements()[:2] for line in tle_lines(one)))
    line = ["--station", str(station), "--elements", str(sky), "--models", str(tmp_path)]
    given = calibrate.arguments([*line, *(["--start", start] if start else [])])
    calibrate.plan(given)
    fit, shadow = planner.requests
    assert fit[:3] == (2, begin_s + 180.0, 86400.0)
    # Satellites of the user's do not come every ten minutes.
    assert shadow[2] == 86400.0
    assert given.ephemeris_error is None


def test_a_campaign_begins_after_the_last_observation_when_it_is_resumed(planner: Planner, tmp_path: Path) -> None:
    given = options(tmp_path, "--resume")
    points = in_sector(resting(10, START_S + 3000.0), 7)
    calibrate.journal_of(given).append(points)
    calibrate.plan(given)
    fit, shadow = planner.requests
    assert fit[1] == points.t_s[-1] + 180.0
    assert fit[6].tolist() == [10 if sector == 7 else 0 for sector in range(36)]
    assert shadow[6] is None


def test_a_full_sky_needs_the_shadow_alone_and_an_empty_one_is_refused(planner: Planner, tmp_path: Path) -> None:
    planner.windows, planner.thin = [], ()
    schedule = calibrate.plan(options(tmp_path))
    assert schedule.windows == []
    # From the begin of a campaign that has nothing to do.
    assert planner.requests[1][1] == START_S + 360.0
    planner.thin = (3,)
    planner.requests.clear()
    with pytest.raises(ValueError, match=r"longest=1200\.0 s leaves no satellite to track"):
        calibrate.plan(options(tmp_path))


def test_the_shadow_has_all_its_passes_or_is_refused(planner: Planner, tmp_path: Path) -> None:
    del planner.rest[3:]
    assert len(calibrate.plan(options(tmp_path)).shadow) == 3
    del planner.rest[2:]
    planner.requests.clear()
    with pytest.raises(ValueError, match="shadow=3: only 2 passes can be tracked after the campaign"):
        calibrate.plan(options(tmp_path))


def test_pieces_of_passes_are_high_enough_and_leave_time_for_acquisition(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(calibrate, "candidate_arcs", lambda *given: seen.append(given) or (["arc"], None))
    planned: list[Any] = []
    monkeypatch.setattr(calibrate.calibration, "plan_campaign", lambda *given: planned.append(given) or "campaign")
    rule, filled = SectorRule(), np.arange(36)
    assert calibrate.planned(options(tmp_path), [], START_S, 600.0, (60.0,), rule, filled) == "campaign"
    ((elements, place, begin_s, span_s, arcs),) = seen
    assert (elements, place, begin_s, span_s) == ([], read_station("dss13").site, START_S, 600.0)
    assert (arcs.arcs_s, arcs.every_s, arcs.spacing_s, arcs.lead_s) == ((60.0,), 60.0, 0.5, 45.0)
    assert math.degrees(arcs.lowest_rad) == pytest.approx(11.0)
    ((candidates, the_rule, slew, already),) = planned
    assert (candidates, the_rule) == (["arc"], rule)
    assert already is filled
    assert slew.settle_s == 55.0
    assert np.degrees(slew.travel_rad) == pytest.approx([-220.0, 220.0])


def schedule_of(windows: int = 4, shadow: int = 3) -> Schedule:
    """Return real passes of CBERS-2 as the plan."""
    elements = next(one for one in verification_elements() if one.catalogue_number == 28057)
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    found = find_passes(track, elements.epoch_t_s, 3 * 86400.0, math.radians(10.0))
    coverage = SectorRule().coverage(np.zeros(0), np.zeros(0))
    campaign: Any = SimpleNamespace(coverage=coverage)
    return Schedule([elements, *verification_elements()[:1]], campaign, found[:windows], found[windows:][:shadow])


def test_the_plan_reads_as_a_line() -> None:
    schedule = schedule_of()
    text = calibrate.plan_text(schedule)
    utc = [calibrate.utc_text(t_s) for t_s in (schedule.windows[0].aos_t_s, schedule.windows[-1].los_t_s)]
    last = calibrate.utc_text(schedule.shadow[-1].los_t_s)
    assert text == f"4 passes from {utc[0]} to {utc[1]} fill 0 of 36 sectors; 3 more in the shadow until {last}"


def resting(count: int, t_s: float) -> Observations:
    """Return points of one pass, observed where they are."""
    zero, some = np.zeros(count), np.full(count, 0.5)
    return Observations(
        station="Goldstone DSS-13", band="X", t_s=t_s + np.arange(float(count)), pass_id=np.zeros(count, dtype=np.int64),
        observed_azimuth_rad=some, observed_elevation_rad=some, true_azimuth_rad=some, true_elevation_rad=some,
        azimuth_rate_rad_s=zero, elevation_rate_rad_s=zero, azimuth_acceleration_rad_s2=zero,
        elevation_acceleration_rad_s2=zero, sigma_azimuth_rad=np.full(count, 1e-5),
        sigma_elevation_rad=np.full(count, 1e-5),
    )  # fmt: skip


def test_the_calibrator_takes_the_numbers_of_the_campaign(tmp_path: Path) -> None:
    given = options(tmp_path, "--orbit-prior", "7", "--shadow", "4")
    path = calibrate.calibrator_parameters(tmp_path / "calibrator.yaml", given)
    assert yaml.safe_load(path.read_text())["/**/bias_calibrator"]["ros__parameters"] == {
        "orbit": {"along_track_m": 7.0, "cross_track_m": 7.0, "radial_m": 7.0},
        "calibrator": {"spacing_s": 0.5, "settle_s": 25.0},
        "shadow": {"fewest_passes": 4, "accept": "better"},
    }


def test_the_fit_of_the_report_starts_at_the_model_in_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = options(tmp_path)
    points = resting(30, START_S)
    calibrate.journal_of(given).append(points)
    fitted: list[Any] = []

    def fit(log: Any, present: BiasModel, *, pass_priors: Any) -> str:
        fitted.append((dict(present.coefficients), pass_priors.sigma.tolist()[:3], log.station, log.band))
        return "fit"

    monkeypatch.setattr(calibrate.CalibrationLog, "fit", fit)
    found, result = calibrate.fit_of(given)
    assert (len(found), result) == (30, "fit")
    file = read_station("dss13").bias_model_file("X")
    assert file is not None
    assert fitted == [(dict(read_model(file).model.coefficients), [5.0, 5.0, 5.0], "Goldstone DSS-13", "X")]


class Later:
    """A future that is done."""

    def __init__(self, value: Any) -> None:
        self._value = value

    def done(self) -> bool:
        return True

    def result(self) -> Any:
        return self._value


class Graph:
    """Processes, actions and services of a station: `events` is what happened, in order."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.campaigns = [
            RunCampaign.Result(success=True, message="campaign done", observations=900),
            RunCampaign.Result(success=True, message="shadow done", passes_observed=3, verdict="better"),
        ]
        self.fit = FitModel.Result(success=True, message="fitted", model=PointingModel(name="new"))
        self.accepted = True
        self.goals: list[Any] = []
        self.feedback: Any = None

    def begin(self, *_given: Any, **_named: Any) -> "Graph":
        return self

    def start(self, _names: Any, simulated_time: bool = True) -> None:
        self.events.append("start" if simulated_time else "start in real time")

    def configure(self, _names: Any) -> None:
        pass

    def activate(self, _names: Any) -> None:
        pass

    def check(self) -> None:
        pass

    def wait(self, _duration_s: float) -> None:
        pass

    def stop(self) -> None:
        pass

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        if what == "the actions":
            self.events.append("actions")
        assert condition()

    def change(self, names: Any, transition: str) -> None:
        self.events.append((transition, *names))

    def client(self, _node: Any, kind: Any, name: str) -> Any:
        def send(goal: Any, feedback_callback: Any) -> Later:
            self.goals.append(goal)
            self.events.append(name)
            self.feedback = feedback_callback
            result = self.fit if kind is FitModel else self.campaigns.pop(0)
            answer = Later(SimpleNamespace(result=result))
            return Later(SimpleNamespace(accepted=True, get_result_async=lambda: answer))

        return SimpleNamespace(send_goal_async=send, server_is_ready=lambda: True)

    def service(self, _kind: Any, name: str) -> Any:
        def call(_request: Any) -> Later:
            self.events.append(name)
            return Later(Trigger.Response(success=self.accepted, message=f"{name} answered"))

        return SimpleNamespace(service_is_ready=lambda: True, call_async=call)


PASSES = [("activate", "simulation_clock"), ("deactivate", "simulation_clock")]
CAMPAIGN, FIT = "bias_calibrator/run_campaign", "bias_calibrator/fit_model"


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Graph:
    """Return a graph in place of processes, topics and a bag."""
    made = Graph()
    node = SimpleNamespace(create_client=made.service)
    executor = SimpleNamespace(add_node=lambda _: None, spin_once=lambda **_: None)
    recorder = SimpleNamespace(unmatched=list)
    monkeypatch.setattr(station_run, "rclpy", SimpleNamespace(create_node=lambda *_args, **_named: node))
    monkeypatch.setattr(station_run, "make_executor", lambda: executor)
    monkeypatch.setattr(station_run, "ManagedGraph", made.begin)
    monkeypatch.setattr(station_run, "Recorder", lambda *_: recorder)
    monkeypatch.setattr(station_run, "settle_garbage", lambda: None)
    monkeypatch.setattr(calibrate, "ActionClient", made.client)
    monkeypatch.setattr(calibrate, "fit_of", lambda _: made.events.append("fit of the report") or ("points", "fit"))
    return made


def calibration_of(tmp_path: Path, *line: str, windows: int = 4) -> CalibrationRun:
    given = options(tmp_path, *line)
    schedule = schedule_of(windows)
    given.elements = str(tmp_path / "satellites.tle")
    Path(given.elements).write_text("\n".join(tle_lines(schedule.elements[0])))
    return CalibrationRun(given, schedule, tmp_path)


def test_a_better_model_is_accepted_and_time_runs_only_while_passes_are_tracked(graph: Graph, tmp_path: Path) -> None:
    run = calibration_of(tmp_path, "--sensor", "monopulse")
    assert run.calibrate() == Outcome("new", ("points", "fit"), True, "shadow done")
    assert graph.events == [
        "start", "actions", CAMPAIGN, *PASSES, FIT, "fit of the report", CAMPAIGN, *PASSES, "bias_calibrator/accept",
    ]  # fmt: skip
    campaign, _, shadow = graph.goals
    assert ([len(goal.passes) for goal in (campaign, shadow)], campaign.sensor) == ([4, 3], "monopulse")
    assert (campaign.resume, shadow.resume) == (False, True)
    written = yaml.safe_load((tmp_path / "run.yaml").read_text())["/**/simulation_clock"]["ros__parameters"]
    first = schedule_of().windows[0].aos_t_s
    assert 150.0 <= first - written["start_s"] <= 600.0


def test_a_model_that_cannot_be_accepted_settles_nothing(graph: Graph, tmp_path: Path) -> None:
    graph.accepted = False
    assert calibration_of(tmp_path).calibrate() == Outcome("new", ("points", "fit"), False, "shadow done")


@pytest.mark.parametrize(
    ("verdict", "observed", "settled"),
    [("undecided", 3, True), ("undecided", 4, True), ("undecided", 2, False), ("worse", 3, False), ("worse", 2, False)],
)
def test_a_model_that_is_not_better_is_rejected(
    verdict: str, observed: int, settled: bool, graph: Graph, tmp_path: Path
) -> None:
    graph.campaigns[1] = RunCampaign.Result(message="no better", passes_observed=observed, verdict=verdict)
    assert calibration_of(tmp_path).calibrate() == Outcome("new", ("points", "fit"), settled, "no better")
    assert graph.events[-1] == "bias_calibrator/reject"


def test_a_full_sky_is_fitted_at_once(graph: Graph, tmp_path: Path) -> None:
    del graph.campaigns[0]
    assert calibration_of(tmp_path, windows=0).calibrate().settled
    assert graph.events[:3] == ["start", "actions", FIT]


def test_a_resumed_campaign_continues_its_observations(graph: Graph, tmp_path: Path) -> None:
    calibration_of(tmp_path, "--resume").calibrate()
    assert [goal.resume for goal in graph.goals if isinstance(goal, RunCampaign.Goal)] == [True, True]


def test_a_fault_in_the_campaign_ends_it_before_the_fit(graph: Graph, tmp_path: Path) -> None:
    graph.campaigns[0] = RunCampaign.Result(message="ended by a fault", fault="drive: overload")
    assert calibration_of(tmp_path).calibrate() == Outcome(fault="drive: overload", why=("ended by a fault",))
    assert FIT not in graph.events


def test_a_fault_in_the_shadow_leaves_the_fit(graph: Graph, tmp_path: Path) -> None:
    graph.campaigns[1] = RunCampaign.Result(message="ended by a fault", fault="drive: overload", verdict="better")
    outcome = calibration_of(tmp_path).calibrate()
    assert outcome == Outcome("new", ("points", "fit"), fault="drive: overload")


def test_a_campaign_without_a_fit_has_the_reasons(graph: Graph, tmp_path: Path) -> None:
    graph.fit = FitModel.Result(success=False, message="3 observations, must have at least 30")
    outcome = calibration_of(tmp_path).calibrate()
    assert outcome == Outcome(why=("3 observations, must have at least 30", "campaign done"))
    assert graph.events[-1] == FIT


@pytest.mark.parametrize("during", [1, 2])
def test_the_user_ends_campaign_or_shadow(during: int, graph: Graph, tmp_path: Path) -> None:
    run = calibration_of(tmp_path)
    whole, count = graph.change, []

    def change(names: Any, transition: str) -> None:
        whole(names, transition)
        count.append(transition)
        if count.count("deactivate") == during:
            run.interrupt()

    graph.change = change
    outcome = run.calibrate()
    if during == 1:
        assert outcome == Outcome(why=("it was interrupted", "campaign done"))
        assert FIT not in graph.events
    else:
        assert outcome == Outcome("new", ("points", "fit"))
        assert graph.events[-1] == ("deactivate", "simulation_clock")


def test_a_real_antenna_is_started_in_time_for_its_first_pass(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    station = tmp_path / "roof.yaml"
    read_station("dss13").write(station, {"drive.type": "hamlib", "wind.anemometer": False})
    run = calibration_of(tmp_path, "--station", str(station))
    waited: list[float] = []
    monkeypatch.setattr(run, "wait_for", lambda t_s, _what: waited.append(t_s) or graph.events.append("wait"))
    assert run.calibrate().settled
    # The longest way: 440 deg of azimuth at 2 deg/s, and half a minute to settle.
    assert waited == pytest.approx([schedule_of().windows[0].aos_t_s - 250.0], abs=1.0)
    assert graph.events[:2] == ["wait", "start in real time"]
    assert not any("simulation_clock" in event for event in graph.events)


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_is_a_line_per_pass_or_one_line_of_a_terminal(
    terminal: bool, graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calibration_of(tmp_path).calibrate()
    capsys.readouterr()
    monkeypatch.setattr(calibrate.sys.stderr, "isatty", lambda: terminal, raising=False)
    for number, observations in ((1, 5), (1, 9), (2, 12)):
        state = RunCampaign.Feedback(pass_number=number, target="A", observations=observations, sectors_filled=1)
        graph.feedback(SimpleNamespace(feedback=state))
    shown = capsys.readouterr().err
    texts = [
        f"pass {number} of 3, A: so far {observations} observations, 1 of 36 sectors"
        for number, observations in ((1, 5), (1, 9), (2, 12))
    ]
    if terminal:
        assert [part.rstrip() for part in shown.split("\r")] == ["", *texts]
        assert "\n" not in shown
    else:
        assert shown.splitlines() == [texts[0], texts[2]]


def test_two_campaigns_begin_their_lines_anew(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = calibration_of(tmp_path)
    first = RunCampaign.Feedback(pass_number=1, target="A")
    whole = graph.change

    def change(names: Any, transition: str) -> None:
        whole(names, transition)
        graph.feedback(SimpleNamespace(feedback=first))

    graph.change = change
    monkeypatch.setattr(calibrate.sys.stderr, "isatty", lambda: False, raising=False)
    run.calibrate()
    shown = [line for line in capsys.readouterr().err.splitlines() if line.startswith("pass 1")]
    assert [line.partition(",")[0] for line in shown] == ["pass 1 of 4", "pass 1 of 3"]


@pytest.mark.parametrize("terminal", [False, True])
def test_the_line_of_a_terminal_ends_before_the_message_of_the_campaign(
    terminal: bool, graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = calibration_of(tmp_path)
    monkeypatch.setattr(calibrate.sys.stderr, "isatty", lambda: terminal, raising=False)
    run.calibrate()
    assert ("\n\ncalibrate: campaign done\n" in capsys.readouterr().err) == terminal
    assert graph.campaigns == []


def test_the_satellites_and_numbers_of_a_run_are_in_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    schedule, runs = schedule_of(), []
    monkeypatch.setattr(calibrate, "plan", lambda _: schedule)
    monkeypatch.setattr(calibrate, "execute", lambda *given: runs.append(given) or 5)
    folder = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--output", str(folder), "--models", str(tmp_path)])
    assert ended.value.code == 5
    ((given, the_schedule, output),) = runs
    assert the_schedule is schedule
    assert output == folder
    assert given.elements == str(folder / "satellites.tle")
    assert given.satellite == "28057"
    assert given.params_file == [str(folder / "calibrator.yaml")]
    assert (folder / "calibrator.yaml").is_file()
    lines = [line for one in schedule.elements for line in (one.name, *tle_lines(one))]
    assert (folder / "satellites.tle").read_text() == "\n".join(lines) + "\n"
    assert capsys.readouterr().err.startswith("calibrate: 4 passes from ")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("/**/nobody: {ros__parameters: {a: 1}}", "nobody is no node"), ("/**/bias_calibrator: 3", "bias_calibrator")],
)
def test_files_are_checked_before_the_plan(
    text: str, complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(calibrate, "plan", lambda _: pytest.fail("it was planned"))
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--output", str(tmp_path / "out"), "--params-file", str(tmp_path / "a.yaml")])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


def test_a_speed_is_checked_before_the_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(calibrate, "plan", lambda _: pytest.fail("it was planned"))
    with pytest.raises(SystemExit):
        calibrate.main(["--output", str(tmp_path / "out"), "--speed", "fast"])
    assert "speed='fast'" in capsys.readouterr().err


class Written:
    """The reports that were written, and how the run that ends with `outcome` ended."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        self.outcome, self.points = Outcome(), None
        self.reports: list[Any] = []
        self.tmp_path = tmp_path
        monkeypatch.setattr(calibrate, "run_to_end", lambda _program, make, work: work(make()))
        monkeypatch.setattr(calibrate, "CalibrationRun", lambda *_: SimpleNamespace(calibrate=lambda: self.outcome))
        monkeypatch.setattr(
            calibrate, "journal_of", lambda _: SimpleNamespace(points=self.points, path="observations.csv")
        )
        monkeypatch.setattr(calibration_report, "write_calibration_report", self._calibration)
        monkeypatch.setattr(calibration_report, "write_campaign_report", self._campaign)

    def _calibration(self, folder: Path, points: Any, result: Any, *, name: str, remarks: list[str]) -> str:
        self.reports.append((folder, points, result, name, remarks))
        return "report.html"

    def _campaign(self, folder: Path, points: Any, why: tuple[str, ...]) -> str:
        self.reports.append((folder, points, why))
        return "campaign.html"

    def execute(self) -> int:
        return calibrate.execute(options(self.tmp_path), schedule_of(), self.tmp_path)


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Written:
    return Written(monkeypatch, tmp_path)


@pytest.mark.parametrize(("settled", "code"), [(True, 0), (False, 1)])
def test_a_fit_is_reported_with_the_verdict_of_the_shadow(
    settled: bool, code: int, written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points: Any = "points"
    fit: Any = (points, "fit")
    written.outcome, written.points = Outcome("new", fit, settled, "better"), points
    assert written.execute() == code
    assert written.reports == [(tmp_path, "points", "fit", "new", ["In the shadow of the model in force: better"])]
    shown = capsys.readouterr().err
    assert ("kept in observations.csv" in shown) == (not settled)
    assert "report report.html" in shown
    assert "NOT calibrated" not in shown


def test_a_fit_without_a_verdict_has_no_remark(written: Written) -> None:
    fit: Any = ("points", "fit")
    written.outcome = Outcome("new", fit)
    written.execute()
    assert written.reports[0][4] == []


@pytest.mark.parametrize("points", [None, "points"])
def test_a_campaign_without_a_fit_is_reported_with_the_reasons(
    points: Any, written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written.outcome, written.points = Outcome(fault="drive: overload", why=("it ended",)), points
    assert written.execute() == 1
    assert written.reports == [(tmp_path, points, ("it ended",))]
    shown = capsys.readouterr().err
    # Where nothing was kept there is nothing to resume.
    assert ("kept in observations.csv" in shown) == (points is not None)
    assert "NOT calibrated: drive: overload" in shown
