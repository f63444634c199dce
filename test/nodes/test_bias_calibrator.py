"""The bias calibrator between its topics: goals, observations, and the model that it publishes."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.action import GoalResponse
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import Pass, TrackingStatus
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger

from rf_pointing.core import JointReading, PointingError, Target
from rf_pointing.nodes import bias_calibrator
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.ros import convert, station_node
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.campaign.calibrator import journal_of
from rf_pointing.station.description import read_station
from test.nodes.goal_handle import GoalHandle
from test.station.campaign.test_calibrator import NOW_S, OFFSETS, commissioned, filled

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


class Servers:
    """The client of a service or an action that is there; it keeps what was asked, and answers when it is told to."""

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.answer: Any = None

    def ready(self) -> bool:
        return True

    def ask(self, request: Any) -> Any:
        self.asked.append(request)
        return SimpleNamespace(done=lambda: self.answer is not None, result=lambda: self.answer)

    service_is_ready = server_is_ready = ready
    call_async = send_goal_async = ask


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Yield a maker of nodes: `make(station, calibrator__folder=value)`; `sent` is what is published."""
    made: list[Any] = []

    def calibrator(station: str = "leo_3m7", active: bool = True, **given: Any) -> Any:
        monkeypatch.setattr(station_node, "read_station", lambda _: read_station(station))
        actions: dict[str, Any] = {}
        server = lambda _node, _kind, name, conclude, **calls: actions.setdefault(  # noqa: E731
            name.strip("~/"), SimpleNamespace(conclude=conclude, **calls)
        )
        tracker, selector = Servers(), Servers()
        monkeypatch.setattr("rf_pointing.ros.one_goal.ActionServer", server)
        monkeypatch.setattr(bias_calibrator, "ActionServer", server)
        monkeypatch.setattr(bias_calibrator, "ActionClient", lambda *_: tracker)
        monkeypatch.setattr(BiasCalibrator, "create_client", lambda *_: selector)
        node: Any = BiasCalibrator()
        made.append(node)
        node.actions, node.tracker, node.selector, node.sent, node.now_s = actions, tracker, selector, [], lambda: NOW_S
        node.stream = lambda *_: SimpleNamespace(publish=node.sent.append)
        for name, value in given.items():
            (done,) = node.set_parameters([Parameter(name.replace("__", "."), value=value)])
            assert done.successful, done.reason
        assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
        if active:
            assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
        return node

    yield calibrator
    for node in made:
        node.end()
        node.lock.release()
        node.destroy_node()


def give(node: Any, topic: str, message: Any) -> None:
    (door,) = [each.callback for each in node.subscriptions if each.topic_name == f"/{topic}"]
    door(serialize_message(message))


def answer(node: Any, name: str) -> Trigger.Response:
    (service,) = (each for each in node.services if each.service_name == f"/bias_calibrator/{name}")
    return service.callback(Trigger.Request(), Trigger.Response())


def targets(node: Any, t_s: float) -> None:
    for at_s in (t_s - 1.0, t_s + 1.0):
        give(node, "target", convert.target_to_message(Target(
            t_s=at_s, name="bird", azimuth_rad=1.0, elevation_rad=0.5, azimuth_rate_rad_s=0.0, elevation_rate_rad_s=0.0,
            azimuth_acceleration_rad_s2=0.0, elevation_acceleration_rad_s2=0.0, range_m=1e6, range_rate_m_s=0.0,
            refraction_rad=0.0,
        )))  # fmt: skip


def sensed(node: Any, t_s: float) -> None:
    """Deliver what an observation at `t_s` needs; encoders turn at 0.02 rad/s in azimuth, read each 0.05 s."""
    targets(node, t_s)
    for at_s in (t_s - 0.05, t_s, t_s + 0.05, t_s + 0.1):
        position = np.array([1.0 + 0.02 * (at_s - NOW_S), 0.5])
        reading = JointReading(t_s=at_s, position_rad=position, velocity_rad_s=np.zeros(2))
        give(node, "joint_states", convert.joints_to_message(reading))
    error = PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=1e-5, elevation_rad=-2e-5)
    give(node, "pointing_error", convert.error_to_message(error))


def test_the_model_of_the_station_is_published_with_the_activation_and_others_publish_none(
    make: Callable[..., Any],
) -> None:
    (message,) = make("dss13").sent
    found = (message.name, message.station, message.header.stamp.sec)
    assert found == ("dss13-commissioning", "Goldstone DSS-13", int(NOW_S))


def test_an_observation_is_made_of_the_encoders_at_the_time_of_the_error(make: Callable[..., Any]) -> None:
    node = make(active=False)
    assert node.sent == []
    log = node.calibrator.log
    sensed(node, NOW_S)
    assert len(log) == 0, "not active"
    node.on_activate(ANY_STATE)
    for late_s, count in ((0.0, 1), (0.9, 1), (1.0, 2)):
        sensed(node, NOW_S + late_s)
        assert len(log) == count, "spacing_s=1"
    row = log.observations()
    assert row.observed_azimuth_rad[0] == pytest.approx(1.0 + 1e-5 / np.cos(0.5), abs=1e-9)
    assert row.observed_elevation_rad[0] == pytest.approx(0.5 - 2e-5, abs=1e-9)


def test_errors_of_a_scan_belong_to_its_centre_and_the_mount_has_the_temperature_of_its_sensor(
    make: Callable[..., Any],
) -> None:
    node = make()
    targets(node, NOW_S)
    for at_s in (NOW_S - 1.0, NOW_S + 1.0):
        status = TrackingStatus(mode="conscan", sensor="conscan", scan_centre=[1.01, 0.5])
        status.header.stamp = stamp_from_seconds(at_s)
        give(node, "tracking_status", status)
    error = PointingError(t_s=NOW_S, sensor="conscan", cross_elevation_rad=0.0, elevation_rad=0.0)
    give(node, "pointing_error", convert.error_to_message(error))
    assert node.calibrator.log.observations().observed_azimuth_rad[0] == pytest.approx(1.01, abs=1e-9)
    give(node, "weather/temperature", Temperature(temperature=-12.5))
    assert node.calibrator.keeper.temperature_k == pytest.approx(260.65, abs=1e-9)


@pytest.mark.parametrize("resume", [False, True])
def test_a_campaign_begins_anew_unless_it_is_resumed_and_reports_until_its_result(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator, resume: bool
) -> None:
    filled(tmp_path, random, 1)
    node = make(calibrator__folder=str(tmp_path))
    kept, runs = len(node.calibrator.log), node.actions["run_campaign"]
    wanted = Pass(target="a", aos=stamp_from_seconds(NOW_S))
    goal = GoalHandle(RunCampaign.Goal(passes=[wanted], sensor="monopulse", resume=resume))
    assert (runs.goal_callback(goal.request), node.turn()) == (GoalResponse.ACCEPT, 0.2)
    runs.handle_accepted_callback(goal)
    assert runs.goal_callback(goal.request) == GoalResponse.REJECT, "there is one antenna"
    before = kept if resume else 0
    assert len(node.calibrator.log) == before
    assert len(list(tmp_path.rglob(f"*{NOW_S:.0f}*"))) == (not resume)
    assert (node.turn(), node.turn()) == (0.02, 0.02)
    (request,) = node.selector.asked
    assert (request.target, request.start.sec) == ("a", int(NOW_S) - 7200)
    node.selector.answer = SimpleNamespace(success=True, message="")
    node.turn()
    assert (node.tracker.asked[0].target_pass.target, node.tracker.asked[0].sensor) == ("a", "monopulse")
    sensed(node, NOW_S)
    ended = SimpleNamespace(result=SimpleNamespace(seconds_tracked=9.0, message="", fault=""))
    result = SimpleNamespace(done=lambda: True, result=lambda: ended)
    node.tracker.answer = SimpleNamespace(accepted=True, get_result_async=lambda: result)
    for _ in range(2):
        node.turn()
    assert [(each.observations, each.pass_number, each.target) for each in goal.feedback] == [
        (before, 1, "a"), (before + 1, 1, "a")
    ]  # fmt: skip
    assert goal.ends == ["execute"]
    done = runs.conclude(goal)
    assert (done.success, done.passes_observed, done.observations) == (True, 1, before + 1)
    assert done.message == f"1 of 1 passes observed, {before + 1} observations"
    assert (node.turn(), goal.ends) == (0.2, ["execute", "succeed"])


def test_a_campaign_that_cannot_start_ends_at_once_with_the_reason(make: Callable[..., Any]) -> None:
    node = make()
    runs = node.actions["run_campaign"]
    for request, reason in (
        (RunCampaign.Goal(), "passes is empty, must name at least one pass"),
        (RunCampaign.Goal(passes=[Pass()]), "ephemeris_publisher and pointing_controller must be running"),
    ):
        goal = GoalHandle(request)
        runs.handle_accepted_callback(goal)
        result = runs.conclude(goal)
        assert (goal.ends, result.success, result.passes_observed) == (["execute", "abort"], False, 0)
        assert reason in result.message
        assert runs.goal_callback(request) == GoalResponse.ACCEPT, "no campaign is under way"
        node.tracker.server_is_ready = lambda: False


def test_a_fit_becomes_a_candidate_and_what_is_in_force_is_published(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator
) -> None:
    filled(tmp_path, random)
    node = make(calibrator__folder=str(tmp_path), shadow__accept="not worse", shadow__fewest_passes=4)
    fits = node.actions["fit_model"]
    assert fits.goal_callback(FitModel.Goal()) == GoalResponse.ACCEPT
    goal = GoalHandle(FitModel.Goal(terms=list(OFFSETS)))
    result = fits.conclude(goal)
    assert ([each.stage for each in goal.feedback], goal.ends) == (["fit"], ["succeed"])
    assert (result.success, result.model.name, result.passes) == (True, "fit-1200000000", 6)
    assert node.sent == [], "a candidate is not in force"
    assert answer(node, "accept").message == "fit-1200000000 is in force; it was not yet observed in shadow"
    assert not answer(node, "reject").success
    assert not answer(node, "rollback").success
    assert [(each.name, each.header.stamp.sec) for each in node.sent] == [("fit-1200000000", int(NOW_S))]
    node.set_parameters([Parameter("shadow.fewest_passes", value=7)])
    assert node.calibrator.keeper.rules.fewest_passes == 7
    few = GoalHandle(FitModel.Goal(terms=["nonsense"]))
    assert not fits.conclude(few).success
    assert few.ends == ["abort"]


def test_the_first_model_is_rolled_back_to_one_that_corrects_nothing(make: Callable[..., Any]) -> None:
    node = make(shadow__accept="not worse")
    node.calibrator.keeper.propose(commissioned())
    answer(node, "accept")
    assert answer(node, "rollback").message == "no model is in force again"
    message = node.sent[-1]
    assert (message.name, message.station, set(message.values)) == ("none", "LEO 3.7 m", {0.0})


def test_observations_that_the_disk_did_not_take_are_written_when_the_node_is_deactivated(
    make: Callable[..., Any], tmp_path: Path
) -> None:
    node = make("dss13", calibrator__folder=str(tmp_path))
    journal = journal_of(str(tmp_path), "Goldstone DSS-13", "X")
    journal.path.mkdir(parents=True)
    sensed(node, NOW_S)
    level, message, _ = node.calibrator.health()
    assert (level, message.startswith("1 observations are in memory only: ")) == (1, True)
    journal.path.rmdir()
    node.on_deactivate(ANY_STATE)
    assert len(journal_of(str(tmp_path), "Goldstone DSS-13", "X").points) == 1
