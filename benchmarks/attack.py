"""Attack a station on a device that is not simulated, in wall time, and print a verdict for each attack.

    scripts/run-python benchmarks/attack.py                      every scenario on rotctld
    scripts/run-python benchmarks/attack.py web_page bare_client --drive pty topic --json verdicts.json

The devices are those of `real_station.py`; the nodes are those of a station with a page, an executive
and a server of rotctld's clients, and satellites pass over it.  Between the nodes and the kernel a
library loses and damages datagrams and steps the clock (`live_stalls.py`).  A scenario is one
function of a running `Attacked` behind `@scenario(bound)`: it returns what it has measured, a number
that must not exceed its bound, and what that number is.  Exits with 1 when one fails, or cannot be
tried.
"""

import argparse
import itertools
import json
import math
import os
import random
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
import requests
from ament_index_python.packages import get_package_prefix
from live_stalls import built
from rcl_interfaces.msg import Parameter, ParameterDescriptor, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from real_station import DEVICE_PRIORITY, DEVICES, PATIENCE_S, SPEED_DEG_S, Station, free_port
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus
from rf_pointing_msgs.srv import SignedCall
from std_srvs.srv import Trigger
from two_computers import computers, why_not

from rf_pointing.operations.schedule import ScheduledPass
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.convert_planning import scheduled_to_message
from rf_pointing.ros.leased_services import SIGNED, Caller
from rf_pointing.ros.main_loop import DEAF
from rf_pointing.ros.qos import STATUS
from rf_pointing.ros.stamps import stamp_from_seconds

NODES = (
    "antenna_servo", "ephemeris_publisher", "pointing_controller", "rotctld_server", "operator_page",
    "station_executive",
)  # fmt: skip
FIRST_S, EVERY_S, PASSES = 200.0, 240.0, 12
"""From the start to the first culmination, and from one to the next; each is above 5 deg for 8 min."""
TOKEN = "the-token-of-the-attacks"
PAGE = "http://127.0.0.1"
ON_SOURCE_DEG, AGAIN_S, REGAINED_S = 1.0, 2.5, 120.0
SPOIL = "strange_datagrams", "damaged_datagrams"
"""After these the attacker has left the graph."""


class Measured(NamedTuple):
    """Outcome of a scenario: what is held against its bound, in words, and what else was seen."""

    value: float
    unit: str
    words: str = ""


@dataclass
class Verdict:
    """One row of the table."""

    drive: str
    scenario: str
    good: bool
    measured: float
    bound: float
    unit: str
    words: str


SCENARIOS: dict[str, tuple[float, Callable[["Attacked"], Measured]]] = {}


def scenario(bound: float) -> Callable[[Callable[["Attacked"], Measured]], Callable[["Attacked"], Measured]]:
    """Add a function to the scenarios: what it measures must be at most `bound`."""

    def add(function: Callable[["Attacked"], Measured]) -> Callable[["Attacked"], Measured]:
        SCENARIOS[function.__name__] = bound, function
        return function

    return add


class Attacked(Station):
    """A station with everything that listens, behind a library that spoils its network and its clock."""

    def __init__(self, ends: ExitStack, folder: Path, drive: str) -> None:
        self.drive = drive
        self.page_port, self.server_port = free_port(), free_port()
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        self.disk = folder / "disk"
        self.disk.mkdir()
        # A small disk of its own for what the station writes.
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=32m", "tmpfs", str(self.disk)], check=True)
        ends.callback(subprocess.run, ["umount", "-l", str(self.disk)], check=True)
        self._spoilt = folder / "spoilt"
        self.clock_s = 0.0
        self.spoil()
        os.environ |= {"LD_PRELOAD": str(built(folder)), "DATAGRAM_LOSS": str(self._spoilt)}
        ends.callback(os.environ.pop, "LD_PRELOAD")
        page = {"page.port": self.page_port, "page.token_file": str(folder / "token"), "page.reports": ""}
        night = {"executive.folder": str(self.disk / "night"), "executive.state_file": str(self.disk / "night.json")}
        own = {
            "rotctld_server": {"server.port": self.server_port}, "operator_page": page,
            "station_executive": night | {"executive.sensor": "program"},
        }  # fmt: skip
        culminations = {f"OVERHEAD {number + 1}": FIRST_S + number * EVERY_S for number in range(PASSES)}
        own["antenna_servo"] = {"state_file": str(self.disk / "servo.json"), "wrap_file": str(self.disk / "turn.json")}
        super().__init__(ends, folder, drive, NODES, culminations, own, **{"tuning.alarms.disk_free_gb": 0.001})
        self.until(lambda: self._listens(self.page_port) and self._listens(self.server_port), "its ports")

    def spoil(
        self, *, lost: float = 0.0, damaged: float = 0.0, copied: float = 0.0, ahead_s: float | None = None
    ) -> None:
        """Lose and damage these shares of datagrams, send a stranger's copies of others, and step the clocks."""
        self.clock_s = self.clock_s if ahead_s is None else ahead_s
        with self._spoilt.open("r+b" if self._spoilt.exists() else "wb") as file:
            file.write(struct.pack("4d", lost, damaged, self.clock_s, copied))

    @property
    def overhead(self) -> str:
        """Name of the satellite that culminates next, or has just."""
        past_s = time.time() - self.begun_s - FIRST_S - 0.5 * EVERY_S
        return f"OVERHEAD {max(0, math.ceil(past_s / EVERY_S)) + 1}"

    @staticmethod
    def _listens(port: int) -> bool:
        with socket.socket() as client:
            return client.connect_ex(("127.0.0.1", port)) == 0

    def at_rest(self) -> None:
        """Bring the station to where every scenario begins: no fault, no pass, holding."""
        begun_s = time.monotonic()
        while self.tracking.target or self.antenna.fault or self.antenna.mode != "holding":
            if time.monotonic() > begun_s + PATIENCE_S:
                raise TimeoutError(f"not at rest after {PATIENCE_S:.0f} s: {self.said()}")
            if self.antenna.fault:
                self.call("antenna_servo/reset_fault")
            if self.tracking.target:
                self.call("pointing_controller/stop")
            elif self.antenna.mode not in ("holding", "stopping", "tracking"):
                self.call("antenna_servo/resume")
            self.spin(1.0)
        self.spin(1.0)

    def wait_for_height(self) -> str:
        """Return the satellite overhead once it is high enough, with two minutes left."""

        def low() -> bool:
            return self.direction_deg(self.overhead, time.time())[1] < 10.0

        self.until(lambda: not low(), "a satellite overhead", 300.0)
        return self.overhead

    def goal(self, name: str, patience_s: float = PATIENCE_S) -> Any:
        """Track a satellite; return the future of the result."""
        client = ActionClient(self.node, TrackPass, "track_pass")
        self.until(client.server_is_ready, "track_pass", patience_s)
        sent = client.send_goal_async(TrackPass.Goal(satellite=name, sensor="program"))
        self.until(sent.done, "the accepted goal", patience_s)
        result = sent.result().get_result_async()
        self.until(lambda: self.tracking.target == name or result.done(), "the pass", patience_s)
        if result.done():
            raise TimeoutError(f"no pass: {result.result().result.message}")
        return result

    def track(self) -> str:
        """Begin the pass of the satellite overhead; return its name once the axes are on it."""
        self.at_rest()
        name = self.wait_for_height()
        self.goal(name)
        self.until(lambda: self.now_off_deg(name) < ON_SOURCE_DEG, "the satellite")
        return name

    def now_off_deg(self, name: str) -> float:
        """Return how far the axes are from a satellite; far while they are silent, or of another time."""
        silent = abs(time.time() + self.clock_s - self.axes[-1][0]) > 1.0
        return 180.0 if silent else self.off_deg(name, (self.axes[-1][0] - self.clock_s, *self.axes[-1][1:]))

    def regained_s(self, name: str, patience_s: float = 60.0) -> float:
        """Return how long it takes until the axes are on a satellite again, and stay there for 2 s."""
        begun_s, since_s = time.monotonic(), math.inf
        while time.monotonic() - since_s < 2.0:
            if not self.tracking.target and time.monotonic() - self.tracking_s < 1.0:
                # A client whose goal has ended, or has no answer, sends it again.
                with suppress(TimeoutError):
                    self.goal(name, AGAIN_S)
            on = self.now_off_deg(name) < ON_SOURCE_DEG
            since_s = min(since_s, time.monotonic()) if on else math.inf
            if time.monotonic() - begun_s > patience_s:
                raise TimeoutError(f"{name} not tracked again: {self.said()}")
            self.spin_once()
        return since_s - begun_s

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
        for name in self.nodes:
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
def web_page(station: Attacked) -> Measured:
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


@scenario(bound=2.0)
def controller_killed_under_a_client(station: Attacked) -> Measured:
    """Kill the controller in a client's pass: how long are points accepted that nothing follows?"""
    station.at_rest()
    name, on_source = station.wait_for_height(), 0.0
    lies_s, lied_s, killed_s, back_s = 0.0, 0.0, math.inf, math.inf
    with socket.create_connection(("127.0.0.1", station.server_port), 5.0) as client:
        begun_s = last_s = time.monotonic()
        while time.monotonic() < begun_s + 110.0 and not (time.monotonic() > killed_s + 20.0 and math.isfinite(back_s)):
            azimuth, elevation = station.direction_deg(name, time.time())
            accepted = station.answer(client, f"P {azimuth:.2f} {max(elevation, 0.0):.2f}") == "RPRT 0"
            before = station.now_off_deg(name)
            station.spin(0.5)
            now_s, follows = time.monotonic(), station.now_off_deg(name) < max(1.0, before - 0.2)
            # Until it is killed the antenna may still turn round on its way from rest.
            lied_s = 0.0 if follows or not accepted or killed_s == math.inf else lied_s + now_s - last_s
            lies_s, last_s = max(lies_s, lied_s), now_s
            tracked = station.tracking.target == name and now_s - station.tracking_s < 1.0
            on_source = on_source + 0.5 if tracked and station.tracking.on_source else 0.0
            if killed_s == math.inf and on_source > 3.0:
                station.kill("pointing_controller")
                killed_s = time.monotonic()
            elif now_s > killed_s + 1.0 and on_source:
                back_s = min(back_s, now_s - killed_s)
        stopped = station.answer(client, "S")
    if killed_s == math.inf:
        raise TimeoutError(f"no pass of the points: {station.processes.complaint('rotctld_server')}")
    station.until(lambda: station.antenna.mode == "holding", "the end after S", 20.0)
    return Measured(lies_s, "s of RPRT 0 unfollowed", f"tracked again after {back_s:.1f} s; S: {stopped}")


@scenario(bound=3.0)
def bare_client(station: Attacked) -> Measured:
    """Kill the controller in the pass of a client that only waits for its result."""
    station.at_rest()
    result = station.goal(station.wait_for_height())
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


def flood(station: Attacked, calls: int, callers: int) -> tuple[int, float, float]:
    """Call `park` so often; return the answers, the time of the last, and that of a stop behind them, in s."""
    station.at_rest()
    # A client keeps so many answers until it spins: of rclpy's own 10, a busy machine lost 20 of 200.
    qos = QoSProfile(depth=calls)
    clients = [station.node.create_client(Trigger, "antenna_servo/park", qos_profile=qos) for _ in range(callers)]
    stop = station.node.create_client(Trigger, "antenna_servo/stop")
    station.until(lambda: all(each.service_is_ready() for each in [*clients, stop]), "the services")
    station.spin(2.0)
    begun_s = time.monotonic()
    futures = [clients[index % callers].call_async(Trigger.Request()) for index in range(calls)]
    stopped, stopped_s, count, last_s = stop.call_async(Trigger.Request()), math.inf, 0, math.inf
    while time.monotonic() < begun_s + 30.0 and not (count == calls and math.isfinite(stopped_s)):
        station.spin_once()
        now_s, done = time.monotonic() - begun_s, sum(each.done() for each in futures)
        stopped_s = min(stopped_s, now_s) if stopped.done() else stopped_s
        count, last_s = (done, now_s) if done > count else (count, last_s)
    for each in [*clients, stop]:
        station.node.destroy_client(each)
    return count, last_s, stopped_s


@scenario(bound=0)
def calls_of_one_client(station: Attacked) -> Measured:
    """Make 200 calls at once, as one client."""
    count, last_s, _ = flood(station, 200, 1)
    return Measured(200 - count, "calls not answered", f"the last answer after {last_s:.2f} s")


@scenario(bound=0)
def calls_of_many_clients(station: Attacked) -> Measured:
    """Make 200 calls at once, as 200 clients that have just started."""
    count, last_s, _ = flood(station, 200, 200)
    return Measured(200 - count, "calls not answered", f"the last answer after {last_s:.2f} s")


@scenario(bound=200.0)
def stop_behind_a_flood(station: Attacked) -> Measured:
    """Stop the antenna behind 1000 calls."""
    count, last_s, stopped_s = flood(station, 1000, 1)
    return Measured(1e3 * stopped_s, "ms until stop is answered", f"{count} of 1000 calls answered in {last_s:.1f} s")


@scenario(bound=0)
def replayed_call(station: Attacked) -> Measured:
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
def half_open_requests(station: Attacked) -> Measured:
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
def texts_of_the_page(station: Attacked) -> Measured:
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


def fastest_deg_s(axes: list[tuple[float, float, float]]) -> float:
    """Return the fastest motion of an axis over a quarter of a second, where the stamps go on."""
    fastest = 0.0
    for index in range(len(axes) - 12):
        first, last = axes[index], axes[index + 12]
        if 0.2 < last[0] - first[0] < 0.5:
            way = max(abs(b - a) for a, b in zip(first[1:], last[1:], strict=True))
            fastest = max(fastest, way / (last[0] - first[0]))
    return fastest


def died(station: Attacked) -> list[str]:
    """Return the nodes that have ended, with their last words, and start them again."""
    ended = [f"{name} ended with {code}: {station.processes.complaint(name)}"
             for name, code in station.processes.ended().items()]  # fmt: skip
    for name in list(station.processes.ended()):
        station.start([name])
    if (code := station.device.process.poll()) is not None:
        ended.append(f"device ended with {code}")
        station.device.start()
    return ended


def ask(station: Attacked, kind: Any, name: str, request: Any) -> Any:
    client = station.node.create_client(kind, name)
    # An answer that arrives while the executor takes the client up would not be noticed.
    station.spin(0.02)
    station.until(client.service_is_ready, name)
    future = client.call_async(request)
    station.until(future.done, f"an answer of {name}")
    station.node.destroy_client(client)
    return future.result()


def extremes(descriptor: ParameterDescriptor, present: ParameterValue) -> Iterator[ParameterValue]:
    """Yield the ends of the range of a parameter, a step beyond them, and at last its present value."""
    numbers: list[Any] = [*descriptor.floating_point_range, *descriptor.integer_range]
    for each in numbers:
        for value in (each.from_value, each.to_value, each.from_value - 1, each.to_value + 1):
            match present.type:
                case ParameterType.PARAMETER_DOUBLE:
                    yield ParameterValue(type=present.type, double_value=float(value))
                case ParameterType.PARAMETER_INTEGER:
                    yield ParameterValue(type=present.type, integer_value=int(value))
                case ParameterType.PARAMETER_DOUBLE_ARRAY:
                    count = len(present.double_array_value)
                    yield ParameterValue(type=present.type, double_array_value=[float(value)] * count)
    if present.type == ParameterType.PARAMETER_BOOL:
        yield ParameterValue(type=present.type, bool_value=not present.bool_value)
    yield present


@scenario(bound=0)
def parameters_in_motion(station: Attacked) -> Measured:
    """Set every parameter of what moves to the ends of its range in a pass, and back."""
    harm, sets, taken, ended = list[str](), 0, 0, 0
    station.track()
    del station.axes[:-1]
    for node in ("antenna_servo", "pointing_controller", "ephemeris_publisher"):
        names = list(ask(station, ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names)
        request = DescribeParameters.Request(names=names)
        described = ask(station, DescribeParameters, f"{node}/describe_parameters", request).descriptors
        values = ask(station, GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names)).values
        for descriptor, present in zip(described, values, strict=True):
            accepted = 0
            for value in extremes(descriptor, present):
                one = SetParametersAtomically.Request(parameters=[Parameter(name=descriptor.name, value=value)])
                answer = ask(station, SetParametersAtomically, f"{node}/set_parameters_atomically", one)
                sets, accepted = sets + 1, accepted + answer.result.successful
                if answer.result.successful and value is not present:
                    station.spin(0.1)
            taken += accepted > 1
            if dead := died(station):
                harm += [f"{node} {descriptor.name}: {each}" for each in dead]
                station.until(lambda: station.tracking.sequence > 0, "the nodes again")
            if not station.tracking.target or station.antenna.fault:
                ended += 1
                station.track()
    if (fastest := fastest_deg_s(station.axes)) > 1.5 * SPEED_DEG_S:
        harm.append(f"an axis moved at {fastest:.1f} deg/s")
    station.at_rest()
    station.track()
    words = f"{sets} sets, {taken} parameters taken, the pass ended {ended} times, {fastest:.1f} deg/s"
    return Measured(len(harm), "sets that did harm", "; ".join([words, *harm[:3]]))


STEPS_S = (0.3, -0.3, 1.0, -1.0, 60.0, -60.0, 3600.0, -3600.0, 86400.0, -86400.0)


@scenario(bound=0)
def clock_steps(station: Attacked) -> Measured:
    """Step the clock of all nodes in a pass, and back: the antenna stops or follows, and nothing dies."""
    wrong, seen = list[str](), list[str]()
    for step_s in STEPS_S:
        station.track()
        station.spin(2.0)
        del station.axes[:-1]
        station.spoil(ahead_s=step_s)
        station.spin(5.0)
        fault, mode = station.antenna.fault, station.antenna.mode
        rest = station.axes[-100:]
        still = max(abs(a - b) for a, b in zip(rest[0][1:], rest[-1][1:], strict=True)) < 0.1
        seen.append(f"{step_s:+g} s: {'fault' if fault else mode}")
        if abs(step_s) < 0.5 and (fault or mode != "tracking"):
            wrong.append(f"{step_s:+g} s: {mode} {fault}")
        if abs(step_s) >= 1.0 and not (still and "clock jumped" in fault):
            wrong.append(f"{step_s:+g} s: {mode}, still {still}, fault {fault!r}")
        # The computer of a topic drive keeps its clock, and a drive of the past is refused.
        if len(station.axes) < 100 and "this computer's clock" not in fault:
            wrong.append(f"{step_s:+g} s: {len(station.axes)} joint states in 5 s")
        station.spoil(ahead_s=0.0)
        station.spin(3.0)
        if (fastest := fastest_deg_s(station.axes)) > 1.5 * SPEED_DEG_S:
            wrong.append(f"{step_s:+g} s: an axis moved at {fastest:.1f} deg/s")
        wrong += [f"{step_s:+g} s: {each}" for each in died(station)]
        try:
            station.at_rest()
        except TimeoutError as error:
            wrong.append(f"{step_s:+g} s and back: {error}")
    return Measured(len(wrong), "steps with harm", "; ".join(wrong[:4] or seen))


def off_s(station: Attacked, name: str, seconds: float, act: Callable[[], object] = lambda: None) -> float:
    """Return for how much of a time the axes are off a satellite while `act` is repeated."""
    begun_s, off, last_s = time.monotonic(), 0.0, time.monotonic()
    while last_s < begun_s + seconds:
        act()
        station.spin(0.1)
        now_s = time.monotonic()
        off += (now_s - last_s) * (station.now_off_deg(name) > ON_SOURCE_DEG)
        last_s = now_s
    return off


@scenario(bound=10.0)
def lost_datagrams(station: Attacked) -> Measured:
    """Lose a fifth of all datagrams of all nodes for 30 s of a pass."""
    name = station.track()
    station.spoil(lost=0.2)
    off = off_s(station, name, 30.0)
    station.spoil()
    off += station.regained_s(name)
    dead = died(station)
    return Measured(math.inf if dead else off, "s off the satellite", "; ".join(dead))


@scenario(bound=10.0)
def strange_datagrams(station: Attacked) -> Measured:
    """Send 20 000 datagrams of noise, and a stranger's damaged copy of a fifth of all that nodes send."""
    return spoilt_pass(station, copied=0.2)


@scenario(bound=60.0)
def damaged_datagrams(station: Attacked) -> Measured:
    """Do that, and damage a fifth of what the nodes send in place of copies, as no checksum of UDP lets pass.

    It leaves several pairs of nodes broken, of which each is proved within 15 s, some after others.
    """
    return spoilt_pass(station, damaged=0.2)


def spoilt_pass(station: Attacked, **shares: float) -> Measured:
    """Spoil the network for 30 s of a pass of the executive; measure for how long the axes are off after it.

    The device itself says where they are: whoever receives what was damaged may hang in DDS for good.
    """
    name, random_ = begin_night(station), random.Random(1)
    first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"])
    ports = [first, first + 1, *(first + 10 + 2 * number + kind for number in range(12) for kind in (0, 1))]
    sent, ended = 0, list[str]()
    station.leave()
    station.spoil(**shares)
    end_s = time.monotonic() + 30.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        while time.monotonic() < end_s:
            for port in ports:
                for _ in range(4):
                    noise = random_.randbytes(random_.randrange(1, 400))
                    stranger.sendto(random_.choice((noise, b"RTPS\x02\x03\x01\x0f" + noise)), ("127.0.0.1", port))
                    sent += 1
            ended += died(station)
            time.sleep(0.1)
    station.spoil()
    begun_s, since_s = time.monotonic(), math.inf
    while time.monotonic() - since_s < 2.0:
        ended += died(station)
        time.sleep(0.1)
        place = time.time(), *station.device.place_deg()
        on = station.off_deg(name, place) < ON_SOURCE_DEG
        since_s = min(since_s, time.monotonic()) if on else math.inf
        if time.monotonic() - begun_s > REGAINED_S:
            raise TimeoutError(f"{name} not tracked again: {place[1:]}; {'; '.join(ended)}")
    # A node that has gone deaf ends by itself, or is ended where it hangs in DDS; nothing else may.
    hung = [name for name in station.nodes if "Timeout (0:" in station.processes.log(name).read_text(errors="replace")]
    by_itself = f"ended with {DEAF}", f"ended with {-signal.SIGPROF}"
    dead = [each for each in ended if not any(map(each.count, by_itself)) and each.split()[0] not in hung]
    words = "; ".join([f"{sent} of noise", *ended])
    return Measured(math.inf if dead else since_s - begun_s, "s off the satellite", words)


def begin_night(station: Attacked) -> str:
    """Let the executive track the satellite overhead; return its name."""
    name = station.wait_for_height()
    number = int(name.rpartition(" ")[2]) - 1
    middle_s = station.begun_s + FIRST_S + number * EVERY_S
    one = ScheduledPass(id=f"pass{number}", target=str(91000 + number), name=name, aos_t_s=middle_s - 230.0,
                        los_t_s=middle_s + 230.0, sensor="program")  # fmt: skip
    client = ActionClient(station.node, RunSchedule, "run_schedule")
    station.until(client.server_is_ready, "run_schedule")
    sent = client.send_goal_async(RunSchedule.Goal(passes=[scheduled_to_message(one)]))
    station.until(sent.done, "an answer of run_schedule")
    station.until(lambda: station.tracking.target == name, f"the pass of {name}")
    station.until(lambda: station.now_off_deg(name) < ON_SOURCE_DEG, "the satellite")
    return name


def end_night(station: Attacked) -> None:
    station.call("station_executive/abort")
    station.until(lambda: not station.tracking.target, "the end of the night")
    station.spin(3.0)


@scenario(bound=5.0)
def full_disk(station: Attacked) -> Measured:
    """Fill the disk of recordings and states in a pass of the executive: who says so, and does the pass go on?"""
    station.at_rest()
    name = begin_night(station)
    begun_s, told_s, filler = time.monotonic(), math.inf, station.disk / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            for size in (1 << 20, 1 << 10, 1):
                with suppress(OSError):
                    while file.write(bytes(size)) == size:
                        pass
        finally:
            begun_s, words, off = time.monotonic(), "", 0.0
            while time.monotonic() < begun_s + 20.0:
                off += off_s(station, name, 0.2)
                for check, status in station.health.items():
                    full = "No space" in status.message or "disk" in status.message
                    if status.level != b"\0" and full and told_s == math.inf:
                        told_s, words = time.monotonic() - begun_s, f"{check}: {status.message}"
            filler.unlink()
    dead = died(station)
    end_night(station)
    good = not dead and off < 1.0
    return Measured(told_s if good else math.inf, "s until it is on /diagnostics",
                    "; ".join([words[:120], f"{off:.1f} s off the satellite", *dead]))  # fmt: skip


@scenario(bound=0)
def two_executives(station: Attacked) -> Measured:
    """Start a second executive on another computer, with the folder of locks of the first and with its own."""
    if refused := why_not():
        raise TimeoutError(refused)
    line = [sys.executable, __file__, "two_executives", "--drive", station.drive, "--inside"]
    wrong, said = 0, list[str]()
    with tempfile.TemporaryDirectory() as folder, computers(Path(folder), server=False) as both:
        for shared in ("shared", "own"):
            log = Path(folder) / f"{shared}.log"
            plain = {"LD_PRELOAD": "", "TMPDIR": folder}
            inner = both.start(0, [*line, both.names[1], shared], shared, **plain)
            inner.wait(400.0)
            found = log.read_text(errors="replace").strip().splitlines() or ["nothing"]
            wrong, said = wrong + (inner.returncode != 0), [*said, f"{shared} locks: {found[-1]}"]
    return Measured(wrong, "of 2 cases in which not exactly one steers", "; ".join(said))


def second_executive(ends: ExitStack, folder: Path, drive: str, other: str, shared: str) -> int:
    """Do `two_executives` on the first computer, this one; return the exit code."""
    station = Attacked(ends, folder, drive)
    statuses: dict[str, ExecutiveStatus] = {}

    def note(message: ExecutiveStatus) -> None:
        statuses[message.process] = message

    station.node.create_subscription(ExecutiveStatus, "executive_status", note, STATUS)
    second = folder / "second"
    (second / "tmp").mkdir(parents=True)
    program = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / "station_executive"
    own = {"executive.folder": str(second / "night"), "executive.state_file": str(second / "night.json")}
    given = [word for name, value in own.items() for word in ("-p", f"{name}:={value}")]
    locks = {} if shared == "shared" else {"TMPDIR": str(second / "tmp")}
    with (second / "log").open("wb") as log:
        process = subprocess.Popen(
            ["ip", "netns", "exec", other, str(program), "--ros-args", "-r", f"__ns:={station.namespace}",
             "--params-file", str(folder / "run.yaml"), *given, "-p", "lifecycle.autostart:=true"],
            env=os.environ | locks, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
        )  # fmt: skip
    try:
        if shared == "shared":
            station.until(lambda: process.poll() is not None, "the end of the second executive")
            words = (second / "log").read_text().strip().splitlines()[-1]
            print(words)
            return int("already runs" not in words)
        station.until(lambda: len(statuses) == 2, "both executives")
        # Both offer run_schedule, so both take this night.
        name = begin_night(station)
        off = off_s(station, name, 30.0)
        journals = [folder / "disk" / "night" / "journal.jsonl", second / "night" / "journal.jsonl"]
        steer = sum(each.exists() and '"directive": "track", "event": "sent"' in each.read_text() for each in journals)
        logs = station.processes.log("station_executive").read_text() + (second / "log").read_text()
        says = next((line for line in logs.splitlines() if "has a night of this antenna" in line), "nobody says why")
        print(f"{steer} of 2 have tracked, {off:.1f} s off the satellite; {says.partition(']: ')[2] or says}")
        return int(steer != 1 or off > 1.0 or says == "nobody says why")
    finally:
        process.kill()
        process.wait()


def attack(drive: str, names: list[str], keep: Path | None) -> list[Verdict]:
    """Run scenarios on a drive and print a row for each."""
    verdicts = []
    with ExitStack() as ends:
        folder = ends.enter_context(tempfile.TemporaryDirectory(prefix="attack"))
        if keep is not None:
            ends.callback(lambda: shutil.copytree(Path(folder) / "logs", keep / drive, dirs_exist_ok=True))
        station = Attacked(ends, Path(folder), drive)
        for name in names:
            bound, function = SCENARIOS[name]
            try:
                found = function(station)
            except (TimeoutError, OSError) as error:
                found = Measured(math.inf, "not tried", f"{type(error).__name__}: {error}")
                station.spoil(ahead_s=0.0)
            if dead := died(station):
                found = found._replace(words="; ".join([found.words, *dead]))
            good = found.value <= bound
            verdicts.append(Verdict(drive, name, good, found.value, bound, found.unit, found.words))
            load = f"load {os.getloadavg()[0]:.0f}"
            print(f"{'ok' if good else 'FAILS':<6}{drive:<8}{name:<34}{found.value:>9.3g} <= {bound:<7g}"
                  f"{found.unit}; {found.words}; {load}", flush=True)  # fmt: skip
    return verdicts


def each_alone(options: argparse.Namespace, runs: list[tuple[str, list[str]]]) -> list[int]:
    """Attack each drive from a process of its own, and from another one where the network is spoilt."""
    codes, verdicts = list[int](), list[Any]()
    for drive, group in runs:
        with tempfile.NamedTemporaryFile(suffix=".json") as file:
            command = [sys.executable, __file__, *group, "--drive", drive]
            command += ["--json", file.name, *["--keep", str(options.keep)] * bool(options.keep)]
            codes.append(subprocess.run(command, check=False).returncode)
            verdicts += json.loads(Path(file.name).read_text() or "[]")
    if options.json:
        options.json.write_text(json.dumps(verdicts, indent=1))
    return codes


def main() -> int:
    """Run the scenarios and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=f"default: all of {', '.join(SCENARIOS)}")
    parser.add_argument("--drive", nargs="+", choices=DEVICES, default=["rotctld"])
    parser.add_argument("--json", type=Path, help="write the verdicts to a file")
    parser.add_argument("--keep", type=Path, help="folder to which the logs are copied, by drive")
    parser.add_argument("--inside", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if unknown := [name for name in options.scenarios if name not in SCENARIOS]:
        parser.error(f"{unknown[0]} must be one of {', '.join(SCENARIOS)}")
    names = options.scenarios or list(SCENARIOS)
    groups = [[each for each in names if each not in SPOIL], *([each] for each in names if each in SPOIL)]
    runs = list(itertools.product(options.drive, filter(None, groups)))
    if len(runs) > 1:
        return int(any(each_alone(options, runs)))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    os.environ |= {"ROS_DOMAIN_ID": str(random.randrange(1, 100)), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    # The delays of the attacker on a busy computer are not the station's; its children begin as usual.
    with suppress(PermissionError):
        priority = os.sched_param(DEVICE_PRIORITY - 10)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, priority)
    # Never shut down: that may hang after damaged datagrams, and the process ends here.
    rclpy.init()
    if options.inside:
        with ExitStack() as ends:
            folder = ends.enter_context(tempfile.TemporaryDirectory(prefix="attack"))
            return second_executive(ends, Path(folder), options.drive[0], *options.inside)
    verdicts = [row for drive in options.drive for row in attack(drive, names, options.keep)]
    if options.json:
        options.json.write_text(json.dumps([asdict(each) for each in verdicts], indent=1))
    return int(not all(each.good for each in verdicts))


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # a participant that took damaged datagrams may never end
