"""A run from its start to its end; one that cannot be begun gives the reason in a line, and is over."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from std_srvs.srv import Trigger

from rf_pointing.ros.graph import DRIVE_NODES, NODES, TOPICS, topics_of
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.ros.station_run import GraphRun, InterruptedRunError, RunSetup, StationRun, run_to_end
from test.ros.fake_station import BEGIN_S, FakeStation, fake

__all__ = ["fake"]

CLOCK, OTHERS = NODES[:1], NODES[1:]


@pytest.fixture
def setup(tmp_path: Path) -> RunSetup:
    return RunSetup(
        program="track", namespace="/roof", nodes=NODES, simulated=True, parameter_files=(tmp_path / "run.yaml",),
        logs=tmp_path / "logs", bag=tmp_path / "bag", notes={"seed": "1"}, awaited="CBERS 2",
    )  # fmt: skip


@pytest.fixture
def real(setup: RunSetup) -> RunSetup:
    return replace(setup, nodes=DRIVE_NODES, simulated=False, punctual=True, reset_fault=True, begin_s=BEGIN_S + 150.0)


@pytest.fixture
def run(fake: FakeStation, setup: RunSetup) -> StationRun:
    return StationRun(setup)


def test_a_run_has_its_nodes_its_files_and_its_recording(fake: FakeStation, setup: RunSetup, real: RunSetup) -> None:
    StationRun(setup)
    graph = fake.graph
    assert (graph.namespace, graph.files, graph.logs, graph.on_time, graph.processes) == (
        "/roof", [setup.bag.parent / "run.yaml"], setup.logs, (), 2,
    )  # fmt: skip
    assert fake.recorder.given == ("/roof", setup.bag, TOPICS, {"seed": "1"}, True)
    StationRun(replace(real, bag=setup.bag.parent / "other"))
    # Only what runs is recorded of a real antenna; clock and servo go first in real time.
    assert fake.recorder.given[2] == topics_of(DRIVE_NODES) != TOPICS
    assert not fake.recorder.given[-1], "the wall clock is its time"
    assert fake.graph.on_time == ("simulation_clock", "antenna_servo")


def test_a_simulated_station_is_brought_up_behind_its_clock(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    action: Any = SimpleNamespace(server_is_ready=lambda: fake.wall.passed_s >= 2.0)
    fake.recorder.ready_s = 3.0
    run.bring_up(action)
    assert fake.log == [("start", NODES, True), ("configure", CLOCK), ("configure", OTHERS), ("activate", OTHERS)]
    assert fake.wall.passed_s == pytest.approx(3.2, abs=0.05)
    assert capsys.readouterr().err == f"track: {len(NODES)} nodes matched and active in 3.2 s\n"
    run.run_time()
    run.hold_time()
    assert fake.log[4:] == [("activate", CLOCK), ("deactivate", CLOCK)]


def test_a_real_station_is_started_in_time_without_a_clock_and_its_fault_is_reset(
    fake: FakeStation, real: RunSetup, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.services["antenna_servo/reset_fault"] = lambda _: Trigger.Response(success=True, message="no fault is latched")
    run = StationRun(real)
    run.bring_up()
    run.run_time()
    run.hold_time()
    start = ("start", DRIVE_NODES, False)
    assert fake.log == [start, ("configure", DRIVE_NODES), ("activate", DRIVE_NODES), "antenna_servo/reset_fault"]
    assert fake.wall.passed_s == pytest.approx(150.5, abs=0.1)
    lines = capsys.readouterr().err.splitlines()
    waits = [f"in real time: CBERS 2 is waited for; the antenna is started in {s} s" for s in (150, 90, 30)]
    assert lines == [f"track: {text}" for text in (
        *waits, f"{len(DRIVE_NODES)} nodes matched and active in 0.2 s", "reset of a latched fault: no fault is latched",
    )]  # fmt: skip


def test_a_stop_ends_the_bring_up_but_not_a_run_that_has_begun(fake: FakeStation, run: StationRun) -> None:
    run.spin(0.1)
    run.interrupt()
    with pytest.raises(InterruptedRunError):
        run.spin(0.1)
    run.run_time()
    run.spin(0.1)
    assert fake.wall.passed_s == pytest.approx(0.2, abs=1e-3)


def test_a_goal_is_followed_to_its_result_and_cancelled_once_by_the_user(fake: FakeStation, run: StationRun) -> None:
    client = fake.action_client(None, None, "track_pass")
    fake.ready_s, fake.result_s, fake.results["track_pass"] = 0.0, 10.0, "result"
    run.run_time()
    fake.at(3.0, run.interrupt)
    handle = run.send(client, "goal", "pointing_controller", print)
    assert (fake.goals, fake.feedback) == ([("track_pass", "goal")], print)
    assert run.result(handle) == "result"
    assert fake.cancelled_s == [pytest.approx(3.1, abs=0.15)]
    # Processes are checked five times a second.
    assert 33 <= fake.graph.checks <= 55


def test_a_goal_that_is_refused_has_its_reason(fake: FakeStation, run: StationRun) -> None:
    fake.ready_s, fake.results["track_pass"] = 0.0, None
    client = fake.action_client(None, None, "track_pass")
    with pytest.raises(NotStartedError, match="the goal was refused: the last line of pointing_controller"):
        run.send(client, "goal", "pointing_controller")
    for fake.state, why in (("inactive", "it must be active"), ("active", "its log says why")):
        with pytest.raises(NotStartedError, match=f"refused: pointing_controller is {fake.state}; {why}"):
            GraphRun("station", "/gs1").send(client, "goal", "pointing_controller")


def test_a_process_that_has_ended_ends_every_wait(fake: FakeStation, run: StationRun) -> None:
    fake.ready_s, fake.result_s, fake.results["track_pass"] = 0.0, math.inf, "result"
    handle = run.send(fake.action_client(None, None, "track_pass"), "goal", "pointing_controller")
    fake.graph.ended = "antenna_servo ended: no such device"
    for lasts in (lambda: run.result(handle), run.check, lambda: run.request("antenna_servo/reset_fault")):
        with pytest.raises(NotStartedError, match="antenna_servo ended"):
            lasts()


def test_at_the_end_the_nodes_go_first_then_the_bag_is_closed(
    fake: FakeStation, run: StationRun, capsys: pytest.CaptureFixture[str]
) -> None:
    losses = (SimpleNamespace(count=7), SimpleNamespace(count=4))
    fake.recorder.result = SimpleNamespace(problem="the disk is full", lost=losses)
    run.close()
    assert fake.log[:2] == ["stop", "bag closed"]
    assert fake.life[-2:] == ["executor shut down", "destroyed"]
    assert capsys.readouterr().err == "track: recording stopped: the disk is full; 11 messages are not in the bag\n"


def raising(error: Exception) -> Callable[[Any], int]:
    def work(_: Any) -> int:
        raise error

    return work


@pytest.mark.parametrize(
    ("work", "code", "text"),
    [
        (lambda _: 7, 7, ""),
        (raising(NotStartedError("no node")), 2, "track: no node\n"),
        (raising(TimeoutError("not seen")), 2, "track: not seen\n"),
        (raising(InterruptedRunError()), 1, "track: interrupted before the graph was up\n"),
        (raising(ZeroDivisionError()), None, ""),
    ],
)
def test_a_run_ends_with_its_code_and_in_order_and_leaves_the_signals_as_they_were(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], work: Callable[[Any], int], code: int | None, text: str
) -> None:
    if code is None:
        with pytest.raises(ZeroDivisionError):
            run_to_end("track", lambda: GraphRun("track", "/gs1"), work)
    else:
        assert run_to_end("track", lambda: GraphRun("track", "/gs1"), work) == code
    assert capsys.readouterr().err == text
    assert fake.life == ["begun", "executor shut down", "destroyed", "over"]
    assert fake.handlers == {2: "of before", 15: "of before"}


def test_a_signal_is_left_to_the_run(fake: FakeStation) -> None:
    """Ctrl-C must cancel the goal and end the run in order, not end rclpy under it."""

    def work(run: GraphRun) -> int:
        fake.handlers[2](2, None)
        return int(run.stopping)

    assert run_to_end("track", lambda: GraphRun("track", "/gs1"), work) == 1


def test_a_run_without_room_for_its_bag_ends_with_the_reason_and_nothing_left(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def make() -> StationRun:
        raise OSError("no room to begin a recording in /full")

    assert run_to_end("track", make, lambda _: pytest.fail("there is no run to work with")) == 2
    assert capsys.readouterr().err == "track: no room to begin a recording in /full\n"
    assert not rclpy.ok()
