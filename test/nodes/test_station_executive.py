"""The executive between its topics: what it takes from them, publishes and serves; a dead one is noticed."""

import json
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.msg import (
    AntennaStatus,
    ExecutiveStatus,
    Pass,
    PassCertificate,
    PassList,
    Schedule,
    ScheduledPass,
    TrackingStatus,
)
from rf_pointing_msgs.srv import ChangeSchedule, Named

from rf_pointing import __version__
from rf_pointing.core import JointReading, utc_text
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.operations.alarms import MOST_HISTORY, AlarmParams
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import INSTANCE, CommandKey, CommandKeyParams
from rf_pointing.ros.convert_planning import scheduled_to_message
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.directives import type_of
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.clients.night_watch import ExecutiveParams
from test.nodes.bench import NOW_S
from test.station.clients import test_night_watch

LISTED = {"p0": 600.0, "p1": 1200.0}
LIST = [scheduled_to_message(each) for each in test_night_watch.listed(*LISTED.values())]


@pytest.fixture
def make(make_bench: Callable[..., Any], tmp_path: Path) -> Callable[..., Any]:
    """Return a maker of executives that record nothing."""
    own = {"executive.folder": str(tmp_path), "executive.record": False, "station": "leo_3m7"}
    return lambda **given: make_bench(StationExecutive, namespace="/gs1", **own | given)


def known(bench: Any, attribute: str) -> tuple[Any, float]:
    """Return the newest value of an attribute and how long before now it was seen."""
    seen = bench.node.watch.night.expected_state.actual(attribute)
    return (None, 0.0) if seen is None else (seen.value, bench.t_s - seen.t_s)


def stamped(message: Any, t_s: float) -> Any:
    message.header.stamp = stamp_from_seconds(t_s)
    return message


def test_every_shipped_directive_has_an_installed_type_with_its_arguments() -> None:
    for row in read_tables(AlarmParams()).directives.values():
        if row.kind in ("service", "action"):
            kind = type_of(row.type_name)
            blank = kind.Request() if row.kind == "service" else kind.Goal()
            assert not [name for name in row.takes if not hasattr(blank, name)], row


@pytest.mark.parametrize(("rate", "moving"), [(1.1e-4, True), (-1.1e-4, True), (1e-4, False)])
def test_what_the_nodes_publish_is_known_with_its_time(make: Callable[..., Any], rate: float, moving: bool) -> None:
    bench = make().up()
    reading = JointReading(t_s=NOW_S - 1.0, position_rad=np.array([0.5, 0.7]), velocity_rad_s=np.zeros(2))
    bench.give("joint_states", convert.joints_to_message(reading))
    antenna = AntennaStatus(mode="holding", fault="f", high_wind="h", rate_command=[0.0, rate])
    bench.give("antenna_status", stamped(antenna, NOW_S - 2.0))
    bench.give("tracking_status", stamped(TrackingStatus(mode="conscan", seconds_tracked=12.5, held=True), NOW_S - 3.0))
    bench.give("pass_certificate", PassCertificate(target="bird", accepted=False, refusal="too fast"))
    bench.give("passes", PassList(target="bird", passes=[Pass(target="bird")]))
    wanted = {
        "antenna.mode": ("holding", 2.0), "antenna.fault": ("f", 2.0), "antenna.high_wind": ("h", 2.0),
        "antenna.moving": (moving, 2.0), "antenna.azimuth": (0.5, 1.0), "antenna.elevation": (0.7, 1.0),
        "tracking.mode": ("conscan", 3.0), "tracking.seconds_tracked": (12.5, 3.0), "tracking.held": (True, 3.0),
        "certificate.refusal": ("too fast", 0.0),
        "certificate.accepted": (False, 0.0), "ephemeris.target": ("bird", 0.0), "ephemeris.pass_found": (False, 0.0),
    }  # fmt: skip
    assert {name: known(bench, name) for name in wanted} == wanted


def test_the_health_of_the_nodes_of_its_namespace_and_of_no_other_is_known(make: Callable[..., Any]) -> None:
    bench = make().up()
    for node in ("/gs2/antenna_servo", "/gs1/station_executive", "/gs10/antenna_servo", "/gs1/antenna_servo"):
        assert known(bench, "drive.problem") == (None, 0.0)
        values = [KeyValue(key="azimuth_starts", value="7")]
        status = DiagnosticStatus(hardware_id=node, name="x: device", level=ERROR, message="lost", values=values)
        bench.give("/diagnostics", DiagnosticArray(status=[status]))
        bench.run(0.2)
    assert [known(bench, name)[0] for name in ("drive.problem", "relays.starts")] == ["lost", "7"]
    bench.run(4.0)
    assert known(bench, "antenna_servo.silent_s")[0] == pytest.approx(4.2)


@pytest.fixture
def shared(make: Callable[..., Any], tmp_path: Path) -> tuple[Any, Callable[..., None]]:
    """Return an executive with the passes of `LIST` whose partner is gs0, and what speaks in its name."""
    own = {"executive.partners": "gs0", "executive.partners_key_file": str(tmp_path / "partners.key")}
    bench = make(**own).up()
    bench.goal("run_schedule", RunSchedule.Goal(passes=LIST))

    def say(
        state: str = "", *, late_s: float = 0.0, key: str = "partners.key", name: str = "gs0", say: str = ""
    ) -> None:
        topic = "schedule" if state else "executive_status"
        message = Schedule(passes=[ScheduledPass(id="p0", state=state)]) if state else ExecutiveStatus(state="running")
        stamped(message, bench.t_s - late_s)
        CommandKey(CommandKeyParams(command_key_file=key and str(tmp_path / key))).sign_claim(message, topic, name)
        if say:
            message.passes[0].state = say
        bench.give(f"/gs0/{topic}", message)

    return bench, say


def test_a_partner_s_schedule_counts_while_it_shows_signs_of_life(shared: Any) -> None:
    bench, say = shared
    say("active")
    for waited_s, status, taken in ((4.8, False, {"p0"}), (0.6, False, set()), (0.2, True, {"p0"})):
        bench.run(waited_s)
        if status:
            say()
            bench.run(0.2)
        assert bench.node.watch.night.taken == taken, waited_s


@pytest.mark.parametrize(
    ("claim", "reason"),
    [
        ({"key": ""}, "not signed by gs0"),
        ({"key": "other.key"}, "not signed by gs0"),
        ({"name": "gs1"}, "not signed by gs0"),
        ({"say": "tracked"}, "not signed by gs0"),
        ({"late_s": -11.0}, "the clock of gs0 is 11.0 s ahead, must be <= 10 s"),
    ],
)
def test_a_claim_that_is_not_the_partner_s_is_refused_and_counted(shared: Any, claim: Any, reason: str) -> None:
    bench, say = shared
    say("active", **claim)
    say()
    bench.run(0.4)
    assert bench.node.watch.night.taken == set()
    assert reason in bench.health("inputs").values["last_refusal"]


def test_what_a_partner_has_said_before_is_not_said_again(shared: Any) -> None:
    bench, say = shared
    say("waiting")
    say()
    bench.run(0.4)
    assert bench.node.watch.night.taken == {"p0"}
    say("yields")
    say("waiting", late_s=0.4)
    bench.run(0.4)
    assert bench.node.watch.night.taken == set()
    assert "an older one" in bench.health("inputs").values["last_refusal"]
    bench.run(30.0)
    say("waiting")
    say(late_s=10.5)
    bench.run(0.4)
    assert bench.node.watch.night.taken == {"p0"}, "the schedule itself is a sign of life"
    assert "10.5 s old" in bench.health("inputs").values["last_refusal"]


def test_schedule_and_status_bear_the_name_of_the_antenna(make: Callable[..., Any]) -> None:
    bench = make().up()
    bench.goal("run_schedule", RunSchedule.Goal(passes=LIST))
    shown = [bench.sent[topic][-1] for topic in ("schedule", "executive_status")]
    assert {(each.antenna, each.process, each.signature) for each in shown} == {("gs1", INSTANCE, "")}
    assert {each.header.frame_id for each in shown} == {"gs1/base_link"}
    with pytest.raises(ValueError, match="must name the key that is shared with partners=gs2"):
        ExecutiveParams(partners="gs2")


def test_a_night_is_a_goal_with_feedback_and_a_result_and_its_report_is_written(
    make: Callable[..., Any], tmp_path: Path
) -> None:
    bench = make()
    assert bench.step("configure")
    assert bench.goal("run_schedule", RunSchedule.Goal(passes=LIST)) is None, "not active"
    assert bench.step("activate")
    refused = bench.goal("run_schedule", RunSchedule.Goal())
    assert (refused.end, refused.result.success) == ("aborted", False)
    assert "must name passes" in refused.result.message
    goal = bench.goal("run_schedule", RunSchedule.Goal(passes=LIST))
    assert bench.goal("run_schedule", RunSchedule.Goal(passes=LIST)) is None
    bench.run(1.2)
    # What station_alarms has reported while this executive was away, also twice.
    for event in ("raised", "cleared", "raised", "cleared"):
        utc = utc_text(NOW_S - 60.0 + 30.0 * (event == "cleared"))
        values = [KeyValue(key="event", value=event), KeyValue(key="utc", value=utc)]
        status = DiagnosticStatus(name="lost_executive", message="station_executive has been silent", values=values)
        bench.give("alarms", DiagnosticArray(status=[status]))
    for number in range(2 * MOST_HISTORY):
        bench.node.watch.night.book.note_of_another(float(number), "raised", "flood", 2, "by nobody that is known")
    assert len(bench.node.watch.night.book.history) == MOST_HISTORY
    assert (goal.feedback[-1].state, goal.feedback[-1].passes_left) == ("running", 2)
    assert goal.cancel()
    bench.run(0.4)
    assert (goal.end, goal.result.success) == ("canceled", True)
    (report,) = tmp_path.glob("report-*/night.json")
    assert goal.result.report == str(report.parent)
    night = json.loads(report.read_text())
    assert {"disk", "inputs"} <= set(night["health"])
    assert night["health"]["software"] == {
        "rf_pointing": __version__, "Python": platform.python_version(), "description": bench.node.station.digest[:12],
    }  # fmt: skip
    assert __version__ in report.with_name("night.html").read_text()
    away = [each for each in night["alarms"] if each["name"] == "lost_executive"]
    assert [each["until_t_s"] - each["raised_t_s"] for each in away] == [30.0]
    assert goal.cancel(), "it has ended meanwhile"


def test_requests_are_answered_and_the_schedule_is_published_when_it_changes(make: Callable[..., Any]) -> None:
    bench = make().up()
    bench.goal("run_schedule", RunSchedule.Goal(passes=LIST))
    rows, published = bench.sent["schedule"][-1].passes, len(bench.sent["schedule"])
    assert [(row.id, seconds_from_stamp(row.aos) - NOW_S) for row in rows] == list(LISTED.items())
    assert seconds_from_stamp(bench.sent["schedule"][-1].header.stamp) == NOW_S
    assert bench.call("~/pause").message == "pause: the executive is paused"
    assert not bench.call("~/pause").success
    assert bench.call("~/resume").success
    assert len(bench.sent["schedule"]) == published, "the schedule is the same"
    answer = bench.call("~/change_schedule", ChangeSchedule.Request(remove=["p1"]))
    assert answer.message == "0 passes added, 1 removed; 1 in all"
    assert len(bench.sent["schedule"]) == published + 1
    assert bench.call("~/skip", Named.Request(name="p0")).message == "pass p0 is skipped"
    assert "no alarm" in bench.call("~/acknowledge", Named.Request()).message
    assert not bench.call("~/acknowledge", Named.Request(name="x")).success


def test_the_status_names_the_next_pass_and_the_alarms_once_a_second(make: Callable[..., Any]) -> None:
    bench = make().up()
    bench.run(2.0, 0.1)
    assert len(bench.sent["executive_status"]) in (2, 3)
    assert (bench.sent["executive_status"][-1].state, bench.health("alarms").message) == ("idle", "none")
    bench.goal("run_schedule", RunSchedule.Goal(passes=LIST))
    night = bench.node.watch.night
    night.schedule.replan(bench.t_s, (0.0, 0.5))
    night.book.raise_("disk", 1, "full", bench.t_s - 7.0)
    night.book.raise_("wind", 2, "strong", bench.t_s)
    night.book.acknowledge("wind", bench.t_s)
    bench.node.watch.poll(bench.t_s)
    bench.run(1.0, 1.0)
    status = bench.sent["executive_status"][-1]
    assert (status.state, status.next_id, seconds_from_stamp(status.next_start)) == ("running", "p0", NOW_S + 600.0)
    assert [(each.name, each.level, each.acknowledged, each.count) for each in status.alarms] == [
        ("wind", 2, True, 0), ("disk", 1, False, 1)
    ]  # fmt: skip
    assert (bench.health("alarms").level, bench.health("night").level) == (WARN, OK)
    assert ("warning", "alarm raised: disk: full; nothing: the station deals with it") in bench.log


def test_a_silent_executive_is_an_error_unless_it_was_idle(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(PointingControllerNode).up()
    assert bench.health("executive").message == "none"
    for state, waited_s, level in (("running", 0.0, OK), ("running", 8.0, ERROR), ("idle", 99.0, OK)):
        bench.give("executive_status", ExecutiveStatus(state=state))
        bench.wait(waited_s)
        health = bench.health("executive")
        assert health.level == level
        words = f"station_executive has been silent for 8 s; it was {state}" if level == ERROR else state
        assert health.message == words
