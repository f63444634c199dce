"""The node of the operator's page: what it refuses to start with, and any message that it may receive."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import (
    AntennaStatus,
    ExecutiveStatus,
    Pass,
    PassList,
    PassProfile,
    Schedule,
    ScheduledPass,
    StationInUse,
)

from rf_pointing.nodes.operator_page import OperatorPage
from rf_pointing.ros.diagnostics import ERROR
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.clients.board import READ
from rf_pointing.station.description import read_station
from rf_pointing.web.metrics import exposition
from rf_pointing.web.page_server import PageApp, PageServer, shown
from test.nodes.test_hostile_messages import fill, mutated

PAYLOADS, SHOWN_EVERY = 1000, 25
START = "from rf_pointing.nodes.operator_page import main; main()"


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
def put(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Return what the page gives its server to show to one viewer."""
    sections: list[dict[str, Any]] = []
    monkeypatch.setattr(PageServer, "put", lambda _, values, _antenna: sections.append(values))
    monkeypatch.setattr(PageApp, "viewers", property(lambda _: 1))
    monkeypatch.setattr(PageApp, "watching", lambda *_: 1)
    return sections


@pytest.fixture
def scraped(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what /metrics shows, once for each time that it is measured."""
    texts: list[str] = []
    measure = property(lambda _: None, lambda _, measured: texts.append(exposition(measured[1])))
    monkeypatch.setattr(PageApp, "measured", measure, raising=False)
    return texts


@pytest.fixture
def page(make_bench: Callable[..., Any], put: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a page of the namespace /gs1 with one viewer."""
    bench = make_bench(
        OperatorPage, namespace="/gs1", **{"page.port": 0, "page.reports": str(tmp_path), "lifecycle.autostart": False}
    )
    token = tmp_path / "token"
    token.write_text("a-token-of-the-test")
    token.chmod(0o600)
    assert bench.change(**{"page.token_file": str(token)}) == ""
    assert bench.step("configure"), bench.health("state").message
    bench.turn()
    return bench


def test_whatever_arrives_can_be_shown(page: Any, put: list[dict[str, Any]], random: np.random.Generator) -> None:
    for topic, message_type in page.inputs():
        for index in range(PAYLOADS):
            if index % 20 == 0:
                message = message_type()
                fill(message, random, page.t_s)
                for each in getattr(message, "profiles", []):
                    whole(each, random)
                for each in getattr(message, "status", []):
                    each.hardware_id = f"/gs1/{each.hardware_id}"
                base = bytes(serialize_message(message))
            page.give(topic, base if index % 3 == 0 else mutated(base, random))
            if index % SHOWN_EVERY == 0:
                page.wait(2.0)
                page.turn()
        assert page.node.inputs.errors == 0, (topic, page.node.inputs.last_error)
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


def test_messages_and_parameters_of_the_station_become_sections(page: Any, put: list[dict[str, Any]]) -> None:
    page.give("antenna_status", AntennaStatus(mode="holding"))
    page.give("executive_status", ExecutiveStatus(state="paused"))
    page.give("station_in_use", StationInUse(station="Dish", band="X"))
    page.give("passes", PassList(target="BIRD", passes=[Pass(target="BIRD")] * 201))
    status = DiagnosticStatus(
        hardware_id="/gs1/antenna_servo", name="gs1/antenna_servo: device", level=ERROR, message="lost"
    )
    page.give("/diagnostics", DiagnosticArray(status=[status]))
    station = read_station("dss13")
    given = station.parameters("pointing_controller", station.default_band)
    for node, names in READ.items():
        values = [given.get(name, 0.25) for name in names]
        values = [Parameter("x", value=list(v) if isinstance(v, tuple) else v).to_parameter_msg().value for v in values]
        client = page.clients[f"{node}/get_parameters"]
        assert client.answer(GetParameters.Response(values=values)).names == list(names)
    page.wait(1.1)
    page.turn()
    found = put[-1]
    assert (found["live"]["antenna"], found["live"]["executive"], found["executive"]["state"]) == (
        "holding", "paused", "paused",
    )  # fmt: skip
    assert (found["station"]["name"], found["station"]["namespace"]) == ("Dish", "/gs1")
    assert found["station"]["offsets"].startswith("along track 0.25 s, cross track 0.25 deg")
    assert found["station"]["limits_deg"] == pytest.approx([-220.0, 220.0, 4.0, 89.5])
    assert (found["passes"]["target"], len(found["passes"]["rows"])) == ("BIRD", 200)
    assert {"name": "antenna_servo", "silent_s": 0, "checks": [["device", 2, "lost"]]} in found["nodes"]
    assert page.health("page").values["viewers"] == "1"


def test_a_shown_pass_is_tracked_and_what_cannot_be_shown_takes_no_command_with_it(
    page: Any, put: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    rises = [page.t_s + 100.0, page.t_s + 6000.0]
    page.give(
        "passes", PassList(passes=[Pass(target=f"b{k}", aos=stamp_from_seconds(t_s)) for k, t_s in enumerate(rises)])
    )
    page.wait(1.1)
    page.turn()

    def broken(*_: Any) -> None:
        raise KeyError("bug")

    monkeypatch.setattr(PageServer, "put", broken)
    answers: list[Any] = []
    waiting = [SimpleNamespace(
        name="track", arguments={"aos_utc": put[-1]["passes"]["rows"][1]["aos_utc"]}, who="viewer", antenna="",
        reply=lambda *answer: answers.append(answer),
    )]  # fmt: skip
    queue = SimpleNamespace(empty=lambda: not waiting, get=waiting.pop)
    monkeypatch.setattr(PageServer, "requests", queue)
    page.wait(1.1)
    page.turn()
    assert page.node.inputs.errors == 1
    page.clients["track_pass"].futures[-1].set_result(SimpleNamespace(accepted=False))
    page.turn()
    (goal,) = page.clients["track_pass"].requests
    assert (goal.target_pass.target, goal.sensor) == ("b1", "auto")
    assert answers == [(False, "the goal was refused")]


def test_metrics_count_every_pass_of_a_schedule_that_the_page_shows_in_part(scraped: list[str], page: Any) -> None:
    states = ["tracked"] * 300 + ["waiting"] * 200
    page.give("executive_status", ExecutiveStatus(state="running"))
    page.give("schedule", Schedule(passes=[ScheduledPass(id=f"p{n}", state=each) for n, each in enumerate(states)]))
    page.wait(1.1)
    page.turn()
    counts = [line for line in scraped[-1].splitlines() if line.startswith("rf_pointing_schedule_passes{")]
    assert [line.split("{")[1] for line in counts] == ['state="tracked"} 300.0', 'state="waiting"} 200.0']
