"""The nodes of each array system, joined by their topics in one process: what they publish is near the truth that they do."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="nodes need ROS 2", exc_type=ImportError)
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from rf_pointing.array_sensors.attitude.quaternion import rotation_angle_between_rad
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS
from rf_pointing.array_sensors.nodes.array_receiver import ArrayReceiver
from rf_pointing.array_sensors.nodes.array_tracker import ArrayTracker
from rf_pointing.array_sensors.nodes.doa_attitude import DoaAttitudeNode
from rf_pointing.array_sensors.nodes.doa_source import DoaSource
from rf_pointing.array_sensors.nodes.interferometer_source import InterferometerSourceNode
from rf_pointing.array_sensors.nodes.interferometer_tracker import InterferometerTrackerNode
from rf_pointing.array_sensors.nodes.tripulse_attitude import TripulseAttitudeNode
from rf_pointing.array_sensors.nodes.tripulse_receiver import TripulseReceiverNode
from rf_pointing.array_sensors.nodes.tripulse_source import TripulseSourceNode
from rf_pointing.core import PointingError
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.ros.convert import error_from_message, error_to_message
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.stamps import seconds_from_stamp

CONFIG = Path(__file__).parents[3] / "config"
START_S = 1_767_225_600.0
SUCCESS = TransitionCallbackReturn.SUCCESS
ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


class Bench:
    """Nodes whose topics are joined without a wire, and whose time goes on by hand."""

    def __init__(self) -> None:
        self.t_s = START_S
        self.sent: dict[str, list[Any]] = {}
        self.nodes: list[Any] = []
        self._heard: dict[str, list[Callable[[Any], None]]] = {}
        self._work: dict[Any, list[list[Any]]] = {}

    def add(self, kind: type, below: str = "", **given: Any) -> Any:
        """Return a node, configured; `below` is the namespace under which its topics are."""
        node = kind()
        # Two receivers of one name: on a station each has a namespace of its own.
        node.lock.release()
        together = [Parameter(name.replace("__", "."), value=value) for name, value in given.items()]
        assert node.set_parameters_atomically(together).successful
        node.now_s = lambda: self.t_s
        node.knows_time = lambda: True

        class Sender:
            def __init__(self, topic: str) -> None:
                self.topic = topic

            def publish(self, message: Any) -> None:
                bench.sent.setdefault(self.topic, []).append(message)
                for callback in bench._heard.get(self.topic, []):
                    callback(message)

        bench = self
        node.stream = node.publisher = lambda _type, topic, _qos: Sender(below + topic)
        node.listen = lambda _type, topic, callback, _qos, **_: self._heard.setdefault(below + topic, []).append(
            callback
        )
        node.every = lambda period_s, work: self._work.setdefault(node, []).append(
            [self.t_s + period_s, period_s, work]
        )
        assert node.on_configure(ANY_STATE) == SUCCESS, node._reason
        self.nodes.append(node)
        return node

    def activate(self) -> None:
        for node in self.nodes:
            assert node.on_activate(ANY_STATE) == SUCCESS, node._reason

    def stop(self, node: Any) -> None:
        node.on_deactivate(ANY_STATE)
        self._work.pop(node, None)

    def run(self, until_s: float, *, silent: tuple[Any, ...] = ()) -> None:
        """Do the periodic work that is due, in the order of time; that of `silent` nodes is skipped."""
        while True:
            due = [item for node, work in self._work.items() if node not in silent for item in work]
            item = min(due, key=lambda item: item[0])
            if item[0] > START_S + until_s:
                return
            self.t_s = item[0]
            item[0] += item[1]
            item[2](self.t_s)

    def health(self, node: Any, name: str) -> Any:
        return node.diagnostics._checks[name]()

    def close(self) -> None:
        for node in self.nodes:
            node.end()
            node.destroy_node()


@pytest.fixture
def bench(default_context: None) -> Iterator[Bench]:
    found = Bench()
    yield found
    found.close()


def given(system: str, node: str) -> dict[str, Any]:
    """Return the parameters of a node in the file of its system."""
    values = read_parameter_files([CONFIG / f"{system}.yaml"])[node]
    return {name.replace(".", "__"): value for name, value in values.items()}


def published(system: str) -> set[str]:
    return {topic.name for topic in ARRAY_SYSTEMS[system].topics} - {"clock", "/diagnostics"}


def truth_near(messages: list[Any], t_s: float, read: Callable[[Any], tuple[float, Any]]) -> Any:
    return min((read(message) for message in messages), key=lambda pair: abs(pair[0] - t_s))[1]


def test_the_attitude_of_a_satellite_is_found_from_what_its_array_hears(bench: Bench) -> None:
    source = bench.add(DoaSource, **given("doa", "doa_source"))
    tracker = bench.add(DoaAttitudeNode, start__settle_s=10.0, **given("doa", "doa_attitude"))
    bench.activate()
    bench.run(60.0)
    assert bench.sent.keys() == published("doa")
    assert (
        len(bench.sent["known_torque"])
        == len(bench.sent["sim/attitude"])
        == len(bench.sent["sim/attitude_rate"])
        == 120
    )
    assert len(bench.sent["attitude"]) == len(bench.sent["array_snapshots"])
    found = [convert.attitude_from_message(message) for message in bench.sent["attitude"]]
    valid = [one for one in found if one.valid]
    assert len(valid) > 40
    assert len(bench.sent["attitude_rate"]) == len(valid)
    last = valid[-1]
    assert last.t_s > START_S + 58.0
    quaternion = truth_near(bench.sent["sim/attitude"], last.t_s, convert.orientation_from_message)
    assert rotation_angle_between_rad(last.quaternion, quaternion) < 4.0 * np.sqrt(np.trace(last.covariance_rad2))
    rate = convert.rate_from_message(bench.sent["attitude_rate"][-1])
    turning = truth_near(bench.sent["sim/attitude_rate"], rate.t_s, convert.vector_from_message)
    assert np.linalg.norm(rate.rate_rad_s - turning) < 4.0 * np.sqrt(np.trace(rate.covariance_rad2_s2))
    frames = [bench.sent[name][0].header.frame_id for name in ("attitude", "attitude_rate", "sim/attitude_rate")]
    assert frames == [convert.ORBIT_FRAME, convert.BODY_FRAME, convert.BODY_FRAME]
    assert bench.sent["attitude"][0].child_frame_id == convert.BODY_FRAME
    for node, name in ((source, "blocks"), (tracker, "blocks"), (tracker, "torques")):
        assert bench.health(node, name).level == OK
    assert bench.health(tracker, "torques").values["valid"] == 120


def test_silence_of_the_array_is_bridged_up_to_the_last_two_seconds(bench: Bench) -> None:
    source = bench.add(DoaSource, **given("doa", "doa_source"))
    tracker = bench.add(DoaAttitudeNode, start__settle_s=10.0, **given("doa", "doa_attitude"))
    bench.activate()
    bench.run(30.0)
    before = len(bench.sent["attitude"])
    bench.run(31.9, silent=(source,))
    assert len(bench.sent["attitude"]) == before
    bench.run(36.0, silent=(source,))
    carried = [seconds_from_stamp(message.header.stamp) for message in bench.sent["attitude"][before:]]
    assert carried[-1] == pytest.approx(START_S + 34.0)
    assert bench.health(tracker, "blocks").message == "no block for more than 2.0 s"
    assert bench.health(tracker, "blocks").level == WARN


def test_what_arrives_at_a_node_that_is_not_active_is_no_input(bench: Bench) -> None:
    source = bench.add(DoaSource, **given("doa", "doa_source"))
    tracker = bench.add(DoaAttitudeNode, **given("doa", "doa_attitude"))
    assert source.on_activate(ANY_STATE) == SUCCESS
    bench.run(2.0)
    assert "attitude" not in bench.sent
    for name in ("blocks", "torques"):
        assert bench.health(tracker, name).message == "nothing received yet"
    assert tracker.on_activate(ANY_STATE) == SUCCESS
    bench.run(3.0)
    heard = len(bench.sent["attitude"])
    assert heard > 0
    bench.stop(tracker)
    bench.run(4.0)
    assert len(bench.sent["attitude"]) == heard
    sent = len(bench.sent["known_torque"])
    bench.stop(source)
    assert not source._blocks.open
    assert len(bench.sent["known_torque"]) == sent


def test_the_attitude_of_an_array_is_found_from_the_lines_of_sight_of_two_stations(bench: Bench) -> None:
    source = bench.add(TripulseSourceNode, **given("tripulse", "tripulse_source"))
    stations = ("usingen", "hartebeesthoek")
    receivers = [
        bench.add(TripulseReceiverNode, f"{name}/", station__name=name, **given("tripulse", "tripulse_receiver"))
        for name in stations
    ]
    solver = bench.add(TripulseAttitudeNode, **given("tripulse", "tripulse_attitude"))
    bench.activate()
    bench.run(5.0)
    assert bench.sent.keys() == published("tripulse")
    assert {name: len(messages) for name, messages in bench.sent.items()} == dict.fromkeys(bench.sent, 5)
    for name in stations:
        assert [message.station for message in bench.sent[f"{name}/tripulse_measurement"]] == [name] * 5
        assert all(message.valid for message in bench.sent[f"{name}/tripulse_measurement"])
    found = [convert.attitude_from_message(message) for message in bench.sent["attitude"]]
    for one in found:
        quaternion = truth_near(bench.sent["sim/attitude"], one.t_s, convert.orientation_from_message)
        assert one.valid
        assert rotation_angle_between_rad(one.quaternion, quaternion) < 4.0 * np.sqrt(np.trace(one.covariance_rad2))
    assert bench.sent["attitude"][0].child_frame_id == convert.ARRAY_FRAME
    assert bench.sent["sim/attitude"][0].header.frame_id == convert.ORBIT_FRAME
    assert bench.health(source, "frames").values["valid"] == 5
    assert [bench.health(receiver, "frames").values["valid"] for receiver in receivers] == [5, 5]
    assert bench.health(solver, "lines of sight").values["valid"] == 10
    # A frame that is another station's is refused, and so is what arrives when a node is not active.
    frame = bench.sent["usingen/tripulse_frame"][-1]
    receivers[1]._frames.take(lambda: receivers[1]._measure(frame))
    assert bench.health(receivers[1], "frames").message == "station='usingen' must be 'hartebeesthoek'"
    for node in (solver, *receivers):
        bench.stop(node)
    assert not any(intake.open for intake in (solver._lines, *(receiver._frames for receiver in receivers)))
    bench.stop(source)
    assert not source._sending.open


def test_a_receiver_without_a_name_is_that_of_its_namespace_or_refused(bench: Bench) -> None:
    node = TripulseReceiverNode()
    node.lock.release()
    bench.nodes.append(node)
    assert node.on_configure(ANY_STATE) != SUCCESS
    assert "must name the station" in node._reason
    node.get_namespace = lambda: "/tripulse/wallops"
    assert node.on_configure(ANY_STATE) == SUCCESS
    assert node._station == "wallops"


def test_pose_and_motion_of_an_approaching_spacecraft_are_found(bench: Bench) -> None:
    source = bench.add(InterferometerSourceNode, **given("interferometer", "interferometer_source"))
    tracker = bench.add(InterferometerTrackerNode, **given("interferometer", "interferometer_tracker"))
    bench.activate()
    bench.run(20.0)
    assert bench.sent.keys() == published("interferometer")
    counts = {name: len(messages) for name, messages in bench.sent.items()}
    assert counts["interferometer_measurement"] == counts["sim/relative_pose"] == counts["sim/relative_twist"] == 10
    assert counts["relative_pose_status"] == 10
    assert counts["relative_pose"] == counts["relative_twist"] >= 8
    t_s, pose = convert.pose_from_messages(bench.sent["relative_pose"][-1], bench.sent["relative_twist"][-1])
    true_s, truth = convert.pose_from_messages(
        bench.sent["sim/relative_pose"][-1], bench.sent["sim/relative_twist"][-1]
    )
    assert t_s == true_s
    sigma = np.sqrt(np.diag(pose.pose_covariance))
    assert np.all(np.abs(pose.position_m - truth.position_m) < 4.0 * sigma[:3])
    twist = np.sqrt(np.diag(pose.twist_covariance))
    assert np.all(np.abs(pose.velocity_m_s - truth.velocity_m_s) < 4.0 * twist[:3])
    assert np.linalg.norm(truth.position_m) == pytest.approx(2000.0, rel=0.03)
    assert bench.health(source, "sequences").values["rejected"] == 0
    assert bench.health(tracker, "sequences").values["rejected"] == 0
    # Without a measurement for 5 s the pose is carried on, and says so.
    before = len(bench.sent["relative_pose_status"])
    bench.run(24.9, silent=(source,))
    assert len(bench.sent["relative_pose_status"]) == before
    bench.run(32.0, silent=(source,))
    assert len(bench.sent["relative_pose_status"]) > before
    assert bench.health(tracker, "sequences").message == bench.sent["relative_pose_status"][-1].reason != ""
    for node in (source, tracker):
        bench.stop(node)
        assert not node._sequences.open


def test_sequences_longer_than_their_period_are_refused(bench: Bench) -> None:
    node = InterferometerSourceNode()
    node.lock.release()
    bench.nodes.append(node)
    node.set_parameters([Parameter("source.period_s", value=0.5)])
    assert node.on_configure(ANY_STATE) != SUCCESS
    assert node._reason.startswith("source.period_s=0.5 must be >= the sequence's ")


def test_a_dish_knows_from_the_array_on_it_how_far_the_target_is_off(bench: Bench) -> None:
    receiver, tracker = bench.add(ArrayReceiver), bench.add(ArrayTracker)
    truth = PointingError(
        t_s=START_S, sensor="truth", cross_elevation_rad=0.02, elevation_rad=-0.03, carrier_to_noise_db_hz=60.0
    )
    (heard,) = bench._heard["sim/pointing_error"]
    heard(error_to_message(truth))
    assert not {"array_snapshots", "pointing_error"} & bench.sent.keys()
    bench.activate()
    heard(error_to_message(truth))
    found = error_from_message(bench.sent["pointing_error"][-1])
    assert found.valid
    miss = np.array([found.cross_elevation_rad - 0.02, found.elevation_rad + 0.03])
    assert miss @ np.linalg.solve(found.covariance_rad2, miss) < 20.0
    health = bench.health(tracker, "blocks")
    assert (health.level, health.message) == (OK, "errors are valid")
    tracker._tracker.last_reason = "too weak"
    assert (bench.health(tracker, "blocks").level, bench.health(tracker, "blocks").message) == (WARN, "too weak")
    bench.stop(tracker)
    heard(error_to_message(replace(truth, t_s=START_S + 1.0)))
    assert len(bench.sent["pointing_error"]) == 1
    assert len(bench.sent["array_snapshots"]) == 2
    assert receiver.active


@pytest.mark.parametrize(
    ("module", "kind"),
    [
        ("array_receiver", ArrayReceiver),
        ("array_tracker", ArrayTracker),
        ("doa_attitude", DoaAttitudeNode),
        ("doa_source", DoaSource),
        ("interferometer_source", InterferometerSourceNode),
        ("interferometer_tracker", InterferometerTrackerNode),
        ("tripulse_attitude", TripulseAttitudeNode),
        ("tripulse_receiver", TripulseReceiverNode),
        ("tripulse_source", TripulseSourceNode),
    ],
)
@pytest.mark.usefixtures("default_context")
def test_an_executable_runs_its_node(module: str, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded, started = importlib.import_module(f"rf_pointing.array_sensors.nodes.{module}"), list[type]()
    monkeypatch.setattr(loaded, "run", started.append)
    loaded.main()
    assert started == [kind]
    node = kind()
    node.lock.release()
    assert node.get_name() == module
    node.end()
    node.destroy_node()


def test_work_is_done_once_a_period_and_silence_looked_for_twice_as_often_as_it_lasts(bench: Bench) -> None:
    kinds = {
        DoaSource: ("source", 0.5, 0.5),
        TripulseSourceNode: ("source", 1.25, 1.25),
        InterferometerSourceNode: ("source", 3.0, 3.0),
        DoaAttitudeNode: ("", 0.0, 1.0),
    }
    for kind, (group, given_s, _) in kinds.items():
        bench.add(kind, **({f"{group}__period_s": given_s} if group else {}))
    bench.add(InterferometerTrackerNode, tracking__silence_s=4.0)
    bench.activate()
    periods = {type(node): [item[1] for item in work] for node, work in bench._work.items()}
    expected = {kind: [period_s] for kind, (*_, period_s) in kinds.items()}
    assert periods == {**expected, InterferometerTrackerNode: [2.0]}


def test_a_silence_is_carried_on_up_to_its_length_before_the_clock(bench: Bench) -> None:
    source = bench.add(DoaSource, **given("doa", "doa_source"))
    bench.add(DoaAttitudeNode, **given("doa", "doa_attitude"))
    bench.activate()
    bench.run(3.0)
    last_s = seconds_from_stamp(bench.sent["attitude"][-1].header.stamp)
    before = len(bench.sent["attitude"])
    bench.run(last_s - START_S + 3.1, silent=(source,))
    carried = [seconds_from_stamp(message.header.stamp) for message in bench.sent["attitude"][before:]]
    assert carried
    assert carried[-1] == pytest.approx(bench.t_s - 2.0)


def test_a_receiver_is_named_by_its_namespace_unless_it_is_told_its_station(bench: Bench) -> None:
    node = bench.add(TripulseReceiverNode, station__name="kourou")
    node.get_namespace = lambda: "/tripulse/wallops"
    node.configure()
    assert node._station == "kourou"
