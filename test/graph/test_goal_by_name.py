"""track_pass by name and time on a live controller and ephemeris publisher, with a user's own TLE."""

import dataclasses
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassList

from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import Pass as Window
from rf_pointing.ephemeris import find_elements, passes_with_present, tle_lines, verification_elements
from rf_pointing.ephemeris.source import load_track
from rf_pointing.ros.qos import LATCHED
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.description import read_station
from test.conftest import within

from .conftest import live_graph

pytestmark = pytest.mark.graph
CANCELED, ABORTED = 5, 6
NODES = ["antenna_servo", "ephemeris_publisher", "pointing_controller"]
DAY_S = 86400.0
ROOT = Path(__file__).parents[2]


class Station:
    """Live nodes in real time, and elements of which the first object never rises."""

    def __init__(self, live: SimpleNamespace, folder: Path, nodes: list[str]) -> None:
        self.live, self.passes, self.feedback = live, PassList(), list[Any]()
        polar = find_elements(verification_elements(), "28057")
        now_s = time.time()
        mine = dataclasses.replace(polar, name="MYSAT 1", catalogue_number=90001, epoch_t_s=now_s - 3600.0)
        equator = dataclasses.replace(mine, name="EQUATOR", catalogue_number=90002, inclination_rad=0.0)
        self.file = folder / "my.tle"
        self.file.write_text("".join(f"{one.name}\n" + "\n".join(tle_lines(one)) + "\n" for one in (equator, mine)))
        live.node.create_subscription(PassList, "passes", lambda m: setattr(self, "passes", m), LATCHED)
        source = {"source.elements": str(self.file), "source.satellite": ""}
        self.parameters = yaml.safe_dump({"/**/ephemeris_publisher": {"ros__parameters": source}})
        live.start(nodes, self.parameters)
        self.client = ActionClient(live.node, TrackPass, "track_pass")
        live.spin_until(self.client.server_is_ready, "track_pass")

    def windows(self, start_s: float) -> list[Window]:
        """Return the passes of MYSAT 1 in a day, as the publisher must find them."""
        sets = read_station("dss13").sets("ephemeris_publisher")
        source = sets["source"].replace(elements=str(self.file), satellite="MYSAT 1")
        mask = sets["mask"].above(sets["publisher"].mask_rad)
        return passes_with_present(load_track(source), start_s, DAY_S, mask)

    def send(self, **fields: Any) -> Any:
        self.feedback.clear()
        sent = self.client.send_goal_async(TrackPass.Goal(**fields), feedback_callback=self.feedback.append)
        self.live.spin_until(sent.done, "an answer")
        assert sent.result().accepted
        return sent.result()

    def result(self, handle: Any) -> Any:
        future = handle.get_result_async()
        self.live.spin_until(future.done, "the result")
        return future.result()

    def refusal(self, **fields: Any) -> str:
        """Return why the goal is refused; the antenna has not moved."""
        answer = self.result(self.send(**fields))
        assert answer.status == ABORTED
        assert not answer.result.success
        return str(answer.result.message)


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Station]:
    """A publisher whose first object has no pass is active all the same: another one can be selected."""
    folder = tmp_path_factory.mktemp("by_name")
    with live_graph(folder, ros_domain) as live:
        yield Station(live, folder, NODES)


def test_the_next_pass_of_a_satellite_is_tracked_and_cancelled_by_name(station: Station) -> None:
    handle = station.send(satellite="mysat 1", sensor="program")
    expected = station.windows(time.time())[0]
    station.live.spin_until(lambda: bool(station.feedback), "feedback")
    window = station.feedback[0].feedback.target_pass
    assert window.target == "MYSAT 1"
    assert seconds_from_stamp(window.aos) == pytest.approx(expected.aos_t_s, abs=0.1)
    assert seconds_from_stamp(station.feedback[0].feedback.status.los) == pytest.approx(expected.los_t_s, abs=0.1)
    assert station.passes.passes[0] == window
    handle.cancel_goal_async()
    answer = station.result(handle)
    assert (answer.status, answer.result.message) == (CANCELED, "the goal was cancelled")
    assert answer.result.target_pass == window


def test_a_goal_waits_for_an_ephemeris_that_is_started_after_it(tmp_path: Path, ros_domain: int) -> None:
    with live_graph(tmp_path, ros_domain) as live:
        station = Station(live, tmp_path, ["antenna_servo", "pointing_controller"])
        handle = station.send(satellite="MYSAT 1", sensor="program")
        live.start(["ephemeris_publisher"], station.parameters)
        live.spin_until(lambda: bool(station.feedback), "feedback")
        assert station.feedback[0].feedback.target_pass.target == "MYSAT 1"
        handle.cancel_goal_async()
        assert station.result(handle).result.message == "the goal was cancelled"


def test_a_time_without_a_pass_is_refused_with_the_next_one(station: Station) -> None:
    windows = station.windows(time.time())
    gaps = [(b.aos_t_s - a.los_t_s, a.los_t_s, b.aos_t_s) for a, b in pairwise(windows)]
    gap_s, los_s, aos_s = max(gaps)
    assert gap_s > 3.0 * 3600.0
    near_s = 0.5 * (los_s + aos_s)
    message = station.refusal(satellite="MYSAT 1", near=stamp_from_seconds(near_s))
    assert message == (
        f"MYSAT 1 has no pass within 60 min of {utc_text(near_s)}; the next one begins at "
        f"{utc_text(seconds_from_stamp(station.passes.passes[0].aos))}"
    )


def test_the_python_example_reports_what_went_wrong_and_stops_on_ctrl_c(station: Station) -> None:
    command = [sys.executable, str(ROOT / "examples" / "fly_a_pass.py"), station.live.namespace]

    def fly(satellite: str) -> "subprocess.Popen[str]":
        return subprocess.Popen([*command, satellite], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    wrong = fly("MYSAT 2")
    station.live.spin_until(lambda: wrong.poll() is not None, "the end of the example")
    assert (wrong.returncode, "did you mean MYSAT 1" in wrong.communicate()[0]) == (1, True)
    right, begun_s = fly("MYSAT 1"), time.time()
    try:
        assert right.stdout is not None
        assert "slew" in right.stdout.readline()
        right.send_signal(signal.SIGINT)
        station.live.spin_until(lambda: right.poll() is not None, "the end of the example")
    finally:
        right.kill()
    assert right.returncode == 1
    assert "MYSAT 1: the goal was cancelled; 0 s held" in right.communicate()[0]
    assert within(time.time() - begun_s, 30.0)
