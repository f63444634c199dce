"""What a node alone says: the call of its lifecycle, then the inputs without which it cannot work."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import Header

from rf_pointing.array_sensors.nodes.array_receiver import ArrayReceiver
from rf_pointing.array_sensors.nodes.array_tracker import ArrayTracker
from rf_pointing.array_sensors.nodes.doa_attitude import DoaAttitudeNode
from rf_pointing.array_sensors.nodes.interferometer_tracker import InterferometerTrackerNode
from rf_pointing.array_sensors.nodes.tripulse_receiver import TripulseReceiverNode
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.nodes.operator_page import OperatorPage
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.nodes.rotctld_server import RotctldServerNode
from rf_pointing.nodes.station_alarms import AlarmNode
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.ros.diagnostics import ERROR, OK, PATIENCE_S, WARN
from rf_pointing.ros.graph import FOREIGN, TOPICS
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station

JOINTS, TARGET = "joint_states (antenna_servo)", "target (ephemeris_publisher, target_designate)"
ANTENNA, TRACKING = "antenna_status (antenna_servo)", "tracking_status (pointing_controller)"
RECEIVER = "(rf_receiver, or a receiver of your own)"
WATCHED = f"{JOINTS}, {ANTENNA}, {TRACKING}"
WAITS = {
    BiasCalibrator: f"{TARGET}, {JOINTS}, {TRACKING}",
    ConscanTrackerNode: f"carrier_power {RECEIVER}, {JOINTS}, {TRACKING}",
    MonopulseTrackerNode: f"monopulse {RECEIVER}, {TRACKING}",
    PointingControllerNode: f"{JOINTS}, {TARGET}, {ANTENNA}",
    RfReceiver: "sim/boresight (antenna_servo)", StationDescriptionNode: f"{TARGET}, {JOINTS}",
    AlarmNode: WATCHED, StationExecutive: WATCHED, RotctldServerNode: WATCHED,
    OperatorPage: f"{ANTENNA}, {TRACKING}, {TARGET}, {JOINTS}",
    ArrayReceiver: "sim/pointing_error (rf_receiver, signal_source)",
    ArrayTracker: "array_snapshots", DoaAttitudeNode: "array_snapshots",
    InterferometerTrackerNode: "interferometer_measurement", TripulseReceiverNode: "tripulse_frame",
}  # fmt: skip
OWN: dict[Any, dict[str, Any]] = {
    AlarmNode: {"folder": "{}"}, BiasCalibrator: {"calibrator.folder": "{}"},
    ArrayReceiver: {"station": "rotator_2m"}, ArrayTracker: {"station": "rotator_2m"},
    OperatorPage: {"page.port": 0, "page.reports": "{}", "lifecycle.autostart": False},
    RotctldServerNode: {"server.port": 0},
    StationExecutive: {"executive.folder": "{}", "executive.record": False},
    TripulseReceiverNode: {"station.name": "wallops"},
}  # fmt: skip
PLAIN = {"joint_states", "target", "antenna_status", "tracking_status", "sim/boresight", "sim/pointing_error"}
"""Topics of which an empty message with a stamp can be taken."""


def lines(bench: Any) -> list[str]:
    bench.wait(2.0 * PATIENCE_S)
    bench.health("state")
    found = [words for _level, words in bench.log if "waits" in words]
    bench.log.clear()
    return found


@pytest.mark.parametrize("kind", WAITS, ids=lambda kind: kind.__name__)
def test_a_node_alone_says_once_what_it_waits_for(kind: Any, make_bench: Callable[..., Any], tmp_path: Any) -> None:
    given = {name: str(tmp_path) if value == "{}" else value for name, value in OWN.get(kind, {}).items()}
    bench = make_bench(kind, namespace="/gs1", **given)
    name = bench.node.get_name()
    assert bench.turn() > 0.0, "the main loop turns a node that nobody has configured"
    assert bench.health("state").level == OK
    (line,) = lines(bench)
    assert line.startswith(f"unconfigured: waits for `ros2 lifecycle set /gs1/{name} configure`, or ")
    assert lines(bench) == []
    assert bench.step("configure")
    assert bench.health("state").level == OK
    assert lines(bench) == [f"inactive: waits for `ros2 lifecycle set /gs1/{name} activate`"]
    assert bench.step("activate")
    health = bench.health("state")
    assert (health.level, health.message, health.values["state"]) == (WARN, f"waits for {WAITS[kind]}", "active")
    assert (lines(bench), lines(bench)) == ([f"active: waits for {WAITS[kind]}"], [])
    missing = re.sub(r" \([^)]*\)", "", WAITS[kind]).split(", ")
    while missing and set(missing) <= PLAIN:
        (topic,) = (each for each in TOPICS if each.name == missing[0])
        given = {"range": 1e6} if topic.name == "target" else {}
        bench.give(topic.name, topic.message_type(header=Header(stamp=stamp_from_seconds(bench.t_s)), **given))
        del missing[0]
        found = re.sub(r" \([^)]*\)", "", bench.health("state").message)
        assert found == (f"waits for {', '.join(missing)}" if missing else "active")
    if not missing:
        assert (bench.health("state").level, lines(bench)) == (OK, ["active: waits no longer"])
    # What is configured again waits again, and no input of before ends it.
    assert bench.step("deactivate")
    assert bench.step("cleanup")
    bench.up()
    assert bench.health("state").message == f"waits for {WAITS[kind]}"


def test_a_node_without_time_says_on_which_topic_it_waits_for_it(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(ConscanTrackerNode, **{"use_sim_time": True, "lifecycle.autostart": True})
    bench.node.bring_up()
    health = bench.health("state")
    assert (health.level, health.message) == (WARN, "waits for the time on /clock")
    assert lines(bench) == ["inactive: waits for the time on /clock"]


@pytest.mark.parametrize(
    ("kind", "given", "words"),
    [
        (RfReceiver, {"source.satellite": ""}, "no target is named: elements='' must be a file, "),
        (EphemerisPublisher, {"source.satellite": ""}, "no target is named: elements='' must be a file, "),
        (PointingControllerNode, {"station": ""}, "station='' must name a station description: your YAML file, or one"),
    ],
)
def test_neither_a_station_nor_a_satellite_is_guessed(
    make_bench: Callable[..., Any], kind: Any, given: dict[str, Any], words: str
) -> None:
    bench = make_bench(kind, **given)
    assert not bench.step("configure")
    health = bench.health("state")
    assert (health.level, health.message[: len(words)]) == (ERROR, words)


def test_elements_without_a_name_mean_their_first(make_bench: Callable[..., Any], tmp_path: Any) -> None:
    file = tmp_path / "own.tle"
    file.write_text(
        "MYSAT\n"
        "1 90001U 26001A   06177.78615833  .00000060  00000-0  35940-4 0  1837\n"
        "2 90001  98.3881 247.6198 0000884  88.1964 271.9322 14.35478080140553\n"
    )
    bench = make_bench(EphemerisPublisher, **{"source.elements": str(file), "source.satellite": ""})
    assert bench.step("configure"), bench.health("state").message
    assert bench.node.prediction.track.name == "MYSAT"


@pytest.mark.parametrize("simulated", [False, True], ids=["wall time", "simulated time"])
def test_instruments_are_heard_whatever_they_publish_with_and_own_streams_are_reliable(
    make_bench: Callable[..., Any], tmp_path: Any, simulated: bool
) -> None:
    read_station("rotator_2m").write(tmp_path / "w.yaml", {"wind.anemometer": True, "base.coast_s": 1.0})
    own = {"station": str(tmp_path / "w.yaml")}
    heard = {}
    for kind, more in {
        **{each: {} for each in WAITS if each not in (AlarmNode, OperatorPage, StationExecutive)},
        AntennaServo: own | {"drive.type": "simulated_rotator"},
        EphemerisPublisher: own | {"source.refraction": "measured", "source.antenna.half_power_beamwidth_deg": 60.0},
    }.items():
        bench = make_bench(kind, **OWN.get(kind, {}) | more | {"use_sim_time": simulated})
        assert bench.step("configure"), bench.health("state").message
        for each in bench.node.subscriptions:
            heard[each.topic_name.lstrip("/")] = each.qos_profile.reliability
    assert set(FOREIGN) <= set(heard)
    found = {name for name, each in heard.items() if each == ReliabilityPolicy.BEST_EFFORT} - {"clock"}
    assert found == (set() if simulated else set(FOREIGN)), "a reliable subscriber does not hear SensorDataQoS"
