"""Disturb the samples of a flown pass: is it named, does the beam coast, does the tracker go on?

    scripts/run-python benchmarks/receiver_faults.py [--kind vita49] [--rounds 1] [--json FILE]

`track` flies a pass of leo_3m7 (S band, conscan) in real time.  In place of `signal_source` this
script makes the samples from where the beam is, as DIFI or rtl_tcp.  Each fault lasts 5 s.  Named
is the time until its words appear on /diagnostics; off is the largest loss of the true beam from
begin of the fault until the tracker is back, in dB; back the time from its end until conscan tracks
again with a level and no problem.  At last the memory that signal_receiver's process has gained
since the first round.
"""

import argparse
import json
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from real_station import free_port
from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.msg import Boresight, TrackingStatus

from rf_pointing.api import live
from rf_pointing.commands import track
from rf_pointing.core import Mode, PointingError
from rf_pointing.ephemeris.source import load_track
from rf_pointing.receiver.params import OutletParams
from rf_pointing.receiver.serving import Outlet, make_outlet
from rf_pointing.ros import convert
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.qos import SAMPLES, STREAM
from rf_pointing.simulation import StationSetup
from rf_pointing.station.antenna.radio import SimulatedRadio
from rf_pointing.station.derive.axes import kinematics_of

RATE_HZ, CENTRE_HZ = 240e3, 2249.98e6
FAULT_S, SETTLED_S, BEGIN_S = 5.0, 8.0, 420.0
NAMED_S, BACK_S, LOSS_DB = 2.0, 20.0, 1.0
FLY = "--fly"


class Radio:
    """The radio behind the beam; what is wrong with it is set by the attributes."""

    def __init__(self, kind: str, port: int, words: list[str]) -> None:
        request = track.request_of(words)
        source = request.target.parameters
        changes = {"rf_receiver": {**source, "signal.seed": request.seed}}
        setup = StationSetup(request.station.description, "S", changes=changes)
        sets = setup.sets("rf_receiver")
        radio = setup.sets("signal_source")["sdr"]
        self._signal = SimulatedRadio(
            sets["signal"], radio, load_track(sets["source"]), kinematics_of(setup.station.content)
        )
        self._kind, self._port = kind, port
        self._random = np.random.default_rng(1)
        self.width_rad = float(sets["signal"].beam.half_power_beamwidth_rad)
        self.silent = self.noise = False
        self.gain = self.share = 1.0
        self.late_s = 0.0
        self.loss_db = 0.0
        self.outlet: Outlet | None = None
        self.open()

    def open(self) -> None:
        self.outlet = make_outlet(OutletParams(format=self._kind, port=self._port), RATE_HZ, CENTRE_HZ)

    def shut(self) -> None:
        outlet, self.outlet = self.outlet, None
        assert outlet is not None
        outlet.close()

    def retune(self, by_hz: float) -> None:
        assert self.outlet is not None
        self.outlet.centre_hz = CENTRE_HZ + by_hz
        self._signal.radio = self._signal.radio.replace(centre_hz=CENTRE_HZ + by_hz)

    def state(self, share: float) -> None:
        assert self.outlet is not None
        self.outlet.rate_hz = share * RATE_HZ

    def take(self, message: Boresight) -> PointingError | None:
        """Make and send the samples of a tick; return the truth."""
        piece = self._signal.take(convert.boresight_from_message(message))
        if piece is None:
            return None
        error_rad = math.hypot(piece.truth.cross_elevation_rad, piece.truth.elevation_rad)
        self.loss_db = 12.04 * (error_rad / self.width_rad) ** 2
        if self.silent or self.outlet is None:
            return piece.truth
        samples, count = piece.samples, piece.samples.shape[1]
        if self.noise:
            samples = (self._random.integers(0, 2, (1, 2 * count)) * np.float32(2.0) - 1.0).view(np.complex64)
        parts = np.clip(self.gain * samples.view(np.float32), -1.0, 1.0)
        sent = parts.view(np.complex64)[:, : round(self.share * count)]
        with suppress(OSError):
            self.outlet.send(np.ascontiguousarray(sent), piece.t_s - self.late_s)
        return piece.truth


Act = Callable[[Radio], object]


def setting(name: str, value: float) -> Act:
    return lambda radio: setattr(radio, name, value)


OF_BOTH: dict[str, tuple[Act, Act, str]] = {
    "killed": (Radio.shut, Radio.open, " at "),
    "stalled": (setting("silent", True), setting("silent", False), "silent"),
    "garbage": (setting("noise", True), setting("noise", False), "garbage"),
    "clipped": (setting("gain", 300.0), setting("gain", 1.0), "clipped"),
}
FAULTS: dict[str, dict[str, tuple[Act, Act, str]]] = {
    "vita49": OF_BOTH
    | {
        "1e9 samples late": (setting("late_s", 1e9 / RATE_HZ), setting("late_s", 0.0), "late"),
        "retuned by 30 kHz": (lambda radio: radio.retune(-3e4), lambda radio: radio.retune(0.0), "retuned"),
        "half the rate stated": (lambda radio: radio.state(0.5), lambda radio: radio.state(1.0), "rate"),
    },
    "rtl_tcp": OF_BOTH
    | {
        "half the rate": (setting("share", 0.5), setting("share", 1.0), "arrive"),
        "retuned by 10 kHz": (lambda radio: radio.retune(-1e4), lambda radio: radio.retune(0.0), "retuned"),
        "retuned by 30 kHz": (lambda radio: radio.retune(-3e4), lambda radio: radio.retune(0.0), "no signal"),
    },
}
"""By the kind of the source: what begins and what ends a fault, and a word that names it."""


class Flight:
    """A pass that `track` flies, its radio, and what is published of both."""

    def __init__(self, kind: str, folder: Path) -> None:
        port, namespace = free_port(), f"/faults_{kind}"
        address = f"{kind}://localhost:{port}?iq.rate_hz={RATE_HZ:.0f}&iq.centre_mhz={1e-6 * CENTRE_HZ}"
        words = ["--station", "leo_3m7", "--band", "S", "--mask", "8", "--sensor", "conscan",
                 "--namespace", namespace, "--output", str(folder), "--receiver", address]  # fmt: skip
        self.radio = Radio(kind, port, words)
        self.words, self.mode = "not yet", ""
        self.problems = dict[str, None]()
        self.modes = set[str]()
        self.worst_db = 0.0
        self.node = rclpy.create_node("disturber", namespace=namespace)
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self._truth, self._ticks = self.node.create_publisher(ours.PointingError, "sim/pointing_error", STREAM), 0
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.node.create_subscription(TrackingStatus, "tracking_status", self._on_status, STREAM)
        self.node.create_subscription(Boresight, "sim/boresight", self._on_boresight, SAMPLES)
        self.process = subprocess.Popen([sys.executable, __file__, FLY, *words], stdin=subprocess.DEVNULL)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("signal_receiver: signal"):
                self.words = status.message if status.level != b"\0" else ""
                self.problems[self.words] = None

    def _on_status(self, message: TrackingStatus) -> None:
        self.mode = message.mode
        self.modes.add(message.mode)

    def _on_boresight(self, message: Boresight) -> None:
        truth = self.radio.take(message)
        self._ticks += 1
        if truth is not None and self._ticks % 5 == 0:
            self._truth.publish(convert.error_to_message(truth))
        self.worst_db = max(self.worst_db, self.radio.loss_db)

    def good(self) -> bool:
        return self.mode == Mode.CONSCAN and not self.words

    def until(self, condition: Callable[[], bool], patience_s: float) -> float:
        """Return how long a condition takes, infinity beyond the patience."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s or self.process.poll() is not None:
                return math.inf
            self.executor.spin_once(timeout_sec=0.01)
        return time.monotonic() - begun_s

    def wait(self, seconds: float) -> None:
        begun_s = time.monotonic()
        self.until(lambda: time.monotonic() - begun_s > seconds, seconds + 1.0)

    def megabytes(self) -> float:
        """Return the memory of signal_receiver."""
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError, IndexError):
                line = (folder / "cmdline").read_bytes().decode()
                if "signal_receiver" in line and f"__ns:={self.node.get_namespace()}\0" in line:
                    return int((folder / "status").read_text().split("RssAnon:")[1].split()[0]) / 1024.0
        return math.nan

    def disturb(self, name: str, begin: Act, end: Act, word: str) -> dict[str, object]:
        self.modes, self.worst_db = set(), 0.0
        begun_s = time.monotonic()
        begin(self.radio)
        named_s = self.until(lambda: word in self.words, FAULT_S)
        self.wait(FAULT_S - (time.monotonic() - begun_s))
        end(self.radio)
        self.problems.clear()
        back_s = self.until(self.good, 4.0 * BACK_S)
        row = {"fault": name, "named_s": named_s, "back_s": back_s, "off_db": self.worst_db,
               "modes": sorted(self.modes - {Mode.CONSCAN}), "words": list(self.problems)}  # fmt: skip
        row["good"] = named_s <= NAMED_S and back_s <= BACK_S and self.worst_db <= LOSS_DB
        self.until(lambda: not self.good(), SETTLED_S)
        self.until(self.good, BACK_S)
        return row

    def end(self) -> None:
        """End the pass, and what it has started."""
        self.process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(60.0)
        self.process.kill()
        self.node.destroy_node()


def fly(words: list[str]) -> None:
    """Fly as `track` does, without a source of samples."""
    whole = live.with_receiver
    live.with_receiver = lambda names, kind: tuple(each for each in whole(names, kind) if each != "signal_source")
    track.main(words)


def main() -> int:
    """Disturb, print the table, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=list(FAULTS), default="vita49")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    os.environ |= {"ROS_DOMAIN_ID": str(random.randrange(1, 100)), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    rclpy.init()
    rows = list[dict[str, object]]()
    for kind in [options.kind]:
        with tempfile.TemporaryDirectory() as place:
            flight, before = Flight(kind, Path(place)), math.nan
            try:
                took_s = flight.until(flight.good, BEGIN_S)
                print(f"{kind}: conscan tracks after {took_s:.0f} s", flush=True)
                flight.wait(SETTLED_S)
                for round_ in range(options.rounds if took_s < math.inf else 0):
                    for name, fault in FAULTS[kind].items():
                        row = flight.disturb(name, *fault)
                        rows.append(row)
                        print(
                            f"{'ok' if row['good'] else 'FAILS':<6}{name:<22}named {row['named_s']:5.2f} s, "
                            f"off at most {row['off_db']:.2f} dB ({', '.join(row['modes'])}), "
                            f"back {row['back_s']:5.2f} s",
                            flush=True,
                        )
                    before = flight.megabytes() if not round_ else before
                now = flight.megabytes()
                print(f"      signal_receiver: {now:.1f} MB, {now - before:+.1f} since the first round")
            finally:
                flight.end()
    rclpy.try_shutdown()
    if options.json:
        options.json.write_text(json.dumps(rows))
    return int(not rows or not all(row["good"] for row in rows))


if __name__ == "__main__":
    if sys.argv[1:2] == [FLY]:
        fly(sys.argv[2:])
    sys.exit(main())
