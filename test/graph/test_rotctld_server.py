"""The rotctld server before a live station: Debian's rotctl, an unknown track through north, and a known satellite."""

import dataclasses
import math
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import AntennaStatus, PassCertificate, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.core import angular_distance_rad, azel_from_unit_vector
from rf_pointing.drives.line_server import Inquiry, LineServer, ServerParams
from rf_pointing.drives.rotctld import RotatorWords, StationView
from rf_pointing.ephemeris import TopocentricTrack, tle_lines
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.clients.board import PageParams
from rf_pointing.station.description import read_station
from rf_pointing.web.page_server import PageServer
from test.conftest import within
from test.graph.real_station import satellite_over

from .conftest import free_port, live_graph
from .test_operator_page import start_browser

pytestmark = pytest.mark.graph

NODES = ["antenna_servo", "ephemeris_publisher", "pointing_controller", "rotctld_server"]
CULMINATES_S = 110.0
"""After the start of the nodes; the satellite is high enough from a minute before until a minute after."""
SETTLED_S = 8.0
"""After the first point of a motion."""
SWING_RAD = math.radians(0.5)
"""Of a dish that has stopped, 2 s later; it slews at 6 deg/s."""
Direction = Callable[[float], tuple[float, float]]


class Watched:
    """A station on the system's time, what it publishes, and the port of its rotctld server."""

    def __init__(self, live: SimpleNamespace, folder: Path) -> None:
        self.live, self.joints = live, []
        self.antenna, self.tracking, self.certificate = AntennaStatus(), TrackingStatus(), PassCertificate()
        self.site, self.begun_s = read_station("leo_3m7").site, time.time()
        self.overhead = satellite_over(self.site, self.begun_s + CULMINATES_S)
        other = dataclasses.replace(
            satellite_over(self.site, self.begun_s + 9000.0), name="OTHER", catalogue_number=91001
        )
        elements = folder / "two.tle"
        elements.write_text("".join("\n".join((one.name, *tle_lines(one))) + "\n" for one in (other, self.overhead)))
        self.port = free_port()
        live.node.create_subscription(JointState, "joint_states", self._on_joints, STREAM)
        live.node.create_subscription(AntennaStatus, "antenna_status", lambda m: setattr(self, "antenna", m), STATUS)
        live.node.create_subscription(TrackingStatus, "tracking_status", lambda m: setattr(self, "tracking", m), STREAM)
        live.node.create_subscription(PassCertificate, "pass_certificate", self._on_certificate, LATCHED)
        self.processes = live.start(
            NODES,
            "/**:\n  ros__parameters: {station: leo_3m7}\n"
            + "".join(
                f"/**/{name}:\n  ros__parameters: {{command_key_file: {folder / 'command.key'}}}\n"
                for name in ("antenna_servo", "pointing_controller")
            )
            + f"/**/ephemeris_publisher:\n  ros__parameters: {{source.elements: {elements}, source.satellite: '91001'}}\n"
            f"/**/rotctld_server:\n  ros__parameters: {{server.port: {self.port}, match.silence_s: 4.0, "
            f"command_key_file: {folder / 'command.key'}}}\n",
            autostart=True,
            # The controller is killed alone.
            processes=8,
        )
        live.spin_until(lambda: self.antenna.mode == "holding" and self._listens(), "a station that listens")

    def _listens(self) -> bool:
        try:
            with socket.create_connection(("127.0.0.1", self.port), 1.0) as client:
                client.sendall(b"p\n")
                return not _line(client).startswith("RPRT") and bool(self.joints)
        except OSError:
            return False

    def _on_certificate(self, message: PassCertificate) -> None:
        self.certificate = message

    def _on_joints(self, message: JointState) -> None:
        self.joints.append((seconds_from_stamp(message.header.stamp), *message.position))

    def log(self) -> str:
        return self.processes.log("rotctld_server").read_text()

    def rotctl(self, *words: str) -> str:
        done = subprocess.run(
            ["rotctl", "-m", "2", "-r", f"127.0.0.1:{self.port}", *words], capture_output=True, text=True, timeout=20.0
        )
        return done.stdout + done.stderr

    def spin(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.live.executor.spin_once(timeout_sec=0.02)

    def fly(self, client: socket.socket, direction: Direction, seconds: float) -> list[str]:
        """Send a point and read the position once a second, as Gpredict does; return the answers to the points."""
        answers = []
        begun_s = time.time()
        while time.time() < begun_s + seconds:
            azimuth, elevation = map(math.degrees, direction(time.time()))
            client.sendall(f"P {azimuth % 360.0:.2f} {elevation:.2f}\n".encode())
            answers.append(_line(client))
            client.sendall(b"p\n")
            read = float(_line(client)), float(_line(client))
            assert 0.0 <= read[0] < 360.0
            assert 0.0 <= read[1] <= 90.0
            self.spin(1.0 - (time.time() - begun_s) % 1.0)
        return answers

    def errors_deg(self, direction: Direction, begin_s: float, end_s: float) -> np.ndarray:
        """Return how far the axes are from the target."""
        rows = np.array([row for row in self.joints if begin_s <= row[0] <= end_s])
        truth = np.array([direction(t_s) for t_s in rows[:, 0]])
        return np.degrees(angular_distance_rad(rows[:, 1], rows[:, 2], truth[:, 0], truth[:, 1]))


def _line(client: socket.socket) -> str:
    text = b""
    while not text.endswith(b"\n"):
        data = client.recv(1)
        assert data, "the server has closed the connection"
        text += data
    return text.decode().strip()


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Watched]:
    folder = tmp_path_factory.mktemp("rotctld")
    with live_graph(folder, ros_domain) as live:
        yield Watched(live, folder)


def test_debians_rotctl_commands_reads_stops_and_parks_the_antenna(station: Watched) -> None:
    assert station.rotctl("P", "350", "45") == ""
    station.live.spin_until(lambda: abs(station.joints[-1][1] + math.radians(10.0)) < 1e-3, "azimuth -10 deg")
    station.live.spin_until(lambda: abs(station.joints[-1][2] - math.radians(45.0)) < 1e-3, "elevation 45 deg")
    station.spin(2.0)
    azimuth, elevation = map(float, station.rotctl("p").split())
    assert (azimuth, elevation) == pytest.approx((350.0, 45.0), abs=0.02)
    assert "LEO 3.7 m" in station.rotctl("_")

    # A stop in the middle of a slew: the axes rest within a second, far from the goal.
    assert station.rotctl("P", "120", "45") == ""
    station.live.spin_until(lambda: station.joints[-1][1] > 0.0, "a slew")
    before = station.joints[-1][1]
    assert station.rotctl("S") == ""
    station.spin(2.0)
    rest = station.joints[-1][1]
    station.spin(1.0)
    assert station.joints[-1][1] == pytest.approx(rest, abs=SWING_RAD)
    assert math.degrees(rest - before) < 20.0
    assert station.antenna.fault == ""

    assert station.rotctl("K") == ""
    station.live.spin_until(lambda: station.antenna.mode == "parked", "the park position")
    # What a client has parked, a client's next point releases.
    assert station.rotctl("P", "340", "50") == ""
    station.live.spin_until(lambda: abs(station.joints[-1][1] + math.radians(20.0)) < 1e-2, "azimuth -20 deg")


def test_an_unknown_track_through_north_is_followed_between_its_points_without_unwinding(station: Watched) -> None:
    middle_s = time.time() + 18.0

    def direction(t_s: float) -> tuple[float, float]:
        # A straight flight 500 km up at 7.5 km/s, 300 km north of the antenna.
        azimuth, elevation = azel_from_unit_vector([7.5 * (t_s - middle_s), 300.0, 500.0])
        return float(azimuth), float(elevation)

    begun_s = time.time()
    with socket.create_connection(("127.0.0.1", station.port), 5.0) as client:
        assert set(station.fly(client, direction, 36.0)) == {"RPRT 0"}
        ended_s = time.time()
        assert station.antenna.commander.endswith("rotctld_server")
        with socket.create_connection(("127.0.0.1", station.port), 5.0) as rival:
            rival.sendall(b"P 200 50\np\n")
            assert _line(rival) == "RPRT -9"
    azimuths = np.degrees([row[1] for row in station.joints if row[0] > begun_s + SETTLED_S])
    axes = station.errors_deg(direction, begun_s + SETTLED_S, ended_s - 1.0)
    print(f"unknown track: axes {1e3 * rms(axes):.1f} mdeg rms, {1e3 * axes.max():.1f} largest")
    assert azimuths[0] < -5.0
    assert azimuths[-1] > 15.0
    assert np.all(np.abs(azimuths) < 40.0), "no unwinding"
    assert rms(axes) < 0.03
    assert np.max(axes) < 0.1

    # A client that is gone: the motion goes on for 3 s, then the axes hold.
    station.spin(5.0)
    rest = station.joints[-1][1]
    station.spin(1.0)
    assert station.joints[-1][1] == pytest.approx(rest, abs=SWING_RAD)
    assert "holding: no further point for 3." in station.log()


def test_the_points_of_a_known_satellite_become_its_pass_and_end_with_their_client(station: Watched) -> None:
    seen = TopocentricTrack(station.overhead, station.site)
    sent = TopocentricTrack(station.overhead, station.site, refraction=None)

    def of(track: TopocentricTrack) -> Direction:
        def direction(t_s: float) -> tuple[float, float]:
            look = track.target_at(t_s)
            return look.azimuth_rad, look.elevation_rad

        return direction

    with socket.create_connection(("127.0.0.1", station.port), 5.0) as client:
        begun_s = time.time()
        answers = station.fly(client, of(sent), 8.0)
        while not (station.tracking.target and station.tracking.on_source):
            assert within(time.time() - begun_s, 45.0), station.log()
            answers += station.fly(client, of(sent), 2.0)
        matched_s = time.time()
        assert station.tracking.target == "OVERHEAD"
        print(f"on the target {matched_s - begun_s:.0f} s after the first point")
        answers += station.fly(client, of(sent), 20.0)
        ended_s = time.time()
        assert set(answers) == {"RPRT 0"}
        assert station.antenna.commander.endswith("pointing_controller")
    axes = station.errors_deg(of(seen), max(matched_s, ended_s - 19.0), ended_s - 0.5)
    print(f"known satellite: axes {1e3 * rms(axes):.1f} mdeg rms, {1e3 * axes.max():.1f} largest")
    assert station.certificate.target == "OVERHEAD"
    assert station.certificate.accepted
    assert "the points are those of OVERHEAD (91000)" in station.log()
    assert rms(axes) < 0.01

    # A controller that is killed in the pass: its points are followed until it tracks the pass again.
    with socket.create_connection(("127.0.0.1", station.port), 5.0) as client:
        os.kill(station.processes.process_id("pointing_controller"), signal.SIGKILL)
        killed_s = time.time()
        station.live.spin_until(lambda: "pointing_controller" in station.processes.ended(), "its end")
        answers = station.fly(client, of(sent), 4.0)
        assert station.antenna.commander.endswith("rotctld_server")
        # What it has sent before its end may have arrived late.
        station.tracking = TrackingStatus()
        station.processes.start(["pointing_controller"], simulated_time=False, autostart=True)
        while not (station.tracking.target == "OVERHEAD" and station.tracking.on_source):
            assert within(time.time() - killed_s, 45.0), station.log()
            answers += station.fly(client, of(sent), 2.0)
        print(f"killed controller: on the target again after {time.time() - killed_s:.0f} s")
        # The certificate may choose the other side of the zenith, so the axes may have a way to go.
        assert answers[-1] == "RPRT 0"
        assert set(answers) <= {"RPRT 0", "RPRT -9"}
    station.live.spin_until(lambda: station.tracking.target == "", "the end of a pass whose client has gone")
    assert "has been silent for" in station.log()


def test_a_client_that_waits_for_the_result_of_a_killed_controller_gets_it_as_aborted(station: Watched) -> None:
    client = ActionClient(station.live.node, TrackPass, "track_pass")
    station.live.spin_until(client.server_is_ready, "track_pass")
    sent = client.send_goal_async(TrackPass.Goal(satellite="OVERHEAD", sensor="program"))
    station.live.spin_until(sent.done, "the accepted goal")
    result = sent.result().get_result_async()
    station.live.spin_until(lambda: station.tracking.target == "OVERHEAD", "its pass")
    os.kill(station.processes.process_id("pointing_controller"), signal.SIGKILL)
    station.live.spin_until(lambda: "pointing_controller" in station.processes.ended(), "its end")
    station.processes.start(["pointing_controller"], simulated_time=False, autostart=True)
    station.tracking = TrackingStatus()
    station.live.spin_until(lambda: station.tracking.sequence > 0, "the controller again")
    back_s = time.monotonic()
    station.live.spin_until(result.done, "the result")
    found = result.result()
    assert (found.status, found.result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert found.result.message == "pointing_controller was killed in the pass; send the goal again"
    assert within(time.monotonic() - back_s, 3.0)
    client.destroy()


HOSTILE = """<iframe name=frame></iframe><script>
const body = "P 200 40\\nS\\nK\\n", tries = [];
for (const port of PORTS) {
  const address = `http://127.0.0.1:${port}/command`;
  for (const method of ["POST", "GET", "P"]) for (const mode of ["no-cors", "cors"])
    tries.push(() => fetch(address, {method, mode, body: method == "POST" ? body : undefined}));
  tries.push(() => navigator.sendBeacon(address, body));
  tries.push(() => new Promise(over => { const one = new WebSocket(`ws://127.0.0.1:${port}/live`);
    one.onclose = over; one.onopen = () => { document.title = "open"; one.send(body); }; }));
  tries.push(() => { const form = document.createElement("form"), field = document.createElement("textarea");
    Object.assign(form, {action: address, method: "post", enctype: "text/plain", target: "frame"});
    Object.assign(field, {name: "P 200 40\\r\\nS\\r\\n", value: body});
    form.append(field); document.body.append(form); form.submit(); });
}
(async () => { for (const each of tries) try { await each(); } catch {}
  setTimeout(() => document.title += "done", 1000); })();
</script>"""


@pytest.mark.skipif(not (shutil.which("chromium") and shutil.which("chromedriver")), reason="no browser")
def test_a_page_of_another_site_in_a_real_browser_moves_nothing() -> None:
    taken: list[Inquiry] = []
    server = LineServer(ServerParams(port=0), RotatorWords(StationView("x", (1.0, 2.0))), taken.append)
    page = PageServer(PageParams(port=0), "the-token-of-this-test")

    class Site(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(HOSTILE.replace("PORTS", f"[{server.port}, {page.port}]").encode())

        def log_message(self, *_: object) -> None: ...

    site = ThreadingHTTPServer(("127.0.0.1", 0), Site)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    browser = start_browser()
    try:
        browser.get(f"http://localhost:{site.server_port}/")
        begun_s = time.monotonic()
        while not browser.title.endswith("done"):
            assert within(time.monotonic() - begun_s, 30.0), browser.title
        assert browser.title == "done", "no socket was opened"
        assert (taken, page.requests.empty(), page.app.viewers) == ([], True, 0)
        # Both were reached, by each way that a page has.
        assert server.counts.ended >= 5
        assert page.app.refused >= 5
    finally:
        browser.quit()
        site.shutdown()
        site.server_close()
        page.close()
        server.close()
