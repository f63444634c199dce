"""`track --designate` in real time: SBS text of an aircraft leads Debian's rotctld to it."""

import math
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rf_pointing.ephemeris import Site
from rf_pointing.station.description import read_station
from test.drives.rotctld import RealRotctld
from test.graph.conftest import start_track
from test.graph.real_station import write_station

pytestmark = [pytest.mark.graph, pytest.mark.alone]

SPEED_M_S, NORTH_M, HEIGHT_M, DEGREE_M = 220.0, 30e3, 10e3, 111.2e3
ICAO24 = "3C6444"


class Aircraft:
    """A receiver of SBS on a port of its own: an aircraft flies by in the north, to the east."""

    def __init__(self, site: Site) -> None:
        self._site, self._begun_s = site, time.time()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._ended = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def azimuth_rad(self) -> float:
        return math.atan2(SPEED_M_S * (time.time() - self._begun_s), NORTH_M)

    def _serve(self) -> None:
        while not self._ended.is_set():
            connection, _ = self._server.accept()
            with connection:
                try:
                    while not self._ended.wait(1.0):
                        connection.sendall(self._lines().encode())
                except OSError:
                    continue

    def _lines(self) -> str:
        east_m = SPEED_M_S * (time.time() - self._begun_s)
        latitude = math.degrees(self._site.latitude_rad) + NORTH_M / DEGREE_M
        longitude = math.degrees(self._site.longitude_rad) + east_m / DEGREE_M / math.cos(math.radians(latitude))
        height = f"{(HEIGHT_M + self._site.altitude_m) / 0.3048:.0f}"
        return (
            f"MSG,4,1,1,{ICAO24},1,,,,,,,428,90.0,,,0,,,,,\r\nMSG,8,1,1,ABCDEF,1,,,,,,,,,,,,,,,,0\r\n"
            f"MSG,3,1,1,{ICAO24},1,,,,,,{height},,,{latitude:.6f},{longitude:.6f},,,0,0,0,0\r\n"
        )

    def end(self) -> None:
        self._ended.set()
        self._server.close()


@pytest.fixture
def rotctld() -> Iterator[RealRotctld]:
    server = RealRotctld()
    yield server
    server.kill()


def test_an_aircraft_leads_a_real_rotctld(
    rotctld: RealRotctld, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    station = write_station(tmp_path, rotctld.port)
    aircraft = Aircraft(read_station(station).site)
    rotctld.go(10.0, 18.0)
    said, apart_rad = [], math.inf
    with start_track(
        "--station", str(station), "--designate", f"adsb:127.0.0.1:{aircraft.port}/{ICAO24}", "--sensor", "program",
        "--namespace", f"/led{rotctld.port}", "--output", str(tmp_path / "run"),
    ) as track:  # fmt: skip
        assert track.stderr is not None
        for line in track.stderr:
            said.append(line)
            if "program_track" in line and "on source" in line and apart_rad == math.inf:
                azimuth_rad = math.radians(rotctld.position()[0])
                apart_rad = math.remainder(azimuth_rad - aircraft.azimuth_rad(), math.tau)
                track.send_signal(signal.SIGINT)
    aircraft.end()
    text = "".join(said)
    assert "certificate of designated 3C6444" in text, text
    # The rotator steps in degrees; the pass was held until it was cancelled.
    assert abs(math.degrees(apart_rad)) < 2.0, text
    assert "the goal was cancelled" in text, text
