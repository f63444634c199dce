"""Whatever arrives on a subscription: refused or used, never the end of a node, and its periodic work goes on.

Each subscription of each node gets 10 000 payloads through the decoder and its own callback: messages of plausible numbers,
some with one field beyond anything, and the same with bytes changed, cut, added or overwritten.  The operator's page has
the same in its own tests, where what it then shows is looked at.
"""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.msg import ArraySnapshots, PointingModel
from sensor_msgs.msg import JointState

from rf_pointing.array_sensors.nodes.array_receiver import ArrayReceiver
from rf_pointing.array_sensors.nodes.array_tracker import ArrayTracker
from rf_pointing.array_sensors.nodes.doa_attitude import DoaAttitudeNode
from rf_pointing.array_sensors.nodes.interferometer_tracker import InterferometerTrackerNode
from rf_pointing.array_sensors.nodes.tripulse_attitude import TripulseAttitudeNode
from rf_pointing.array_sensors.nodes.tripulse_receiver import TripulseReceiverNode
from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading
from rf_pointing.core.dates import utc_text
from rf_pointing.drives import DriveParams
from rf_pointing.ephemeris import Pass
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.nodes.rotctld_server import RotctldServerNode
from rf_pointing.nodes.simulation_clock import SimulationClock
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.planning import PassProfile
from rf_pointing.rf.dish_array import DishArrayParams
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.topic_drive import TopicDrive

PAYLOADS = 10_000
WORK_EVERY = 50
BASES = 100
ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
NODES: dict[type[ManagedNode], dict[str, Any]] = {
    AntennaServo: {},
    BiasCalibrator: {},
    ConscanTrackerNode: {},
    MonopulseTrackerNode: {},
    PointingControllerNode: {},
    RfReceiver: {},
    SimulationClock: {},
    EphemerisPublisher: {"source.refraction": "measured", "source.antenna.half_power_beamwidth_deg": 60.0},
    StationDescriptionNode: {},
    StationExecutive: {"executive.record": False, "executive.partners": "gs2"},
    RotctldServerNode: {"server.port": 0},
    ArrayReceiver: {},
    ArrayTracker: {},
    DoaAttitudeNode: {},
    InterferometerTrackerNode: {},
    TripulseAttitudeNode: {},
    TripulseReceiverNode: {"station.name": "wallops"},
}
WORDS = (
    "", "azimuth", "elevation", "monopulse", "conscan", "tracking", "wallops", "/antenna_servo", "antenna_servo: device",
    "orbit", "x" * 300, "\N{SNOWMAN}",
)  # fmt: skip
EXTREMES = (0.0, -1.0, 1e-300, 1e6, -1e6, 1e12, 1e17, -1e17, 1e19, 1e300, -1e300, np.nan, np.inf, -np.inf)
PASS = {
    "name": "bird", "peak_elevation_rad": 1.0, "aos_azimuth_rad": 0.5, "aos_elevation_rad": 0.1, "los_azimuth_rad": 2.5,
    "azimuth_min_rad": 0.5, "azimuth_max_rad": 2.5, "peak_azimuth_rate_rad_s": 0.01, "peak_elevation_rate_rad_s": 0.01,
    "peak_azimuth_acceleration_rad_s2": 1e-4, "smallest_range_m": 1e6, "rises_before": False, "sets_after": False,
}  # fmt: skip


def profile_of(window: Pass, sun_rad: tuple[float, float]) -> PassProfile:
    """Return a smooth way from the rise of a pass over its peak to its set."""
    share = np.linspace(0.0, 1.0, 601)
    sweep, lift = window.los_azimuth_rad - window.aos_azimuth_rad, window.peak_elevation_rad - window.aos_elevation_rad
    angle, one = math.pi * share, np.ones_like(share)
    rate = math.pi / window.duration_s
    return PassProfile(
        name=window.name,
        t_s=window.aos_t_s + share * window.duration_s,
        position_rad=np.column_stack(
            [window.aos_azimuth_rad + sweep * share, window.aos_elevation_rad + lift * np.sin(angle)]
        ),
        velocity_rad_s=np.column_stack([sweep / window.duration_s * one, lift * rate * np.cos(angle)]),
        acceleration_rad_s2=np.column_stack([0.0 * one, -lift * rate**2 * np.sin(angle)]),
        sun_rad=np.tile(sun_rad, (len(share), 1)),
        range_m=window.smallest_range_m * (1.0 + (2.0 * share - 1.0) ** 2),
        satellite_gain_db=0.0 * share,
    )


class Door:
    """A node under attack: its subscriptions, and the work that its timers would do."""

    def __init__(self, kind: type[ManagedNode], given: dict[str, Any]) -> None:
        self.doors: dict[str, tuple[Any, Callable[[bytes], None]]] = {}
        self.passes = 0
        self.work: list[tuple[float, Callable[[float], None]]] = []
        self.node = kind()
        self.node.set_parameters([Parameter(name, value=value) for name, value in given.items()])
        create = self.node.create_subscription

        def noted(message_type: Any, topic: str, callback: Any, qos: Any, **options: Any) -> Any:
            self.doors[topic] = (message_type, callback)
            return create(message_type, topic, callback, qos, **options)

        self.node.create_subscription = noted
        every = self.node.every
        self.node.every = lambda period_s, work: self.work.append((period_s, work)) or every(period_s, work)
        self.node.brings_itself_up = kind is SimulationClock
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        assert self.node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.t_s = self.node.now_s()
        if isinstance(self.node, StationExecutive):
            begun, end = utc_text(self.t_s - 60.0), utc_text(self.t_s + 86400.0)
            self.node._start(RunSchedule.Goal(schedule=f"target,aos_utc,los_utc\nbird,{begun},{end}\n"))

    def step(self) -> None:
        """Do a period of the node's own work, in the middle of a pass where it tracks."""
        if isinstance(self.node, PointingControllerNode) and not self.node._controller.busy:
            times = {"aos_t_s": self.t_s - 100.0, "tca_t_s": self.t_s + 200.0, "los_t_s": self.t_s + 500.0}
            # A hostile status may have stated a fault of the antenna, which refuses a pass.
            self.node._controller.take_antenna("holding", "")
            core, window = self.node._controller, Pass(**times, **PASS)
            core.plan.take_profiles([profile_of(window, core.plan.sun.at(window.aos_t_s))])
            core.take_joints(JointReading(t_s=self.t_s, position_rad=[1.0, 0.5], velocity_rad_s=[0.0, 0.0]))
            core.start(self.t_s, window, "auto")
            self.passes += 1
        for period_s, work in self.work:
            self.t_s += period_s
            work(self.t_s)
        self.node.turn()
        self.node.diagnostics.publish()

    def close(self) -> None:
        self.node.end()
        self.node.lock.release()
        self.node.destroy_node()


@pytest.fixture(params=NODES, ids=lambda kind: kind.__name__)
def attacked(request: pytest.FixtureRequest, default_context: None) -> Iterator[Door]:
    """Yield each node that subscribes to anything, active."""
    door = Door(request.param, NODES[request.param])
    yield door
    door.close()


def fill(message: Any, random: np.random.Generator, now_s: float) -> None:
    """Put plausible values into every field of a message."""
    count = int(random.choice((0, 2, 2, 2, 5)))
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        if isinstance(value, Time):
            when_s = now_s + random.normal(0.0, 0.5)
            setattr(message, field, Time(sec=int(when_s), nanosec=int(when_s % 1.0 * 1e6) * 1000))
        elif hasattr(value, "get_fields_and_field_types"):
            fill(value, random, now_s)
        elif isinstance(value, bool):
            setattr(message, field, bool(random.random() < 0.5))
        elif isinstance(value, float):
            setattr(message, field, number(random))
        elif isinstance(value, int):
            setattr(message, field, int(random.integers(0, 100)))
        elif isinstance(value, str):
            setattr(message, field, str(random.choice(WORDS)))
        elif isinstance(value, np.ndarray):
            # A fixed square is a covariance, nearly always a valid one.
            side = round(len(value) ** 0.5)
            square = (
                np.eye(side).ravel() if side * side == len(value) and random.random() < 0.9 else np.ones(len(value))
            )
            setattr(message, field, (square * abs(random.normal(0.0, 1e-2))).astype(value.dtype))
        elif kind == "sequence<string>":
            setattr(message, field, ["azimuth", "elevation"])
        elif kind.startswith(("sequence<double", "sequence<float")):
            setattr(message, field, random.normal(0.0, 1.0, count).tolist())
        elif kind.startswith("sequence<") and "/" in kind:
            setattr(message, field, elements(message, kind, random, now_s))


def fill_model(message: PointingModel, random: np.random.Generator, _now_s: float) -> None:
    """Make a pointing model of the package's own terms."""
    message.terms = list(BiasModel.zero().coefficients)
    message.values = random.normal(0.0, 1e-4, len(message.terms)).tolist()
    message.covariance = np.zeros(len(message.terms) ** 2).tolist()


def fill_snapshots(message: ArraySnapshots, random: np.random.Generator, now_s: float) -> None:
    """Make a block of samples of the array on a dish."""
    fill(message, random, now_s)
    message.elements, message.snapshots = DishArrayParams().elements, int(random.integers(8, 40))
    for name in ("samples_i", "samples_q"):
        setattr(message, name, random.normal(0.0, 1.0, message.elements * message.snapshots).tolist())


def elements(message: Any, kind: str, random: np.random.Generator, now_s: float) -> list[Any]:
    """Return a few elements of a sequence of messages."""
    package, name = kind.removeprefix("sequence<").rstrip(">").split("/")
    element = getattr(__import__(f"{package}.msg", fromlist=["msg"]), name)
    made = [element() for _ in range(int(random.integers(0, 4)))]
    for each in made:
        fill(each, random, now_s)
    return made


def number(random: np.random.Generator) -> float:
    return float(random.choice((random.normal(), abs(random.normal(0.0, 0.1)), random.normal(0.0, 1e-3), 40.0)))


MAKERS = {PointingModel: fill_model, ArraySnapshots: fill_snapshots}
"""Messages whose fields depend on each other."""


def leaves(message: Any) -> list[tuple[Any, str]]:
    """Return every field of a message that holds numbers."""
    found = []
    for field in message.get_fields_and_field_types():
        value = getattr(message, field)
        if hasattr(value, "get_fields_and_field_types"):
            found += leaves(value)
        elif isinstance(value, list):
            for each in value:
                found += leaves(each) if hasattr(each, "get_fields_and_field_types") else []
        if isinstance(value, (int, float, np.ndarray)) or hasattr(value, "typecode"):
            found.append((message, field))
    return found


def spoil(message: Any, random: np.random.Generator) -> None:
    """Put something beyond anything into one field."""
    places = leaves(message)
    holder, field = places[int(random.integers(len(places)))]
    value, extreme = getattr(holder, field), float(random.choice(EXTREMES))
    if isinstance(value, bool):
        return
    if isinstance(value, int):
        kind = holder.get_fields_and_field_types()[field]
        bits = int(kind.rpartition("int")[2])
        low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        setattr(holder, field, (low, max(low, -1), 0, 1, high)[int(random.integers(5))])
    elif isinstance(value, float):
        setattr(holder, field, extreme)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iu":
        bounds = np.iinfo(value.dtype)
        value[int(random.integers(len(value)))] = (bounds.min, bounds.max)[int(random.integers(2))]
    elif len(value):
        value[int(random.integers(len(value)))] = extreme if abs(extreme) < 3e38 or np.isnan(extreme) else 1e30


def mutated(payload: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with some changed, cut, added, or overwritten by a large length."""
    data = bytearray(payload)
    for _ in range(int(random.integers(1, 4))):
        kind, at = int(random.integers(5)), int(random.integers(len(data) + 1))
        if kind == 0 and at < len(data):
            data[at] = int(random.integers(256))
        elif kind == 1:
            del data[at:]
        elif kind == 2:
            data[at:at] = os.urandom(int(random.integers(1, 17)))
        elif kind == 3:
            data[at : at + 4] = random.choice(np.array([0, 1, 2**31 - 1, 2**32 - 1], dtype=np.uint32)).tobytes()
        else:
            data[at : at + 8] = np.float64(random.choice(EXTREMES)).tobytes()
    return bytes(data)


def test_no_payload_ends_a_node_or_its_work(
    attacked: Door, random: np.random.Generator, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    node = attacked.node
    monkeypatch.setattr(node, "get_logger", lambda: SILENT)
    # A tracker that scans or calibrates subscribes to more: the doors of the beginning are attacked first.
    for topic in list(attacked.doors):
        message_type, door = attacked.doors[topic]
        used = 0
        for index in range(PAYLOADS):
            if index % (PAYLOADS // BASES) == 0:
                message = message_type()
                make = MAKERS.get(message_type, fill)
                make(message, random, attacked.t_s)
                base = serialize_message(message)
            payload = base
            if index % 3 == 1:
                payload = mutated(base, random)
            elif index % 3 == 2:
                spoiled = message_type()
                make(spoiled, random, attacked.t_s)
                spoil(spoiled, random)
                payload = serialize_message(spoiled)
            before = sum(node.inputs.refused.values())
            door(payload)
            used += sum(node.inputs.refused.values()) == before
            assert node.inputs.errors == 0, (topic, node.inputs.last_error)
            if index % WORK_EVERY == 0:
                attacked.step()
        assert used > 0, topic


def test_no_payload_of_a_vendors_node_ends_the_work_of_a_drive(
    default_context: None, random: np.random.Generator
) -> None:
    """It is read by the antenna's own period, which cannot be left out."""
    beside = rclpy.create_node("antenna_servo")
    drive = TopicDrive(beside, DriveParams(type="topic"))
    now_s = 1.8e9
    drive.step(now_s)
    for _ in range(PAYLOADS // 3):
        message = JointState()
        fill(message, random, now_s)
        message.velocity = list(message.position) if random.random() < 0.5 else []
        base = serialize_message(message)
        spoil(message, random)
        for payload in (base, mutated(base, random), serialize_message(message)):
            drive._on_state(payload)
            reading = drive.step(now_s)
            assert reading is None or np.all(np.abs(reading.position_rad) < 70.0)
            assert reading is None or reading.t_s < now_s + 10.0
    assert drive._reading is not None, "some can be used"
    assert drive.losses["state that cannot be used"] > PAYLOADS // 10
    drive.close()
    beside.destroy_node()


def tried(node: ManagedNode, name: str, random: np.random.Generator) -> list[Any]:
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
        low, high = max(bounds.from_value, -1e6), min(bounds.to_value, 1e6)
        return [
            bounds.from_value,
            bounds.to_value,
            0.0,
            1e-9,
            math.nan,
            math.inf,
            *random.uniform(low, high, 4).tolist(),
        ]
    count = len(value)
    if name.endswith(("travel_min_deg", "travel_max_deg")):
        return [*random.uniform(-300.0, 300.0, (20, count)).tolist(), [-223.0, -12.0], [math.nan] * count]
    rows = [0.0, 1e-9, 1e-3, 1.0, 10.0, 1e3, 1e9, -1.0, math.nan]
    return [[row] * count for row in rows] + [[], [1.0], [1.0] * (count + 1)]


class Silent:
    """A logger of which nothing is seen."""

    def __getattr__(self, _level: str) -> Callable[..., None]:
        return lambda *_words, **_options: None


SILENT = Silent()


def test_no_value_that_a_live_parameter_accepts_ends_the_work(
    attacked: Door, random: np.random.Generator, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Each at its bounds, beyond them and between, in turn; those that are taken stay while the work goes on."""
    monkeypatch.chdir(tmp_path)
    node = attacked.node
    monkeypatch.setattr(node, "get_logger", lambda: SILENT)
    for name in sorted(node.parameters._live):
        before = node.get_parameter(name)
        for value in tried(node, name, random):
            (result,) = node.set_parameters([Parameter(name, value=value)])
            assert result.successful or result.reason
            attacked.step()
        node.set_parameters([before])
    assert node.inputs.errors == 0
