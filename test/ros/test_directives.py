"""Directives reach services, actions and parameters by name and type, and what comes back is their response."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import ParameterType
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import Pass, PointingError
from rf_pointing_msgs.srv import GoTo, SelectTarget, SignedCall
from std_srvs.srv import Trigger

from rf_pointing.operations.dictionary import DirectiveRow
from rf_pointing.ros import directives
from rf_pointing.ros.command_key import CommandKeyParams
from rf_pointing.ros.directives import DirectiveSender, filled, plain_fields
from test.nodes.bench import ActionClient, Service

# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
Row = tuple[str, str, str, str, tuple[str, ...]]
ROWS: tuple[Row, ...] = (
    ("park", "service", "antenna_servo/park", "std_srvs/srv/Trigger", ()),
    ("go", "service", "antenna_servo/go_to", "rf_pointing_msgs/srv/GoTo", ("azimuth", "elevation")),
    ("track", "action", "track_pass", "rf_pointing_msgs/action/TrackPass", ("sensor",)),
    ("lead", "parameter", "pass/ephemeris_publisher/publisher.lead_s", "", ("value",)),
    ("note", "own", "write", "", ("text",)),
)


class Graph:
    """A node without ROS: its clients by address, and what the sender reports."""

    def __init__(self) -> None:
        self.bench = self
        self.clients: dict[str, Service] = {}
        self.destroyed: list[Service] = []
        self.responses: list[tuple[Any, ...]] = []
        self.ends: list[tuple[Any, ...]] = []

    def create_client(self, kind: Any, address: str) -> Service:
        made = self.clients.setdefault(address, Service())
        made.kind = kind  # type: ignore[attr-defined]
        return made

    def destroy_client(self, client: Service) -> None:
        assert not isinstance(client, ActionClient), "an action's client is no entity of the node"
        self.destroyed.append(client)

    def resolve_service_name(self, name: str) -> str:
        return f"/gs1/{name}"

    def get_fully_qualified_name(self) -> str:
        return "/gs1/station_executive"

    def answer(self, address: str, response: Any) -> Any:
        return self.clients[address].answer(response)


def write(text: str) -> str:
    if not text:
        raise ValueError("text='' must have a letter")
    return f"written: {text}"


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Graph:
    monkeypatch.setattr(directives, "ActionClient", ActionClient)
    return Graph()


@pytest.fixture
def make(graph: Graph) -> Callable[..., DirectiveSender]:
    def sender(*given: Row, key: str = "", **options: Any) -> DirectiveSender:
        names = ("name", "kind", "address", "type_name", "takes")
        rows = {each[0]: DirectiveRow(**dict(zip(names, each, strict=True))) for each in given or ROWS}  # type: ignore[arg-type]
        return DirectiveSender(
            graph, rows, {"write": write}, lambda *each: graph.responses.append(each),  # type: ignore[arg-type]
            lambda *each: graph.ends.append(each), CommandKeyParams(command_key_file=key), **options,
        )  # fmt: skip

    return sender


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (("fly", "own", "fly", "", ()), r"directive fly: own='fly' must be one of write$"),
        (("go", "service", "go", "rf_pointing_msgs/srv/GoTo", ("azimuth", "roll")), "GoTo has no field roll$"),
        (("go", "action", "t", "rf_pointing_msgs/action/TrackPass", ("azimuth",)), "TrackPass has no field azimuth$"),
        (("x", "service", "x", "no_package/srv/Trigger", ()), "type no_package/srv/Trigger is not installed"),
        (("x", "service", "x", "std_srvs/srv/Nothing", ()), "type std_srvs/srv/Nothing is not installed"),
    ],
)
def test_a_row_that_cannot_be_sent_is_refused(make: Callable[..., DirectiveSender], row: Row, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make(row)


def test_a_service_gets_its_arguments_and_its_answer_is_the_response(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender = make()
    sender.send(7, "go", {"azimuth": 1, "elevation": 0.5})
    sender.send(8, "park", {})
    sender.poll()
    assert graph.responses == [], "nothing has come back"
    request = graph.answer("antenna_servo/go_to", GoTo.Response(success=False, message="behind the mask"))
    assert (type(request), request.azimuth, request.elevation) == (GoTo.Request, 1.0, 0.5)
    sender.poll()
    # A service without `success` has received it.
    graph.answer("antenna_servo/park", SimpleNamespace())
    sender.poll()
    sender.poll()
    assert graph.responses == [(7, False, "behind the mask"), (8, True, "")]


def test_whole_answers_of_services_are_taken_in_place_of_responses(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    answers: list[Any] = []
    sender = make(answered=lambda *each: answers.append(each))
    response = Trigger.Response(success=True, message="parking")
    for ready in (True, False):
        graph.clients["antenna_servo/park"].ready = ready
        sender.send(1, "park", {})
    graph.answer("antenna_servo/park", response)
    sender.poll()
    assert answers == [(1, True, "parking", response)]
    assert graph.responses == [(1, False, "service antenna_servo/park is not offered")]


def test_a_leased_service_is_called_with_the_key_of_the_station(
    graph: Graph, make: Callable[..., DirectiveSender], tmp_path: Path
) -> None:
    make(key=str(tmp_path / "command.key")).send(1, "park", {})
    (call,) = graph.clients["antenna_servo/signed"].requests
    assert isinstance(call, SignedCall.Request)
    assert (call.service, call.caller) == ("/gs1/antenna_servo/park", "/gs1/station_executive")
    assert len(call.signature) == 32


def test_a_parameter_is_set_at_its_node(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender, owner = make(), "pass/ephemeris_publisher/set_parameters_atomically"
    sender.send(3, "lead", {"value": 1.5})
    refused = SimpleNamespace(result=SimpleNamespace(successful=False, reason="lead_s=1.5 must be <= 1"))
    (wanted,) = graph.answer(owner, refused).parameters
    assert wanted.name == "publisher.lead_s"
    assert (wanted.value.type, wanted.value.double_value) == (ParameterType.PARAMETER_DOUBLE, 1.5)
    sender.poll()
    sender.send(4, "lead", {})
    assert graph.responses == [(3, False, "lead_s=1.5 must be <= 1"), (4, False, "directive lead needs value")]


@pytest.mark.parametrize(("status", "succeeded"), [(4, True), (5, False), (6, False)])
def test_an_action_is_accepted_and_ends_with_the_plain_fields_of_its_result(
    graph: Graph, make: Callable[..., DirectiveSender], status: int, succeeded: bool
) -> None:
    sender, over = make(), Service().call_async(None)
    sender.send(9, "track", {"sensor": "monopulse"})
    handle = SimpleNamespace(accepted=True, get_result_async=lambda: over)
    assert graph.answer("track_pass", handle).sensor == "monopulse"
    sender.poll()
    sender.poll()
    assert (graph.responses, graph.ends) == ([(9, True, "")], [])
    over.set_result(SimpleNamespace(status=status, result=TrackPass.Result(message="over", seconds_tracked=310.5)))
    sender.poll()
    ((*head, fields),) = graph.ends
    assert (head, fields["message"], fields["seconds_tracked"]) == ([9, "track", succeeded], "over", 310.5)


def test_a_refused_goal_has_no_end_and_a_missing_action_is_refused_at_once(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender = make()
    sender.send(9, "track", {"sensor": "monopulse"})
    graph.answer("track_pass", SimpleNamespace(accepted=False))
    sender.poll()
    graph.clients["track_pass"].ready = False
    sender.send(2, "track", {})
    sender.poll()
    assert graph.ends == []
    assert graph.responses == [(9, False, "the goal was refused"), (2, False, "action track_pass is not offered")]


def test_own_directives_and_wrong_arguments_are_answered_at_once(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender = make()
    for number, (name, arguments) in enumerate(
        (("note", {"text": "rain"}), ("note", {"text": ""}), ("go", {"azimuth": "north"}), ("track", {"speed": 1.0}))
    ):
        sender.send(number, name, arguments)
    assert graph.responses == [
        (0, True, "written: rain"), (1, False, "text='' must have a letter"), (2, False, "azimuth='north' is no float"),
        (3, False, "TrackPass_Goal has no field speed"),
    ]  # fmt: skip


def test_closed_clients_are_destroyed_and_nothing_comes_back(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender = make()
    sender.send(1, "park", {})
    sender.close()
    assert len(graph.destroyed) == len(graph.clients) - 1, "all but the client of the action"
    graph.answer("antenna_servo/park", Trigger.Response(success=True))
    sender.poll()
    assert graph.responses == []
    sender.close()


def test_nested_fields_and_times_are_filled_from_plain_values() -> None:
    request = filled(SelectTarget.Request(), {"target": "ISS", "start": 1_151_384_000.25, "minimum_peak_elevation": 1})
    assert (request.target, request.minimum_peak_elevation) == ("ISS", 1.0)
    for start, stamp in ((1_151_384_000.25, Time(sec=1_151_384_000, nanosec=250_000_000)), (Time(sec=5), Time(sec=5)),
                         ("12.5", Time(sec=12, nanosec=500_000_000))):  # fmt: skip
        assert filled(SelectTarget.Request(), {"start": start}).start == stamp
    wanted = {"target_pass": {"target": "ISS", "aos": 100, "peak_elevation": 0.5}, "sensor": "conscan"}
    goal = filled(TrackPass.Goal(), wanted)
    assert (goal.sensor, goal.target_pass.target, goal.target_pass.aos.sec) == ("conscan", "ISS", 100)
    assert filled(TrackPass.Goal(), {"target_pass": Pass(target="MIR")}).target_pass.target == "MIR"


@pytest.mark.parametrize(
    ("message", "values", "words"),
    [
        (SelectTarget.Request(), {"goal": "ISS"}, "SelectTarget_Request has no field goal"),
        (SelectTarget.Request(), {"target": 25544}, "target=25544 is no str"),
        (PointingError(), {"valid": 1}, "valid=1 is no bool"),
        (PointingError(), {"sequence": True}, "sequence=True is no int"),
        (PointingError(), {"cross_elevation": "0.1"}, "cross_elevation='0.1' is no float"),
    ],
)
def test_a_value_of_another_type_is_refused_before_it_is_sent(message: Any, values: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        filled(message, values)


def test_plain_fields_are_numbers_texts_and_truth_values() -> None:
    fields = plain_fields(PointingError(sensor="monopulse", valid=True, sequence=3, cross_elevation=0.5))
    wanted = {"sensor": "monopulse", "valid": True, "sequence": 3, "cross_elevation": 0.5}
    assert {name: fields[name] for name in wanted} == wanted
    assert not {"header", "covariance"} & set(fields)
