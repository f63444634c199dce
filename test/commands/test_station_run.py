"""A run from its start to its end; one that cannot be begun gives the reason in a line, and is over."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from std_srvs.srv import Trigger

from rf_pointing.commands import calibrate, station_run, track_options
from rf_pointing.commands.station_run import GraphRun, InterruptedRunError, StationRun, run_to_end
from rf_pointing.ephemeris import Pass
from rf_pointing.ros.graph import NODES, TOPICS, topics_of
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.station.description import read_station
from test.commands.fake_station import BEGIN_S, FakeGraph, FakeStation, make_run

T_S = 1_151_384_323.8
WINDOW = Pass(
    name="CBERS 2", aos_t_s=T_S, tca_t_s=T_S + 300.0, los_t_s=T_S + 600.0, peak_elevation_rad=0.8,
    aos_azimuth_rad=2.5, aos_elevation_rad=0.09, los_azimuth_rad=-0.04, azimuth_min_rad=-0.04, azimuth_max_rad=2.5,
    peak_azimuth_rate_rad_s=0.01, peak_elevation_rate_rad_s=0.003, peak_azimuth_acceleration_rad_s2=6e-5,
    smallest_range_m=1.05e6, rises_before=False, sets_after=False,
)  # fmt: skip


def test_a_run_without_room_for_its_bag_ends_with_the_reason_and_nothing_left(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def make() -> StationRun:
        raise OSError("no room to begin a recording in /full")

    assert run_to_end("track", make, lambda _: pytest.fail("there is no run to work with")) == 2
    assert capsys.readouterr().err == "track: no room to begin a recording in /full\n"
    assert not rclpy.ok()


def test_calibrate_refuses_an_output_with_a_bag_before_anything_is_written(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bag").mkdir()
    monkeypatch.setattr(calibrate, "plan", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--output", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"calibrate: output={tmp_path} holds a bag already\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeStation:
    return make_run(monkeypatch)


@pytest.fixture
def make(fake: FakeStation, tmp_path: Path) -> Callable[..., StationRun]:
    """Return a maker of runs into `tmp_path`; keyword `real` gives the station a drive that is a device."""

    def make(*line: str, real: bool = False) -> StationRun:
        if real:
            read_station("dss13").write(tmp_path / "mine.yaml", {"drive.type": "hamlib", "wind.anemometer": False})
            line = (*line, "--station", str(tmp_path / "mine.yaml"))
        return StationRun("track", track_options.arguments([*line]), WINDOW, tmp_path)

    return make


@pytest.fixture
def run(make: Callable[..., StationRun]) -> StationRun:
    return make()


def graph_of(run: StationRun) -> FakeGraph:
    graph: Any = run.graph
    return graph


CLOCK, OTHERS = NODES[:1], NODES[1:]
DRIVE = tuple(name for name in OTHERS if name != "rf_receiver")


def test_a_run_has_its_nodes_its_files_and_its_recording(
    fake: FakeStation, make: Callable[..., StationRun], tmp_path: Path
) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("/**/antenna_servo: {ros__parameters: {wind.mean_speed_m_s: 3.0}}")
    graph = graph_of(make("--namespace", "roof", "--params-file", str(mine)))
    assert (graph.namespace, graph.logs, graph.on_time) == ("/roof", tmp_path / "logs", ())
    assert graph.files == [tmp_path / "run.yaml", mine]
    (recorder,) = fake.recorders
    assert (recorder.namespace, recorder.path) == ("/roof", tmp_path / "bag")
    assert recorder.topics == TOPICS
    assert recorder.notes["seed"] == "1"


@pytest.mark.parametrize(("speed", "on_time"), [("1", ("simulation_clock", "antenna_servo")), ("50", ())])
def test_in_real_time_clock_and_servo_go_first(
    make: Callable[..., StationRun], speed: str, on_time: tuple[str, ...]
) -> None:
    assert graph_of(make("--speed", speed)).on_time == on_time


def test_of_a_real_antenna_only_what_runs_is_recorded(fake: FakeStation, make: Callable[..., StationRun]) -> None:
    make(real=True)
    assert fake.recorders[0].topics == topics_of(DRIVE) != TOPICS


def test_a_simulated_station_is_brought_up_behind_its_clock(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    action: Any = SimpleNamespace(server_is_ready=lambda: fake.wall.passed_s >= 2.0)
    ready: Any = SimpleNamespace(server_is_ready=lambda: True)
    fake.recorder.ready_s = 3.0
    run.bring_up(ready, action)
    assert graph_of(run).steps == [
        ("start", NODES, True), ("configure", CLOCK), ("configure", OTHERS), ("activate", OTHERS),
        ("until", "the actions"), ("until", "every topic"), ("wait", 0.2),
    ]  # fmt: skip
    assert fake.wall.passed_s == pytest.approx(3.2, abs=0.05)
    assert capsys.readouterr().err == f"track: {len(NODES)} nodes matched and active in 3.2 s\n"


def test_a_real_station_has_no_clock(fake: FakeStation, make: Callable[..., StationRun]) -> None:
    run = make(real=True)
    run.bring_up()
    run.run_time()
    run.hold_time()
    assert graph_of(run).steps == [
        ("start", DRIVE, False), ("configure", DRIVE), ("activate", DRIVE),
        ("until", "the actions"), ("until", "every topic"), ("wait", 0.2),
    ]  # fmt: skip


def test_a_latched_fault_is_reset_when_all_nodes_are_active(
    fake: FakeStation, make: Callable[..., StationRun], capsys: pytest.CaptureFixture[str]
) -> None:
    fake.services["antenna_servo/reset_fault"] = lambda _: Trigger.Response(success=True, message="no fault is latched")
    fake.ready_s = 1.0
    run = make("--reset-fault", real=True)
    run.bring_up()
    assert [name for name, _ in fake.calls] == ["antenna_servo/reset_fault"]
    assert graph_of(run).steps[-4:] == [
        ("wait", 0.2), ("until", "antenna_servo/reset_fault"), ("until", "an answer of antenna_servo/reset_fault"),
        ("wait", 0.2),
    ]  # fmt: skip
    assert "reset of a latched fault: no fault is latched" in capsys.readouterr().err


def test_simulated_time_runs_and_is_held(fake: FakeStation, run: StationRun) -> None:
    run.run_time()
    assert graph_of(run).steps == [("activate", CLOCK)]
    assert fake.life == ["settled"]
    run.hold_time()
    assert graph_of(run).steps[1:] == [("deactivate", CLOCK)]


def test_a_stop_ends_the_bring_up_but_not_a_run_that_has_begun(fake: FakeStation, run: StationRun) -> None:
    run.spin(0.1)
    run.interrupt()
    with pytest.raises(InterruptedRunError):
        run.spin(0.1)
    run.run_time()
    run.spin(0.1)
    assert fake.wall.passed_s == pytest.approx(0.2, abs=1e-3)


def test_a_wait_for_a_pass_reports_once_a_minute(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    run.wait_for(BEGIN_S + 150.0, "CBERS 2")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[-2] for line in lines] == ["150", "90", "30"]
    assert lines[0] == "track: in real time: CBERS 2 in 150 s"
    assert 150.0 <= fake.wall.passed_s < 150.1
    run.wait_for(BEGIN_S, "CBERS 2")
    assert fake.wall.passed_s < 150.1


def test_a_goal_is_sent_and_one_that_is_refused_has_its_reason(fake: FakeStation, run: StationRun) -> None:
    client, goals = fake.action_client(None, None, "track_pass"), []
    fake.ready_s = 0.0
    fake.results["track_pass"] = "result"
    handle = run.send(client, "goal", "pointing_controller", goals.append)
    assert handle.accepted
    assert fake.goals == [("track_pass", "goal")]
    assert fake.feedback == goals.append
    assert run.result(handle) == "result"
    fake.results["track_pass"] = None
    with pytest.raises(NotStartedError, match="the goal was refused: the last line of pointing_controller"):
        run.send(client, "goal", "pointing_controller")


def test_processes_are_checked_five_times_a_second_while_a_pass_lasts(fake: FakeStation, run: StationRun) -> None:
    client = fake.action_client(None, None, "track_pass")
    fake.ready_s, fake.result_s = 0.0, 10.0
    fake.results["track_pass"] = "result"
    assert run.result(run.send(client, "goal", "pointing_controller")) == "result"
    assert 33 <= graph_of(run).checks <= 51
    run.check()
    handle = run.send(client, "goal", "pointing_controller")
    graph_of(run).ended = "antenna_servo ended: no such device"
    for lasts in (lambda: run.result(handle), run.check):
        with pytest.raises(NotStartedError, match="antenna_servo ended"):
            lasts()


def test_a_run_without_processes_of_its_own_has_none_to_check(fake: FakeStation) -> None:
    run = GraphRun("station", "/gs1")
    run.check()
    assert not run.stopping
    client = fake.action_client(None, None, "track_pass")
    fake.ready_s, fake.answer_s = 0.0, math.inf
    fake.results["track_pass"] = "result"
    with pytest.raises(TimeoutError, match="an answer of pointing_controller not seen within 120 s"):
        run.send(client, "goal", "pointing_controller")
    assert fake.wall.passed_s == pytest.approx(120.0, abs=0.1)


def test_the_processes_of_any_run_end_with_it(fake: FakeStation) -> None:
    run, stopped = GraphRun("identify_antenna", "/gs1"), []
    graph: Any = SimpleNamespace(stop=lambda: stopped.append("graph"))
    run.graph = graph
    run.close()
    assert (stopped, fake.life) == (["graph"], ["executor shut down", "destroyed"])


def test_at_the_end_the_nodes_go_first_then_the_bag_is_closed(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    graph: Any = run.graph
    graph.stop = lambda: fake.life.append(f"stopped, bag {'closed' if fake.recorders[0].closed else 'open'}")
    run.close()
    assert fake.life[0] == "stopped, bag open"
    assert fake.recorders[0].closed
    assert fake.life[-2:] == ["executor shut down", "destroyed"]
    assert capsys.readouterr().err == ""


def test_a_recording_that_has_stopped_is_reported_with_what_it_lacks(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.recorder.result = SimpleNamespace(
        problem="the disk is full", lost=(SimpleNamespace(count=7), SimpleNamespace(count=4))
    )
    run.close()
    assert capsys.readouterr().err == "track: recording stopped: the disk is full; 11 messages are not in the bag\n"


def raising(error: Exception) -> Callable[[Any], int]:
    def work(_: Any) -> int:
        raise error

    return work


@pytest.mark.parametrize(
    ("work", "code", "text"),
    [
        (lambda _: 0, 0, ""),
        (lambda _: 7, 7, ""),
        (raising(NotStartedError("no node")), 2, "track: no node\n"),
        (raising(TimeoutError("not seen")), 2, "track: not seen\n"),
        (raising(InterruptedRunError()), 1, "track: interrupted before the graph was up\n"),
    ],
)
def test_a_run_ends_with_its_code_and_in_order(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], work: Callable[[Any], int], code: int, text: str
) -> None:
    assert run_to_end("track", lambda: GraphRun("track", "/gs1"), work) == code
    assert capsys.readouterr().err == text
    assert fake.life == ["begun", "executor shut down", "destroyed", "over"]
    assert sorted(fake.handlers) == [2, 15]


def test_a_run_that_breaks_is_closed_too(fake: FakeStation) -> None:
    with pytest.raises(ZeroDivisionError):
        run_to_end("track", lambda: GraphRun("track", "/gs1"), raising(ZeroDivisionError()))
    assert fake.life[-2:] == ["destroyed", "over"]


def test_a_signal_is_left_to_the_run(fake: FakeStation, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C must cancel the goal and end the run in order, not end rclpy under it."""
    given: dict[str, Any] = {}
    monkeypatch.setattr(station_run.rclpy, "init", lambda **options: given.update(options))
    seen: list[bool] = []

    def work(run: GraphRun) -> int:
        fake.handlers[2](2, None)
        seen.append(run.stopping)
        return 0

    run_to_end("track", lambda: GraphRun("track", "/gs1"), work)
    assert seen == [True]
    assert given == {"signal_handler_options": rclpy.signals.SignalHandlerOptions.NO}
