"""A small night on the live graph: two passes, an executive that is killed in the first one, the morning report."""

import itertools
import json
import math
import os
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import rf_pointing as rp

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, PassCertificate, Schedule, StationInUse, TrackingStatus
from rosgraph_msgs.msg import Clock

from rf_pointing.commands import station
from rf_pointing.operations.pass_list import to_json
from rf_pointing.ros.graph import NODES, STATION_IN_USE
from rf_pointing.ros.qos import IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from test.conftest import within
from test.faults.test_restarts import PACING, Stopwatch
from test.simulation.night_plan import small_night

from .conftest import executable, live_graph

# Minutes of simulated time go no faster than a busy machine lets them.
pytestmark = [pytest.mark.graph, pytest.mark.timeout(600)]

SPEED = 8.0
EVERY = (*NODES, "station_executive")


class LiveNight:
    """A whole simulated station with its executive, and what it publishes."""

    def __init__(
        self, live: SimpleNamespace, folder: Path, nodes: tuple[str, ...] = EVERY,
        speed: float = SPEED, more: str = "", lead_s: float = 90.0,
    ) -> None:  # fmt: skip
        self.live, self.folder, self.now_s = live, folder, 0.0
        self.schedule, self.status, self.lost = Schedule(), ExecutiveStatus(), {}
        self.tracking, self.antenna, self.statuses = TrackingStatus(), AntennaStatus(), 0
        self.in_use: dict[str, list[str]] = {}
        self.healths: dict[str, tuple[int, str]] = {}
        off_axis = {"bands.S.feed_offset.cross_elevation_deg": 0.9, "bands.S.feed_offset.elevation_deg": -0.6}
        changes = {"tuning.alarms.disk_free_gb": 0.001, **off_axis}
        _, elements, self.passes = small_night(folder, ("S", ""), **changes)
        source = f"{{source.elements: {elements}, source.satellite: '90001'}}"
        start_s = math.floor(self.passes[0].aos_t_s) - lead_s
        of_station = "".join(
            f"/**/{name}:\n  ros__parameters:\n    station: {folder / 'station.yaml'}\n"
            for name in EVERY
            if name != "simulation_clock"
        )
        self.yaml = of_station + (
            f"/**/simulation_clock:\n  ros__parameters: {{start_s: {start_s}, speed: {speed}, tick_s: 0.1}}\n"
            f"/**/ephemeris_publisher:\n  ros__parameters: {source}\n/**/rf_receiver:\n  ros__parameters: {source}\n"
        )
        own = folder / "executive.yaml"
        own.write_text(
            "/**/station_executive:\n  ros__parameters:\n"
            f"    executive: {{folder: {folder / 'night'}, state_file: {folder / 'state.json'}}}\n"
        )
        node = live.node
        node.create_subscription(Schedule, "schedule", lambda m: setattr(self, "schedule", m), LATCHED)
        node.create_subscription(ExecutiveStatus, "executive_status", self._on_status, STATUS)
        node.create_subscription(TrackingStatus, "tracking_status", lambda m: setattr(self, "tracking", m), STREAM)
        node.create_subscription(AntennaStatus, "antenna_status", lambda m: setattr(self, "antenna", m), STREAM)
        node.create_subscription(Clock, "clock", lambda m: setattr(self, "now_s", seconds_from_stamp(m.clock)), STREAM)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, STREAM)
        self.certified: list[str] = []
        certified = lambda m: self.certified.append(m.band)  # noqa: E731
        node.create_subscription(PassCertificate, "pass_certificate", certified, LATCHED)
        node.create_subscription(StationInUse, STATION_IN_USE, self._on_station, IN_USE)
        self.processes = live.start([*nodes], self.yaml + own.read_text() + more, autostart=True, simulated=True)
        self.client = ActionClient(node, RunSchedule, "run_schedule")

    def _on_status(self, message: ExecutiveStatus) -> None:
        self.status, self.statuses = message, self.statuses + 1

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.healths[status.name.partition("/")[2]] = int.from_bytes(status.level, "little"), status.message
            if status.name.endswith(": inputs"):
                self.lost[status.name] = sum(int(pair.value) for pair in status.values if pair.key.startswith("lost "))

    def _on_station(self, message: StationInUse) -> None:
        self.in_use.setdefault(message.node.rpartition("/")[2], []).append(message.band)

    def start(self) -> None:
        self.live.spin_until(self.client.server_is_ready, "run_schedule")
        self.live.spin_until(lambda: self.antenna.mode != "" and self.tracking.sequence > 0, "the station")
        listed = self.folder / "passes.json"
        listed.write_text(to_json(self.passes))
        self.operator = subprocess.Popen(
            [executable("station"), "--namespace", self.live.namespace, "queue", str(listed), "--start"],
            stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def states(self) -> dict[str, str]:
        return {each.id: each.state for each in self.schedule.passes}


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Any:
    """A night whose executive is killed in the first pass and started again."""
    folder = tmp_path_factory.mktemp("night")
    with live_graph(folder, ros_domain) as live:
        one = LiveNight(live, folder)
        began_s = time.monotonic()
        one.start()
        live.spin_until(lambda: one.tracking.held and one.tracking.seconds_tracked > 10.0, "a held target")
        one.before = one.status
        os.kill(one.processes.process_id("station_executive"), signal.SIGKILL)
        live.spin_until(lambda: "station_executive" in one.processes.ended(), "its end")
        one.kept = json.loads((folder / "state.json").read_text())
        one.tracked_before_s = one.tracking.seconds_tracked
        silent_s = time.monotonic() + 7.0
        one.noticed = 0, ""
        while one.noticed[0] < 2 and time.monotonic() < silent_s:
            live.executor.spin_once(timeout_sec=0.1)
            one.noticed = one.healths.get("pointing_controller: executive", (0, ""))
        one.statuses = 0
        one.processes.start(["station_executive"], autostart=True)
        watch = Stopwatch(*(one.processes.process_id(name) for name in {"station_executive", *PACING}))
        live.spin_until(lambda: watch.look() >= 0.0 and one.statuses > 0, "the executive")
        one.back_s, one.after = watch.net_s, one.status
        one.commander_modes = one.tracking.mode
        began_s = time.monotonic()
        while one.status.state != "idle" and within(time.monotonic() - began_s, 240.0):
            live.executor.spin_once(timeout_sec=0.1)
        assert one.status.state == "idle", one.status.reason
        one.wall_s = time.monotonic() - began_s
        try:
            one.said = one.operator.communicate(timeout=60.0)[1]
            one.codes = {words: station_exit([*("--namespace", live.namespace), *words.split()]) for words in COMMANDS}
            live.spin_until(lambda: math.degrees(one.antenna.commanded[1]) < 61.0, "the antenna at 60 deg")
        finally:
            one.operator.kill()
        yield one


COMMANDS = ("status", "passes --json", "log -n 5", "release", "go 20 60", "offset --along 0.2", "go 900 60", "night pause",
            "night ack nothing", "--namespace /nobody status")  # fmt: skip


def station_exit(words: list[str]) -> int:
    with pytest.raises(SystemExit) as ended:
        station.main(words)
    return int(ended.value.code or 0)


def test_the_operator_is_told_the_end_by_an_executive_that_was_started_again(night: LiveNight) -> None:
    assert night.operator.returncode == 0, night.said
    assert "2 tracked, 0 not" in night.said


def test_commands_of_the_client_have_the_exit_codes_that_scripts_need(night: LiveNight) -> None:
    refused = {"go 900 60": 1, "night pause": 1, "night ack nothing": 1, "--namespace /nobody status": 2}
    assert night.codes == dict.fromkeys(COMMANDS, 0) | refused


def test_both_passes_are_tracked_although_the_executive_was_killed(night: LiveNight) -> None:
    assert night.states() == {"90001": "tracked", "90002": "tracked"}, [each.reason for each in night.schedule.passes]
    assert within(night.wall_s, 90.0), f"{night.wall_s:.0f} s"


def test_killed_executive_is_back_within_3_s_where_it_was(night: LiveNight) -> None:
    assert night.before.pass_id == night.after.pass_id == "90001"
    assert night.kept["attempt"]["id"] == "90001"
    assert night.after.state == "running"
    assert night.back_s < 3.0


def test_a_dead_executive_is_noticed_by_the_controller(night: LiveNight) -> None:
    level, words = night.noticed
    assert level == 2
    assert "station_executive has been silent" in words


def test_each_pass_is_flown_and_recorded_in_its_band_and_no_node_is_restarted_for_it(night: LiveNight) -> None:
    # The first is in the band of the feed that is off the axis; the executive came back in it.
    # What is latched may be offered twice.
    bands = {name: "".join(band for band, _ in itertools.groupby(seen)) for name, seen in night.in_use.items()}
    followed = dict.fromkeys(set(NODES) - {"simulation_clock"}, "XSX")
    assert bands == followed | {"station_executive": "XSXSX"}
    for name, band in (("90001", "S"), ("90002", "X")):
        bag = max((night.folder / "night" / "passes" / name).glob("bag*"))
        assert rp.Recording(bag).notes["band"] == band
    assert [band for band, _ in itertools.groupby(night.certified)] == ["S", "X"]


def test_no_message_was_lost_and_the_morning_report_is_there(night: LiveNight) -> None:
    assert sum(night.lost.values()) == 0, night.lost
    (page,) = night.folder.glob("night/report-*/night.json")
    report = json.loads(page.read_text())
    assert [(each["id"], each["state"], each["recorded"]) for each in report["passes"]] == [
        ("90001", "tracked", True), ("90002", "tracked", True)
    ]  # fmt: skip
    assert [each["band"] for each in report["passes"]] == ["S", "X"]
    assert report["held_share"] > 0.7
    assert (page.with_name("night.html")).stat().st_size > 3000


def test_the_journal_has_every_directive_and_each_pass_was_started_once(night: LiveNight) -> None:
    rows = [json.loads(line) for line in (night.folder / "night" / "journal.jsonl").read_text().splitlines()]
    sent = [row["directive"] for row in rows if row["event"] == "sent"]
    assert sent.count("track") == 2
    assert {"select_target", "record"} <= set(sent)
    assert [row["event"] for row in rows].count("restored") >= 1
