"""An experiment of `identify`: every sample is published once, and its goal ends when the axes rest."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.action import CancelResponse, GoalResponse
from rf_pointing_msgs.action import Identify

from rf_pointing.identification import IdentificationExperiment
from rf_pointing.ros import identification_server
from rf_pointing.ros.identification_server import IdentificationServer
from test.nodes.goal_handle import GoalHandle

START_RAD = (0.5, 0.8)


class Antenna:
    """An antenna whose axes the test moves; `refusal` is why it takes no experiment."""

    def __init__(self) -> None:
        self.params = SimpleNamespace(tick_s=0.02)
        self.axes = SimpleNamespace(travel_rad=((-4.0, 4.0), (0.1, 1.5)))
        self.mode, self.refusal = "manual_rate", ""
        self.experiment: IdentificationExperiment | None = None

    def identify(self, experiment: IdentificationExperiment) -> str:
        self.experiment = experiment
        return self.refusal

    def reading(self, _t_s: float) -> Any:
        return SimpleNamespace(position_rad=np.array(START_RAD))


class Goal(GoalHandle):
    def __init__(self, axis: str = "azimuth", **changes: Any) -> None:
        values = {
            "kind": "white", "sequences": 1, "samples": 120, "mean": 0.0, "rms": math.radians(0.02),
            "peak": math.radians(0.1), "idle": 0.0, "seed": 3,
        }  # fmt: skip
        super().__init__(Identify.Goal(axis=axis, **{**values, **changes}))


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a server of an antenna; `sent` are the samples, `errors` the lines of its log."""
    monkeypatch.setattr(identification_server, "ActionServer", lambda *_given, **_options: None)
    sent: list[Any] = []
    errors: list[str] = []
    logger = SimpleNamespace(error=errors.append)
    node = SimpleNamespace(stream=lambda *_: SimpleNamespace(publish=sent.append), get_logger=lambda: logger)
    made: Any = IdentificationServer(node)  # type: ignore[arg-type]
    made.sent, made.errors = sent, errors
    return made


@pytest.fixture
def antenna(server: Any) -> Antenna:
    made = Antenna()
    server.configure(made)
    return made


def run(server: Any, antenna: Antenna, ticks: int) -> None:
    """Do ticks: the antenna takes a command of the experiment, then the server publishes its sample."""
    assert antenna.experiment is not None
    for number in range(ticks):
        antenna.experiment.command(np.array([0.51, 0.82]))
        server.tick(100.0 + 0.02 * number)


def test_one_goal_at_a_time_and_only_with_an_antenna(server: Any) -> None:
    assert server._on_goal(None) == GoalResponse.REJECT
    server.tick(100.0)
    antenna = Antenna()
    server.configure(antenna)
    assert server._on_goal(None) == GoalResponse.ACCEPT
    server._on_accepted(Goal())
    assert server._on_goal(None) == GoalResponse.REJECT


@pytest.mark.parametrize(("axis", "place"), [("azimuth", 0.51), ("elevation", 0.82)])
def test_each_sample_is_published_once_and_each_fiftieth_is_feedback(
    server: Any, antenna: Antenna, axis: str, place: float
) -> None:
    goal = Goal(axis)
    server._on_accepted(goal)
    server.tick(99.9)
    assert server.sent == [], "no sample has been taken"
    run(server, antenna, 101)
    server.tick(103.0)
    assert [each.sample for each in server.sent] == list(range(101))
    assert {each.axis for each in server.sent} == {axis}
    assert server.sent[-1].header.stamp.sec == 102
    assert list(server.sent[0].position) == [0.51, 0.82]
    rate = antenna.experiment.newest[0]
    assert list(server.sent[-1].rate) == rate.tolist()
    assert [(each.progress, each.position) for each in goal.feedback] == [(50 / 120, place), (100 / 120, place)]


@pytest.mark.parametrize("mode", ["manual_rate", "stopping"])
def test_a_goal_ends_with_success_when_the_axes_rest(server: Any, antenna: Antenna, mode: str) -> None:
    goal = Goal()
    server._on_accepted(goal)
    antenna.mode = "holding"
    run(server, antenna, 119)
    assert goal.ends == [], "one sample is missing"
    antenna.mode = mode
    run(server, antenna, 2)
    assert goal.ends == []
    antenna.mode = "holding"
    server.tick(200.0)
    server.tick(200.02)
    assert goal.ends == ["execute"]
    result = server._conclude(goal)
    assert (result.success, result.message, result.samples_taken) == (True, "", 120)
    assert goal.ends == ["execute", "succeed"]
    assert server._on_goal(None) == GoalResponse.ACCEPT
    second = Goal()
    server._on_accepted(second)
    run(server, antenna, 1)
    assert server.sent[-1].sample == 0


def test_a_cancelled_goal_ends_as_such_with_the_samples_until_then(server: Any, antenna: Antenna) -> None:
    assert server._on_cancel(None) == CancelResponse.ACCEPT
    goal = Goal()
    server._on_accepted(goal)
    run(server, antenna, 30)
    assert server._on_cancel(goal) == CancelResponse.ACCEPT
    goal.is_cancel_requested, antenna.mode = True, "holding"
    server.tick(300.0)
    result = server._conclude(goal)
    assert (result.success, result.message, result.samples_taken) == (False, "the goal was cancelled", 30)
    assert goal.ends == ["execute", "canceled"]


def test_a_deactivation_concludes_the_goal_once(server: Any, antenna: Antenna) -> None:
    server.end()
    goal = Goal()
    server._on_accepted(goal)
    run(server, antenna, 3)
    server.end()
    server.end()
    assert goal.ends == ["execute"]
    server.tick(300.0)
    assert len(server.sent) == 3


@pytest.mark.parametrize(
    ("goal", "refusal", "words"),
    [
        (Goal(), "the antenna is parked", "the antenna is parked"),
        (Goal("roll"), "", "axis='roll' must be one of"),
        (Goal(sequences=0), "", "sequences=0 must be >= 1"),
        (Goal("elevation", samples=100_000, mean=math.radians(0.07)), "", "elevation would run from 0.8"),
    ],
)
def test_a_refused_goal_ends_at_once_with_the_reason(
    server: Any, antenna: Antenna, goal: Goal, refusal: str, words: str
) -> None:
    goal.ends.clear()
    antenna.refusal = refusal
    server._on_accepted(goal)
    assert goal.ends == ["execute"]
    result = server._conclude(goal)
    assert (result.success, result.samples_taken) == (False, 0)
    assert words in result.message
    assert len(server.errors) == 1
    assert words in server.errors[0]
    assert server._on_goal(None) == GoalResponse.ACCEPT
    antenna.refusal = ""
    server._on_accepted(Goal())
    assert server._reason == ""


def test_the_seed_and_the_axis_give_the_input(server: Any, antenna: Antenna) -> None:
    def inputs(goal: Goal) -> list[float]:
        server._goal = None
        server._on_accepted(goal)
        assert antenna.experiment is not None
        return [float(np.max(np.abs(antenna.experiment.command(np.array(START_RAD))))) for _ in range(20)]

    first = inputs(Goal())
    assert inputs(Goal()) == first
    assert inputs(Goal(seed=4)) != first
    assert inputs(Goal("elevation")) != first
