"""The bias calibrator between its topics: campaigns, observations, fits, and which model is in force."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.action import CancelResponse, GoalResponse
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import Pass, TrackingStatus
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.core import JointReading, PointingError, Target
from rf_pointing.nodes.bias_calibrator import SECTORS, BiasCalibrator
from rf_pointing.ros import convert, station_node
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.campaign.model_keeper import journal_of
from rf_pointing.station.description import STATIONS, read_station
from test.calibration.conftest import one_pass
from test.nodes.goal_handle import GoalHandle

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
NOW_S = 1_200_000_000.0
STATION, BAND = "LEO 3.7 m", "X"


class Runner:
    """A runner of campaigns whose passes the test tracks."""

    def __init__(self) -> None:
        self.busy, self.refusal = True, ""
        self.number, self.observed, self.count = 1, 0, 2
        self.target, self.fault = "bird", ""
        self.failures: list[str] = []
        self.polls = self.cancels = 0
        self.started: tuple[Any, ...] = ()

    def start(self, *given: Any) -> None:
        if self.refusal:
            raise ValueError(self.refusal)
        self.started = given

    def poll(self) -> None:
        self.polls += 1

    def cancel(self) -> None:
        self.cancels += 1


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Yield a maker of configured nodes: `make("calibrator.folder", value, ...)`; `sent` is what is published."""
    made: list[BiasCalibrator] = []

    def calibrator(station: str = "leo_3m7", **given: Any) -> Any:
        monkeypatch.setattr(station_node, "read_station", lambda _: read_station(station))
        node: Any = BiasCalibrator()
        made.append(node)
        monkeypatch.setattr(node, "now_s", lambda: NOW_S)
        for name, value in given.items():
            (done,) = node.set_parameters([Parameter(name.replace("__", "."), value=value)])
            assert done.successful, done.reason
        assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, node._reason
        node.sent = []
        monkeypatch.setattr(node._models, "publish", node.sent.append)
        return node

    yield calibrator
    for node in made:
        node.end()
        node.lock.release()
        node.destroy_node()


def activated(node: Any) -> Any:
    assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, node._reason
    return node


def give(node: Any, topic: str, message: Any) -> None:
    """Deliver a message to the subscription of a topic."""
    (door,) = [each.callback for each in node.subscriptions if each.topic_name == f"/{topic}"]
    door(serialize_message(message))


def answer(node: Any, name: str) -> Trigger.Response:
    (service,) = (each for each in node.services if each.service_name == f"/bias_calibrator/{name}")
    return service.callback(Trigger.Request(), Trigger.Response())


def filled(folder: Path, random: np.random.Generator, passes: int = 6) -> BiasModel:
    """Keep the observations of passes with a planted model below `folder`, and return the model."""
    planted = BiasModel.zero().replace(azimuth_offset=2e-3, elevation_offset=-1.5e-3)
    journal = journal_of(str(folder), STATION, BAND)
    for number in range(passes):
        journal.append(
            dataclasses.replace(one_pass(number, planted, 1e-5, random, "rotation"), station=STATION, band=BAND)
        )
    return planted


def target(t_s: float) -> Target:
    return Target(
        t_s=t_s, name="bird", azimuth_rad=1.0, elevation_rad=0.5, azimuth_rate_rad_s=0.0, elevation_rate_rad_s=0.0,
        azimuth_acceleration_rad_s2=0.0, elevation_acceleration_rad_s2=0.0, range_m=1e6, range_rate_m_s=0.0,
        refraction_rad=0.0,
    )  # fmt: skip


def sensed(node: Any, t_s: float) -> None:
    """Deliver what an observation at `t_s` needs; encoders turn at 0.02 rad/s in azimuth, read each 0.05 s."""
    for at_s in (t_s - 1.0, t_s + 1.0):
        give(node, "target", convert.target_to_message(target(at_s)))
    for at_s in (t_s - 0.05, t_s, t_s + 0.05, t_s + 0.1):
        position = [1.0 + 0.02 * (at_s - NOW_S), 0.5]
        reading = JointReading(t_s=at_s, position_rad=np.array(position), velocity_rad_s=np.zeros(2))
        give(node, "joint_states", convert.joints_to_message(reading))
    error = PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=1e-5, elevation_rad=-2e-5)
    give(node, "pointing_error", convert.error_to_message(error))


def test_the_model_of_the_station_is_published_with_the_activation(make: Callable[..., Any]) -> None:
    node = make("dss13")
    assert node.sent == []
    activated(node)
    (message,) = node.sent
    assert (message.name, message.station, message.header.stamp.sec) == (
        "dss13-commissioning",
        "Goldstone DSS-13",
        int(NOW_S),
    )
    health = node._health()
    assert (health.level, health.message) == (OK, "dss13-commissioning")
    assert health.values == {"observations": 0, "candidate": "", "shadow": ""}
    assert node.diagnostics._checks["model"] == node._health


def test_without_a_model_nothing_is_published_and_health_is_a_warning(make: Callable[..., Any]) -> None:
    node = activated(make())
    assert node.sent == []
    assert (node._health().level, node._health().message) == (WARN, "no model: commands are not corrected")


def test_an_observation_is_made_of_the_encoders_at_the_time_of_the_error(
    make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    node, rows = make(), []
    monkeypatch.setattr(node._keeper, "observe", rows.append)
    sensed(node, NOW_S)
    assert (len(node._log), rows) == (0, []), "not active"
    activated(node)
    sensed(node, NOW_S)
    (row,) = rows
    assert len(node._log) == 1
    assert row.t_s[0] == NOW_S
    assert row.observed_azimuth_rad[0] == pytest.approx(1.0 + 1e-5 / np.cos(0.5), abs=1e-9)
    assert row.observed_elevation_rad[0] == pytest.approx(0.5 - 2e-5, abs=1e-9)
    sensed(node, NOW_S + 0.9)
    assert len(rows) == 1, "spacing_s=1"
    sensed(node, NOW_S + 1.0)
    assert (len(rows), len(node._log)) == (2, 2)


def test_errors_of_a_scan_belong_to_its_centre(make: Callable[..., Any]) -> None:
    node = activated(make())
    for at_s in (NOW_S - 1.0, NOW_S + 1.0):
        give(node, "target", convert.target_to_message(target(at_s)))
        status = TrackingStatus(mode="conscan", sensor="conscan", scan_centre=[1.01, 0.5])
        status.header.stamp = stamp_from_seconds(at_s)
        give(node, "tracking_status", status)
    error = PointingError(t_s=NOW_S, sensor="conscan", cross_elevation_rad=0.0, elevation_rad=0.0)
    give(node, "pointing_error", convert.error_to_message(error))
    assert node._log.observations().observed_azimuth_rad[0] == pytest.approx(1.01, abs=1e-9)


def test_a_goal_is_accepted_by_an_active_node_and_a_campaign_only_alone(make: Callable[..., Any]) -> None:
    node = make()
    assert node._on_goal(RunCampaign.Goal()) == GoalResponse.REJECT
    assert node._on_fit_goal(FitModel.Goal()) == GoalResponse.REJECT
    activated(node)
    assert node._on_goal(RunCampaign.Goal()) == GoalResponse.ACCEPT
    assert node._on_fit_goal(FitModel.Goal()) == GoalResponse.ACCEPT
    node._runner = Runner()
    node._on_campaign(GoalHandle(RunCampaign.Goal(passes=[Pass()])))
    assert node._on_goal(RunCampaign.Goal()) == GoalResponse.REJECT, "there is one antenna"
    assert node._on_cancel(None) == CancelResponse.ACCEPT
    assert node._runner.cancels == 1


@pytest.mark.parametrize("resume", [False, True])
def test_a_campaign_begins_anew_unless_it_is_resumed(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator, resume: bool
) -> None:
    filled(tmp_path, random, 1)
    node = activated(make(calibrator__folder=str(tmp_path)))
    kept = len(node._log)
    assert kept > 10
    node._runner = Runner()
    goal = GoalHandle(RunCampaign.Goal(passes=[Pass(target="a"), Pass(target="b")], sensor="monopulse", resume=resume))
    node._on_campaign(goal)
    passes, sensor, log = node._runner.started
    assert ([each.target for each in passes], sensor, log is node._log) == (["a", "b"], "monopulse", True)
    assert len(node._log) == (kept if resume else 0)
    aside = [each.name for each in tmp_path.rglob("*1200000000*")]
    assert len(aside) == (0 if resume else 1)
    assert goal.ends == []


def test_a_campaign_that_cannot_start_ends_at_once_with_the_reason(make: Callable[..., Any]) -> None:
    node = activated(make())
    node._runner = Runner()
    node._runner.refusal = "passes is empty, must name at least one pass"
    goal = GoalHandle(RunCampaign.Goal())
    node._on_campaign(goal)
    assert goal.ends == ["execute"]
    result = node._conclude(goal)
    assert (result.success, result.passes_observed, result.message) == (False, 0, node._runner.refusal)
    assert goal.ends == ["execute", "abort"]
    assert node._on_goal(RunCampaign.Goal()) == GoalResponse.ACCEPT, "no campaign is under way"
    node._runner.refusal = ""
    node._on_campaign(GoalHandle(RunCampaign.Goal(passes=[Pass()])))
    assert node._reason == ""


def test_a_campaign_reports_each_observation_once_and_ends_its_goal(make: Callable[..., Any]) -> None:
    node = activated(make())
    assert node.turn() == 0.2
    node._runner = Runner()
    node._runner.number = 2
    goal = GoalHandle(RunCampaign.Goal(passes=[Pass(), Pass()]))
    node._on_campaign(goal)
    assert node.turn() == 0.02
    assert node.turn() == 0.02
    sensed(node, NOW_S)
    node.turn()
    assert node._runner.polls == 3
    assert [(each.observations, each.pass_number, each.target, each.progress) for each in goal.feedback] == [
        (0, 2, "bird", 0.5),
        (1, 2, "bird", 0.5),
    ]
    node._runner.count = 0
    assert node._progress().progress == 1.0
    node._runner.busy = False
    assert goal.ends == []
    assert node.turn() == 0.02
    assert goal.ends == ["execute"]
    assert node.turn() == 0.2


@pytest.mark.parametrize(
    ("observed", "fault", "cancel", "end", "message"),
    [
        (2, "", False, "succeed", "2 of 2 passes observed, 0 observations"),
        (1, "", False, "abort", "1 of 2 passes observed, 0 observations; b: the controller refused the pass"),
        (
            2, "drives cut", False, "abort",
            "stopped by a fault in pass 1 of 2: drives cut; 2 of 2 passes observed, 0 observations",
        ),
        (1, "", True, "canceled", "1 of 2 passes observed, 0 observations"),
    ],
)  # fmt: skip
def test_the_result_of_a_campaign_counts_passes_and_names_failures(
    make: Callable[..., Any], observed: int, fault: str, cancel: bool, end: str, message: str
) -> None:
    node = activated(make())
    node._runner = Runner()
    node._runner.observed, node._runner.fault = observed, fault
    if "refused" in message:
        node._runner.failures = ["b: the controller refused the pass"]
    goal = GoalHandle(RunCampaign.Goal(passes=[Pass(), Pass()]), cancel)
    result = node._conclude(goal)
    assert (result.message, result.passes_observed, result.fault) == (message, observed, fault)
    assert result.success == (end == "succeed")
    assert goal.ends == [end]
    assert (result.sectors_filled, result.verdict) == (0, "")


def test_a_fit_of_kept_observations_becomes_a_candidate_and_is_put_in_force_and_back(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator
) -> None:
    planted = filled(tmp_path, random)
    node = activated(make(calibrator__folder=str(tmp_path), shadow__accept="not worse"))
    refused = answer(node, "accept")
    assert (refused.success, refused.message) == (False, "no model has been fitted")
    goal = GoalHandle(FitModel.Goal(terms=["azimuth_offset", "elevation_offset"]))
    result = node._on_fit(goal)
    assert ([each.stage for each in goal.feedback], goal.ends) == (["fit"], ["succeed"])
    assert result.success
    assert (result.model.name, result.passes) == ("fit-1200000000", 6)
    values = dict(zip(result.model.terms, result.model.values, strict=True))
    for name in ("azimuth_offset", "elevation_offset"):
        assert values[name] == pytest.approx(planted.coefficients[name], abs=2e-4), name
    assert node._health().values["candidate"] == "fit-1200000000"
    assert node._health().values["shadow"] == "not yet observed in shadow"
    assert node.sent == [], "a candidate is not in force"
    # In a campaign it is scored meanwhile.
    node._runner = Runner()
    campaign = node._conclude(GoalHandle(RunCampaign.Goal(passes=[Pass(), Pass()])))
    assert campaign.message.endswith("observations"), "no verdict yet"
    assert campaign.sectors_filled == 36 - len(node._log.coverage(SECTORS).thin) > 0
    accepted = answer(node, "accept")
    assert accepted.message == "fit-1200000000 is in force; it was not yet observed in shadow"
    assert (node.sent[-1].name, node.sent[-1].header.stamp.sec) == ("fit-1200000000", int(NOW_S))
    assert node._on_fit(GoalHandle(FitModel.Goal(name="second"))).model.name == "second"
    assert answer(node, "reject").message == "second is dropped"
    assert not answer(node, "reject").success
    assert len(node.sent) == 1
    node._on_fit(GoalHandle(FitModel.Goal(name="third")))
    answer(node, "accept")
    assert answer(node, "rollback").message == "fit-1200000000 is in force again"
    assert [each.name for each in node.sent] == ["fit-1200000000", "third", "fit-1200000000"]


def test_a_verdict_of_the_shadow_is_in_the_result_of_a_campaign(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator
) -> None:
    planted = filled(tmp_path, random)
    node = activated(make(calibrator__folder=str(tmp_path)))
    node._on_fit(GoalHandle(FitModel.Goal(name="new", terms=["azimuth_offset", "elevation_offset"])))
    for number in range(10, 14):
        rows = dataclasses.replace(one_pass(number, planted, 1e-5, random, "rotation"), station=STATION, band=BAND)
        node._keeper.observe(rows)
    node._runner = Runner()
    result = node._conclude(GoalHandle(RunCampaign.Goal(passes=[Pass(), Pass()])))
    assert result.verdict == "better"
    assert "new is better after 4 passes in shadow" in result.message
    assert answer(node, "accept").message.startswith("new is in force; it was better after 4 passes in shadow")


def test_the_first_model_of_a_node_without_a_folder_is_rolled_back_to_none(make: Callable[..., Any]) -> None:
    node = activated(make(shadow__accept="not worse"))
    model = read_model(STATIONS / "bias_model_dss13_x.yaml")
    node._keeper.propose(dataclasses.replace(model, station=STATION, band=BAND, valid_from_t_s=NOW_S - 1.0))
    assert answer(node, "accept").success
    back = answer(node, "rollback")
    assert (back.success, back.message) == (True, "no model is in force again")
    _, message = node.sent
    assert (message.name, message.station, set(message.values)) == ("none", STATION, {0.0})


def test_a_fit_of_too_few_observations_is_aborted_with_the_reason(make: Callable[..., Any]) -> None:
    node = activated(make())
    goal = GoalHandle(FitModel.Goal())
    result = node._on_fit(goal)
    assert (result.success, goal.ends) == (False, ["abort"])
    assert result.message.startswith("0 observations, must have at least 30")
    assert node._health().values["candidate"] == ""


def test_the_rules_of_the_shadow_change_while_it_runs(make: Callable[..., Any]) -> None:
    node = activated(make(shadow__fewest_passes=4))
    assert node._keeper.rules.fewest_passes == 4
    node.set_parameters([Parameter("shadow.fewest_passes", value=7)])
    assert node._keeper.rules.fewest_passes == 7
    orbit = node.parameters.value("orbit")
    assert (orbit.along_track_m, orbit.cross_track_m, orbit.radial_m) == (100.0, 60.0, 30.0)
    (done,) = node.set_parameters([Parameter("orbit.radial_m", value=20.0)])
    assert done.successful, done.reason


def test_observations_that_the_disk_did_not_take_are_written_when_the_node_is_deactivated(
    make: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = activated(make("dss13", calibrator__folder=str(tmp_path)))
    node._runner = Runner()

    def full(_points: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(node._log._journal, "append", full)
        sensed(node, NOW_S)
    health = node._health()
    assert health.level == WARN
    assert health.message.startswith("1 observations are in memory only")
    assert health.message.endswith("No space left on device"), "there is a model"
    node.on_deactivate(ANY_STATE)
    assert node._runner.cancels == 1
    assert len(journal_of(str(tmp_path), "Goldstone DSS-13", BAND).points) == 1


def test_observations_are_not_kept_where_that_is_not_wanted(make: Callable[..., Any], tmp_path: Path) -> None:
    node = activated(make(calibrator__folder=str(tmp_path), calibrator__keep_observations=False))
    sensed(node, NOW_S)
    assert len(node._log) == 1
    assert not list(tmp_path.rglob("observations*"))


def test_the_temperature_of_the_mount_is_that_of_its_sensor(make: Callable[..., Any]) -> None:
    node = make()
    give(node, "weather/temperature", Temperature(temperature=-12.5))
    assert node._keeper.temperature_k == pytest.approx(260.65, abs=1e-9)
