"""Tune and key rigs live: how large are the steps, how far off the Doppler, how late is the key up?

    scripts/run-python benchmarks/radio.py [--seconds 20] [--keys 40]

`radio_control` runs as `ros2 run` starts it.  Its receiver is at 1 GHz, the satellite passes
overhead at 500 km: 375 Hz/s.  Its rigs are two of Hamlib's dummy (`rigctld -m 1`), or a receiver
that answers at once.  `off` is from the range rate at the moment of the reading.  The key is taken
down by `antenna_status`.  Printed is the time until the order is at the transmitter's rigctld, which
takes at most one tuning (41 ms) and 50 ms of its own for it, until that says so, and until a key that
is pressed at once is refused.
"""

import argparse
import json
import math
import os
import random
import socket
import socketserver
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from real_station import ROOT, of_tests
from rf_pointing_msgs.msg import AntennaStatus, Target, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.core import JointReading
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ros import convert
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station

EXAMPLE, NAMESPACE = ROOT / "examples" / "transponder_radio.yaml", "/radio"
DOWN_HZ, SPEED_M_S, HEIGHT_M = 1e9, 7500.0, 500e3
STEP_HZ, KEY_S, BRING_UP_S = 10.0, 0.1, 25.0


class AtOnce(socketserver.StreamRequestHandler):
    """A receiver that takes any frequency and answers at once."""

    hertz = b"145000000"

    def handle(self) -> None:
        with suppress(ConnectionError):
            for line in self.rfile:
                letter, _, rest = line.strip().lstrip(b"+").partition(b" ")
                name = {b"F": b"set_freq", b"f": b"get_freq"}.get(letter, b"set_ptt")
                type(self).hertz = rest if letter == b"F" else self.hertz
                value = b"Frequency: " + self.hertz + b"\n" if letter == b"f" else b""
                said = name + b": " + rest + b"\n" + value + b"RPRT 0\n"
                self.wfile.write(said if line.startswith(b"+") else self.hertz + b"\n")


class Relay(socketserver.BaseRequestHandler):
    """Passes on what goes to and from a rigctld, and notes when an order to unkey comes."""

    port = 0
    unkeyed_s = math.inf

    def handle(self) -> None:
        with socket.create_connection(("127.0.0.1", self.port)) as rig, suppress(OSError):
            rig.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._back, args=(rig,), daemon=True).start()
            while data := self.request.recv(4096):
                if b"T 0" in data:
                    type(self).unkeyed_s = min(self.unkeyed_s, time.monotonic())
                rig.sendall(data)

    def _back(self, rig: socket.socket) -> None:
        with suppress(OSError):
            while data := rig.recv(4096):
                self.request.sendall(data)


class Bench:
    """The node, its topics and rigs."""

    def __init__(self, ends: ExitStack, folder: Path, receive_port: int, transmit_port: int) -> None:
        station, file = folder / "radio.yaml", folder / "run.json"
        ports = {"radio.receive.port": receive_port, "radio.transmit.port": transmit_port}
        read_station(EXAMPLE).write(station, ports)
        station.write_text(station.read_text().replace("435.64", f"{1e-6 * DOWN_HZ}"))
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        given = {"station": str(station), "server.port": self.port}
        file.write_text(json.dumps({"/**/radio_control": {"ros__parameters": given}}))
        self.begun_s, self.inhibit, self.given_s = time.time() + BRING_UP_S, "", 0.0
        self.values, self.words = dict[str, str](), ""
        self.node = rclpy.create_node("station", namespace=NAMESPACE)
        ends.callback(self.node.destroy_node)
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        kinds: list[tuple[Any, str, Any]] = [
            (Target, "target", STREAM), (JointState, "joint_states", STREAM),
            (AntennaStatus, "antenna_status", STATUS), (TrackingStatus, "tracking_status", STREAM),
        ]  # fmt: skip
        self.topics = {topic: self.node.create_publisher(kind, topic, qos) for kind, topic, qos in kinds}
        processes = NodeProcesses(NAMESPACE, [file], folder / "logs")
        ends.callback(processes.stop)
        processes.start(["radio_control"], simulated_time=False, autostart=True)
        self.until(lambda: self.words.startswith("follows"), 60.0)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("radio_control: receiver"):
                self.words, self.values = status.message, {each.key: each.value for each in status.values}

    def rate_m_s(self, t_s: float) -> float:
        """Return the range rate of a flight overhead, in 1 s more of which it is closest."""
        along_m = SPEED_M_S * (t_s - self.begun_s)
        return SPEED_M_S * along_m / math.hypot(along_m, HEIGHT_M)

    def give(self) -> None:
        t_s = time.time()
        self.given_s, stamp = t_s, stamp_from_seconds(t_s)
        ahead_s = round(t_s, 1) + 2.0
        one = targets.target(ahead_s, "RS-44", self.rate_m_s(ahead_s))
        reading = JointReading(t_s=t_s, position_rad=np.array([4.0, 0.9]), velocity_rad_s=np.zeros(2))
        antenna = AntennaStatus(mode="tracking", transmit_inhibit=self.inhibit)
        tracking = TrackingStatus(mode="program_track", target="RS-44", beamwidth=0.5)
        antenna.header.stamp = tracking.header.stamp = stamp
        given = (convert.target_to_message(one), convert.joints_to_message(reading), antenna, tracking)
        for publisher, message in zip(self.topics.values(), given, strict=True):
            publisher.publish(message)

    def until(self, condition: Callable[[], bool], patience_s: float) -> float:
        """Return how long a condition takes, infinity beyond the patience."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                return math.inf
            if time.time() - self.given_s >= 0.1:
                self.give()
            self.executor.spin_once(timeout_sec=0.002)
        return time.monotonic() - begun_s

    def ask(self, line: str) -> str:
        """Send a line as a program that asks, and return the answer."""
        found: list[str] = []
        thread = threading.Thread(target=lambda: found.append(answer(self.port, line)))
        thread.start()
        self.until(lambda: not thread.is_alive(), 5.0)
        return found[0]


def answer(port: int, line: str) -> str:
    with socket.create_connection(("127.0.0.1", port), 2.0) as client:
        client.sendall(f"{line}\n".encode())
        return client.recv(200).decode().strip()


def steps(bench: Bench, port: int, seconds: float, name: str) -> float:
    """Print and return the largest step in Hz while the satellite is closest."""
    off_hz, largest, due_s = list[float](), 0.0, bench.begun_s - 0.5 * seconds
    while time.time() < bench.begun_s + 0.5 * seconds:
        bench.until(lambda: time.time() > due_s, 60.0)  # noqa: B023
        due_s += 0.25
        hertz, now_s = float(answer(port, "f")), time.time()
        off_hz.append(abs(hertz - DOWN_HZ * (1.0 - bench.rate_m_s(now_s) / SPEED_OF_LIGHT_M_S)))
        largest = float(bench.values.get("largest_step_hz", "inf"))
    print(f"{name}: {bench.values.get('answer_ms')} ms for an answer, steps of at most {largest:.1f} Hz, off by "
          f"{np.median(off_hz):.1f} Hz (median), at most {max(off_hz):.1f} Hz; {bench.words}", flush=True)  # fmt: skip
    return largest


def keys(bench: Bench, rig: Any, count: int) -> tuple[float, int]:
    """Return the longest time in s until a key is refused, and how often one was not."""
    took, ordered, refused, taken = list[float](), list[float](), list[float](), 0
    for _ in range(count):
        bench.inhibit = ""
        bench.until(lambda: bench.ask("T 1") == "RPRT 0", 5.0)
        bench.until(lambda: rig.ask("t") == "1", 2.0)
        bench.until(lambda: False, random.uniform(0.0, 0.1))
        bench.inhibit, Relay.unkeyed_s, begun_s = "the antenna is stopping", math.inf, time.monotonic()
        bench.give()
        bench.until(lambda: Relay.unkeyed_s < math.inf, 2.0)
        taken += bench.ask("T 1") != "RPRT -9"
        refused.append(time.monotonic() - begun_s)
        bench.until(lambda: rig.ask("t") == "0", 2.0)
        took.append(time.monotonic() - begun_s)
        ordered.append(Relay.unkeyed_s - begun_s)
    for words, each in (("key refused", refused), ("unkeyed", ordered), ("the rig says so", took)):
        print(f"{words} {1e3 * np.median(each):.0f} ms (median), at most {1e3 * max(each):.0f} ms after the message")
    print(f"{count} times; {taken} keys taken", flush=True)
    return max(refused + ordered), taken


targets = of_tests("station/radio/targets.py")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--keys", type=int, default=40)
    options = parser.parse_args()
    os.environ |= {"ROS_DOMAIN_ID": str(random.randrange(1, 100)), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    rclpy.init()
    rigs = of_tests("drives/rotctld.py").RealRigctld
    transmitter, receiver = rigs(), rigs()
    at_once = socketserver.ThreadingTCPServer(("127.0.0.1", 0), AtOnce)
    at_once.daemon_threads = True
    threading.Thread(target=at_once.serve_forever, daemon=True).start()
    quick_port, Relay.port = int(at_once.server_address[1]), transmitter.port
    relay = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Relay)
    relay.daemon_threads = True
    threading.Thread(target=relay.serve_forever, daemon=True).start()
    good = True
    for name, port in (("a receiver that answers at once", quick_port), ("rigctld -m 1", receiver.port)):
        with ExitStack() as ends, tempfile.TemporaryDirectory() as folder:
            bench = Bench(ends, Path(folder), port, int(relay.server_address[1]))
            largest_hz = steps(bench, port, options.seconds, name)
            good &= largest_hz <= STEP_HZ or port == receiver.port
            if port == quick_port:
                longest_s, taken = keys(bench, transmitter, options.keys)
                good &= longest_s <= KEY_S and not taken
    for each in (transmitter, receiver):
        each.kill()
    rclpy.try_shutdown()
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
