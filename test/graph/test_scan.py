"""A scan of the Moon on a live graph, commanded by `station scan`; the Sun is refused with its angle."""

import json
import math
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")

from rf_pointing.core.dates import parse_utc
from rf_pointing.station.description import read_station

from .conftest import executable, live_graph

pytestmark = pytest.mark.graph
NODES = ["simulation_clock", "antenna_servo", "rf_receiver", "ephemeris_publisher", "pointing_controller"]
START_S = parse_utc("2026-06-21T16:00:00")
"""Moon and Sun both stand above 40 deg over Stuttgart."""
SPEED = 20.0
PLAY_DEG = 0.03


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[SimpleNamespace]:
    folder = tmp_path_factory.mktemp("scan")
    with live_graph(folder, ros_domain) as live:
        place = folder / "leo.yaml"
        read_station("leo_3m7").write(place, {"tuning.signal.receiver.noise_bandwidth_hz": 2.4e6})
        own = {name: {"station": str(place), "band": "S"} for name in NODES[1:]}
        for name in ("rf_receiver", "ephemeris_publisher"):
            own[name]["source.satellite"] = "Moon"
        own["simulation_clock"] = {"start_s": START_S, "speed": SPEED, "tick_s": 0.1}
        live.start(
            NODES[1:] + NODES[:1], simulated=True,
            parameters=yaml.safe_dump({f"/**/{name}": {"ros__parameters": values} for name, values in own.items()}),
        )  # fmt: skip
        live.folder, live.domain = folder, ros_domain
        yield live


def operate(station: SimpleNamespace, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run `station` while the graph goes on."""
    process = subprocess.Popen(
        [executable("station"), "--namespace", station.namespace, *words], text=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"ROS_DOMAIN_ID": str(station.domain)},
    )  # fmt: skip
    try:
        out, err = process.communicate(timeout=240.0)
    finally:
        process.kill()
    return subprocess.CompletedProcess(words, process.returncode, out, err)


def test_the_sun_is_refused_with_its_angle_and_nothing_moves(station: SimpleNamespace) -> None:
    done = operate(station, "scan", "Sun")
    assert done.returncode == 1
    assert "from the Sun, must be >=" in done.stderr


def test_the_moon_gives_the_errors_of_the_mount_and_the_noise_of_the_station(station: SimpleNamespace) -> None:
    output: Path = station.folder / "scans"
    done = operate(
        station, "scan", "Moon", "--repetitions", "1", "--rate", "0.9", "--output", str(output), "--table",
        str(output / "offsets.csv"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "the scan is complete" in done.stderr
    found = json.loads(next(output.glob("Moon-*.json")).read_text())
    mount = read_station("leo_3m7").sets("antenna_servo", "S")["mount"].model()
    place = np.radians([[found["azimuth_deg"]], [found["elevation_deg"]]])
    still = np.zeros((4, 1))
    needed = np.degrees(mount.offset_rad(*place, *still))[:, 0]
    row = (output / "offsets.csv").read_text().splitlines()[1].split(",")
    off = (np.array(row[2:4], dtype=float) - needed) * [math.cos(place[1, 0]), 1.0]
    assert np.abs(off).max() < PLAY_DEG + 4.0 * float(row[4])
    assert found["system_noise_k"] == pytest.approx(150.0, rel=0.15)
