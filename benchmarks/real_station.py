"""A live station on a device that is not simulated, in wall time: what `attack.py`, `soak.py` and `slews` attack.

The devices: Debian's `rotctld -m 1` (libhamlib-utils), an Easycomm controller on a pseudo terminal, and
examples/topic_drive_node.py.  Each is a process of its own that can be stopped, killed and started again.
"""

import dataclasses
import importlib.util
import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rf_pointing_msgs.msg import AntennaStatus, TrackingStatus
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack, tle_lines
from rf_pointing.ros.main_loop import DRIVE_PRIORITY, make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.description import read_station

ROOT = Path(__file__).parents[1]
DEVICE_PRIORITY = DRIVE_PRIORITY + 5
SPEED_DEG_S = 6.0
PATIENCE_S, BRING_UP_S = 60.0, 240.0
EARTH_RAD_S = 7.292115e-5


def of_tests(file: str) -> Any:
    """Return a module of the tests by its file."""
    # `test` is a package of Python's own, too.
    path = ROOT / "test" / file
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


live = of_tests("graph/real_station.py")


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Let so many processes compute meanwhile."""
    computing = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in computing:
            process.kill()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Device:
    """A process that stands for hardware: it goes before the nodes, where that is permitted.

    `drive` is the block of the description, `home_deg` where the device is after its start.
    """

    drive: str
    resolution_deg = 0.01
    home_deg = 0.0, 0.0

    def __init__(self, folder: Path, namespace: str) -> None:
        self._folder, self._namespace = folder, namespace
        self.prepare()
        self.start()

    def prepare(self) -> None:
        """Choose what lasts over starts: port or name."""

    def line(self) -> list[str]:
        """Return the command line."""
        raise NotImplementedError

    def ready(self) -> None:
        """Wait until the device answers."""

    def start(self) -> None:
        """Start the device, at its home."""
        # Whatever spoils the nodes leaves the device alone.
        environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
        self.process = subprocess.Popen(
            self.line(),
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        with suppress(PermissionError):
            os.sched_setscheduler(self.process.pid, os.SCHED_FIFO, os.sched_param(DEVICE_PRIORITY))
        self.ready()

    def place_deg(self) -> tuple[float, float]:
        """Return azimuth and elevation of the device, where it keeps them."""
        azimuth, elevation = map(math.degrees, json.loads((self._folder / "axes.json").read_text()))
        return azimuth, elevation

    def signal(self, sign: int) -> None:
        """Stop the device (SIGSTOP) or let it go on (SIGCONT)."""
        self.process.send_signal(sign)

    def kill(self) -> None:
        """End the device as a lost power supply does."""
        self.process.kill()
        self.process.wait()


class Rotctld(Device):
    """Hamlib's dummy rotator."""

    def prepare(self) -> None:
        self.port = free_port()
        self.drive = f"{{type: hamlib, link: {{host: 127.0.0.1, port: {self.port}}}, rotator: {{latency_s: 0.0}}}}"

    def line(self) -> list[str]:
        return ["rotctld", "-m", "1", "-T", "127.0.0.1", "-t", str(self.port)]

    def ready(self) -> None:
        end_s = time.monotonic() + 10.0
        while time.monotonic() < end_s:
            with suppress(OSError):
                socket.create_connection(("127.0.0.1", self.port), 0.5).close()
                return
            time.sleep(0.02)
        raise TimeoutError("rotctld does not listen")

    def place_deg(self) -> tuple[float, float]:
        with socket.create_connection(("127.0.0.1", self.port), 2.0) as client:
            client.sendall(b"p\n")
            answer = client.makefile()
            return float(answer.readline()), float(answer.readline())


class Pty(Device):
    """An Easycomm controller behind a name that leads to its pseudo terminal."""

    resolution_deg = 0.1
    home_deg = 0.0, 30.0
    PROGRAM = (
        "import json, pathlib, sys, time, math, test; test.__path__ = [sys.argv[1]]\n"
        "from rf_pointing.core.whole_file import write_whole\n"
        "from rf_pointing.drives import RotatorModel\n"
        "from test.drives.simulators import MODEL, Easycomm\n"
        "class Controller(Easycomm):\n"
        "    def _read(self):\n"
        "        data = super()._read()\n"
        "        self.model.step(time.monotonic())\n"
        "        return data\n"
        "low, high = (math.radians(-180.0), 0.0), (math.radians(360.0), math.radians(90.0))\n"
        "device, step = Controller(), (math.radians(0.1),) * 2\n"
        "params = MODEL.replace(travel_min_rad=low, travel_max_rad=high)\n"
        "device.model = RotatorModel(params, step, (0.0, math.radians(30.0)))\n"
        "print(device.device, flush=True)\n"
        "axes, due_s = pathlib.Path(sys.argv[2]), 0.0\n"
        "while True:\n    device.step(time.monotonic())\n    time.sleep(0.005)\n"
        "    if time.monotonic() > due_s:\n        due_s = time.monotonic() + 0.1\n"
        "        write_whole(axes, json.dumps(device.model.position_rad))\n"
    )
    """The simulators belong to the tests, whose folder Python's own package `test` hides.

    A request is answered with where the device is after its arrival, however late this process is.
    """

    def prepare(self) -> None:
        self.name = self._folder / "rotator"
        self.drive = f"{{type: easycomm, link: {{device: {self.name}}}}}"

    def line(self) -> list[str]:
        return [sys.executable, "-c", self.PROGRAM, str(ROOT / "test"), str(self._folder / "axes.json")]

    def ready(self) -> None:
        assert self.process.stdout is not None
        self.name.unlink(missing_ok=True)
        self.name.symlink_to(self.process.stdout.readline().strip())


class Topic(Device):
    """The example of a driver behind topics."""

    drive = "{type: topic, model: position, rotator: {latency_s: 0.05}}"
    home_deg = 0.0, math.degrees(0.5)
    PROGRAM = (
        "import json, pathlib, sys, rclpy; sys.path.insert(0, sys.argv.pop(1))\n"
        "from topic_drive_node import Driver\n"
        "from rf_pointing.core.whole_file import write_whole\n"
        "from rf_pointing.ros.driver_node import spin_watched\n"
        "place = pathlib.Path(sys.argv.pop(1))\n"
        "rclpy.init(args=sys.argv)\n"
        "driver = Driver()\n"
        "if place.exists():\n    driver.axes.update(zip(driver.axes, json.loads(place.read_text())))\n"
        "driver.create_timer(0.1, lambda: write_whole(place, json.dumps([*driver.axes.values()])))\n"
        "spin_watched(driver)\n"
    )
    """The example, with encoders that keep their place when it is started again."""

    def line(self) -> list[str]:
        arguments = [str(self._folder / "axes.json"), "--ros-args", "-r", f"__ns:={self._namespace}"]
        return [sys.executable, "-c", self.PROGRAM, str(ROOT / "examples"), *arguments]

    def kill(self) -> None:
        super().kill()
        (self._folder / "axes.json").unlink(missing_ok=True)


DEVICES: dict[str, type[Device]] = {"rotctld": Rotctld, "pty": Pty, "topic": Topic}


def write_station(folder: Path, device: Device, **changes: Any) -> Path:
    """Write the description of a rotator on the device, and return the file."""
    path, plain = folder / "station.yaml", folder / "plain.yaml"
    text = (ROOT / "examples" / "hamlib_rotator.yaml").read_text()
    text = text.replace("resolution_deg: 0.01", f"resolution_deg: {device.resolution_deg}")
    lines = [f"drive: {device.drive}" if line.startswith("drive:") else line for line in text.splitlines()]
    plain.write_text("\n".join(lines) + "\n")
    read_station(plain).write(path, changes)
    return path


class Station:
    """Live nodes on a device, what they publish, and the ways to attack them.

    `culminations` maps the names of satellites to when they culminate, in s after the start; `own`
    are parameters by node.  The servo has its real-time priority, as the launch file gives it.  What
    is begun is ended by `ends`.
    """

    def __init__(
        self, ends: ExitStack, folder: Path, drive: str, nodes: Sequence[str], culminations: Mapping[str, float],
        own: Mapping[str, Mapping[str, Any]], **changes: Any,
    ) -> None:  # fmt: skip
        self.folder, self.nodes, self.begun_s = folder, tuple(nodes), time.time()
        self.namespace = f"/attack{os.getpid()}"
        self.device = DEVICES[drive](folder, self.namespace)
        ends.callback(lambda: self.device.kill())
        station = write_station(folder, self.device, **changes)
        self.description = read_station(station)
        lines, self.tracks = [], dict[str, TopocentricTrack]()
        first = live.satellite_over(self.description.site, self.begun_s)
        for number, (name, at_s) in enumerate(culminations.items()):
            # The same motion over the turning Earth, so much later.
            node_rad = (first.ascending_node_rad + EARTH_RAD_S * at_s) % (2.0 * math.pi)
            one = dataclasses.replace(
                first, name=name, catalogue_number=91000 + number, epoch_t_s=first.epoch_t_s + at_s,
                ascending_node_rad=node_rad,
            )  # fmt: skip
            self.tracks[name] = TopocentricTrack(one, self.description.site)
            lines += [name, *tle_lines(one)]
        elements = folder / "elements.tle"
        elements.write_text("\n".join(lines) + "\n")
        self.key = str(folder / "command.key")
        state = {"state_file": str(folder / "servo.json"), "wrap_file": str(folder / "turn.json")}
        target = {"source.elements": str(elements), "source.satellite": next(iter(culminations))}
        given: dict[str, dict[str, Any]] = {name: {} for name in nodes}
        given["antenna_servo"] |= state | {"lifecycle.realtime_priority": DRIVE_PRIORITY}
        given["ephemeris_publisher"] |= target | {"publisher.state_file": str(folder / "target.json")}
        for name, values in given.items():
            if name != "ephemeris_publisher":
                values["command_key_file"] = self.key
            if name != "operator_page":
                values["station"] = str(station)
            values |= own.get(name, {})
        sections = {f"/**/{name}": {"ros__parameters": values} for name, values in given.items()}
        (folder / "run.yaml").write_text(json.dumps(sections))
        self.antenna, self.tracking, self.tracking_s = AntennaStatus(), TrackingStatus(), -math.inf
        self.axes: list[tuple[float, float, float]] = []
        self.health: dict[str, DiagnosticStatus] = {}
        self.listen()
        self.processes = NodeProcesses(self.namespace, [folder / "run.yaml"], folder / "logs")
        ends.callback(self.processes.stop)
        self.start(nodes)
        self.until(lambda: self.antenna.mode and self.tracking.sequence > 0, "the station", BRING_UP_S)

    def listen(self) -> None:
        """Join the graph as a new participant."""
        # It ends with the process: the end of one that is deaf may never come.
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(os.environ["ROS_DOMAIN_ID"]))
        self.node = rclpy.create_node("attacker", namespace=self.namespace, context=self.context)
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)
        listen = self.node.create_subscription
        listen(AntennaStatus, "antenna_status", lambda m: setattr(self, "antenna", m), STATUS)
        listen(TrackingStatus, "tracking_status", self._on_tracking, STREAM)
        listen(JointState, "joint_states", self._on_joints, STREAM)
        listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)

    def leave(self) -> None:
        """Leave the graph until `listen`: what takes damaged datagrams may hang for good."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()

    def _on_tracking(self, message: TrackingStatus) -> None:
        self.tracking, self.tracking_s = message, time.monotonic()

    def _on_joints(self, message: JointState) -> None:
        self.axes.append((seconds_from_stamp(message.header.stamp), *map(math.degrees, message.position)))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id.startswith(f"{self.namespace}/"):
                self.health[status.name.rpartition("/")[2]] = status

    def start(self, nodes: Sequence[str]) -> None:
        """Start nodes, which bring themselves up."""
        self.processes.start(nodes, simulated_time=False, autostart=True)

    def spin(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.spin_once()

    def spin_once(self) -> None:
        """Take what has arrived; a datagram that was damaged on purpose is left out, as by the nodes."""
        with suppress(ValueError, RuntimeError):
            self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> float:
        """Wait for a condition; return how long, TimeoutError after `patience_s`."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                raise TimeoutError(f"waited {patience_s:.0f} s for {what}: {self.said()}")
            self.spin_once()
        return time.monotonic() - begun_s

    def said(self) -> str:
        """Return what antenna and controller say of themselves."""
        antenna, tracking = self.antenna, self.tracking
        return f"antenna {antenna.mode} {antenna.fault}; {tracking.target} {tracking.mode} {tracking.reason}"

    def call(self, name: str) -> Trigger.Response:
        client = self.node.create_client(Trigger, name)
        self.spin(0.02)
        self.until(client.service_is_ready, name)
        future = client.call_async(Trigger.Request())
        self.until(future.done, f"an answer of {name}")
        self.node.destroy_client(client)
        return future.result()

    def signal(self, name: str, sign: int) -> None:
        os.kill(self.processes.process_id(name), sign)

    def kill(self, name: str) -> None:
        """Kill a node, as a crash would, and start it again."""
        self.signal(name, signal.SIGKILL)
        self.until(lambda: name in self.processes.ended(), f"the end of {name}")
        self.start([name])

    def direction_deg(self, name: str, t_s: float) -> tuple[float, float]:
        look = self.tracks[name].target_at(t_s)
        return math.degrees(look.azimuth_rad) % 360.0, math.degrees(look.elevation_rad)

    def off_deg(self, name: str, axes: tuple[float, float, float]) -> float:
        """Return how far the axes were from a satellite, `axes` with their time."""
        here, there = map(math.radians, axes[1:]), map(math.radians, self.direction_deg(name, axes[0]))
        return math.degrees(angular_distance_rad(*here, *there))
