"""What the executive sends, by name and type; two executives that share a list; a dead one is noticed."""

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.serialization import deserialize_message
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import ExecutiveStatus, Pass, Schedule, ScheduledPass
from rf_pointing_msgs.srv import GoTo, SelectTarget

from rf_pointing.nodes import station_node
from rf_pointing.nodes.command_key import CommandKey, CommandKeyParams
from rf_pointing.nodes.diagnostics import ERROR, OK
from rf_pointing.nodes.directives import DirectiveSender, filled, plain_fields, type_of
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.nodes.station_node import ExecutiveWatch
from rf_pointing.operations import AlarmParams
from rf_pointing.operations.dictionary import read_directives, read_tables


def test_every_shipped_directive_has_an_installed_type_with_its_arguments() -> None:
    for row in read_tables(AlarmParams()).directives.values():
        if row.kind in ("service", "action"):
            kind = type_of(row.type_name)
            blank = kind.Request() if row.kind == "service" else kind.Goal()
            assert not [name for name in row.takes if not hasattr(blank, name)], row


def test_messages_are_filled_from_plain_values() -> None:
    request = filled(SelectTarget.Request(), {"target": "25544", "start": 12.25, "minimum_peak_elevation": 1})
    assert (request.target, request.start.sec, request.start.nanosec) == ("25544", 12, 250_000_000)
    assert request.minimum_peak_elevation == 1.0
    goal = filled(TrackPass.Goal(), {"target_pass": {"target": "x", "aos": 3.0}, "sensor": "auto"})
    assert (goal.target_pass.target, goal.target_pass.aos.sec, goal.sensor) == ("x", 3, "auto")
    window = Pass(target="y")
    assert filled(TrackPass.Goal(), {"target_pass": window}).target_pass.target == "y"


@pytest.mark.parametrize(
    ("values", "message"),
    [({"speed": 1.0}, "has no field speed"), ({"azimuth": "north"}, "azimuth='north' is no float")],
)
def test_what_does_not_fit_a_message_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        filled(GoTo.Request(), values)


def test_results_give_their_plain_fields() -> None:
    found = plain_fields(TrackPass.Result(success=True, message="loss of signal", seconds_tracked=3.0))
    assert (found["success"], found["message"], found["seconds_tracked"]) == (True, "loss of signal", 3.0)


class Clients:
    """A node whose services are ready or not, and answer when they are set to."""

    def __init__(self, ready: bool) -> None:
        self.ready, self.futures = ready, []

    def create_client(self, kind: Any, name: str) -> Any:
        self.made = kind, name
        return SimpleNamespace(service_is_ready=lambda: self.ready, call_async=self._call)

    def _call(self, request: Any) -> Any:
        self.futures.append(
            SimpleNamespace(done=lambda: hasattr(self, "answer"), result=lambda: self.answer, request=request)
        )
        return self.futures[-1]


ROWS = """
version: 1
directives:
  go: {service: antenna_servo/go_to, type: rf_pointing_msgs/srv/GoTo, takes: [azimuth, elevation]}
  set: {parameter: ephemeris_publisher/source.along_track_offset_s, takes: [value]}
  record: {own: record, takes: [name]}
"""


def sender(clients: Clients, own: Any = None, key: str = "") -> tuple[DirectiveSender, list[Any]]:
    answers: list[Any] = []
    made = DirectiveSender(
        clients, read_directives(ROWS), {"record": own or (lambda name: f"recording {name}")},
        lambda *answer: answers.append(answer), lambda *_: None, CommandKeyParams(command_key_file=key),
    )  # fmt: skip
    return made, answers


def test_a_service_that_is_not_offered_is_a_refusal_at_once() -> None:
    made, answers = sender(Clients(ready=False))
    made.send(1, "go", {"azimuth": 0.1, "elevation": 0.2})
    assert answers == [(1, False, "service antenna_servo/go_to is not offered")]


def test_a_response_comes_back_with_its_number_when_it_is_polled() -> None:
    clients = Clients(ready=True)
    made, answers = sender(clients)
    made.send(7, "go", {"azimuth": 0.1, "elevation": 0.2})
    made.poll()
    assert (answers, clients.futures[0].request.azimuth) == ([], 0.1)
    clients.answer = GoTo.Response(success=False, message="the antenna is parked")
    made.poll()
    made.poll()
    assert answers == [(7, False, "the antenna is parked")]


@pytest.mark.usefixtures("ros_domain")
def test_what_has_a_lease_is_called_signed_with_the_key_of_the_antenna(tmp_path: Path) -> None:
    path = tmp_path / "command.key"
    servo, clients = CommandKey(CommandKeyParams(command_key_file=str(path))), Clients(ready=True)
    clients.resolve_service_name = lambda name: f"/gs1/{name}"
    clients.get_fully_qualified_name = lambda: "/gs1/station_executive"
    made, _ = sender(clients, key=str(path))
    made.send(7, "go", {"azimuth": 0.1, "elevation": 0.2})
    call = clients.futures[0].request
    assert (call.service, call.caller) == ("/gs1/antenna_servo/go_to", "/gs1/station_executive")
    servo.check_call(call)
    assert deserialize_message(bytes(call.request), GoTo.Request).azimuth == 0.1


def test_a_parameter_is_set_by_node_and_name_and_its_refusal_is_the_response() -> None:
    clients = Clients(ready=True)
    made, answers = sender(clients)
    made.send(2, "set", {"value": 0.3})
    (parameter,) = clients.futures[0].request.parameters
    assert (parameter.name, parameter.value.double_value) == ("source.along_track_offset_s", 0.3)
    clients.answer = SimpleNamespace(result=SimpleNamespace(successful=False, reason="must be <= 60"))
    made.poll()
    assert answers == [(2, False, "must be <= 60")]


def test_what_the_executive_does_itself_fails_with_its_reason() -> None:
    def full(name: str) -> str:
        raise OSError("0.1 GB are free")

    made, answers = sender(Clients(ready=True), full)
    made.send(3, "record", {"name": "p1"})
    assert answers == [(3, False, "0.1 GB are free")]


def test_two_executives_share_a_list_and_the_living_one_takes_over() -> None:
    rows = {"a": "waiting", "b": "active", "c": "tracked", "d": "yields"}
    message = Schedule(passes=[ScheduledPass(id=name, state=state) for name, state in rows.items()])

    def taken(mine: str, other: str, silent_s: float) -> set[str]:
        node = StationExecutive.__new__(StationExecutive)
        changes: list[float] = []
        node._night = SimpleNamespace(schedule=SimpleNamespace(antenna=mine), taken=set(), change=changes.append)
        node.parameters = SimpleNamespace(value=lambda _name: AlarmParams())
        node._schedules, node._partner_s = {other: message}, {other: time.monotonic() - silent_s}
        node._share(5.0)
        assert changes == [5.0]
        return node._night.taken

    # The first by name leaves only what has begun; the second leaves all that the first plans.
    assert taken("gs1", "gs2", 0.0) == {"b", "c"}
    assert taken("gs2", "gs1", 0.0) == {"a", "b", "c"}
    assert taken("gs2", "gs1", 60.0) == {"c"}


def test_a_silent_executive_is_an_error_unless_it_was_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    checks: dict[str, Any] = {}
    node = SimpleNamespace(listen=lambda *_: None, diagnostics=SimpleNamespace(add=checks.__setitem__))
    watch, now_s = ExecutiveWatch(node), 100.0
    monkeypatch.setattr(station_node.time, "monotonic", lambda: now_s)
    assert (checks["executive"]().level, checks["executive"]().message) == (OK, "none")
    watch._note(ExecutiveStatus(state="running"))
    assert checks["executive"]().level == OK
    now_s = 108.0
    assert checks["executive"]().level == ERROR
    assert checks["executive"]().message == "station_executive has been silent for 8 s; it was running"
    watch._note(ExecutiveStatus(state="idle"))
    now_s = 200.0
    assert checks["executive"]().level == OK
