"""The nodes of each array system, joined by their topics in one process: what they publish is near the truth that they do."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="nodes need ROS 2")

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
from rf_pointing.ros.stamps import seconds_from_stamp

CONFIG = Path(__file__).parents[3] / "config" / "array_sensors"
START_S = 1_767_225_600.0
STEP_S = 0.25
OK, WARN = b"\x00", b"\x01"


class Joined:
    """Nodes on benches whose topics are joined, as if each had its process; `sent` are the messages of all."""

    def __init__(self, make_bench: Callable[..., Any]) -> None:
        self.t_s, self.sent = START_S, dict[str, list[Any]]()
        self._make, self._benches, self._taken = make_bench, list[Any](), dict[tuple[int, str], int]()

    def add(self, kind: type, system: str = "", node: str = "", namespace: str = "/", **given: Any) -> Any:
        """Return a node with the parameters of its system's file, configured."""
        values = dict(read_parameter_files([CONFIG / f"{system}.yaml"])[node]) if system else {}
        bench = self._make(kind, beside=True, namespace=namespace, t_s=START_S, **{**values, **given})
        assert bench.step("configure"), bench.health("state").message
        self._benches.append(bench)
        return bench

    def activate(self) -> None:
        for bench in self._benches:
            assert bench.step("activate"), bench.health("state").message

    def run(self, until_s: float, *, silent: Any = None) -> None:
        """Let time go on to so long after the start; `silent` does nothing meanwhile."""
        while self.t_s < START_S + until_s - 1e-6:
            self.t_s += STEP_S
            for bench in self._benches:
                bench.wait(STEP_S)
            for bench in self._benches:
                if bench is not silent:
                    bench.turn()
                self.forward()

    def forward(self) -> None:
        """Deliver what was published since the last call, until nothing more comes of it."""
        news = True
        while news:
            news = False
            for number, bench in enumerate(self._benches):
                for topic in [topic for topic in bench.sent if not topic.startswith("/")]:
                    full, begin = bench.node.resolve_topic_name(topic), self._taken.get((number, topic), 0)
                    self._taken[number, topic] = len(bench.sent[topic])
                    for message in bench.sent[topic][begin:]:
                        news = True
                        self.sent.setdefault(full[1:], []).append(message)
                        for other in self._benches:
                            if full in [name for name, _ in other.inputs()]:
                                other.give(full, message)


@pytest.fixture
def joined(make_bench: Callable[..., Any]) -> Joined:
    return Joined(make_bench)


def published(system: str) -> set[str]:
    return {topic.name for topic in ARRAY_SYSTEMS[system].topics} - {"clock", "/diagnostics"}


def truth_near(messages: list[Any], t_s: float, read: Callable[[Any], tuple[float, Any]]) -> Any:
    return min((read(message) for message in messages), key=lambda pair: abs(pair[0] - t_s))[1]


def test_the_attitude_of_a_satellite_is_found_and_a_silence_of_its_array_bridged(joined: Joined) -> None:
    source = joined.add(DoaSource, "doa", "doa_source")
    tracker = joined.add(DoaAttitudeNode, "doa", "doa_attitude", **{"start.settle_s": 10.0})
    assert source.step("activate")
    joined.run(2.0)
    assert "attitude" not in joined.sent
    assert {tracker.health(name).message for name in ("blocks", "torques")} == {"nothing received yet"}, "not active"
    assert tracker.step("activate")
    joined.run(60.0)
    assert joined.sent.keys() == published("doa")
    found = [convert.attitude_from_message(message) for message in joined.sent["attitude"]]
    valid = [one for one in found if one.valid]
    assert len(valid) > 40
    assert len(joined.sent["attitude_rate"]) == len(valid)
    last, rate = valid[-1], convert.rate_from_message(joined.sent["attitude_rate"][-1])
    assert last.t_s > START_S + 58.0
    quaternion = truth_near(joined.sent["sim/attitude"], last.t_s, convert.orientation_from_message)
    assert rotation_angle_between_rad(last.quaternion, quaternion) < 4.0 * np.sqrt(np.trace(last.covariance_rad2))
    turning = truth_near(joined.sent["sim/attitude_rate"], rate.t_s, convert.vector_from_message)
    assert np.linalg.norm(rate.rate_rad_s - turning) < 4.0 * np.sqrt(np.trace(rate.covariance_rad2_s2))
    frames = [joined.sent[name][0].header.frame_id for name in ("attitude", "attitude_rate", "sim/attitude_rate")]
    assert frames == [convert.ORBIT_FRAME, convert.BODY_FRAME, convert.BODY_FRAME]
    assert {bench.health("blocks").level for bench in (source, tracker)} == {OK}
    # Carried on after 2 s, up to 2 s before the clock.
    before, last_s = len(joined.sent["attitude"]), seconds_from_stamp(joined.sent["attitude"][-1].header.stamp)
    joined.run(last_s - START_S + 1.9, silent=source)
    assert len(joined.sent["attitude"]) == before
    joined.run(last_s - START_S + 6.0, silent=source)
    assert seconds_from_stamp(joined.sent["attitude"][-1].header.stamp) == pytest.approx(joined.t_s - 2.0, abs=1.0)
    health = tracker.health("blocks")
    assert (health.level, health.message) == (WARN, "no block for more than 2.0 s")
    assert tracker.step("deactivate")
    count = len(joined.sent["attitude"])
    joined.run(last_s - START_S + 9.0)
    assert len(joined.sent["attitude"]) == count


def test_the_attitude_of_an_array_is_found_from_the_lines_of_sight_of_two_stations(joined: Joined) -> None:
    source, stations = joined.add(TripulseSourceNode, "tripulse", "tripulse_source"), ("usingen", "hartebeesthoek")
    receivers = [
        joined.add(TripulseReceiverNode, "tripulse", "tripulse_receiver", namespace=f"/{name}") for name in stations
    ]
    solver = joined.add(TripulseAttitudeNode, "tripulse", "tripulse_attitude")
    joined.activate()
    joined.run(5.0)
    assert joined.sent.keys() == published("tripulse")
    assert {name: len(messages) for name, messages in joined.sent.items()} == dict.fromkeys(joined.sent, 5)
    for name in stations:
        measured = joined.sent[f"{name}/tripulse_measurement"]
        assert [(message.station, message.valid) for message in measured] == [(name, True)] * 5
    for message in joined.sent["attitude"]:
        one = convert.attitude_from_message(message)
        quaternion = truth_near(joined.sent["sim/attitude"], one.t_s, convert.orientation_from_message)
        assert one.valid
        assert rotation_angle_between_rad(one.quaternion, quaternion) < 4.0 * np.sqrt(np.trace(one.covariance_rad2))
    assert joined.sent["attitude"][0].child_frame_id == convert.ARRAY_FRAME
    checks = ((source, "frames", "5"), *((each, "frames", "5") for each in receivers), (solver, "lines of sight", "10"))
    assert [bench.health(name).values["valid"] for bench, name, _ in checks] == [count for *_, count in checks]
    receivers[1].give("tripulse_frame", joined.sent["usingen/tripulse_frame"][-1])
    assert receivers[1].health("frames").message == "station='usingen' must be 'hartebeesthoek'"


def test_a_receiver_is_named_by_its_parameter_or_its_namespace_and_refused_without_both(make_bench: Any) -> None:
    bench = make_bench(TripulseReceiverNode)
    assert not bench.step("configure")
    assert "must name the station" in bench.health("state").message


def test_pose_and_motion_of_an_approaching_spacecraft_are_found_and_carried_on(joined: Joined) -> None:
    source = joined.add(InterferometerSourceNode, "interferometer", "interferometer_source")
    tracker = joined.add(InterferometerTrackerNode, "interferometer", "interferometer_tracker")
    joined.activate()
    joined.run(20.0)
    assert joined.sent.keys() == published("interferometer")
    counts = {name: len(messages) for name, messages in joined.sent.items()}
    assert counts["interferometer_measurement"] == counts["relative_pose_status"] == counts["sim/relative_pose"] == 10
    assert counts["relative_pose"] == counts["relative_twist"] >= 8
    t_s, pose = convert.pose_from_messages(joined.sent["relative_pose"][-1], joined.sent["relative_twist"][-1])
    true_s, truth = convert.pose_from_messages(
        joined.sent["sim/relative_pose"][-1], joined.sent["sim/relative_twist"][-1]
    )
    assert t_s == true_s
    assert np.all(np.abs(pose.position_m - truth.position_m) < 4.0 * np.sqrt(np.diag(pose.pose_covariance))[:3])
    assert np.all(np.abs(pose.velocity_m_s - truth.velocity_m_s) < 4.0 * np.sqrt(np.diag(pose.twist_covariance))[:3])
    assert np.linalg.norm(truth.position_m) == pytest.approx(2000.0, rel=0.03)
    assert {bench.health("sequences").values["rejected"] for bench in (source, tracker)} == {"0"}
    joined.run(24.75, silent=source)
    assert len(joined.sent["relative_pose_status"]) == 10
    joined.run(32.0, silent=source)
    assert len(joined.sent["relative_pose_status"]) > 10
    assert tracker.health("sequences").message == joined.sent["relative_pose_status"][-1].reason != ""


def test_sequences_longer_than_their_period_are_refused(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(InterferometerSourceNode, **{"source.period_s": 0.5})
    assert not bench.step("configure")
    assert bench.health("state").message.startswith("source.period_s=0.5 must be >= the sequence's ")


def test_a_dish_knows_from_the_array_on_it_how_far_the_target_is_off(joined: Joined) -> None:
    receiver, tracker = joined.add(ArrayReceiver), joined.add(ArrayTracker)
    truth, later = (error_to_message(PointingError(
        t_s=t_s, sensor="truth", cross_elevation_rad=0.02, elevation_rad=-0.03, carrier_to_noise_db_hz=60.0
    )) for t_s in (START_S, START_S + 1.0))  # fmt: skip
    receiver.give("sim/pointing_error", truth)
    joined.forward()
    assert not {"array_snapshots", "pointing_error"} & joined.sent.keys(), "not active"
    joined.activate()
    receiver.give("sim/pointing_error", truth)
    joined.forward()
    found = error_from_message(joined.sent["pointing_error"][-1])
    assert found.valid
    miss = np.array([found.cross_elevation_rad - 0.02, found.elevation_rad + 0.03])
    assert miss @ np.linalg.solve(found.covariance_rad2, miss) < 20.0
    health = tracker.health("blocks")
    assert (health.level, health.message) == (OK, "errors are valid")
    assert tracker.step("deactivate")
    receiver.give("sim/pointing_error", later)
    joined.forward()
    assert (len(joined.sent["pointing_error"]), len(joined.sent["array_snapshots"])) == (1, 2)
