"""Fly a pass over two computers, cut their link for five seconds, and print hop times, losses and the clock's offset.

    sudo scripts/run-python benchmarks/two_computers.py [--server] [--offset 0.05] [--seconds 20]
    sudo scripts/run-python benchmarks/two_computers.py --discovery 12 60 [--server | --peers]

The computers are two network namespaces of the kernel with a veth pair: ephemeris, controller and tracker on one,
control unit and receiver on the other.  --server: a Fast DDS discovery server on the first in place of multicast,
--peers: the address of each computer is known to the other (ROS_STATIC_PEERS); the link then carries no multicast.
--offset: the clock of the second is ahead by so many s, made by libfaketime.  --discovery: how long so many
participants need to find each other, and what that sends over the link.  Prints JSON.
"""

import argparse
import dataclasses
import json
import math
import os
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ADDRESSES = ("10.77.0.1", "10.77.0.2")
SERVER_PORT = 11811
FAKETIME = next((str(each) for each in Path("/usr/lib").glob("*/faketime/libfaketime.so.1")), "")
NAMESPACE = "/gs1"
SIDES = (
    ("ephemeris_publisher", "pointing_controller", "conscan_tracker", "bias_calibrator"),
    ("antenna_servo", "rf_receiver"),
)
CUT_S = 5.0
EARTH_RAD_S = 7.292115e-5
RISES_IN_S = 25.0
PATIENCE_S = 120.0
TOPICS = 8


class Computers:
    """Two network namespaces that reach each other over a veth pair, and what runs in them."""

    def __init__(self, environment: dict[str, str], folder: Path) -> None:
        self.names = [f"rfp{os.getpid()}{side}" for side in "ab"]
        self._environment, self._folder, self._running = environment, folder, list[subprocess.Popen[bytes]]()

    def connect(self) -> None:
        """CalledProcessError where the kernel or the user's rights do not allow it."""
        first, second = self.names
        for name in self.names:
            ip("netns", "add", name)
        ip("link", "add", "rfp0", "netns", first, "type", "veth", "peer", "name", "rfp0", "netns", second)
        for name, address in zip(self.names, ADDRESSES, strict=True):
            ip("-n", name, "addr", "add", f"{address}/24", "dev", "rfp0")
            for link in ("lo", "rfp0"):
                ip("-n", name, "link", "set", link, "up")
            ip("-n", name, "route", "add", "default", "dev", "rfp0")

    def start(self, side: int, command: Sequence[str], log: str, **environment: str) -> "subprocess.Popen[bytes]":
        with (self._folder / f"{log}.log").open("wb") as file:
            process = subprocess.Popen(
                ["ip", "netns", "exec", self.names[side], *command],
                env=os.environ | self._environment | environment,
                stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
            )  # fmt: skip
        self._running.append(process)
        return process

    def close(self) -> None:
        for sign in (signal.SIGINT, signal.SIGKILL):
            for process in self._running:
                process.send_signal(sign)
            for process in self._running:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(10.0)
        for name in self.names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


def why_not() -> str:
    """Return "" or why there can be no two computers here."""
    trial = Computers({}, Path())
    try:
        trial.connect()
    except FileNotFoundError:
        return "no ip: install iproute2"
    except subprocess.CalledProcessError as error:
        return f"no network namespaces here: {error.stderr.strip()}"
    finally:
        with suppress(FileNotFoundError):
            trial.close()
    return ""


@contextmanager
def computers(folder: Path, *, server: bool, peers: bool = False) -> Iterator[Computers]:
    """Two connected computers; their nodes find each other by multicast, by addresses, or at a server on the first."""
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    if server:
        environment["ROS_DISCOVERY_SERVER"] = f"{ADDRESSES[0]}:{SERVER_PORT}"
    if peers:
        environment |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": ";".join(ADDRESSES)}
    both = Computers(environment, folder)
    # Neither the loopback profile of this computer nor its range is for two.
    os.environ.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
    try:
        both.connect()
        for name in both.names if server or peers else ():
            ip("-n", name, "link", "set", "rfp0", "multicast", "off")
        if server:
            program = Path(sys.prefix) / "bin" / "fast-discovery-server"
            both.start(0, [str(program), "-i", "0", "-l", ADDRESSES[0], "-p", str(SERVER_PORT)], "server")
        yield both
    finally:
        both.close()


def write_elements(path: Path, station: str) -> None:
    """Write the TLE of a satellite that rises at the station in RISES_IN_S."""
    from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, tle_lines, verification_elements
    from rf_pointing.station.description import read_station

    now_s = time.time()
    found = dataclasses.replace(find_elements(verification_elements(), "28057"), epoch_t_s=now_s)
    windows = find_passes(TopocentricTrack(found, read_station(station).site), now_s, 86400.0, math.radians(5.0))
    window = max(windows, key=lambda each: each.peak_elevation_rad if each.peak_elevation_rad < 1.3 else 0.0)
    earlier_s = window.aos_t_s - (now_s + RISES_IN_S)
    # The same motion over the turning Earth, so much earlier.
    node_rad = (found.ascending_node_rad - EARTH_RAD_S * earlier_s) % (2.0 * math.pi)
    epoch_s = found.epoch_t_s - earlier_s
    mine = dataclasses.replace(
        found, name="FLYER", catalogue_number=90001, epoch_t_s=epoch_s, ascending_node_rad=node_rad
    )
    path.write_text("\n".join((mine.name, *tle_lines(mine))) + "\n")


def fly(*, server: bool = False, offset_s: float = 0.0, seconds: float = 20.0) -> dict[str, Any]:
    """Fly and return what was measured."""
    from ament_index_python.packages import get_package_prefix

    nodes = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing"
    with TemporaryDirectory() as name, computers(Path(name), server=server) as both:
        folder = Path(name)
        elements, station = folder / "flyer.tle", "leo_3m7"
        arguments = [
            "--ros-args",
            "-r",
            f"__ns:={NAMESPACE}",
            "-p",
            "lifecycle.autostart:=true",
            "-p",
            f"station:={station}",
        ]
        source = ["-p", f"source.elements:={elements}", "-p", "source.satellite:=FLYER"]
        key = ["-p", f"command_key_file:={folder / 'command.key'}"]
        fake = {"LD_PRELOAD": FAKETIME, "FAKETIME": f"{offset_s:+.3f}s", "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        ahead = fake if offset_s else {}
        write_elements(elements, station)
        for side, names in enumerate(SIDES):
            for each in names:
                given = source if each in ("ephemeris_publisher", "rf_receiver") else []
                # Both computers have a copy of the key that signs the commands.
                given = key if each in ("pointing_controller", "antenna_servo") else given
                both.start(side, [str(nodes / each), *arguments, *given], each, **(ahead if side else {}))
        both.start(1, [sys.executable, __file__, "--echo"], "echo")
        report = folder / "report.json"
        words = [sys.executable, __file__, "--observe", both.names[1], str(report), str(seconds)]
        observer = both.start(0, words, "observer", ROS_SUPER_CLIENT="TRUE")
        observer.wait(PATIENCE_S + 2.0 * seconds + 60.0)
        if not report.is_file():
            logs = [f"{path.stem}: {path.read_text(errors='replace')[-600:]}" for path in sorted(folder.glob("*.log"))]
            raise RuntimeError("\n".join(logs))
        found: dict[str, Any] = json.loads(report.read_text())
        return {"server": server, "offset_s": offset_s, **found}


class Observer:
    """A client on the first computer: sends the goal, cuts the link, measures."""

    def __init__(self) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.action import ActionClient
        from rf_pointing_msgs.action import TrackPass
        from rf_pointing_msgs.msg import AntennaStatus, TrackingStatus
        from sensor_msgs.msg import JointState

        from rf_pointing.ros.main_loop import make_executor
        from rf_pointing.ros.qos import STATUS, STREAM

        rclpy.init()
        self.node = rclpy.create_node("observer", namespace=NAMESPACE)
        self._executor = make_executor()
        self._executor.add_node(self.node)
        self.tracking, self.antenna, self.antenna_s = TrackingStatus(), AntennaStatus(), 0.0
        self.hops_s, self.sent, self.lost, self.clocks = list[float](), 0, dict[str, int](), (0, "")
        make = self.node.create_subscription
        make(TrackingStatus, "tracking_status", lambda m: setattr(self, "tracking", m), STREAM)
        make(AntennaStatus, "antenna_status", self._on_antenna, STATUS)
        make(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        make(JointState, "hop/back", self._on_hop, STREAM)
        self._out, self._message = self.node.create_publisher(JointState, "hop/out", STREAM), JointState()
        self.client = ActionClient(self.node, TrackPass, "track_pass")
        self.goal = TrackPass.Goal(satellite="FLYER")

    def _on_antenna(self, message: Any) -> None:
        self.antenna, self.antenna_s = message, time.monotonic()

    def _on_hop(self, message: Any) -> None:
        self.hops_s.append(0.5 * (time.monotonic() - message.position[0]))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name.endswith("pointing_controller: clocks"):
                self.clocks = int.from_bytes(status.level, "little"), status.message
            if status.name.endswith(": inputs"):
                self.lost[status.name] = sum(int(pair.value) for pair in status.values if pair.key.startswith("lost "))

    def ping(self) -> None:
        self.sent += 1
        self._message.position = [time.monotonic()]
        self._out.publish(self._message)

    def until(self, condition: Any, what: str, patience_s: float = PATIENCE_S) -> float:
        """Wait for a condition; return the seconds that it took."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                state = self.tracking
                raise TimeoutError(f"{what} not within {patience_s:.0f} s: {state.mode}, {state.reason}, {state.alarm}")
            self._executor.spin_once(timeout_sec=0.02)
        return time.monotonic() - begun_s

    def held_for(self, seconds: float) -> Any:
        begun = [time.monotonic()]

        def held() -> bool:
            if not self.tracking.held:
                begun[0] = time.monotonic()
            return time.monotonic() - begun[0] >= seconds

        return held

    def fly(self, other: str, seconds: float) -> dict[str, Any]:
        from rf_pointing.ros.stamps import seconds_from_stamp

        found_s = self.until(lambda: self.client.server_is_ready() and self.antenna_s > 0.0, "the station")
        sent = self.client.send_goal_async(self.goal)
        self.until(sent.done, "an answer")
        ended = sent.result().get_result_async()
        self.until(lambda: ended.done() or (self.held_for(0.0)() and self.tracking.held), "a held target")
        if ended.done():
            raise RuntimeError(ended.result().result.message)
        self.until(self.held_for(5.0), "a target held for 5 s")
        end_s, next_s = time.monotonic() + seconds, time.monotonic()
        while time.monotonic() < end_s:
            if time.monotonic() >= next_s:
                next_s += 0.02
                self.ping()
            self._executor.spin_once(timeout_sec=0.002)
        hops_ms, lost, clocks = sorted(1e3 * each for each in self.hops_s), sum(self.lost.values()), self.clocks
        before_s, lost_before_s = self.tracking.seconds_tracked, self.tracking.seconds_lost
        ip("-n", other, "link", "set", "rfp0", "down")
        cut_s = time.monotonic()
        self.until(lambda: time.monotonic() - cut_s > CUT_S, "the cut")
        silent_s = time.monotonic() - self.antenna_s
        ip("-n", other, "link", "set", "rfp0", "up")
        joined_s = time.monotonic()
        back_s = self.until(lambda: self.antenna_s > joined_s, "the antenna")
        self.until(lambda: self.tracking.held and self.tracking.seconds_tracked > before_s, "a held target")
        held_s = time.monotonic() - joined_s
        self.until(self.held_for(10.0), "a target held for 10 s")
        state = self.tracking
        result = {
            "found_after_s": found_s, "hops": len(hops_ms), "hops_sent": self.sent,
            "hop_median_ms": statistics.median(hops_ms), "hop_p99_ms": hops_ms[int(0.99 * len(hops_ms))],
            "lost_before_cut": lost, "clocks_level": clocks[0], "clocks": clocks[1],
            "silent_s": silent_s, "antenna_back_s": back_s, "held_again_s": held_s,
            "seconds_lost_by_cut": state.seconds_lost - lost_before_s, "fault": self.antenna.fault,
            "mode": state.mode, "lost_after_cut": sum(self.lost.values()),
            "to_los_s": seconds_from_stamp(state.los) - seconds_from_stamp(state.header.stamp),
        }  # fmt: skip
        sent.result().cancel_goal_async()
        self.until(ended.done, "the end of the pass")
        return result | {"end": ended.result().result.message}


def echo() -> None:
    """Send back on the second computer what comes from the first."""
    import rclpy
    from sensor_msgs.msg import JointState

    from rf_pointing.ros.main_loop import make_executor
    from rf_pointing.ros.qos import STREAM

    rclpy.init()
    node = rclpy.create_node("echo", namespace=NAMESPACE)
    back = node.create_publisher(JointState, "hop/back", STREAM)
    node.create_subscription(JointState, "hop/out", back.publish, STREAM)
    executor = make_executor()
    executor.add_node(node)
    with suppress(KeyboardInterrupt):
        while True:
            executor.spin_once(timeout_sec=0.2)


def discover(count: int, *, server: bool, peers: bool) -> dict[str, Any]:
    """Return how long `count` participants, half on each computer, need until each has found its partners."""
    with TemporaryDirectory() as name, computers(Path(name), server=server, peers=peers) as both:
        folder, half = Path(name), count // 2
        reports = [folder / f"{side}.json" for side in (0, 1)]
        for side in (0, 1):
            words = [sys.executable, __file__, "--participants", str(half), str(side), str(reports[side])]
            both.start(side, words, f"participants{side}")
        deadline_s = time.monotonic() + 2.0 * PATIENCE_S
        while not all(each.is_file() for each in reports):
            if time.monotonic() > deadline_s:
                raise RuntimeError("\n".join(path.read_text(errors="replace")[-600:] for path in folder.glob("*.log")))
            time.sleep(0.2)
        shown = subprocess.run(
            ["ip", "-n", both.names[0], "-s", "-j", "link", "show", "rfp0"], check=True, capture_output=True, text=True
        )
        counts = json.loads(shown.stdout)[0]["stats64"]
        found = [json.loads(each.read_text()) for each in reports]
        return {
            "participants": 2 * half, "server": server, "peers": peers, "found_after_s": max(each["found_s"] for each in found),
            "link_mb": (counts["rx"]["bytes"] + counts["tx"]["bytes"]) / 1e6,
        }  # fmt: skip


def participate(count: int, side: int, report: Path) -> None:
    """Make participants that publish and subscribe as a node of a station does, until all are matched.

    Six in a row are one antenna: each publishes TOPICS topics of its namespace and subscribes to the next one's.
    """
    import rclpy
    from rclpy.context import Context
    from std_msgs.msg import String

    begun_s, publishers, subscriptions = time.monotonic(), list[Any](), list[Any]()
    for number in range(count):
        context = Context()
        rclpy.init(context=context)
        node = rclpy.create_node(f"node{number}", namespace=f"/gs{number // 3}/side{side}", context=context)
        for topic in range(TOPICS):
            publishers.append(node.create_publisher(String, f"/gs{number // 3}/s{side}_{number}_{topic}", 10))
            other = f"/gs{number // 3}/s{1 - side}_{number}_{topic}"
            subscriptions.append(node.create_subscription(String, other, lambda _m: None, 10))
    made_s = time.monotonic()
    while any(each.get_subscription_count() < 1 for each in publishers):
        time.sleep(0.05)
    while any(each.get_publisher_count() < 1 for each in subscriptions):
        time.sleep(0.05)
    report.write_text(json.dumps({"made_s": made_s - begun_s, "found_s": time.monotonic() - begun_s}))
    # The others have to find these.
    with suppress(KeyboardInterrupt):
        time.sleep(PATIENCE_S)


def main() -> None:
    """Run one measurement, or one of its parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--server", action="store_true")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--offset", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--discovery", type=int, nargs="+", default=[])
    for part, count in (("--observe", 3), ("--participants", 3)):
        parser.add_argument(part, nargs=count, help=argparse.SUPPRESS)
    parser.add_argument("--echo", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.echo:
        echo()
    elif options.observe:
        other, report, seconds = options.observe
        Path(report).write_text(json.dumps(Observer().fly(other, float(seconds))))
    elif options.participants:
        count, side, report = options.participants
        participate(int(count), int(side), Path(report))
    elif reason := why_not():
        sys.exit(reason)
    elif options.discovery:
        for count in options.discovery:
            print(json.dumps(discover(count, server=options.server, peers=options.peers)), flush=True)
    else:
        print(json.dumps(fly(server=options.server, offset_s=options.offset, seconds=options.seconds), indent=1))


if __name__ == "__main__":
    main()
