"""The bias calibrator between its topics: goals, observations, and the model that it publishes."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import Pass, TrackingStatus
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import Temperature

from rf_pointing.core import JointReading, PointingError
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.ros import convert
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.campaign.calibrator import journal_of
from test.station.campaign.test_calibrator import NOW_S, OFFSETS, commissioned, filled, target


@pytest.fixture
def make(make_bench: Callable[..., Any]) -> Callable[..., Any]:
    """Return a maker of calibrators of the 3.7-m dish, which has no model."""
    return lambda station="leo_3m7", **given: make_bench(BiasCalibrator, t_s=NOW_S, station=station, **given)


def sense(bench: Any, t_s: float, sensor: str = "monopulse") -> None:
    """Deliver what an observation at `t_s` needs; encoders turn at 0.02 rad/s in azimuth, read each 0.05 s."""
    bench.give("target", *(convert.target_to_message(target(t_s + late_s)) for late_s in (-1.0, 1.0)))
    for at_s in (t_s - 0.05, t_s, t_s + 0.05, t_s + 0.1):
        position = np.array([1.0 + 0.02 * (at_s - NOW_S), 0.5])
        reading = JointReading(t_s=at_s, position_rad=position, velocity_rad_s=np.zeros(2))
        bench.give("joint_states", convert.joints_to_message(reading))
    for at_s in (t_s - 1.0, t_s + 1.0):
        status = TrackingStatus(mode=sensor, sensor=sensor, scan_centre=[1.01, 0.5])
        status.header.stamp = stamp_from_seconds(at_s)
        bench.give("tracking_status", status)
    error = PointingError(t_s=t_s, sensor=sensor, cross_elevation_rad=1e-5, elevation_rad=-2e-5)
    bench.give("pointing_error", convert.error_to_message(error))


def test_the_model_of_the_station_is_published_with_the_activation_and_others_publish_none(
    make: Callable[..., Any],
) -> None:
    (message,) = make("dss13").up().sent["pointing_model"]
    found = (message.name, message.station, message.header.stamp.sec)
    assert found == ("dss13-commissioning", "Goldstone DSS-13", int(NOW_S))
    bench = make().up()
    assert bench.sent["pointing_model"] == []
    assert bench.health("model").message == "no model: commands are not corrected"


@pytest.mark.parametrize(
    ("sensor", "azimuth_rad"), [("monopulse", 1.0 + 1e-5 / np.cos(0.5)), ("conscan", 1.01 + 1e-5 / np.cos(0.5))]
)
def test_an_observation_is_made_of_the_encoders_or_the_centre_of_the_scan_at_the_time_of_the_error(
    make: Callable[..., Any], sensor: str, azimuth_rad: float
) -> None:
    bench = make()
    assert bench.step("configure")
    sense(bench, NOW_S, sensor)
    assert bench.health("model").values["observations"] == "0", "not active"
    assert bench.step("activate")
    sense(bench, NOW_S, sensor)
    row = bench.node.calibrator.log.observations()
    assert row.observed_azimuth_rad == pytest.approx([azimuth_rad], abs=1e-9)
    assert row.observed_elevation_rad == pytest.approx([0.5 - 2e-5], abs=1e-9)
    bench.give("weather/temperature", Temperature(temperature=-12.5))
    assert bench.node.calibrator.keeper.temperature_k == pytest.approx(260.65, abs=1e-9)


@pytest.mark.parametrize("resume", [False, True])
def test_a_campaign_begins_anew_unless_it_is_resumed_and_reports_until_its_result(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator, resume: bool
) -> None:
    filled(tmp_path, random, 1)
    bench = make(**{"calibrator.folder": str(tmp_path)}).up()
    kept = int(bench.health("model").values["observations"])
    request = RunCampaign.Goal(
        passes=[Pass(target="a", aos=stamp_from_seconds(NOW_S))], sensor="monopulse", resume=resume
    )
    goal = bench.goal("~/run_campaign", request)
    assert bench.goal("~/run_campaign", request) is None, "there is one antenna"
    before = kept if resume else 0
    assert len(list(tmp_path.rglob(f"*{NOW_S:.0f}*"))) == (not resume)
    select, track = bench.clients["ephemeris_publisher/select_target"], bench.clients["track_pass"]
    for _ in range(2):
        assert bench.node.turn() == 0.02
    wanted = select.answer(SelectTarget.Response(success=True))
    assert (wanted.target, wanted.start.sec) == ("a", int(NOW_S) - 7200)
    bench.node.turn()
    sense(bench, NOW_S)
    ended = SimpleNamespace(result=SimpleNamespace(seconds_tracked=9.0, message="", fault=""))
    result = SimpleNamespace(done=lambda: True, result=lambda: ended)
    offered = track.answer(SimpleNamespace(accepted=True, get_result_async=lambda: result))
    assert (offered.target_pass.target, offered.sensor) == ("a", "monopulse")
    for _ in range(2):
        bench.node.turn()
    assert [(each.observations, each.pass_number) for each in goal.feedback] == [(before, 1), (before + 1, 1)]
    assert (goal.end, goal.result.success, goal.result.passes_observed) == ("succeeded", True, 1)
    assert goal.result.message == f"1 of 1 passes observed, {before + 1} observations"
    assert bench.node.turn() == 0.2


def test_a_campaign_that_cannot_start_ends_at_once_with_the_reason(make: Callable[..., Any]) -> None:
    bench = make()
    assert bench.step("configure")
    assert bench.goal("~/run_campaign", RunCampaign.Goal(passes=[Pass()])) is None, "not active"
    assert bench.goal("~/fit_model", FitModel.Goal()) is None
    assert bench.step("activate")
    for request, reason in (
        (RunCampaign.Goal(), "passes is empty, must name at least one pass"),
        (RunCampaign.Goal(passes=[Pass()]), "ephemeris_publisher and pointing_controller must be running"),
    ):
        goal = bench.goal("~/run_campaign", request)
        assert (goal.end, goal.result.success, reason in goal.result.message) == ("aborted", False, True)
        bench.clients["track_pass"].ready = False


def test_a_fit_becomes_a_candidate_and_what_is_in_force_is_published(
    make: Callable[..., Any], tmp_path: Path, random: np.random.Generator
) -> None:
    filled(tmp_path, random)
    bench = make(**{"calibrator.folder": str(tmp_path), "shadow.accept": "not worse"}).up()
    goal = bench.goal("~/fit_model", FitModel.Goal(terms=list(OFFSETS)))
    assert ([each.stage for each in goal.feedback], goal.end) == (["fit"], "succeeded")
    assert (goal.result.success, goal.result.model.name, goal.result.passes) == (True, "fit-1200000000", 6)
    assert bench.sent["pointing_model"] == [], "a candidate is not in force"
    assert bench.call("~/accept").message == "fit-1200000000 is in force; it was not yet observed in shadow"
    assert not bench.call("~/reject").success
    assert not bench.call("~/rollback").success
    assert [each.name for each in bench.sent["pointing_model"]] == ["fit-1200000000"]
    assert bench.change(**{"shadow.fewest_passes": 7}) == ""
    assert bench.node.calibrator.keeper.rules.fewest_passes == 7
    assert bench.goal("~/fit_model", FitModel.Goal(terms=["nonsense"])).end == "aborted"


def test_the_first_model_is_rolled_back_to_one_that_corrects_nothing(make: Callable[..., Any]) -> None:
    bench = make(**{"shadow.accept": "not worse"}).up()
    bench.node.calibrator.keeper.propose(commissioned())
    bench.call("~/accept")
    assert bench.call("~/rollback").message == "no model is in force again"
    message = bench.sent["pointing_model"][-1]
    assert (message.name, message.station, set(message.values)) == ("none", "LEO 3.7 m", {0.0})


def test_observations_that_the_disk_did_not_take_are_written_when_the_node_is_deactivated(
    make: Callable[..., Any], tmp_path: Path
) -> None:
    bench = make("dss13", **{"calibrator.folder": str(tmp_path)}).up()
    journal = journal_of(str(tmp_path), "Goldstone DSS-13", "X")
    journal.path.mkdir(parents=True)
    sense(bench, NOW_S)
    assert bench.health("model").message.startswith("1 observations are in memory only: ")
    journal.path.rmdir()
    assert bench.step("deactivate")
    assert len(journal_of(str(tmp_path), "Goldstone DSS-13", "X").points) == 1
