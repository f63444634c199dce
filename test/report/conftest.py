"""A real bag of a run that never happened: known modes, errors, losses and latencies, written through `BagWriter`."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.bag_writer import BagResult, BagWriter
from rf_pointing.report.definitions import Definitions, definitions
from rf_pointing.report.offered_qos import offered_qos

MSG_DEFS = Path(__file__).parents[2] / "msg_defs"
MDEG = math.radians(1e-3)
START_NS = 1_700_000_000 * 10**9
WALL_NS = 1_800_000_000 * 10**9
MS = 1_000_000

Pair = tuple[float, float]


@dataclass
class SyntheticRun:
    """What happened, as functions of the time since the start in seconds; errors and offsets in millidegrees.

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
    lateness_s: Callable[[float], float] = lambda _: 0.0005

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


class _Sheet:
    def __init__(self, run: SyntheticRun, types: Definitions) -> None:
        self.run, self.store = run, types.typestore
        self.types: dict[str, str] = {}
        self.messages: list[tuple[int, str, bytes]] = []
        self.sequence: dict[str, int] = {}

    def make(self, name: str, *values: Any) -> Any:
        return self.store.types[name](*values)

    def time(self, seconds: float) -> Any:
        stamp = START_NS + round(seconds * 1e6) * 1000
        return self.make("builtin_interfaces/msg/Time", stamp // 10**9, stamp % 10**9)

    def header(self, seconds: float) -> Any:
        return self.make("std_msgs/msg/Header", self.time(seconds), "")

    def add(self, topic: str, type_name: str, seconds: float, delay_ms: float, *fields: Any) -> None:
        """Add a message received `delay_ms` of wall time after the clock said `seconds`."""
        if topic in self.run.left_out:
            return
        full = topic if topic.startswith("/") else f"{self.run.namespace}/{topic}"
        self.types[full] = type_name
        index = self.sequence.get(full, 0)
        self.sequence[full] = index + 1
        if index in self.run.dropped.get(topic, ()):
            return
        log_ns = WALL_NS + round(seconds / self.run.speed * 1e9) + round(delay_ms * MS)
        data = self.store.serialize_cdr(self.make(type_name, *fields), type_name)
        self.messages.append((log_ns, full, bytes(data)))

    def own(self, topic: str, name: str, seconds: float, delay_ms: float, *fields: Any, stamp: float = 0.0) -> None:
        number = self.sequence.get(f"{self.run.namespace}/{topic}", 0)
        head = (self.header(seconds + stamp), number)
        self.add(topic, f"rf_pointing_msgs/msg/{name}", seconds, delay_ms, *head, *fields)

    def fill(self) -> None:
        aos, los = self.run.aos_los_s
        middle = 0.5 * (aos + los)
        one = self.make(
            "rf_pointing_msgs/msg/Pass", "28057", *map(self.time, (aos, middle, los)), *[0.0] * 5, 0.9, 0.01, 0.01
        )
        self.own("passes", "PassList", 0.0, 0.0, "28057", [one])
        for tick in range(round(self.run.seconds * 50)):
            self.fast(tick / 50)
            if tick % 5 == 0:
                self.slow(tick / 50)

    def fast(self, t: float) -> None:
        az, el = map(math.radians, self.run.azel_deg(t))
        later, sooner = (np.radians(self.run.azel_deg(t + step)) for step in (0.01, -0.01))
        axes = (["azimuth", "elevation"], np.array([az, el]), (later - sooner) / 0.02, np.zeros(0))
        self.add("clock", "rosgraph_msgs/msg/Clock", t, 0.0, self.time(t))
        self.add("joint_states", "sensor_msgs/msg/JointState", t, 0.4, self.header(t), *axes)
        if self.run.truth:
            self.own("sim/boresight", "Boresight", t, 0.6, az, el)
            self.own("sim/pointing_error", "PointingError", t, 0.9, "truth", True, "", *self.error(t), np.zeros(4), 0.0)

    def error(self, t: float) -> Pair:
        xel, el = self.run.error_mdeg(t)
        return xel * MDEG, el * MDEG

    def slow(self, t: float) -> None:
        run, axes = self.run, np.zeros(2)
        az, el = map(math.radians, run.azel_deg(t))
        cn0, valid, mode = run.carrier_to_noise(t), run.sensed(t), run.mode(t)
        offsets = [value * MDEG for value in run.offset_mdeg(t)]
        reason = "" if valid else "no lock"
        self.own("target", "Target", t, 0.1, "28057", az, el, *[0.0] * 6, stamp=2.0)
        self.own("monopulse", "Monopulse", t, 1.6, 0.02, *[np.zeros(5)] * 6, cn0)
        self.own("carrier_power", "CarrierPower", t, 1.8, 0.1, 1e-15, 1e-17, cn0)
        error = (*self.error(t), np.zeros(4), cn0)
        self.own("pointing_error", "PointingError", t, 3.1, "monopulse", valid, reason, *error)
        status = (mode, "28057", f"now {mode}", self.time(run.aos_los_s[1]), az, el, *self.error(t), *offsets, cn0)
        self.own("tracking_status", "TrackingStatus", t, 4.1, *status, run.beamwidth_mdeg * MDEG, 0.8, round(10 * t))
        duration = self.make("builtin_interfaces/msg/Duration", 1, 0)
        point = self.make("trajectory_msgs/msg/JointTrajectoryPoint", axes, axes, axes, np.zeros(0), duration)
        if mode not in ("idle", "stopped"):
            head = (self.header(t), ["azimuth", "elevation"], [point])
            self.add("joint_trajectory", "trajectory_msgs/msg/JointTrajectory", t, 4.6, *head)
        drive = ("tracking" if mode != "idle" else "holding", "", axes, axes, axes + 0.0175, axes + 0.0087)
        end = (np.zeros(2, dtype=bool), 0.7, run.lateness_s(t), round(10 * t), 1, "stale stamp")
        self.own("antenna_status", "AntennaStatus", t, 0.5, *drive, *end)


@pytest.fixture(scope="session")
def types() -> Definitions:
    return definitions(MSG_DEFS)


@pytest.fixture(scope="session")
def synthetic_run() -> type[SyntheticRun]:
    return SyntheticRun
