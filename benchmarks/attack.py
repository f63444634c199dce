"""Attack a station on a drive that is not simulated, in wall time, and print a verdict for each attack.

    scripts/run-python benchmarks/attack.py                      every scenario
    scripts/run-python benchmarks/attack.py web_page bare_client --json verdicts.json

The drive is Debian's `rotctld -m 1` (libhamlib-utils); the nodes are those of a station with a page and a server of
rotctld's clients, and a satellite passes over it.  A scenario is one function of a running `Station` behind
`@scenario(bound)`: it returns what it has measured, a number that must not exceed its bound, and what that number is.
Exits with 1 when one fails, or cannot be tried.
"""

import argparse
import importlib.util
import json
import math
import os
import random
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
import requests
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import AntennaStatus, TrackingStatus
from rf_pointing_msgs.srv import SignedCall
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.ephemeris.source import read_source
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import SIGNED, Caller
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.description import read_station


def of_tests(file: str) -> Any:
    """Return a module of the tests by its file."""
    # `test` is a package of Python's own, too.
    path = Path(__file__).parents[1] / "test" / file
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


live, rotctld = of_tests("graph/real_station.py"), of_tests("drives/rotctld.py")
NODES = ("antenna_servo", "ephemeris_publisher", "pointing_controller", "rotctld_server", "operator_page")
CULMINATES_S = 200.0
"""After the start; the satellite is above 5 deg from 4 min before until 4 min after."""
TOKEN = "the-token-of-the-attacks"
PATIENCE_S = 60.0
PAGE = "http://127.0.0.1"


class Measured(NamedTuple):
    """Outcome of a scenario: what is held against its bound, in words, and what else was seen."""

    value: float
    unit: str
    words: str = ""


@dataclass
class Verdict:
    """One row of the table."""

    scenario: str
    good: bool
    measured: float
    bound: float
    unit: str
    words: str


SCENARIOS: dict[str, tuple[float, Callable[["Station"], Measured]]] = {}


def scenario(bound: float) -> Callable[[Callable[["Station"], Measured]], Callable[["Station"], Measured]]:
    """Add a function to the scenarios: what it measures must be at most `bound`."""

    def add(function: Callable[["Station"], Measured]) -> Callable[["Station"], Measured]:
        SCENARIOS[function.__name__] = bound, function
        return function

    return add


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Station:
    """Live nodes on rotctld, what they publish, and the ways to attack them."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.rotctld = folder, rotctld.RealRotctld()
        self.page_port, self.server_port = free_port(), free_port()
        station = live.write_station(folder, self.rotctld.port)
        self.site, begun_s = read_station(station).site, time.time()
        elements = live.write_elements(folder, self.site, begun_s + CULMINATES_S)
        self.track = TopocentricTrack(read_source(str(elements)).elements[0], self.site)
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        self.key = str(folder / "command.key")
        own: dict[str, dict[str, Any]] = {
            "antenna_servo": {"state_file": str(folder / "servo.json")},
            "ephemeris_publisher": {"source.elements": str(elements), "source.satellite": "OVERHEAD"},
            "rotctld_server": {"server.port": self.server_port},
            "operator_page": {
                "page.port": self.page_port,
                "page.token_file": str(folder / "token"),
                "page.reports": "",
            },
            "pointing_controller": {},
        }
        for name in ("antenna_servo", "pointing_controller", "rotctld_server", "operator_page"):
            own[name]["command_key_file"] = self.key
        sections = {"/**": {"ros__parameters": {"station": str(station)}}}
        sections |= {f"/**/{name}": {"ros__parameters": values} for name, values in own.items()}
        (folder / "run.yaml").write_text(json.dumps({k: v for k, v in sections.items() if k != "/**"}))
        (folder / "all.yaml").write_text(
            json.dumps({f"/**/{n}": sections["/**"] for n in NODES if n != "operator_page"})
        )
        self.namespace = f"/attack{os.getpid()}"
        self.node = rclpy.create_node("attacker", namespace=self.namespace)
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self.antenna, self.tracking, self.tracking_s = AntennaStatus(), TrackingStatus(), -math.inf
        self.axes: list[tuple[float, float, float]] = []
        listen = self.node.create_subscription
        listen(AntennaStatus, "antenna_status", lambda m: setattr(self, "antenna", m), STATUS)
        listen(TrackingStatus, "tracking_status", self._on_tracking, STREAM)
        listen(JointState, "joint_states", self._on_joints, STREAM)
        self.processes = NodeProcesses(self.namespace, [folder / "all.yaml", folder / "run.yaml"], folder / "logs")
        self.processes.start(NODES, simulated_time=False, autostart=True)
        self.until(lambda: self.antenna.mode and self.tracking.sequence > 0, "the station")
        self.until(lambda: self._listens(self.page_port) and self._listens(self.server_port), "its ports")

    def _on_tracking(self, message: TrackingStatus) -> None:
        self.tracking, self.tracking_s = message, time.monotonic()

    def _on_joints(self, message: JointState) -> None:
        self.axes.append((seconds_from_stamp(message.header.stamp), *map(math.degrees, message.position)))

    @staticmethod
    def _listens(port: int) -> bool:
        with socket.socket() as client:
            return client.connect_ex(("127.0.0.1", port)) == 0

    def close(self) -> None:
        self.processes.stop()
        self.executor.shutdown()
        self.node.destroy_node()
        self.rotctld.kill()

    # What scenarios use

    def spin(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> float:
        """Wait for a condition; return how long, TimeoutError after `patience_s`."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                raise TimeoutError(f"waited {patience_s:.0f} s for {what}")
            self.executor.spin_once(timeout_sec=0.01)
        return time.monotonic() - begun_s

    def at_rest(self) -> None:
        """Bring the station to where every scenario begins: no fault, no pass, holding."""
        if self.antenna.fault:
            self.call("antenna_servo/reset_fault")
        if self.tracking.target:
            self.call("pointing_controller/stop")
        self.until(lambda: not self.tracking.target and self.antenna.mode != "tracking", "the end of a pass")
        if self.antenna.mode != "holding":
            self.call("antenna_servo/resume")
        self.until(lambda: self.antenna.mode == "holding" and not self.antenna.fault, "an antenna at rest")
        self.spin(1.0)

    def call(self, name: str) -> Trigger.Response:
        client = self.node.create_client(Trigger, name)
        self.until(client.service_is_ready, name)
        future = client.call_async(Trigger.Request())
        self.until(future.done, f"an answer of {name}")
        self.node.destroy_client(client)
        return future.result()

    def kill(self, name: str) -> None:
        """Kill a node, as a crash would, and start it again."""
        process = self.processes.process_id(name)
        os.kill(process, signal.SIGKILL)
        self.until(lambda: name in self.processes.ended(), f"the end of {name}")
        self.processes.start([name], simulated_time=False, autostart=True)

    def direction_deg(self) -> tuple[float, float]:
        look = self.track.target_at(time.time())
        return math.degrees(look.azimuth_rad) % 360.0, math.degrees(look.elevation_rad)

    def off_deg(self) -> float:
        """Return how far the axes are from the satellite."""
        here, there = map(math.radians, self.axes[-1][1:]), map(math.radians, self.direction_deg())
        return math.degrees(angular_distance_rad(*here, *there))

    def answer(self, client: socket.socket, line: str) -> str:
        """Send a line of rotctld's protocol, and return the answer to it."""
        client.sendall(f"{line}\n".encode())
        found = b""
        client.setblocking(False)

        def complete() -> bool:
            nonlocal found
            try:
                found += client.recv(1000)
            except BlockingIOError:
                return False
            return found.endswith(b"\n")

        self.until(complete, f"an answer to {line}", 10.0)
        client.setblocking(True)
        return found.decode().strip()

    def ports(self) -> list[int]:
        """Return the TCP ports on which the nodes listen."""
        inodes = set()
        for name in NODES:
            for link in Path(f"/proc/{self.processes.process_id(name)}/fd").iterdir():
                if (target := os.readlink(link)).startswith("socket:["):
                    inodes.add(target[8:-1])
        rows = [
            row.split() for each in ("tcp", "tcp6") for row in Path(f"/proc/net/{each}").read_text().splitlines()[1:]
        ]
        return sorted({int(row[1].rpartition(":")[2], 16) for row in rows if row[3] == "0A" and row[9] in inodes})

    def post(self, body: str | bytes, **headers: str) -> int:
        given = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json", **headers}
        return requests.post(f"{PAGE}:{self.page_port}/command", data=body, headers=given, timeout=10.0).status_code


@scenario(bound=0.05)
def web_page(station: Station) -> Measured:
    """Let a page of another site send orders in the bodies of requests to every port of the station."""
    station.at_rest()
    begin, ports = station.axes[-1], station.ports()
    for port in ports:
        for body in ("P 200 40\n", "S\nK\n", '{"name": "park", "arguments": {}}'):
            head = (
                f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: keep-alive\r\nContent-Length: {len(body)}\r\n"
                "Content-Type: text/plain;charset=UTF-8\r\nOrigin: http://evil.example\r\nAccept: */*\r\n\r\n"
            )
            with socket.create_connection(("127.0.0.1", port), 5.0) as page:
                page.sendall((head + body).encode())
                station.spin(0.3)
    station.spin(4.0)
    moved = max(abs(now - then) for now, then in zip(station.axes[-1][1:], begin[1:], strict=True))
    if station.antenna.mode != "holding":
        return Measured(math.inf, "deg moved", f"the antenna is {station.antenna.mode}")
    return Measured(moved, "deg moved", f"ports {', '.join(map(str, ports))}")


@scenario(bound=3.0)
def controller_killed_under_a_client(station: Station) -> Measured:
    """Kill the controller in a client's pass: how long are points accepted that nothing follows?"""
    station.at_rest()
    lies_s, lied_s, killed_s, back_s = 0.0, 0.0, math.inf, math.inf
    with socket.create_connection(("127.0.0.1", station.server_port), 5.0) as client:
        begun_s = last_s = time.monotonic()
        while time.monotonic() < begun_s + 150.0 and not (time.monotonic() > killed_s + 20.0 and math.isfinite(back_s)):
            azimuth, elevation = station.direction_deg()
            accepted = station.answer(client, f"P {azimuth:.2f} {max(elevation, 0.0):.2f}") == "RPRT 0"
            before = station.off_deg()
            station.spin(0.5)
            now_s, follows = time.monotonic(), station.off_deg() < max(1.0, before - 0.2)
            lied_s = 0.0 if follows or not accepted else lied_s + now_s - last_s
            lies_s, last_s = max(lies_s, lied_s), now_s
            tracked = station.tracking.target == "OVERHEAD" and now_s - station.tracking_s < 1.0
            if killed_s == math.inf and tracked and station.tracking.on_source:
                station.kill("pointing_controller")
                killed_s = time.monotonic()
            elif now_s > killed_s + 1.0 and tracked and station.tracking.on_source:
                back_s = min(back_s, now_s - killed_s)
        stopped = station.answer(client, "S")
    if killed_s == math.inf:
        raise TimeoutError(f"no pass of the points: {station.processes.complaint('rotctld_server')}")
    station.until(lambda: station.antenna.mode == "holding", "the end after S", 20.0)
    return Measured(lies_s, "s of RPRT 0 unfollowed", f"tracked again after {back_s:.1f} s; S: {stopped}")


@scenario(bound=3.0)
def bare_client(station: Station) -> Measured:
    """Kill the controller in the pass of a client that only waits for its result."""
    station.at_rest()
    client = ActionClient(station.node, TrackPass, "track_pass")
    station.until(client.server_is_ready, "track_pass")
    sent = client.send_goal_async(TrackPass.Goal(satellite="OVERHEAD", sensor="program"))
    station.until(sent.done, "the accepted goal")
    result = sent.result().get_result_async()
    station.until(lambda: station.tracking.target == "OVERHEAD" or result.done(), "the pass")
    if result.done():
        raise TimeoutError(f"no pass: {result.result().result.message}")
    station.spin(2.0)
    killed_s = time.monotonic()
    station.kill("pointing_controller")
    station.spin(0.5)
    station.tracking_s = -math.inf
    station.until(lambda: station.tracking_s > 0.0, "the controller again")
    back_s = time.monotonic()
    station.until(result.done, "the result", 30.0)
    found = result.result()
    words = f"{time.monotonic() - killed_s:.1f} s after the kill: status {found.status}, {found.result.message!r}"
    return Measured(time.monotonic() - back_s if found.status == 6 else math.inf, "s after it is back", words)


def flood(station: Station, calls: int, callers: int, depth: int = 10) -> tuple[int, float, float]:
    """Call `park` so often; return the answers, the time of the last, and that of a stop behind them, in s."""
    station.at_rest()
    qos = QoSProfile(depth=depth)
    clients = [station.node.create_client(Trigger, "antenna_servo/park", qos_profile=qos) for _ in range(callers)]
    stop = station.node.create_client(Trigger, "antenna_servo/stop")
    station.until(lambda: all(each.service_is_ready() for each in [*clients, stop]), "the services")
    station.spin(2.0)
    begun_s = time.monotonic()
    futures = [clients[index % callers].call_async(Trigger.Request()) for index in range(calls)]
    stopped, stopped_s, count, last_s = stop.call_async(Trigger.Request()), math.inf, 0, math.inf
    while time.monotonic() < begun_s + 30.0 and not (count == calls and math.isfinite(stopped_s)):
        station.executor.spin_once(timeout_sec=0.01)
        now_s, done = time.monotonic() - begun_s, sum(each.done() for each in futures)
        stopped_s = min(stopped_s, now_s) if stopped.done() else stopped_s
        count, last_s = (done, now_s) if done > count else (count, last_s)
    for each in [*clients, stop]:
        station.node.destroy_client(each)
    return count, last_s, stopped_s


@scenario(bound=0)
def calls_of_one_client(station: Station) -> Measured:
    """Make 200 calls at once, as one client."""
    count, last_s, _ = flood(station, 200, 1)
    return Measured(200 - count, "calls not answered", f"the last answer after {last_s:.2f} s")


@scenario(bound=0)
def calls_of_many_clients(station: Station) -> Measured:
    """Make 200 calls at once, as 200 clients that have just started."""
    count, last_s, _ = flood(station, 200, 200)
    return Measured(200 - count, "calls not answered", f"the last answer after {last_s:.2f} s")


@scenario(bound=200.0)
def stop_behind_a_flood(station: Station) -> Measured:
    """Stop the antenna behind 1000 calls."""
    count, last_s, stopped_s = flood(station, 1000, 1)
    return Measured(1e3 * stopped_s, "ms until stop is answered", f"{count} of 1000 calls answered in {last_s:.1f} s")


@scenario(bound=0)
def replayed_call(station: Station) -> Measured:
    """Send a signed call again after a restart of the servo, from a clock that is 8 s ahead."""
    station.at_rest()
    key = CommandKey(CommandKeyParams(command_key_file=station.key))
    call = Caller(station.node, key).request("antenna_servo/park", Trigger.Request())
    call.stamp = stamp_from_seconds(time.time() + 8.0)
    call.signature = key._call_signature(call)
    answers = []
    for again in (False, True):
        if again:
            station.antenna = AntennaStatus()
            station.kill("antenna_servo")
            station.until(lambda: station.antenna.mode, "the servo again")
        client = station.node.create_client(SignedCall, SIGNED)
        station.until(client.service_is_ready, SIGNED)
        future = client.call_async(call)
        station.until(future.done, "an answer")
        answers.append(future.result())
        station.node.destroy_client(client)
    if not answers[0].success:
        raise TimeoutError(f"the first call was refused: {answers[0].message}")
    return Measured(float(answers[1].success), "replays accepted", answers[1].message)


@scenario(bound=2.0)
def half_open_requests(station: Station) -> Measured:
    """Open 1200 requests to the page and never end them: how long does another one take?"""
    process, opened = station.processes.process_id("operator_page"), []
    before = len(list(Path(f"/proc/{process}/fd").iterdir()))
    for _ in range(1200):
        one = socket.create_connection(("127.0.0.1", station.page_port), 5.0)
        one.sendall(b"POST /command HTTP/1.1\r\nHost: local")
        opened.append(one)
    begun_s = time.monotonic()
    status = requests.get(f"{PAGE}:{station.page_port}/", timeout=10.0).status_code
    took_s = time.monotonic() - begun_s
    files = len(list(Path(f"/proc/{process}/fd").iterdir())) - before
    for one in opened:
        one.close()
    good = status == 200 and files <= 210
    return Measured(took_s if good else math.inf, "s until the page is served", f"{files} connections of 1200")


@scenario(bound=0)
def texts_of_the_page(station: Station) -> Measured:
    """Send the page what no log, message or number can hold, with the token."""
    process, wrong = station.processes.process_id("operator_page"), []
    for body in (
        '{"name": "\\ud800"}', '{"name": "night_skip", "arguments": {"name": "\\udfff"}}', '{"name": "a\\nb\\u0000"}',
        *(f'{{"name": "set_along_track", "arguments": {{"value": {text}}}}}' for text in (f"1{400 * '0'}", "1e400", "-1e300")),
    ):  # fmt: skip
        wrong += [body] if station.post(body) >= 500 else []
    wrong += ["charset"] if station.post("{}", **{"Content-Type": "application/json; charset=bogus"}) >= 500 else []
    station.spin(1.0)
    ended = station.processes.ended()
    dead = "operator_page" in ended or station.processes.process_id("operator_page") != process
    return Measured(len(wrong) + dead, "texts that did harm", f"the node has ended {ended}" if dead else "")


def main() -> int:
    """Run the scenarios and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=f"default: all of {', '.join(SCENARIOS)}")
    parser.add_argument("--json", type=Path, help="write the verdicts to a file")
    options = parser.parse_args()
    if unknown := [name for name in options.scenarios if name not in SCENARIOS]:
        parser.error(f"{unknown[0]} must be one of {', '.join(SCENARIOS)}")
    os.environ["ROS_DOMAIN_ID"] = str(random.randrange(1, 100))
    rclpy.init()
    verdicts = []
    with tempfile.TemporaryDirectory(prefix="attack") as folder:
        station = Station(Path(folder))
        try:
            for name in options.scenarios or SCENARIOS:
                bound, function = SCENARIOS[name]
                try:
                    found = function(station)
                except (TimeoutError, OSError) as error:
                    found = Measured(math.inf, "not tried", f"{type(error).__name__}: {error}")
                good = found.value <= bound
                verdicts.append(Verdict(name, good, found.value, bound, found.unit, found.words))
                load = f"load {os.getloadavg()[0]:.0f}"
                print(f"{'ok' if good else 'FAILS':<6}{name:<34}{found.value:>9.3g} <= {bound:<7g}{found.unit}; "
                      f"{found.words}; {load}", flush=True)  # fmt: skip
        finally:
            station.close()
            rclpy.try_shutdown()
    if options.json:
        options.json.write_text(json.dumps([asdict(each) for each in verdicts], indent=1))
    return int(not all(each.good for each in verdicts))


if __name__ == "__main__":
    sys.exit(main())
