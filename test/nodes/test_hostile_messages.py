"""Whatever arrives on a subscription: refused or used, never the end of a node, and its periodic work goes on.

Each subscription of each node gets 1000 payloads: messages of plausible numbers, and the same with bytes changed, cut,
added or overwritten by a number beyond anything.  The operator's page has the same in its own tests.
"""

import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import (
    AntennaStatus,
    ArraySnapshots,
    ExecutiveStatus,
    Pass,
    PassProfileList,
    PointingModel,
    Schedule,
    ScheduledPass,
)
from sensor_msgs.msg import JointState

from rf_pointing.array_sensors.nodes.array_receiver import ArrayReceiver
from rf_pointing.array_sensors.nodes.array_tracker import ArrayTracker
from rf_pointing.array_sensors.nodes.doa_attitude import DoaAttitudeNode
from rf_pointing.array_sensors.nodes.interferometer_tracker import InterferometerTrackerNode
from rf_pointing.array_sensors.nodes.tripulse_attitude import TripulseAttitudeNode
from rf_pointing.array_sensors.nodes.tripulse_receiver import TripulseReceiverNode
from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading
from rf_pointing.drives import DriveParams
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.nodes.radio_control import RadioControlNode
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.nodes.rotctld_server import RotctldServerNode
from rf_pointing.nodes.simulation_clock import SimulationClock
from rf_pointing.nodes.station_alarms import AlarmNode
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.planning import PassProfile
from rf_pointing.rf.dish_array import DishArrayParams
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.topic_drive import TopicDrive

PAYLOADS, BASES, WORK_EVERY = 1000, 50, 25
# Made by whoever needs it first, gone with this process.
_FOLDER = tempfile.TemporaryDirectory()
PARTNERS_KEY = f"{_FOLDER.name}/partners.key"
NODES: dict[Any, dict[str, Any]] = {
    AntennaServo: {},
    BiasCalibrator: {},
    ConscanTrackerNode: {},
    MonopulseTrackerNode: {},
    PointingControllerNode: {},
    RfReceiver: {},
    SimulationClock: {"lifecycle.autostart": True},
    EphemerisPublisher: {"source.refraction": "measured", "source.antenna.half_power_beamwidth_deg": 60.0},
    StationDescriptionNode: {},
    AlarmNode: {},
    StationExecutive: {
        "executive.record": False, "executive.partners": "gs2",
        "executive.partners_key_file": PARTNERS_KEY,
    },
    RotctldServerNode: {"server.port": 0},
    RadioControlNode: {
        "server.port": 0,
        "station": str(Path(__file__).parents[2] / "examples" / "transponder_radio.yaml"),
    },
    ArrayReceiver: {}, ArrayTracker: {}, DoaAttitudeNode: {}, InterferometerTrackerNode: {},
    TripulseAttitudeNode: {}, TripulseReceiverNode: {"station.name": "wallops"},
}  # fmt: skip
WORDS = (
    "", "azimuth", "elevation", "monopulse", "conscan", "tracking", "wallops", "/antenna_servo", "antenna_servo: device",
    "orbit", "x" * 300, "\N{SNOWMAN}",
)  # fmt: skip
EXTREMES = (0.0, -1.0, 1e-300, 1e6, -1e6, 1e12, 1e17, -1e17, 1e19, 1e300, -1e300, math.nan, math.inf, -math.inf)
Random = np.random.Generator


def begin_pass(bench: Any) -> None:
    """Let the controller track a smooth pass that goes on."""
    begin_s, share = bench.t_s - 100.0, np.linspace(0.0, 1.0, 601)
    rise = 0.9 * np.sin(math.pi * share)
    profile = PassProfile(
        name="bird", t_s=begin_s + 600.0 * share, position_rad=np.column_stack([0.5 + 2.0 * share, 0.1 + rise]),
        velocity_rad_s=np.column_stack([share * 0.0 + 2.0 / 600.0, 0.9 * np.cos(math.pi * share) * math.pi / 600.0]),
        acceleration_rad_s2=np.column_stack([0.0 * share, -rise * (math.pi / 600.0) ** 2]),
        sun_rad=np.tile([4.0, 0.5], (601, 1)), range_m=0.0 * share + 1e6, satellite_gain_db=0.0 * share,
    )  # fmt: skip
    window = Pass(
        target="bird", aos=stamp_from_seconds(begin_s), tca=stamp_from_seconds(begin_s + 300.0),
        los=stamp_from_seconds(begin_s + 600.0), peak_elevation=1.0, aos_azimuth=0.5, los_azimuth=2.5, azimuth_min=0.5,
        azimuth_max=2.5, aos_elevation=0.1, peak_azimuth_rate=0.01, peak_elevation_rate=0.01, smallest_range=1e6,
    )  # fmt: skip
    # A hostile status may have stated a fault of the antenna, which refuses a pass.
    bench.give("antenna_status", AntennaStatus(mode="holding"))
    bench.give("pass_profiles", PassProfileList(profiles=[convert_planning.profile_to_message(profile)]))
    axes = JointReading(t_s=bench.t_s - 0.2, position_rad=[1.0, 0.5], velocity_rad_s=[0.0, 0.0])
    bench.give("joint_states", convert.joints_to_message(axes))
    bench.goal("track_pass", TrackPass.Goal(target_pass=window, sensor="program"))


def work(bench: Any) -> None:
    """Do a period of the node's own work, in the middle of a pass where it tracks."""
    if isinstance(bench.node, PointingControllerNode):
        begin_pass(bench)
    bench.wait(0.1)
    bench.turn()
    bench.node.diagnostics.publish()
    bench.sent.clear()


@pytest.fixture(params=NODES, ids=lambda kind: kind.__name__)
def attacked(
    request: pytest.FixtureRequest, make_bench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Any:
    """Return each node that subscribes to anything, active."""
    monkeypatch.chdir(tmp_path)
    bench = make_bench(request.param, **NODES[request.param]).up()
    if request.param is StationExecutive:
        times = {"aos": stamp_from_seconds(bench.t_s - 60.0), "los": stamp_from_seconds(bench.t_s + 86400.0)}
        bench.goal("run_schedule", RunSchedule.Goal(passes=[ScheduledPass(target="bird", **times)]))
    return bench


def fill(message: Any, random: Random, now_s: float) -> None:
    """Put plausible values into every field of a message."""
    count = int(random.choice((0, 2, 2, 2, 5)))
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        if isinstance(value, Time):
            value = stamp_from_seconds(now_s + random.normal(0.0, 0.5))
        elif hasattr(value, "get_fields_and_field_types"):
            fill(value, random, now_s)
        elif isinstance(value, bool):
            value = bool(random.random() < 0.5)
        elif isinstance(value, float):
            choices = (random.normal(), abs(random.normal(0.0, 0.1)), random.normal(0.0, 1e-3), 40.0)
            value = float(random.choice(choices))
        elif isinstance(value, int):
            value = int(random.integers(0, 100))
        elif isinstance(value, str):
            value = str(random.choice(WORDS))
        elif isinstance(value, np.ndarray):
            # A fixed square is a covariance, nearly always a valid one.
            side = round(len(value) ** 0.5)
            square = np.eye(side).ravel() if side**2 == len(value) and random.random() < 0.9 else np.ones(len(value))
            value = (square * abs(random.normal(0.0, 1e-2))).astype(value.dtype)
        elif kind == "sequence<string>":
            value = ["azimuth", "elevation"]
        elif kind.startswith(("sequence<double", "sequence<float")):
            value = random.normal(0.0, 1.0, count).tolist()
        elif kind.startswith("sequence<") and "/" in kind:
            package, name = kind.removeprefix("sequence<").rstrip(">").split("/")
            element = getattr(__import__(f"{package}.msg", fromlist=["msg"]), name)
            value = [element() for _ in range(int(random.integers(0, 4)))]
            for each in value:
                fill(each, random, now_s)
        setattr(message, field, value)
    # Messages whose fields depend on each other.
    if isinstance(message, PointingModel):
        message.terms = list(BiasModel.zero().coefficients)
        message.values = random.normal(0.0, 1e-4, len(message.terms)).tolist()
        message.covariance = [0.0] * len(message.terms) ** 2
    elif isinstance(message, (Schedule, ExecutiveStatus)):
        topic = "schedule" if isinstance(message, Schedule) else "executive_status"
        CommandKey(CommandKeyParams(command_key_file=PARTNERS_KEY)).sign_claim(message, topic, "gs2")
    elif isinstance(message, ArraySnapshots):
        message.elements, message.snapshots = DishArrayParams().elements, int(random.integers(8, 40))
        for name in ("samples_i", "samples_q"):
            setattr(message, name, random.normal(0.0, 1.0, message.elements * message.snapshots).tolist())


def mutated(payload: bytes, random: Random) -> bytes:
    """Return the bytes with some changed, cut, added, or overwritten by a large length or number."""
    data = bytearray(payload)
    for _ in range(int(random.integers(1, 4))):
        kind, at = int(random.integers(6)), int(random.integers(len(data) + 1))
        if kind == 0 and at < len(data):
            data[at] = int(random.integers(256))
        elif kind == 1 and random.random() < 0.3:
            del data[at:]
        elif kind == 2:
            data[at:at] = os.urandom(int(random.integers(1, 17)))
        elif kind == 3:
            data[at : at + 4] = random.choice(np.array([0, 1, 2**31 - 1, 2**32 - 1], dtype=np.uint32)).tobytes()
        else:
            # Where a number of eight bytes can stand: they are aligned after the four bytes of the head.
            place = 4 + 8 * (at // 8)
            data[place : place + 8] = np.float64(random.choice(EXTREMES)).tobytes()[: len(data) - place]
    return bytes(data)


def test_no_payload_ends_a_node_or_its_work(attacked: Any, random: Random) -> None:
    for topic, message_type in attacked.inputs():
        before = sum(attacked.node.inputs.refused.values())
        for index in range(PAYLOADS):
            if index % (PAYLOADS // BASES) == 0:
                message = message_type()
                fill(message, random, attacked.t_s)
                base = bytes(serialize_message(message))
            attacked.give(topic, base if index % 3 == 0 else mutated(base, random))
            assert attacked.node.inputs.errors == 0, (topic, attacked.node.inputs.last_error)
            if index % WORK_EVERY == 0:
                work(attacked)
        refused = sum(attacked.node.inputs.refused.values()) - before
        assert refused < PAYLOADS, f"{topic}: some can be used"
    assert attacked.node.failure is None


def test_no_payload_of_a_vendors_node_ends_the_work_of_a_drive(default_context: None, random: Random) -> None:
    """It is read by the antenna's own period, which cannot be left out."""
    beside, now_s, used = rclpy.create_node("antenna_servo"), 1.8e9, 0
    drive = TopicDrive(beside, DriveParams(type="topic"))
    drive.step(now_s)
    for _ in range(PAYLOADS):
        message = JointState()
        fill(message, random, now_s)
        message.velocity = list(message.position) if random.random() < 0.5 else []
        base = bytes(serialize_message(message))
        for payload in (base, mutated(base, random)):
            drive.take_state(payload)
            reading = drive.step(now_s)
            used += reading is not None
            assert reading is None or (np.all(np.abs(reading.position_rad) < 70.0) and reading.t_s < now_s + 10.0)
    assert used > 0 < drive.losses["state that cannot be used"]
    drive.close()
    beside.destroy_node()


def tried(node: Any, name: str, random: Random) -> list[Any]:
    """Return values of a parameter's type: bounds, beyond them, random ones."""
    descriptor, value = node.describe_parameter(name), node.get_parameter(name).value
    if isinstance(value, bool):
        return [True, False]
    if isinstance(value, str):
        return ["", "pi", "lqg", "/nowhere", "/dev/null", "\0", "x" * 5000]
    if isinstance(value, int):
        (bounds,) = descriptor.integer_range
        return [bounds.from_value, bounds.to_value, bounds.to_value + 1]
    if isinstance(value, float):
        (bounds,) = descriptor.floating_point_range
        inside = random.uniform(max(bounds.from_value, -1e6), min(bounds.to_value, 1e6), 4).tolist()
        return [bounds.from_value, bounds.to_value, 0.0, 1e-9, math.nan, math.inf, *inside]
    count = len(value)
    if name.endswith(("travel_min_deg", "travel_max_deg")):
        return [*random.uniform(-300.0, 300.0, (20, count)).tolist(), [-223.0, -12.0], [math.nan] * count]
    rows = [0.0, 1e-9, 1e-3, 1.0, 10.0, 1e3, 1e9, -1.0, math.nan]
    return [[row] * count for row in rows] + [[], [1.0], [1.0] * (count + 1)]


def test_no_value_that_a_live_parameter_accepts_ends_the_work(attacked: Any, random: Random) -> None:
    """Each at its bounds, beyond them and between, in turn; those that are taken stay while the work goes on."""
    node = attacked.node
    for name in sorted(node.parameters.live & set(node.parameters.names())):
        before = node.get_parameter(name).value
        for value in tried(node, name, random):
            attacked.change(**{name: value})
            work(attacked)
        attacked.change(**{name: before})
    assert (node.inputs.errors, node.failure) == (0, None)
