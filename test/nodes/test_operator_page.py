"""The node of the operator's page: what it can send, what it refuses to start with, and any message that it may receive."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import PassProfile

from rf_pointing.nodes.directives import type_of
from rf_pointing.nodes.operator_page import OperatorPage, checked_arguments, command_rows
from rf_pointing.nodes.page_server import shown
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
