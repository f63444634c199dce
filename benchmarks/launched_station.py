"""A station on Debian's rotctld as a user starts it, with `launch`, in wall time: what is shared by live benchmarks.

A relay stands between the station and rotctld and may cut, hang, swallow or freeze what passes it.
A hook writes every message of an alarm into a file.
"""

import importlib.util
import json
import math
import os
import signal
import socket
import socketserver
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, TrackingStatus

from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import TopocentricTrack, find_passes, tle_lines
from rf_pointing.operations.pass_list import to_json
from rf_pointing.operations.schedule import ScheduledPass
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.supervisor import STATE
from rf_pointing.station.description import read_station

ROOT = Path(__file__).parents[1]
MASK_DEG = 35.0
"""Above it the satellite stays for about 150 s."""
DRIVER = "rf_receiver"
"""Node of the station's own that this program plays."""


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


over, rotctld = of_tests("graph/real_station.py"), of_tests("drives/rotctld.py")


def executable(name: str) -> str:
    """Return the path of an executable of the package."""
    return str(Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / name)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Relay:
    """Lines between a station and rotctld.

    `mode`: pass; cut: no connection; hung: no answer; stuck: orders are answered and not carried
    out; frozen: the first position is answered for ever.
    """

    def __init__(self, to_port: Callable[[], int]) -> None:
        self.mode, self._to_port = "pass", to_port
        self._frozen: dict[bytes, bytes] = {}
        relay = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                with suppress(OSError):
                    relay.serve(self.connection)

        class Server(socketserver.ThreadingTCPServer):
            allow_reuse_address = True
            daemon_threads = True

            def verify_request(self, *_: Any) -> bool:
                return relay.mode != "cut"

        self._server = Server(("127.0.0.1", 0), Handler)
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def set(self, mode: str) -> None:
        self._frozen.clear()
        self.mode = mode

    def serve(self, client: socket.socket) -> None:
        """Relay lines of one client until it or rotctld ends, or the way is cut."""
        with socket.create_connection(("127.0.0.1", self._to_port()), 1.0) as device:
            device.settimeout(0.05)
            client.settimeout(0.05)
            while self.mode != "cut":
                asked = _read(client)
                if asked is None:
                    return
                if asked and self.mode != "hung":
                    order = asked.lstrip(b"+\\;|").upper()[:1] == b"P" and asked.lstrip(b"+\\;|")[:1] == b"P"
                    if self.mode == "stuck" and order:
                        self._refuse_silently(client, asked)
                        continue
                    device.sendall(asked)
                    answer = self._answer(device)
                    if answer is None:
                        return
                    if self.mode == "frozen" and not order:
                        answer = self._frozen.setdefault(asked, answer)
                    client.sendall(answer)

    @staticmethod
    def _refuse_silently(client: socket.socket, asked: bytes) -> None:
        extended = b"set_pos: " + asked.strip()[2:] + b"\n" if asked.startswith(b"+") else b""
        client.sendall(extended + b"RPRT 0\n")

    def _answer(self, device: socket.socket) -> bytes | None:
        found, until_s = b"", time.monotonic() + 3.0
        while b"RPRT" not in found and found.count(b"\n") < 2 and time.monotonic() < until_s:
            more = _read(device)
            if more is None:
                return None
            found += more
        while b"RPRT" in found and not found.endswith(b"\n"):
            found += _read(device) or b""
        return found


def _read(end: socket.socket) -> bytes | None:
    try:
        return end.recv(4096) or None
    except TimeoutError:
        return b""


class LaunchedStation:
    """A station that `launch` runs: files in `folder`, passes over it at `culminations_s`.

    `ages_h` are the ages of the elements of each; `changes` those of the description.
    """

    def __init__(
        self, folder: Path, culminations_s: Sequence[float], *, ages_h: Sequence[float] = (), changes: str = "",
        anemometer: bool = False, rotctld_on: bool = True, words: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.folder, self.words = folder, words
        self.rotctld = rotctld.RealRotctld()
        self.relay = Relay(lambda: int(self.rotctld.port))
        if not rotctld_on:
            self.relay.set("cut")
        hook = folder / "hook"
        self.told_file = folder / "told.jsonl"
        hook.write_text(f"#!/bin/sh\n{{ tr -d '\\n'; echo; }} >> '{self.told_file}'\n")
        hook.chmod(0o755)
        self.page_port = free_port()
        self.station = folder / "my.yaml"
        text = over.STATION.read_text().replace("port: 4533", f"port: {self.relay.port}")
        text = text.replace("sensors: [steptrack]", "sensors: []")
        text = text.replace("mount:\n", f"mount:\n  pass_elevation_deg: {MASK_DEG}\n")
        if anemometer:
            text = text.replace("anemometer: false", "anemometer: true")
        hooks = f"tuning:\n  hooks.command: {hook}\n{changes}"
        self.station.write_text(f"{text}{hooks}")
        self.params = folder / "run.yaml"
        self.params.write_text(
            f"/**/operator_page: {{ros__parameters: {{page.port: {self.page_port}}}}}\n"
            f"/**/rotctld_server: {{ros__parameters: {{server.port: {free_port()}}}}}\n"
        )
        site = read_station(self.station).site
        self.elements, self.passes, lines = folder / "my.tle", list[ScheduledPass](), list[str]()
        for number, culmination_s in enumerate(culminations_s, start=1):
            age_h = ages_h[number - 1] if ages_h else 0.0
            one = over.satellite_over(site, culmination_s, age_s=3600.0 * age_h, number=number + 1)
            lines += [one.name, *tle_lines(one)]
            above = math.radians(MASK_DEG)
            (window,) = find_passes(TopocentricTrack(one, site), culmination_s - 300.0, 600.0, above)
            self.passes.append(
                ScheduledPass(
                    id=f"pass {number}", target=str(one.catalogue_number), name=one.name, aos_t_s=window.aos_t_s,
                    los_t_s=window.los_t_s, peak_rad=window.peak_elevation_rad, elevation_rad=(above, above),
                    azimuth_path_rad=(
                        window.aos_azimuth_rad, window.azimuth_min_rad, window.azimuth_max_rad, window.los_azimuth_rad,
                    ),
                )
            )  # fmt: skip
        self.elements.write_text("\n".join(lines) + "\n")
        self.schedule = folder / "night.json"
        self.schedule.write_text(to_json(self.passes))
        self.environment = os.environ | {"XDG_STATE_HOME": str(folder / "state")}
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        self.logs = folder / "state" / "rf_pointing" / f"domain{domain}" / "gs1" / "log"
        self.nights = self.logs.parent / "nights"
        self._listen()
        self.launch()

    def launch(self) -> None:
        """Start the station as a user does; again after it has ended."""
        words = [
            executable("launch"), "single_antenna", f"station:={self.station}", f"params_file:={self.params}",
            f"elements:={self.elements}", "executive:=true", *self.words,
        ]  # fmt: skip
        with (self.folder / "launch.out").open("ab") as out:
            self.process = subprocess.Popen(
                words, env=self.environment, stdin=subprocess.DEVNULL, stdout=out, stderr=out, start_new_session=True
            )

    def _listen(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node(DRIVER, namespace="/gs1")
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self.antenna, self.tracking, self.executive = AntennaStatus(), TrackingStatus(), ExecutiveStatus()
        self.heard_s = -math.inf
        self._clients: list[subprocess.Popen[bytes]] = []
        listen = self.node.create_subscription
        listen(AntennaStatus, "antenna_status", self._on_antenna, STATUS)
        listen(TrackingStatus, "tracking_status", lambda m: setattr(self, "tracking", m), STREAM)
        listen(ExecutiveStatus, "executive_status", lambda m: setattr(self, "executive", m), STATUS)
        self._health = self.node.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
        self._wind = self.node.create_publisher(Vector3Stamped, "weather/wind", STREAM)
        self.own_level, self.own_silent, self.own_offset_s, self.wind_m_s = 0, True, 0.0, 3.0
        self.node.create_timer(1.0, self._say)

    def _on_antenna(self, message: AntennaStatus) -> None:
        self.antenna, self.heard_s = message, time.monotonic()

    def _say(self) -> None:
        """Publish what the station's own receiver and anemometer do."""
        wind = Vector3Stamped()
        wind.header.stamp = stamp_from_seconds(time.time())
        wind.vector.x = self.wind_m_s
        self._wind.publish(wind)
        if self.own_silent:
            return
        message = DiagnosticArray()
        message.header.stamp = stamp_from_seconds(time.time() - self.own_offset_s)
        level, words = bytes([self.own_level]), "no reference clock" if self.own_level else "receives"
        message.status = [
            DiagnosticStatus(name=f"gs1/{DRIVER}: lock", hardware_id=f"/gs1/{DRIVER}", level=level, message=words)
        ]
        self._health.publish(message)

    def spin(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.executor.spin_once(timeout_sec=0.05)

    def until(self, condition: Callable[[], Any], patience_s: float) -> float:
        """Wait for a condition; return how long it took, infinite after `patience_s`."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                return math.inf
            self.executor.spin_once(timeout_sec=0.05)
        return time.monotonic() - begun_s

    def fresh(self) -> bool:
        """Return whether the control unit is heard now."""
        return time.monotonic() - self.heard_s < 2.0

    def queue(self) -> subprocess.Popen[bytes]:
        """Hand the passes over and start the night; the client follows it to its end."""
        with (self.folder / "queue.out").open("ab") as out:
            words = [executable("station"), "--namespace", "/gs1", "queue", str(self.schedule), "--start"]
            client = subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=out, stderr=out)
        self._clients.append(client)
        return client

    def told(self) -> list[dict[str, str]]:
        """Return every message that has left the station."""
        lines = self.told_file.read_text().splitlines() if self.told_file.exists() else []
        return [json.loads(line) for line in lines if line]

    def state(self) -> dict[str, Any]:
        """Return what the supervisor says of its processes."""
        with suppress(OSError, ValueError):
            return dict(json.loads((self.logs / STATE).read_text()))
        return {"processes": {}}

    def process_of(self, name: str) -> int | None:
        return self.state()["processes"].get(name, {}).get("process")

    def signal(self, name: str, sign: int) -> None:
        """Send a signal to a node, if it runs."""
        if process := self.process_of(name):
            with suppress(ProcessLookupError):
                os.kill(process, sign)

    def kill_all(self) -> None:
        """End launcher and nodes at once, as a power cut does."""
        processes = [each["process"] for each in self.state()["processes"].values()]
        for process in (self.process.pid, *filter(None, processes)):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self.process.wait()

    def stop(self) -> int:
        """End the station as Ctrl-C does; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60.0)

    def close(self) -> None:
        if self.process.poll() is None:
            self.stop()
        for client in self._clients:
            # One that still follows a night would wait for its end for ever.
            client.terminate()
        self.rotctld.kill()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def report(self) -> dict[str, Any]:
        """Return the newest morning report."""
        files = sorted(self.nights.glob("report-*/night.json"), key=lambda file: file.stat().st_mtime)
        return dict(json.loads(files[-1].read_text())) if files else {}


def say(text: str) -> None:
    print(f"{utc_text(time.time())[11:19]} {text}", flush=True)
