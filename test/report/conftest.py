"""A real bag of a run that never happened: known modes, errors, losses and latencies, written through `BagWriter`."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import Nodetype, Qos

from rf_pointing.report.bag_writer import BagResult, BagWriter
from rf_pointing.report.definitions import Definitions, definitions, qos_from_profile

MSG_DEFS = Path(__file__).parents[2] / "msg_defs"
MDEG = math.radians(1e-3)
START_NS = 1_700_000_000 * 10**9
WALL_NS = 1_800_000_000 * 10**9
MS = 1_000_000

Pair = tuple[float, float]


def offered_qos(*, depth: int = 10, durability: str = "VOLATILE", deadline_ns: int = 0) -> Qos:
    """Return a reliable profile as a publisher offers it, by the attributes that rclpy's has."""
    names = {"history": "KEEP_LAST", "reliability": "RELIABLE", "durability": durability}
    times = {"deadline": deadline_ns, "lifespan": 0}
    return qos_from_profile(
        SimpleNamespace(
            depth=depth,
            **{key: SimpleNamespace(name=name) for key, name in names.items()},
            **{key: SimpleNamespace(nanoseconds=value) for key, value in times.items()},
        )
    )


@dataclass
class SyntheticRun:
    """What happened, as functions of the time since the start in seconds; errors and offsets in millidegrees.

    The encoders run on a circle of `circle_mdeg` around the commanded direction, once in 4 s.
    `dropped` names sequence numbers (or, for standard types, message indexes) that never reached the recorder.
    """

    seconds: float = 60.0
    speed: float = 10.0
    namespace: str = "/gs1"
    mode: Callable[[float], str] = lambda _: "monopulse"
    error_mdeg: Callable[[float], Pair] = lambda _: (0.0, 0.0)
    offset_mdeg: Callable[[float], Pair] = lambda _: (0.0, 0.0)
    azel_deg: Callable[[float], Pair] = lambda t: (100.0 + 0.5 * t, 30.0 + 0.1 * t)
    carrier_to_noise: Callable[[float], float] = lambda _: 60.0
    beamwidth_mdeg: float = 65.0
    aos_los_s: Pair = (10.0, 58.0)
    truth: bool = True
    dropped: dict[str, set[int]] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    sensed: Callable[[float], bool] = lambda _: True
    sensor: str = "monopulse"
    circle_mdeg: float = 0.0
    over: bool = False
    """Whether the dish is over the top: the axes are at (az + 180 deg, 180 deg - el)."""
    lateness_s: Callable[[float], float] = lambda _: 0.0005
    target: Callable[[float], str] = lambda _: "28057"
    """Target of the status; empty while nothing is tracked."""
    counted: Callable[[float], tuple[float, float, float]] = lambda _: (0.0, 0.0, 0.0)
    """Seconds tracked and lost, and mean loss in dB, as the controller counts them."""
    alarm: Callable[[float], tuple[int, str]] = lambda _: (0, "")
    fault: Callable[[float], str] = lambda _: ""
    """Latched fault of the antenna."""
    reason: Callable[[float], str] = lambda _: ""
    """Of the status; "now " and the mode where it is empty."""
    predicted: dict[str, float] | None = None
    """Fields of the branch that the certificate takes; None for no certificate."""

    def write(self, path: Path, types: Definitions, notes: dict[str, str] | None = None) -> BagResult:
        """Write the bag; messages are received in the order of their log times."""
        return self._write(_Sheet(self, types), path, types, notes)

    def _write(self, sheet: "_Sheet", path: Path, types: Definitions, notes: dict[str, str] | None) -> BagResult:
        sheet.fill()
        with BagWriter(path, types, notes=notes) as bag:
            for topic, type_name in sheet.types.items():
                bag.register(topic, type_name, [offered_qos()])
            for log_ns, topic, data in sorted(sheet.messages, key=lambda item: item[0]):
                bag.write(topic, log_ns, data)
        return bag.close()


class Maker:
    """Messages from the fields that matter; all others are zero or empty."""

    def __init__(self, types: Definitions) -> None:
        self.store = types.typestore
        self.blanks: dict[str, dict[str, Any]] = {}

    def message(self, type_name: str, /, **fields: Any) -> Any:
        if type_name not in self.blanks:
            kinds = dict(self.store.fielddefs[type_name][1])
            self.blanks[type_name] = {key: self.blank(kind) for key, kind in kinds.items()}
        blanks = self.blanks[type_name]
        assert fields.keys() <= blanks.keys(), f"{type_name} has no {fields.keys() - blanks.keys()}"
        return self.store.types[type_name](**{**blanks, **fields})

    def blank(self, kind: Any) -> Any:
        node, content = kind
        if node == Nodetype.NAME:
            return self.message(content)
        if node == Nodetype.BASE:
            return "" if content[0] == "string" else False if content[0] == "bool" else 0
        (inner, base), length = content
        if inner != Nodetype.BASE or base[0] == "string":
            return []
        return np.zeros(length, dtype=base[0])

    def serialized(self, type_name: str, /, **fields: Any) -> bytes:
        return bytes(self.store.serialize_cdr(self.message(type_name, **fields), type_name))

    def time(self, stamp_ns: int) -> Any:
        return self.message("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)

    def header(self, stamp_ns: int) -> Any:
        return self.message("std_msgs/msg/Header", stamp=self.time(stamp_ns))


class _Sheet(Maker):
    def __init__(self, run: SyntheticRun, types: Definitions) -> None:
        super().__init__(types)
        self.run = run
        self.types: dict[str, str] = {}
        self.messages: list[tuple[int, str, bytes]] = []
        self.counters: dict[str, int] = {}

    @staticmethod
    def stamp(seconds: float) -> int:
        return START_NS + round(seconds * 1e6) * 1000

    def add(self, topic: str, type_name: str, seconds: float, delay_ms: float, /, **fields: Any) -> None:
        """Add a message received `delay_ms` of wall time after the clock said `seconds`."""
        if topic in self.run.left_out:
            return
        full = f"{self.run.namespace}/{topic}"
        self.types[full] = type_name
        number = self.counters.get(full, 0)
        self.counters[full] = number + 1
        if number in self.run.dropped.get(topic, ()):
            return
        if type_name.startswith("rf_pointing_msgs/"):
            fields["sequence"] = number
        log_ns = WALL_NS + round(seconds / self.run.speed * 1e9) + round(delay_ms * MS)
        self.messages.append((log_ns, full, self.serialized(type_name, **fields)))

    def own(
        self, topic: str, name: str, seconds: float, delay_ms: float, /, *, ahead: float = 0.0, **fields: Any
    ) -> None:
        fields["header"] = self.header(self.stamp(seconds + ahead))
        self.add(topic, f"rf_pointing_msgs/msg/{name}", seconds, delay_ms, **fields)

    def fill(self) -> None:
        aos, los = map(self.stamp, self.run.aos_los_s)
        times = {"aos": self.time(aos), "tca": self.time((aos + los) // 2), "los": self.time(los)}
        one = self.message("rf_pointing_msgs/msg/Pass", target="28057", peak_elevation=0.9, **times)
        self.own("passes", "PassList", 0.0, 0.0, target="28057", passes=[one])
        if self.run.predicted is not None:
            barred = self.message("rf_pointing_msgs/msg/PassBranch", works=False, mean_loss=9.0, lost=99.0)
            taken = self.message("rf_pointing_msgs/msg/PassBranch", works=True, **self.run.predicted)
            self.own(
                "pass_certificate", "PassCertificate", 1.0, 0.0, target="28057", aos=self.time(aos),
                los=self.time(los), accepted=True, least_share=0.75, branches=[barred, taken],
            )  # fmt: skip
        for tick in range(round(self.run.seconds * 50)):
            self.fast(tick / 50)
            if tick % 5 == 0:
                self.slow(tick / 50)

    def fast(self, t: float) -> None:
        run, stamp = self.run, self.stamp(t)
        around = run.circle_mdeg * MDEG * np.array([math.cos(0.5 * math.pi * t), math.sin(0.5 * math.pi * t)])
        position = self.axes_rad(t) + around
        velocity = (np.radians(run.azel_deg(t + 0.01)) - np.radians(run.azel_deg(t - 0.01))) / 0.02
        axes = {"name": ["azimuth", "elevation"], "position": position, "velocity": velocity}
        self.add("clock", "rosgraph_msgs/msg/Clock", t, 0.0, clock=self.time(stamp))
        self.add("joint_states", "sensor_msgs/msg/JointState", t, 0.4, header=self.header(stamp), **axes)
        if run.truth:
            self.own("sim/boresight", "Boresight", t, 0.6, azimuth=position[0], elevation=position[1])
            self.own("sim/pointing_error", "PointingError", t, 0.9, sensor="truth", valid=True, **self.error(t))

    def axes_rad(self, t: float) -> Any:
        az, el = np.radians(self.run.azel_deg(t))
        return np.array([az + math.pi, math.pi - el] if self.run.over else [az, el])

    def error(self, t: float) -> dict[str, float]:
        xel, el = self.run.error_mdeg(t)
        return {"cross_elevation": xel * MDEG, "elevation": el * MDEG}

    def slow(self, t: float) -> None:
        run, valid, mode = self.run, self.run.sensed(t), self.run.mode(t)
        az, el = np.radians(run.azel_deg(t))
        offset = [value * MDEG for value in run.offset_mdeg(t)]
        cn0 = {"carrier_to_noise": run.carrier_to_noise(t)}
        sensed = {"sensor": run.sensor, "valid": valid, "reason": "" if valid else "no lock"}
        self.own("target", "Target", t, 0.1, ahead=2.0, target="28057", azimuth=az, elevation=el)
        self.own("monopulse", "Monopulse", t, 1.6, sample_period=0.02, **cn0)
        self.own("carrier_power", "CarrierPower", t, 1.8, integration_time=0.1, power=1e-15, sigma=1e-17, **cn0)
        self.own("pointing_error", "PointingError", t, 3.1, **sensed, **self.error(t), **cn0)
        reason = run.reason(t) or f"now {mode}"
        status = {"mode": mode, "target": run.target(t), "reason": reason, "azimuth": az, "elevation": el, **cn0}
        tracked_s, lost_s, loss_db = run.counted(t)
        level, alarm = run.alarm(t)
        status |= {"seconds_tracked": tracked_s, "seconds_lost": lost_s, "mean_loss": loss_db, "level": level}
        status |= {"alarm": alarm}
        status |= {"cross_elevation_offset": offset[0], "elevation_offset": offset[1], "command_lead": 0.8}
        status["scan_centre"] = self.axes_rad(t)
        status |= {"beamwidth": run.beamwidth_mdeg * MDEG, "commands_sent": round(10 * t)}
        self.own("tracking_status", "TrackingStatus", t, 4.1, **status)
        if mode not in ("idle", "stopped"):
            self.add(
                "joint_trajectory", "trajectory_msgs/msg/JointTrajectory", t, 4.6,
                header=self.header(self.stamp(t)), joint_names=["azimuth", "elevation"],
            )  # fmt: skip
        drive = {"mode": "holding" if mode == "idle" else "tracking", "tick_lateness": run.lateness_s(t)}
        drive |= {"fault": run.fault(t)}
        drive |= {"rate_limit": np.full(2, 0.0175), "acceleration_limit": np.full(2, 0.0087), "command_lead": 0.7}
        drive |= {"commands_accepted": round(10 * t), "commands_rejected": 1, "last_rejection": "stale stamp"}
        self.own("antenna_status", "AntennaStatus", t, 0.5, **drive)


@pytest.fixture(scope="session")
def types() -> Definitions:
    return definitions(MSG_DEFS)


@pytest.fixture(scope="session")
def synthetic_run() -> type[SyntheticRun]:
    return SyntheticRun


@pytest.fixture(scope="session")
def maker(types: Definitions) -> Maker:
    return Maker(types)
