"""The node of the operator's page: what it can send, what it refuses to start with, and any message that it may receive."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import (
    AntennaStatus,
    ExecutiveStatus,
    Pass,
    PassList,
    PassProfile,
    PassProfileList,
    Schedule,
    ScheduledPass,
    StationInUse,
    Target,
    TrackingStatus,
)

from rf_pointing.core.dates import utc_text
from rf_pointing.nodes import operator_page
from rf_pointing.nodes.operator_page import OperatorPage, checked_arguments, command_rows
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.directives import type_of
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station
from rf_pointing.web.page_server import shown
from test.nodes.test_hostile_messages import SILENT, fill, mutated, spoil

PAYLOADS = 10_000
SHOWN_EVERY = 50
START = "from rf_pointing.nodes.operator_page import main; main()"


def test_every_command_has_an_installed_type_with_its_arguments() -> None:
    for row in command_rows().values():
        if row.kind in ("service", "action"):
            kind = type_of(row.type_name)
            blank = kind.Request() if row.kind == "service" else kind.Goal()
            assert not [name for name in row.takes if not hasattr(blank, name)], row


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("park", {"speed": 1.0}, "park has no argument 'speed'; it takes none"),
        ("track", {"target_pass": {}}, "track has no argument 'target_pass'; it takes aos_utc, sensor"),
        ("night_skip", {"name": "x" * 201}, "name has 201 characters, must be <= 200"),
        ("set_cross_track", {"value": True}, "value=True must be a number"),
        ("set_cross_track", {"value": float("inf")}, "value=inf must be finite"),
    ],
)
def test_arguments_that_a_command_does_not_take_are_refused(name: str, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        checked_arguments(command_rows()[name], arguments)


def test_a_whole_number_is_an_offset_as_well() -> None:
    (value,) = checked_arguments(command_rows()["set_along_track"], {"value": 1}).values()
    assert (value, type(value)) == (1.0, float)


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("page.address:=0.0.0.0", "address=0.0.0.0 can be reached by other computers: token_file='' must name"),
        ("page.port:=70000", "page.port"),
    ],
)
def test_a_page_that_would_be_open_does_not_start(parameter: str, words: str, ros_domain: int) -> None:
    found = subprocess.run(
        [sys.executable, "-c", START, "--ros-args", "-r", "__ns:=/refused", "-p", parameter],
        capture_output=True, text=True, timeout=60.0, check=False,
    )  # fmt: skip
    assert found.returncode == 2
    (line,) = found.stderr.splitlines()
    assert line.startswith("rf_pointing: not started: ")
    assert words in line


@pytest.fixture
def page(default_context: None, tmp_path: Path) -> Iterator[OperatorPage]:
    node = OperatorPage()
    given = {"page.port": 0, "page.reports": str(tmp_path)}
    node.set_parameters([Parameter(name, value=value) for name, value in given.items()])
    yield node
    node.end()
    node.lock.path.with_suffix(".token").unlink(missing_ok=True)
    node.lock.release()
    node.destroy_node()


def test_whatever_arrives_can_be_shown(
    page: OperatorPage, random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    doors: dict[str, tuple[Any, Any]] = {}
    create = page.create_subscription

    def noted(message_type: Any, topic: str, callback: Any, qos: Any, **options: Any) -> Any:
        doors[topic] = message_type, callback
        return create(message_type, topic, callback, qos, **options)

    monkeypatch.setattr(page, "create_subscription", noted)
    assert page.on_configure(LifecycleState(state_id=1, label="unconfigured")) == TransitionCallbackReturn.SUCCESS
    monkeypatch.setattr(page, "get_logger", lambda: SILENT)
    put: list[dict[str, Any]] = []
    assert page._server is not None
    monkeypatch.setattr(page._server, "put", put.append)
    page._watched = True
    assert len(doors) >= 11
    for topic, (message_type, door) in doors.items():
        for index in range(PAYLOADS):
            message = message_type()
            fill(message, random, page.now_s())
            for each in getattr(message, "profiles", []):
                whole(each, random)
            for each in getattr(message, "status", []):
                each.hardware_id = f"/{each.hardware_id}"
            if index % 3 == 1:
                spoil(message, random)
            payload = serialize_message(message)
            door(mutated(payload, random) if index % 3 == 2 else payload)
            if index % SHOWN_EVERY == 0:
                page._slow_s = 0.0
                page._show(1e9 + index)
        assert page.inputs.errors == 0, (topic, page.inputs.last_error)
    for sections in put:
        json.loads(json.dumps(shown(sections), allow_nan=False))
    assert {"live", "station", "passes", "schedule", "executive", "certificate", "path", "nodes"} <= {
        name for sections in put for name, value in sections.items() if value
    }


def whole(profile: PassProfile, random: np.random.Generator) -> None:
    """Make the lists of a profile fit each other, most of the time."""
    if random.random() < 0.8:
        count = int(random.integers(2, 400))
        profile.time = np.arange(float(count)).tolist()
        for name in ("azimuth", "elevation", "azimuth_rate", "elevation_rate", "azimuth_acceleration",
                     "elevation_acceleration", "sun_azimuth", "sun_elevation", "satellite_gain"):  # fmt: skip
            setattr(profile, name, random.normal(0.0, 1.0, count).tolist())
        profile.range = random.uniform(3e5, 3e6, count).tolist()


# What is shown and sent, on clocks of the test and without a port

NOW_S = 1.8e9


class Server:
    """The page's server, without a network."""

    def __init__(self, _params: Any, _token: str, request: Callable[..., Any]) -> None:
        self.address, self.request = "http://127.0.0.1:8000", request
        self.app = SimpleNamespace(viewers=1, dropped=2, commands=3, refused=4)
        self.put_sections: list[dict[str, Any]] = []
        self.put = self.put_sections.append
        self.searches, self.closed = 0, False

    def find_reports(self) -> None:
        self.searches += 1

    def close(self) -> None:
        self.closed = True


class Bench:
    """A page with one viewer."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, node: Any) -> None:
        self.wall_s, self.node = 1000.0, node
        self.sent: list[tuple[int, str, dict[str, Any]]] = []
        monkeypatch.setattr(
            operator_page,
            "time",
            SimpleNamespace(monotonic=lambda: self.wall_s, time=lambda: NOW_S + self.wall_s - 1000.0),
        )
        monkeypatch.setattr(operator_page, "PageServer", Server)
        assert node.turn() == 0.2
        assert node._health().level == WARN
        assert node.on_configure(LifecycleState(state_id=1, label="unconfigured")) == TransitionCallbackReturn.SUCCESS
        self.server: Any = node._server
        node._sender.send = lambda *command: self.sent.append(command)
        self.fast: dict[str, Any] = {}
        node._fast = {name: SimpleNamespace(take=lambda name=name: self.fast.pop(name, None)) for name in node._fast}

    def turn(self, seconds: float = 0.0) -> dict[str, Any]:
        """Let time go on and turn; return what the viewers get."""
        self.wall_s += seconds
        count = len(self.server.put_sections)
        self.node.turn()
        return dict(self.server.put_sections[-1]) if len(self.server.put_sections) > count else {}

    def request(self, name: str, /, **arguments: Any) -> Future[Any]:
        future: Future[Any] = self.server.request(name, arguments, "viewer")
        self.node._act()
        return future


@pytest.fixture
def bench(page: OperatorPage, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Return a page with one viewer."""
    return Bench(monkeypatch, page)


def test_what_is_fast_is_shown_5_times_a_second_and_the_rest_once(bench: Bench) -> None:
    rate_hz = bench.node.parameters.value("page").rate_hz
    assert {"live", "station", "events"} <= set(bench.turn())
    assert bench.turn(0.4 / rate_hz) == {}
    assert set(bench.turn(0.7 / rate_hz)) == {"live"}
    for _ in range(2 * round(rate_hz)):
        bench.turn(1.0 / rate_hz)
    slow = [each for each in bench.server.put_sections if "station" in each]
    assert (len(bench.server.put_sections) >= 2 * round(rate_hz), len(slow)) == (True, 3)


def test_a_turn_waits_for_the_next_view_and_at_most_50_ms(bench: Bench) -> None:
    period_s = 1.0 / bench.node.parameters.value("page").rate_hz
    assert bench.node.turn() == 0.05
    bench.wall_s = bench.node._next_s - 0.02
    assert bench.node.turn() == pytest.approx(0.02)
    bench.wall_s = due_s = bench.node._next_s
    bench.node.turn()
    assert bench.node._next_s == pytest.approx(due_s + period_s)
    bench.wall_s = bench.node._next_s - 1e-5
    assert bench.node.turn() == 0.001
    # After a pause the views are not made up.
    bench.wall_s += 100.0
    bench.node.turn()
    assert bench.node._next_s == pytest.approx(bench.wall_s + 0.5 * period_s)


def test_without_viewers_nothing_is_shown_and_the_first_gets_everything(bench: Bench) -> None:
    bench.turn()
    bench.server.app.viewers = 0
    assert bench.turn(1.0) == {}
    bench.fast["antenna"] = AntennaStatus(mode="holding")
    assert bench.turn(0.9) == {}
    bench.turn(0.2)
    assert bench.node._newest["antenna"].mode == "holding"
    searches = bench.server.searches
    bench.server.app.viewers = 2
    found = bench.turn(0.001)
    assert (found["live"]["viewers"], found["live"]["antenna"]) == (2, "holding")
    assert "station" in found
    assert bench.server.searches == searches + 1


def test_what_cannot_be_shown_does_not_take_the_commands_with_it(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_now_s: float) -> dict[str, Any]:
        raise KeyError("bug")

    monkeypatch.setattr(bench.node, "_live", broken)
    bench.turn()
    assert bench.node.inputs.errors == 1
    bench.request("park")
    assert bench.sent == [(1, "park", {})]


def test_the_live_values_are_those_of_the_newest_messages_with_their_ages(bench: Bench) -> None:
    assert bench.node._live(bench.wall_s) == {"age_s": {}, "viewers": 1}
    bench.node._keep("antenna", AntennaStatus(mode="tracking", rate_command=[0.1, 0.0]))
    bench.wall_s += 2.0
    bench.node._keep("tracking", TrackingStatus(mode="coast", target="BIRD"))
    bench.node._keep("executive", ExecutiveStatus(state="running", blocks=["slew"]))
    bench.node._keep("target", Target(target="BIRD"))
    bench.node._keep("joints", SimpleNamespace(position_rad=np.radians([10.0, 20.0])))
    found = bench.node._live(bench.wall_s + 0.26)
    assert found["age_s"] == {"antenna": 2.3, "tracking": 0.3, "target": 0.3, "executive": 0.3}
    assert (found["antenna"], found["tracking"], found["executive"]) == ("tracking", "coast", "running")
    assert (found["encoder_deg"], found["sky_target"]["name"]) == ([10.0, 20.0], "BIRD")
    assert found["rate_deg_s"][0] == pytest.approx(5.7296)
    assert not {"blocks", "alarms"} & set(found)
    assert bench.node._live(bench.wall_s - 5.0)["age_s"]["antenna"] == 0.0
    del bench.node._newest["tracking"], bench.node._newest["executive"]
    alone = bench.node._live(bench.wall_s)
    assert (alone["antenna"], alone["tracking"], alone["executive"]) == ("tracking", "", "none")


def test_what_changes_seldom_is_shown_with_its_source(bench: Bench) -> None:
    found = bench.node._slow(bench.wall_s)
    assert (found["station"]["name"], found["station"]["band"], found["sun"], found["path"]) == ("", "", None, None)
    assert not {"passes", "executive", "schedule"} & set(found)
    bench.node._keep("station", StationInUse(station="Dish", band="X"))
    bench.node._keep("passes", PassList(target="BIRD", passes=[Pass(target="BIRD")] * 201))
    bench.node._keep("executive", ExecutiveStatus(state="paused"))
    bench.node._keep("schedule", Schedule(passes=[ScheduledPass(id="p")] * 201))
    bench.node._newest["certificate"] = {"name": "BIRD"}
    found = bench.node._slow(bench.wall_s)
    assert (found["station"]["name"], found["station"]["band"]) == ("Dish", "X")
    assert (found["passes"]["target"], len(found["passes"]["rows"]), len(found["schedule"])) == ("BIRD", 200, 200)
    assert (found["executive"]["state"], found["certificate"]) == ("paused", {"name": "BIRD"})


def test_reports_are_looked_for_every_10_s(bench: Bench) -> None:
    for seconds, searches in ((0.0, 1), (9.9, 1), (0.1, 2), (9.9, 2)):
        bench.wall_s += seconds
        bench.node._slow(bench.wall_s)
        assert bench.server.searches == searches


def diagnostics(node: str, check: str, level: bytes, message: str) -> DiagnosticArray:
    name = f"{node.rpartition('/')[2]}: {check}"
    return DiagnosticArray(status=[DiagnosticStatus(hardware_id=node, name=name, level=level, message=message)])


def test_nodes_are_shown_with_their_checks_and_their_silence(bench: Bench) -> None:
    bench.node.get_namespace = lambda: "/gs1"
    take = bench.node._on_diagnostics
    take(diagnostics("/gs2/antenna_servo", "device", OK, "good"))
    take(diagnostics("/gs10/antenna_servo", "device", OK, "good"))
    take(diagnostics("/gs1/rf_receiver", "state", WARN, "slow"))
    take(diagnostics("/gs1/antenna_servo", "device", OK, "good"))
    take(diagnostics("/gs1/antenna_servo", "device", ERROR, "lost"))
    take(diagnostics("/gs1/antenna_servo", "state", b"\x07", "odd"))
    rows = bench.node._slow(bench.wall_s + 3.0)["nodes"]
    assert rows == [
        {"name": "antenna_servo", "silent_s": 0, "checks": [["device", 2, "lost"], ["state", 2, "odd"]]},
        {"name": "rf_receiver", "silent_s": 0, "checks": [["state", 1, "slow"]]},
    ]
    assert [row["silent_s"] for row in bench.node._slow(bench.wall_s + 3.6)["nodes"]] == [4, 4]
    bench.wall_s += 3.0
    take(diagnostics("/gs1/rf_receiver", "state", OK, "active"))
    assert [row["silent_s"] for row in bench.node._slow(bench.wall_s + 0.6)["nodes"]] == [4, 0]


def test_no_more_than_200_nodes_and_checks_are_kept(bench: Bench) -> None:
    for index in range(202):
        bench.node._on_diagnostics(diagnostics("/one", f"check {index}", OK, "first"))
    assert len(bench.node._nodes["one"]["checks"]) == 200
    bench.node._on_diagnostics(diagnostics("/one", "check 7", OK, "second"))
    assert bench.node._nodes["one"]["checks"]["check 7"] == (0, "second")
    for index in range(202):
        bench.node._on_diagnostics(diagnostics(f"/node{index}", "state", OK, "first"))
    assert len(bench.node._nodes) == 200
    bench.node._on_diagnostics(diagnostics("/node5", "state", OK, "second"))
    assert bench.node._nodes["node5"]["checks"]["state"] == (0, "second")


def profile(target: str, begin_s: float, length_s: float, count: int = 4) -> PassProfile:
    made = PassProfile(
        target=target, aos=stamp_from_seconds(NOW_S + begin_s), time=np.linspace(0.0, length_s, count).tolist()
    )
    for name in ("azimuth", "elevation", "azimuth_rate", "elevation_rate", "azimuth_acceleration",
                 "elevation_acceleration", "sun_azimuth", "sun_elevation", "satellite_gain"):  # fmt: skip
        setattr(made, name, [0.1 * k for k in range(count)])
    made.range = [1e6] * count
    return made


def test_the_path_is_that_of_the_pass_that_lasts_or_comes_next(bench: Bench) -> None:
    assert bench.node._path(NOW_S) is None
    rows = [
        PassProfile(target="EMPTY"),
        profile("A", -100.0, 90.0),
        profile("B", -100.0, 150.0),
        profile("C", 500.0, 90.0),
    ]
    bench.node._on_profiles(PassProfileList(profiles=rows))
    assert [bench.node._path(NOW_S + t_s)["target"] for t_s in (-20.0, -10.0, 49.9, 50.0, 589.9)] == list("ABBCC")
    assert bench.node._path(NOW_S + 590.0) is None
    found = bench.node._path(NOW_S)
    assert (found["aos_s"], found["los_s"]) == (NOW_S - 100.0, NOW_S + 50.0)
    # It is worked out once.
    bench.node._sections["path"] = (bench.node._sections["path"][0], {"target": "kept"})
    assert bench.node._path(NOW_S) == {"target": "kept"}
    rows[2].elevation = [0.1]
    bench.node._sections.clear()
    assert bench.node._path(NOW_S) is None
    assert bench.node.inputs.refused == {"pass_profiles": 1}


class Reader:
    """A service of parameters."""

    def __init__(self) -> None:
        self.ready = True
        self.requests: list[Any] = []
        self.removed: list[Any] = []
        self.answer: Any = None

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, request: Any) -> Any:
        self.requests.append(request)
        return SimpleNamespace(done=lambda: self.answer is not None, result=lambda: self.answer)

    def remove_pending_request(self, future: Any) -> None:
        self.removed.append(future)


def test_the_limits_in_force_are_read_every_5_s(bench: Bench) -> None:
    readers = bench.node._readers = {name: Reader() for name in bench.node._readers}
    other, reader = readers.values()
    if reader is not readers["ephemeris_publisher"]:
        other, reader = reader, other
    other.ready = False
    read = bench.node._read_parameters
    read(100.0)
    read(104.9)
    assert (len(reader.requests), len(other.requests), reader.removed) == (1, 0, [])
    assert reader.requests[0].names == ["source.along_track_offset_s", "source.cross_track_offset_deg"]
    # One that was not answered is given up with the next.
    read(105.0)
    assert (len(reader.requests), len(reader.removed)) == (2, 1)
    reader.answer = GetParameters.Response(
        values=[
            Parameter("a", value=0.25).to_parameter_msg().value,
            Parameter("b", value=-0.5).to_parameter_msg().value,
        ]
    )
    read(106.0)
    assert bench.node._newest["offsets"] == {"along_s": 0.25, "cross_deg": -0.5}
    assert bench.node._waiting == {}
    assert bench.node._slow(bench.wall_s)["station"]["offsets"] == {"along_s": 0.25, "cross_deg": -0.5}


def test_limits_horizon_and_sun_are_those_of_the_controller(bench: Bench) -> None:
    names = bench.node._names("pointing_controller")
    assert names[:5] == [
        "limits.azimuth_min_deg", "limits.azimuth_max_deg", "limits.elevation_min_deg", "limits.elevation_max_deg",
        "machine.sun_radius_deg",
    ]  # fmt: skip
    station = read_station("dss13")
    given = station.parameters("pointing_controller", station.default_band)
    values = [given.get(name) for name in names]
    answer = GetParameters.Response(
        values=[Parameter("x", value=list(v) if isinstance(v, tuple) else v).to_parameter_msg().value for v in values]
    )
    short = GetParameters.Response(values=answer.values[1:])
    bench.node._take_parameters("pointing_controller", short)
    bench.node._take_parameters("pointing_controller", None)
    assert "sky" not in bench.node._newest
    bench.node._take_parameters("pointing_controller", answer)
    sky = bench.node._newest["sky"]
    assert sky["limits_deg"] == [given[name] for name in names[:4]]
    assert sky["sun_radius_deg"] == given["machine.sun_radius_deg"]
    assert len(sky["mask_deg"]) == 181
    found = bench.node._slow(bench.wall_s)
    assert found["station"]["limits_deg"] == sky["limits_deg"]
    assert len(found["sun"]) == 2
    sun = bench.node._sun
    bench.node._take_parameters("pointing_controller", answer)
    assert bench.node._sun is sun
    latitude = names.index("sun.site.latitude_deg")
    answer.values[latitude].double_value = 95.0
    bench.node._take_parameters("pointing_controller", answer)
    assert bench.node.inputs.refused == {"get_parameters": 1}
    answer.values[latitude].double_value = -30.0
    bench.node._take_parameters("pointing_controller", answer)
    assert bench.node._sun is not sun


def test_a_command_is_sent_with_a_number_and_answered_by_it(bench: Bench) -> None:
    first, second = bench.request("park"), bench.request("night_skip", name="p1")
    assert bench.sent == [(1, "park", {}), (2, "night_skip", {"name": "p1"})]
    bench.node._responded(2, False, "no pass p1")
    assert (first.done(), second.result(timeout=0)) == (False, (False, "no pass p1"))
    bench.node._responded(1, True, "")
    assert first.result(timeout=0) == (True, "accepted")
    bench.node._responded(1, True, "again")
    bench.node._responded(9, True, "of nobody")
    bench.node._ended(2, "track", False, {"message": ""})
    events = bench.node._slow(bench.wall_s)["events"]
    assert [(row["text"], row["accepted"]) for row in events] == [
        ("track ended: no message", False), ("park: accepted", True), ("night_skip: no pass p1", False)
    ]  # fmt: skip
    assert events[0]["utc"] == utc_text(NOW_S)[:19]


def test_a_refusal_without_a_reason_is_one_and_a_viewer_that_is_gone_gets_none(bench: Bench) -> None:
    future = bench.request("park")
    bench.node._responded(1, False, "")
    assert future.result(timeout=0) == (False, "refused")
    gone = bench.request("stow")
    gone.cancel()
    bench.node._responded(2, True, "")
    assert bench.node._sent[0]["text"] == "stow: accepted"


def test_what_has_happened_is_shown_with_the_next_view(bench: Bench) -> None:
    rate_hz = bench.node.parameters.value("page").rate_hz
    bench.turn()
    assert "events" not in bench.turn(1.01 / rate_hz)
    bench.node._ended(2, "track", True, {"message": "loss of signal"})
    assert "events" in bench.turn(1.01 / rate_hz)


def test_a_command_that_cannot_be_sent_is_refused(bench: Bench) -> None:
    accepted, words = bench.request("dance").result(timeout=0)
    assert (accepted, bench.sent) == (False, [])
    assert "'dance'" in words
    assert bench.request("park", speed=1).result(timeout=0)[0] is False


def test_a_shown_pass_is_tracked_by_its_rise_unless_a_night_runs(bench: Bench) -> None:
    rises = [NOW_S + 100.0, NOW_S + 6000.0]
    aos_utc = utc_text(rises[1])
    assert bench.request("track", aos_utc=aos_utc).result(timeout=0)[0] is False
    bench.node._keep(
        "passes", PassList(passes=[Pass(target=f"b{t_s:.0f}", aos=stamp_from_seconds(t_s)) for t_s in rises])
    )
    bench.request("track", aos_utc=aos_utc)
    bench.request("track", aos_utc=utc_text(rises[0]), sensor="none")
    (_, _, one), (_, _, two) = bench.sent
    assert (one["target_pass"].target, one["sensor"]) == (f"b{rises[1]:.0f}", "auto")
    assert (two["target_pass"].target, two["sensor"]) == (f"b{rises[0]:.0f}", "none")
    assert bench.request("track").result(timeout=0)[0] is False
    bench.node._keep("executive", ExecutiveStatus(state="running"))
    bench.wall_s += 4.9
    assert bench.request("track", aos_utc=aos_utc).result(timeout=0)[0] is False
    # An executive that is silent for 5 s runs nothing.
    bench.wall_s += 0.1
    bench.request("track", aos_utc=aos_utc)
    bench.node._keep("executive", ExecutiveStatus(state="paused"))
    bench.request("track", aos_utc=aos_utc)
    assert len(bench.sent) == 4
    assert bench.node._age_s("nothing") == np.inf


def test_the_page_is_connected_and_polls_what_was_sent(bench: Bench) -> None:
    topics = {
        "antenna_status", "tracking_status", "target", "joint_states", "passes", "pass_profiles", "pass_certificate",
        "schedule", "executive_status", "station_in_use", "diagnostics",
    }  # fmt: skip
    # The base watches /diagnostics of its own.
    names = [each.topic_name.lstrip("/") for each in bench.node.subscriptions]
    assert topics <= set(names)
    readers = {"pointing_controller/get_parameters", "ephemeris_publisher/get_parameters"}
    assert readers <= {each.srv_name.lstrip("/") for each in bench.node.clients}
    polls: list[float] = []
    bench.node._sender.poll = lambda: polls.append(bench.wall_s)
    bench.turn()
    assert polls == [1000.0]
    bench.node.on_cleanup(LifecycleState(state_id=1, label="unconfigured"))
    left = [each.topic_name.lstrip("/") for each in bench.node.subscriptions]
    assert names.count("diagnostics") == left.count("diagnostics") + 1
    assert not readers & {each.srv_name.lstrip("/") for each in bench.node.clients}


def test_the_health_counts_viewers_and_commands(bench: Bench) -> None:
    health = bench.node._health()
    assert (health.level, health.message) == (OK, "http://127.0.0.1:8000, 1 viewers")
    assert health.values == {"viewers": 1, "slow_viewers_dropped": 2, "commands": 3, "requests_refused": 4}
    bench.node.on_cleanup(LifecycleState(state_id=1, label="unconfigured"))
    assert bench.server.closed
    assert bench.node._health().level == WARN


@pytest.mark.parametrize("value", [200, 201])
def test_a_text_has_at_most_200_characters(value: int) -> None:
    row = command_rows()["night_skip"]
    if value > 200:
        with pytest.raises(ValueError, match="201"):
            checked_arguments(row, {"name": "x" * value})
    else:
        assert checked_arguments(row, {"name": "x" * value}) == {"name": "x" * value}


def test_the_page_takes_a_name_where_the_service_does() -> None:
    takes = {
        name.removeprefix("night_"): row.takes for name, row in command_rows().items() if name.startswith("night_")
    }
    none: tuple[str, ...] = ()
    assert takes == {
        "acknowledge": ("name",), "skip": ("name",), "pause": none, "resume": none, "stop": none, "abort": none,
    }  # fmt: skip
