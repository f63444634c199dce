"""Every node started alone, as `ros2 run` does: it says what it waits for, and SIGINT ends it."""

import os
import signal
import subprocess
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest

from test.graph.conftest import STATION_NODES, executable

pytestmark = pytest.mark.graph
ALONE = sorted(
    each.name
    for each in entry_points(group="rf_pointing.executables")
    if ".nodes." in each.value and each.name != "station_process"
)
TARGET = {"source.satellite": "Moon"}
OWN: dict[str, dict[str, Any]] = {
    "array_receiver": {"station": "rotator_2m"}, "array_tracker": {"station": "rotator_2m"},
    "ephemeris_publisher": TARGET, "operator_page": {"page.port": 0}, "rf_receiver": TARGET,
    "rotctld_server": {"server.port": 0}, "tripulse_receiver": {"station.name": "wallops"},
}  # fmt: skip
ROOMS = 5
"""Parts in which they are started, so that the machine keeps up."""
BY_ITSELF = ("operator_page",)
"""Nodes that need no manager."""


@pytest.mark.parametrize("names", [ALONE[first::ROOMS] for first in range(ROOMS)], ids=lambda names: names[0])
@pytest.mark.parametrize("autostart", [False, True], ids=["unconfigured", "autostart"])
def test_a_node_alone_says_what_it_does_and_ends_with_0(
    names: list[str], autostart: bool, live: Any, tmp_path: Path
) -> None:
    folder, running = tmp_path / "home", {}
    folder.mkdir()
    for name in names:
        given = ({"station": "dss13"} if name in STATION_NODES else {}) | OWN.get(name, {})
        given |= {"lifecycle.autostart": "true"} if autostart else {}
        words = [word for item in given.items() for word in ("-p", "{}:={}".format(*item))]
        with (folder / name).open("wb") as log:
            running[name] = subprocess.Popen(
                [executable(name), "--ros-args", "-r", f"__ns:={live.namespace}/{name}", *words],
                stdout=log, stderr=subprocess.STDOUT, cwd=folder, env=os.environ | {"HOME": str(folder)},
            )  # fmt: skip

    def said(name: str) -> str:
        return (folder / name).read_text(errors="replace")

    def expected(name: str) -> str:
        itself = autostart or name in BY_ITSELF
        if autostart and name == "radio_control":
            return "has no section radio"
        if autostart and name == "signal_receiver":
            return "needs no signal_receiver"
        return ": active" if itself else f"waits for `ros2 lifecycle set {live.namespace}/{name}/"

    try:
        live.spin_until(
            lambda: all(expected(name) in said(name) or each.poll() is not None for name, each in running.items()),
            "every node has said something",
        )
        for each in running.values():
            each.send_signal(signal.SIGINT)
        codes = {name: each.wait(60.0) for name, each in running.items()}
    finally:
        for each in running.values():
            each.kill()
            each.wait()
    wrong = {name: (code, said(name)) for name, code in codes.items() if code or expected(name) not in said(name)}
    assert wrong == {}
    assert not [name for name in names if "Traceback" in said(name)]
