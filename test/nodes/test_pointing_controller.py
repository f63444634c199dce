"""The controller's node: its goals come and end by the action, and what it decides is sent and signed."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from rclpy.serialization import serialize_message
from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import Temperature

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.ros import convert, convert_calibration, convert_planning
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams, digest_of
from rf_pointing.ros.signed_commands import cdr_bytes
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.pointing.certificates import pass_profile
from test.station.campaign.test_model_keeper import model_file

SELECT = "ephemeris_publisher/select_target"
LEVELS = {"OK": b"\x00", "WARN": b"\x01", "ERROR": b"\x02"}


@pytest.fixture(scope="module")
def sky() -> Any:
    """Return CBERS-2 seen from DSS-13, its first pass above 40 deg, and the profile of that."""
    track, epoch_s = load_track(SourceParams()), load_elements(SourceParams()).epoch_t_s
    window = first_pass_above(track, epoch_s, math.radians(40.0), math.radians(5.0), 2.0 * 86400.0)
    return track, window, pass_profile(track, window)


class Station:
    """A controller on a bench 5 s before a pass, with axes at its begin; `serve` gives it what it subscribes to."""

    def __init__(self, make_bench: Callable[..., Any], sky: Any, **given: Any) -> None:
        self.track, self.window, profile = sky
        self.bench = make_bench(PointingControllerNode, t_s=round(self.window.aos_t_s - 5.0, 1), **given)
        self.pass_message = convert_planning.pass_to_message(self.window)
        self.profiles = ours.PassProfileList(profiles=[convert_planning.profile_to_message(profile)])

    def up(self) -> "Station":
        self.bench.up().give("pass_profiles", self.profiles)
        self.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
        return self

    def run(self, periods: int) -> None:
        for _ in range(periods):
            axes_rad = [self.window.aos_azimuth_rad, self.window.aos_elevation_rad]
            reading = JointReading(t_s=self.bench.t_s, position_rad=axes_rad, velocity_rad_s=[0.0, 0.0])
            self.bench.give("joint_states", convert.joints_to_message(reading))
            target = self.track.target_at(round(self.bench.t_s + 2.0, 6))
            self.bench.give("target", convert.target_to_message(target))
            self.bench.run(0.1)

    def goal(self, **values: Any) -> Any:
        return self.bench.goal("track_pass", TrackPass.Goal(**{"sensor": "program", **values}))


@pytest.fixture
def station(make_bench: Callable[..., Any], sky: Any) -> Station:
    return Station(make_bench, sky)


def test_a_pass_is_certified_commanded_under_the_name_of_the_node_and_stopped_on_request(
    make_bench: Callable[..., Any], sky: Any, tmp_path: Any
) -> None:
    key = str(tmp_path / "command.key")
    station = Station(make_bench, sky, namespace="/gs1", command_key_file=key, certificate_folder=str(tmp_path)).up()
    station.run(2)
    goal = station.goal(target_pass=station.pass_message)
    station.run(21)
    bench = station.bench
    (certificate,) = bench.sent["pass_certificate"]
    assert (certificate.accepted, certificate.sequence, len(list(tmp_path.glob("*.json")))) == (True, 1, 1)
    command, status = bench.sent["joint_trajectory"][-1], bench.sent["tracking_status"][-1]
    signature = bench.sent["command_signature"][-1]
    CommandKey(CommandKeyParams(command_key_file=key), "/gs1/joint_trajectory").check(signature)
    payload = serialize_message(command)[: cdr_bytes(command)]
    assert (command.header.frame_id, signature.digest) == ("gs1/base_link", digest_of(payload))
    assert (signature.commander, seconds_from_stamp(command.header.stamp)) == ("/gs1/pointing_controller", bench.t_s)
    assert status.commands_sent == len(bench.sent["joint_trajectory"]) == 21
    # One at its begin and one per mode; the next is due after 5 s.
    assert len(goal.feedback) == len({each.status.mode for each in goal.feedback})
    assert (goal.feedback[-1].target_pass, goal.feedback[-1].progress) == (station.pass_message, 0.0)
    assert bench.health("tracking").values["mode"] == status.mode
    answer = bench.call("~/stop")
    assert (answer.success, answer.message, goal.end) == (True, "stopping", "")
    station.run(1)
    assert (goal.end, goal.result.message, goal.result.target_pass) == (
        "aborted", "stop was requested", station.pass_message,
    )  # fmt: skip
    assert bench.call("~/stop").message == "nothing is being tracked"


def test_goals_are_taken_one_at_a_time_while_the_node_is_active(station: Station) -> None:
    assert station.bench.step("configure")
    assert station.goal() is None
    assert station.bench.step("activate")
    first = station.goal(satellite="BIRD")
    assert station.goal(satellite="OTHER") is None
    assert first.cancel()
    station.bench.run(0.1)
    assert (first.end, first.result.message) == ("canceled", "the goal was cancelled")
    second = station.goal(satellite="OTHER")
    assert station.bench.step("deactivate")
    assert (second.end, second.result.message) == ("aborted", "the controller was deactivated")
    # A client that tries again and again does not fill the log.
    assert [words for _, words in station.bench.log if words.startswith("goal refused")] == ["goal refused: not active"]


def test_a_pass_by_name_is_asked_of_the_ephemeris_and_tracked(station: Station) -> None:
    station.up().run(2)
    near_s = station.window.tca_t_s
    goal = station.goal(satellite="CBERS 2", near=stamp_from_seconds(near_s), minimum_peak_elevation=0.25)
    request = station.bench.clients[SELECT].answer(SelectTarget.Response(success=True, passes=[station.pass_message]))
    assert (request.target, request.minimum_peak_elevation) == ("CBERS 2", 0.25)
    assert seconds_from_stamp(request.start) == pytest.approx(station.bench.t_s, abs=1e-6)
    station.run(10)
    assert (goal.end, len(station.bench.sent["joint_trajectory"]) > 5) == ("", True)
    assert goal.feedback[0].target_pass == station.pass_message


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (SelectTarget.Response(success=False, message="BIRD has no pass above 0.0 deg"), "has no pass above 0.0 deg"),
        (SelectTarget.Response(success=True), "ephemeris_publisher has found no pass"),
        (SelectTarget.Response(success=True, passes=[ours.Pass(target="BIRD")]), "must follow each other"),
    ],
)
def test_an_answer_without_a_pass_ends_the_goal_with_its_words(station: Station, answer: Any, words: str) -> None:
    goal = station.up().goal(satellite="BIRD")
    station.bench.clients[SELECT].answer(answer)
    station.bench.turn()
    assert (goal.end, goal.result.target_pass) == ("aborted", ours.Pass())
    assert words in goal.result.message


@pytest.mark.parametrize("values", [{"satellite": "BIRD", "target_pass": ours.Pass(target="OTHER")}, {}])
def test_a_goal_that_says_nothing_or_two_things_is_refused(station: Station, values: dict[str, Any]) -> None:
    goal = station.up().goal(**values)
    assert goal.end == "aborted"
    assert ("'OTHER': give one of them" if values else "must follow each other") in goal.result.message


def test_a_goal_without_a_sensor_takes_the_first_of_the_band(station: Station) -> None:
    station.up().run(2)
    station.goal(target_pass=station.pass_message, sensor="")
    station.run(2)
    assert station.bench.sent["tracking_status"][-1].sensor == station.bench.node.station.chosen_sensor()


def test_nodes_on_another_station_refuse_the_goal(station: Station) -> None:
    station.up()
    own = station.bench.sent["station_in_use"][0]
    other = ours.StationInUse(node="/rf_receiver", station="Other", band=own.band, digest="b" * 16)
    station.bench.publishers["station_in_use"] = ["/pointing_controller", "/rf_receiver"]
    station.bench.give("station_in_use", own, other)
    goal = station.goal(target_pass=station.pass_message)
    assert "rf_receiver on Other" in goal.result.message
    assert station.bench.health("tracking").level == LEVELS["ERROR"]


def test_the_model_is_used_at_the_temperature_of_the_mount(station: Station) -> None:
    version = replace(model_file("thermal"), model=BiasModel.zero().replace(elevation_temperature=2e-3))
    station.up().bench.give("pointing_model", convert_calibration.model_to_message(version))
    health = station.bench.health("tracking")
    assert (health.level, "no temperature has been received" in health.message) == (LEVELS["WARN"], True)
    station.bench.give("weather/temperature", Temperature(temperature=15.0))
    assert station.bench.health("tracking").level == LEVELS["OK"]
    station.bench.give("weather/temperature", Temperature(temperature=45.0))
    assert "3.44 deg off the axes" in station.bench.health("tracking").message


def test_limits_change_while_the_controller_works_and_timing_does_not(station: Station) -> None:
    bench = station.up().bench
    assert bench.change(**{"pointing.on_target_deg": 0.07}) == ""
    assert "read when the node is configured" in bench.change(**{"pointing.period_s": 0.2})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"limits.azimuth_maximum_deg": 10.0}, "limits.azimuth_maximum_deg: no such parameter"),
        ({"limits.elevation_min_deg": 5.0}, "limits.elevation_min_deg is given by the station description: mount.elev"),
        ({"pointing.period_s": math.nan}, "period_s"),
        ({"pointing.transport_s": 0.15}, "transport_s=0.15 must be a whole number of period_s"),
        ({"station": "nowhere.yaml"}, "nowhere.yaml: no such file"),
        ({"autotrack.sensor": 7}, "sensor"),
    ],
)
def test_a_bad_parameter_leaves_the_node_unconfigured_with_its_key(
    make_bench: Callable[..., Any], given: dict[str, Any], words: str
) -> None:
    bench = make_bench(PointingControllerNode, **given)
    assert not bench.step("configure")
    assert words in bench.health("state").message


def test_a_feed_is_calibrated_during_a_monopulse_pass_alone(station: Station) -> None:
    answer = station.up().bench.call("~/calibrate")
    assert (answer.success, bool(answer.message)) == (False, True)


def test_cleanup_leaves_nothing_in_the_graph(station: Station) -> None:
    node = station.bench.node
    kinds = ("subscriptions", "publishers", "services", "timers")
    before = [len(list(getattr(node, kind))) for kind in kinds]
    station.up()
    assert {"tracking", "executive", "clocks"} <= station.bench.health_names()
    assert station.bench.step("deactivate")
    assert station.bench.step("cleanup")
    assert [len(list(getattr(node, kind))) for kind in kinds] == before


@pytest.fixture
def second(make_bench: Callable[..., Any], sky: Any, tmp_path: Any) -> Station:
    """The second of two controllers, and a while in which the first one claims the antenna."""
    given = {"namespace": "/gs1", "command_key_file": str(tmp_path / "key"), "lifecycle.standby": "second"}
    station = Station(make_bench, sky, **given).up()
    station.key = CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "key")), "/gs1/joint_trajectory")
    return station


def run_with_claims(station: Station, key: CommandKey, seconds: float, *, old_s: float = 0.0) -> None:
    for number in range(round(10.0 * seconds)):
        stamp = stamp_from_seconds(station.bench.t_s - old_s)
        station.bench.give("command_signature", key.sign(b"", stamp, number, "/gs1/pointing_controller"))
        station.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
        station.run(1)


def sent_by(station: Station) -> set[str]:
    """Return the topics of its work: parameters and diagnostics are those of any node."""
    return {topic for topic, messages in station.bench.sent.items() if messages and not topic.startswith("/")}


def test_one_that_stands_by_sends_nothing_until_the_other_falls_silent(second: Station) -> None:
    run_with_claims(second, second.key, 12.0)
    assert sent_by(second) == set()
    assert second.bench.health("standby").message == "stands by"
    names = {each.hardware_id for each in second.bench.sent["/diagnostics"][-1].status}
    assert names == {"/gs1/pointing_controller_standby"}
    assert second.goal(target_pass=second.pass_message) is None
    second.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
    second.run(22)
    assert second.bench.health("standby").message == "stands by"
    second.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
    second.run(2)
    assert second.bench.health("standby").message == "works"
    assert sent_by(second) >= {"tracking_status", "station_in_use", "band_in_use", "command_signature"}
    assert second.bench.sent["command_signature"][-1].commander == "/gs1/pointing_controller_standby"
    goal = second.goal(target_pass=second.pass_message)
    second.run(5)
    assert len(second.bench.sent["joint_trajectory"]) > 0
    assert goal.end == ""


def test_one_whom_the_antenna_does_not_obey_is_silent_and_leaves_the_client_to_the_other(second: Station) -> None:
    for _ in range(90):
        second.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
        second.run(1)
    goal = second.goal(target_pass=second.pass_message)
    second.run(5)
    for accepted in (1, 2):
        status = ours.AntennaStatus(commander="/gs1/pointing_controller", commands_accepted=accepted)
        second.bench.give("antenna_status", status)
    second.run(1)
    sent = {topic: len(second.bench.sent[topic]) for topic in sent_by(second)}
    second.run(3)
    assert second.bench.health("standby").message == "stands by in a pass"
    second.bench.give("tracking_status", ours.TrackingStatus(target=""))
    second.run(3)
    assert second.bench.health("standby").message == "stands by"
    assert {topic: len(second.bench.sent[topic]) for topic in sent} == sent
    assert goal.end == ""


@pytest.mark.parametrize("wrong", ["key", "age", "number"])
def test_claims_of_a_stranger_old_ones_and_those_sent_again_are_refused(
    second: Station, tmp_path: Any, wrong: str
) -> None:
    other = CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "other")), "/gs1/joint_trajectory")
    if wrong == "number":
        claim = second.key.sign(b"", stamp_from_seconds(second.bench.t_s), 1, "/gs1/pointing_controller")
        for _ in range(90):
            second.bench.give("command_signature", claim)
            second.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
            second.run(1)
    else:
        run_with_claims(second, other if wrong == "key" else second.key, 9.0, old_s=2.0 if wrong == "age" else 0.0)
    assert second.bench.health("standby").message == "works"
    refused = second.bench.health("inputs").values["refused command_signature"]
    assert refused == ("89" if wrong == "number" else "90")


def test_one_on_another_description_never_takes_over(second: Station) -> None:
    second.bench.give("station_in_use", ours.StationInUse(node="/gs1/pointing_controller", station="other", digest="1"))
    for _ in range(100):
        second.bench.give("antenna_status", ours.AntennaStatus(mode="holding"))
        second.run(1)
    health = second.bench.health("standby")
    assert (health.level, "runs on another description: other" in health.message) == (LEVELS["ERROR"], True)
    assert sent_by(second) == set()
