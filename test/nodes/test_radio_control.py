"""radio_control between its topics, a real rigctld of Debian, and two clients, in wall time."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs.msg import AntennaStatus, TrackingStatus

from rf_pointing.core import SPEED_OF_LIGHT_M_S, JointReading
from rf_pointing.nodes.radio_control import RadioControlNode
from rf_pointing.ros import convert
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station
from test.conftest import within
from test.drives.rotctld import RealRigctld
from test.station.radio.targets import target

EXAMPLE = Path(__file__).parents[2] / "examples" / "transponder_radio.yaml"
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


@pytest.fixture
def rigs() -> Iterator[tuple[RealRigctld, RealRigctld]]:
    both = RealRigctld(), RealRigctld()
    yield both
    for each in both:
        each.hang(hangs=False)
        each.kill()


class Radio:
    """The node, and a station that tracks RS-44 well."""

    def __init__(self, make_bench: Callable[..., Any], file: Path, rigs: tuple[RealRigctld, RealRigctld]) -> None:
        ports = {"radio.receive.port": rigs[0].port, "radio.transmit.port": rigs[1].port}
        read_station(EXAMPLE).write(file, ports)
        self.inhibit, self.begun_s = "", time.time()
        self.bench = make_bench(
            RadioControlNode, real_time=True, station=str(file),
            **{"server.port": 0, "server.most_refused": 5},
        ).up()  # fmt: skip
        self.port = int(self.bench.health("clients").values["port"])

    def range_rate(self, t_s: float) -> float:
        """A pass: 20 m/s^2 towards the closest approach."""
        return -5000.0 + 20.0 * (t_s - self.begun_s)

    def give(self) -> None:
        t_s = time.time()
        at_s = round(t_s, 1) + 2.0
        one = target(at_s, rate_m_s=self.range_rate(at_s))
        self.bench.give("target", convert.target_to_message(one))
        place = np.array([4.0, 0.9])
        reading = JointReading(t_s=t_s, position_rad=place, velocity_rad_s=np.zeros(2))
        self.bench.give("joint_states", convert.joints_to_message(reading))
        stamp = stamp_from_seconds(t_s)
        antenna = AntennaStatus(mode="tracking", transmit_inhibit=self.inhibit)
        antenna.header.stamp = stamp
        self.bench.give("antenna_status", antenna)
        tracking = TrackingStatus(mode="program_track", target="RS-44", beamwidth=0.5)
        tracking.header.stamp = stamp
        self.bench.give("tracking_status", tracking)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Run in wall time; return the time until the condition held."""
        begun_s, given_s = time.monotonic(), -1.0
        while time.monotonic() - begun_s < seconds and not until():
            if time.monotonic() - given_s >= 0.1:
                given_s = time.monotonic()
                self.give()
            self.bench.run(0.02, 0.02)
        return time.monotonic() - begun_s

    def ask(self, line: str) -> str:
        """Send a line as a client while the node runs, and return the answer."""
        found: list[str] = []

        def talk() -> None:
            with socket.create_connection(("127.0.0.1", self.port), 2.0) as client:
                client.sendall(f"{line}\n".encode())
                found.append(client.recv(200).decode().strip())

        thread = threading.Thread(target=talk)
        thread.start()
        self.run(5.0, lambda: not thread.is_alive())
        thread.join()
        return found[0]

    def error_hz(self, rig: RealRigctld) -> float:
        """Return how far the receiver is from what the range rate says."""
        due = 435.640e6 * (1.0 - self.range_rate(time.time()) / SPEED_OF_LIGHT_M_S)
        return abs(float(rig.ask("f")) - due)

    @property
    def published(self) -> str:
        return str(self.bench.sent["radio/inhibit"][-1].data) if self.bench.sent["radio/inhibit"] else "not yet"


def test_the_radio_follows_real_rigs_that_are_killed_stalled_and_cut_off_and_its_key_obeys(
    make_bench: Callable[..., Any], tmp_path: Path, rigs: tuple[RealRigctld, RealRigctld]
) -> None:
    receiver, transmitter = rigs
    radio = Radio(make_bench, tmp_path / "radio.yaml", rigs)
    radio.run(6.0, lambda: radio.published == "" and receiver.ask("f") != "145000000")
    assert radio.published == ""
    radio.run(1.0)
    # 29 Hz/s, an update in 42 ms that the dummy takes, and the time to read it.
    assert radio.error_hz(receiver) < 10.0
    assert float(transmitter.ask("f")) == pytest.approx(145.965e6 * (1.0 - 1.65e-5), abs=300.0)

    # Two clients: one reads, one keys.
    assert radio.ask("F 435655000") == "RPRT 0"
    radio.run(0.3)
    assert float(receiver.ask("f")) == pytest.approx(435.655e6, abs=30.0)
    assert abs(float(radio.ask("f")) - float(receiver.ask("f"))) < 10.0
    assert radio.ask("F 435800000") == "RPRT -1"
    assert radio.ask("POST / HTTP/1.1") == "RPRT -1"
    assert radio.ask("T 1") == "RPRT 0"
    assert transmitter.ask("t") == "1"

    # The antenna leaves the sky that may be sent to: off within 100 ms, and the key is refused.
    radio.inhibit, forbidden_s = "the antenna is stopping", time.monotonic()
    radio.give()
    radio.bench.run(0.02, 0.02)
    assert radio.published == "the antenna is stopping"
    off = [] if transmitter.ask("t") == "1" else [time.monotonic()]
    while not off and time.monotonic() - forbidden_s < 3.0:
        radio.bench.run(0.01, 0.01)
        off = [time.monotonic()] if transmitter.ask("t") == "0" else []
    assert within(off[0] - forbidden_s, 0.1)
    asked_s = time.monotonic()
    assert radio.ask("T 1") == "RPRT -9"
    assert within(time.monotonic() - asked_s, 0.1)
    assert transmitter.ask("t") == "0"
    # Somebody keys it at its front.
    assert transmitter.ask("T 1") == "RPRT 0"
    radio.run(1.0, lambda: transmitter.ask("t") == "0")
    assert transmitter.ask("t") == "0"
    radio.inhibit = ""
    radio.run(0.3)
    assert radio.published == ""

    # Killed and restarted.
    transmitter.kill()
    radio.run(3.0, lambda: radio.published != "")
    assert f"rigctld at localhost:{transmitter.port}" in radio.published
    assert radio.bench.health("transmitter").level == ERROR
    assert radio.ask("T 1") == "RPRT -9"
    transmitter.start()
    assert radio.run(8.0, lambda: radio.published == "") < 8.0
    radio.run(0.5)
    assert float(transmitter.ask("f")) == pytest.approx(145.965e6, abs=2e4)

    # Stalled: it is named within 2 s, and followed again afterwards.
    receiver.hang(hangs=True)
    assert radio.run(4.0, lambda: radio.bench.health("receiver").level == ERROR) < 2.0
    assert "no answer to" in radio.bench.health("receiver").message
    receiver.hang(hangs=False)
    assert radio.run(12.0, lambda: radio.bench.health("receiver").level == OK) < 12.0
    radio.run(0.5)
    assert radio.bench.health("receiver").message == "follows RS-44"
    assert float(receiver.ask("f")) == pytest.approx(435.655e6, abs=1e4)

    # At the end the key is up, whatever it was.
    assert radio.ask("T 1") == "RPRT 0"
    assert radio.bench.step("deactivate")
    assert radio.published == "radio_control is not active"
    time.sleep(0.2)
    assert transmitter.ask("t") == "0"


def test_a_cut_cable_is_named_and_the_rig_is_found_again(
    make_bench: Callable[..., Any], tmp_path: Path, rigs: tuple[RealRigctld, RealRigctld]
) -> None:
    """A port that takes bytes and never answers, as behind a converter whose cable is out; then the rig is there."""
    radio = Radio(make_bench, tmp_path / "radio.yaml", rigs)
    rigs[0].kill()
    with socket.create_server(("127.0.0.1", rigs[0].port)):
        radio.run(8.0, lambda: "no answer to" in radio.bench.health("receiver").message)
        assert "no answer to" in radio.bench.health("receiver").message
        assert radio.bench.health("receiver").level == ERROR
    rigs[0].start()
    assert radio.run(12.0, lambda: radio.bench.health("receiver").level == OK) < 12.0


def test_a_station_without_a_radio_is_told_where_to_read(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(RadioControlNode, station="leo_3m7")
    assert not bench.step("configure")
    assert "has no section radio (docs/own_radio.md)" in bench.health("state").message
