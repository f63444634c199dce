"""Disturb the source of a live signal_receiver in wall time: is it named, and does the level come back?

    scripts/run-python benchmarks/receiver_faults.py [--rounds 1] [--json FILE]

The node runs as `ros2 run` starts it, against a radio that this script plays over loopback: rtl_tcp,
and DIFI for what only stamps can show.  Each fault lasts 6 s.  Named is the time until the words
appear on /diagnostics, back the time after its end until the level is within 0.5 dB again; both
must be short (`NAMED_S`, `BACK_S`), and from 1 s after its begin no level within 20 dB of the truth
that is published may be off by more than 1 dB.  At last the memory that the node has gained since the first round.
"""

import argparse
import json
import math
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from real_station import free_port
from rf_pointing_msgs.msg import CarrierPower

from rf_pointing.receiver import GeneratorParams, SignalGenerator
from rf_pointing.receiver.params import OutletParams
from rf_pointing.receiver.serving import Outlet, make_outlet
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STREAM
from rf_pointing.station.description.description import STATIONS

RATE_HZ, CARRIER_HZ, CENTRE_HZ = 240e3, 2250e6, 2249.98e6
LEVEL_DB_HZ, PIECE_S = 55.0, 0.02
FAULT_S, SETTLED_S = 6.0, 6.0
NAMED_S, BACK_S = 2.0, 5.0
WRONG_DB, RIGHT_DB, NEAR_DB = 1.0, 0.5, 20.0


@dataclass
class Radio(threading.Thread):
    """A radio in real time; what is wrong with it is set by the attributes."""

    kind: str
    port: int
    silent: bool = False
    gain: float = 1.0
    share: float = 1.0
    """Share of the samples of a piece that is sent; below 1 they come at a lower rate than stated."""
    late_s: float = 0.0
    centre_hz: float = CENTRE_HZ
    noise: bool = False
    ended: threading.Event = field(default_factory=threading.Event)
    outlet: Outlet | None = None

    def __post_init__(self) -> None:
        super().__init__(daemon=True)
        self._generator = SignalGenerator(GeneratorParams(rate_hz=RATE_HZ))
        self._random = np.random.default_rng(1)
        self.open()

    __hash__ = threading.Thread.__hash__

    def open(self) -> None:
        self.outlet = make_outlet(
            OutletParams(format=self.kind, port=self.port),
            RATE_HZ,
            CENTRE_HZ,
        )

    def shut(self) -> None:
        outlet, self.outlet = self.outlet, None
        assert outlet is not None
        outlet.close()

    def run(self) -> None:
        due_s, count = time.monotonic(), round(PIECE_S * RATE_HZ)
        while not self.ended.wait(max(0.0, due_s - time.monotonic())):
            due_s += PIECE_S
            if self.silent or (outlet := self.outlet) is None:
                continue
            offset_hz = CARRIER_HZ - self.centre_hz
            samples = self._generator.take(
                count,
                (offset_hz, offset_hz),
                [10.0 ** (LEVEL_DB_HZ / 20.0)],
            )
            if self.noise:
                samples = (self._random.integers(0, 2, (1, 2 * count)) * np.float32(2.0) - 1.0).view(
                    np.complex64,
                )
            parts = np.clip(self.gain * samples.view(np.float32), -1.0, 1.0)
            sent = parts.view(np.complex64)[:, : round(self.share * count)]
            outlet.centre_hz = self.centre_hz
            with suppress(OSError):
                outlet.send(np.ascontiguousarray(sent), time.time() - PIECE_S - self.late_s)


class Watch:
    """A live node and what it publishes."""

    def __init__(self, ends: ExitStack, folder: Path, kind: str) -> None:
        self.radio = Radio(kind, free_port())
        station = folder / f"{kind}.yaml"
        link = f"link: {{host: 127.0.0.1, port: {self.radio.port}}}"
        iq = f"iq: {{rate_hz: {RATE_HZ}, centre_mhz: {1e-6 * CENTRE_HZ}}}"
        section = f"\nreceiver: {{type: {kind}, {link}, {iq}}}\n"
        station.write_text((STATIONS / "leo_3m7.yaml").read_text() + section)
        namespace = f"/receiver_{kind}"
        given = {"station": str(station), "band": "S"}
        path = folder / f"{kind}.json"
        path.write_text(json.dumps({"/**/signal_receiver": {"ros__parameters": given}}))
        self.words, self.levels = "", list[tuple[float, float]]()
        self.node = rclpy.create_node("disturber", namespace=namespace)
        ends.callback(self.node.destroy_node)
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.node.create_subscription(CarrierPower, "carrier_power", self._on_power, STREAM)
        self.processes = NodeProcesses(namespace, [path], folder / "logs")
        ends.callback(self.processes.stop)
        ends.callback(self.radio.ended.set)
        self.radio.start()
        self.processes.start(["signal_receiver"], simulated_time=False, autostart=True)
        if self.until(self.good, 60.0) == math.inf:
            raise TimeoutError(
                f"no level of {kind}: {self.words}; {self.processes.complaint('signal_receiver')}",
            )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("signal_receiver: signal"):
                self.words = status.message if status.level != b"\0" else ""

    def _on_power(self, message: CarrierPower) -> None:
        self.levels.append((time.monotonic(), message.carrier_to_noise))

    def good(self) -> bool:
        """Whether the newest levels are right."""
        recent = [level for at_s, level in self.levels[-10:] if time.monotonic() - at_s < 1.0]
        near = [abs(level - LEVEL_DB_HZ) < RIGHT_DB for level in recent[-5:]]
        return len(near) == 5 and all(near)

    def until(self, condition: Callable[[], bool], patience_s: float) -> float:
        """Return how long a condition takes, infinity beyond the patience."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                return math.inf
            self.executor.spin_once(timeout_sec=0.01)
        return time.monotonic() - begun_s

    def megabytes(self) -> float:
        status = Path(f"/proc/{self.processes.process_id('signal_receiver')}/status").read_text()
        return int(status.split("RssAnon:")[1].split()[0]) / 1024.0


FAULTS: dict[str, tuple[str, dict[str, object], dict[str, object], str]] = {
    "killed": ("rtl_tcp", {"open": False}, {"open": True}, "rtl_tcp at"),
    "stalled for 6 s": ("rtl_tcp", {"silent": True}, {"silent": False}, "silent"),
    "garbage": ("rtl_tcp", {"noise": True}, {"noise": False}, "garbage"),
    "clipped": ("rtl_tcp", {"gain": 300.0}, {"gain": 1.0}, "clipped"),
    "half the rate": ("rtl_tcp", {"share": 0.5}, {"share": 1.0}, "arrive"),
    "1e9 samples late": ("vita49", {"late_s": 1e9 / RATE_HZ}, {"late_s": 0.0}, "late"),
    "retuned by 30 kHz": ("vita49", {"centre_hz": CENTRE_HZ - 3e4}, {"centre_hz": CENTRE_HZ}, "retuned"),
}
"""Kind of the source, what begins and what ends the fault, and a word that names it."""


def disturb(watch: Watch, name: str) -> tuple[float, float, float]:
    """Return how long it took to name a fault and to be back, in s, and the worst level meanwhile, in dB."""
    _, begin, end, word = FAULTS[name]
    radio = watch.radio

    def change(values: dict[str, object]) -> None:
        for key, value in values.items():
            if key == "open":
                radio.open() if value else radio.shut()
            else:
                setattr(radio, key, value)

    count, begun_s = len(watch.levels), time.monotonic()
    change(begin)
    named_s = watch.until(lambda: word in watch.words, FAULT_S)
    watch.until(lambda: time.monotonic() - begun_s > FAULT_S, 2.0 * FAULT_S)
    off_db = [abs(level - LEVEL_DB_HZ) for at_s, level in watch.levels[count:] if at_s > begun_s + 1.0]
    wrong_db = max((each for each in off_db if each < NEAR_DB), default=0.0)
    change(end)
    back_s = watch.until(watch.good, 60.0)
    watch.until(lambda: False, SETTLED_S)
    return named_s, back_s, wrong_db


def main() -> int:
    """Disturb, print the table, and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    os.environ |= {"ROS_DOMAIN_ID": str(random.randrange(1, 100)), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    rclpy.init()
    rows, failed = list[dict[str, object]](), 0
    with ExitStack() as ends:
        folder = Path(ends.enter_context(tempfile.TemporaryDirectory()))
        watches = {kind: Watch(ends, folder, kind) for kind in ("rtl_tcp", "vita49")}
        before = dict[str, float]()
        for round_ in range(options.rounds):
            for name, (kind, *_) in FAULTS.items():
                named_s, back_s, wrong_db = disturb(watches[kind], name)
                good = named_s <= NAMED_S and back_s <= BACK_S and wrong_db <= WRONG_DB
                failed += not good
                rows.append(
                    {"fault": name, "named_s": named_s, "back_s": back_s, "wrong_db": wrong_db},
                )
                print(f"{'ok' if good else 'FAILS':<6}{name:<20}named {named_s:5.2f} s <= {NAMED_S:g}  "
                      f"back {back_s:5.2f} s <= {BACK_S:g}  level off by {wrong_db:5.2f} dB meanwhile", flush=True)  # fmt: skip
            if not round_:
                before = {kind: watch.megabytes() for kind, watch in watches.items()}
        for kind, watch in watches.items():
            print(
                f"      {kind}: {watch.megabytes():.1f} MB, {watch.megabytes() - before[kind]:+.1f} since the first round"
            )
    rclpy.try_shutdown()
    if options.json:
        options.json.write_text(json.dumps(rows))
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
