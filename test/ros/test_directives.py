"""Directives reach services, actions and parameters by name and type, and what comes back is their response."""

import math
from collections.abc import Callable
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
from rf_pointing.ros.directives import DirectiveSender, filled, plain_fields, type_of

# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


class Pending:
    """A future that the test completes."""

    def __init__(self) -> None:
        self.value: Any = None
        self.is_done = False

    def done(self) -> bool:
        return self.is_done

    def result(self) -> Any:
        return self.value

    def complete(self, value: Any) -> None:
        self.value, self.is_done = value, True


class Client:
    """A client of a service or an action: keeps what is sent, and offers nothing until it is `ready`."""

    def __init__(self, kind: Any, address: str) -> None:
        self.kind, self.address, self.ready, self.destroyed = kind, address, True, False
        self.sent: list[tuple[Any, Pending]] = []

    def call_async(self, request: Any) -> Pending:
        self.sent.append((request, Pending()))
        return self.sent[-1][1]

    def service_is_ready(self) -> bool:
        return self.ready

    def destroy(self) -> None:
        assert not self.destroyed
        self.destroyed = True


class Action:
    """The same for an action, with the names of its client."""

    def __init__(self, client: Client) -> None:
        self.server_is_ready, self.send_goal_async, self.destroy = (
            client.service_is_ready,
            client.call_async,
            client.destroy,
        )


class Graph:
    """A node without ROS: makes clients, by their address, and collects what the sender reports."""

    def __init__(self) -> None:
        self.clients: dict[str, Client] = {}
        self.responses: list[tuple[int, bool, str]] = []
        self.ends: list[tuple[int, str, bool, dict[str, Any]]] = []

    def create_client(self, kind: Any, address: str) -> Client:
        return self.clients.setdefault(address, Client(kind, address))

    def destroy_client(self, client: Client) -> None:
        assert isinstance(client, Client), "an action's client is no entity of the node"
        client.destroyed = True

    def resolve_service_name(self, name: str) -> str:
        return f"/gs1/{name}"

    def get_fully_qualified_name(self) -> str:
        return "/gs1/station_executive"


ROWS = (
    ("park", "service", "antenna_servo/park", "std_srvs/srv/Trigger", ()),
    ("go", "service", "antenna_servo/go_to", "rf_pointing_msgs/srv/GoTo", ("azimuth", "elevation")),
    ("track", "action", "track_pass", "rf_pointing_msgs/action/TrackPass", ("sensor",)),
    ("lead", "parameter", "pass/ephemeris_publisher/publisher.lead_s", "", ("value",)),
    ("note", "own", "write", "", ("text",)),
)


def rows(*given: tuple[str, str, str, str, tuple[str, ...]]) -> dict[str, DirectiveRow]:
    names = ("name", "kind", "address", "type_name", "takes")
    return {each[0]: DirectiveRow(**dict(zip(names, each, strict=True))) for each in given}  # type: ignore[arg-type]


def write(text: str) -> str:
    if not text:
        raise ValueError("text='' must have a letter")
    return f"written: {text}"


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Graph:
    made = Graph()
    monkeypatch.setattr(directives, "ActionClient", lambda _node, kind, name: Action(made.create_client(kind, name)))
    return made


@pytest.fixture
def make(graph: Graph) -> Callable[..., DirectiveSender]:
    def sender(*given: tuple[str, str, str, str, tuple[str, ...]], key: str = "") -> DirectiveSender:
        return DirectiveSender(
            graph, rows(*(given or ROWS)), {"write": write},  # type: ignore[arg-type]
            lambda *each: graph.responses.append(each), lambda *each: graph.ends.append(each),
            CommandKeyParams(command_key_file=key),
        )  # fmt: skip

    return sender


def test_each_kind_of_directive_gets_a_client_of_its_type(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    make()
    assert {name: client.kind for name, client in graph.clients.items()} == {
        "antenna_servo/park": Trigger,
        "antenna_servo/go_to": GoTo,
        "track_pass": TrackPass,
        "pass/ephemeris_publisher/set_parameters_atomically": directives.SetParametersAtomically,
    }


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (("fly", "own", "fly", "", ()), r"directive fly: own='fly' must be one of write$"),
        (
            ("go", "service", "go", "rf_pointing_msgs/srv/GoTo", ("azimuth", "height", "roll")),
            r"directive go: rf_pointing_msgs/srv/GoTo has no field height, roll$",
        ),
        (
            ("track", "action", "t", "rf_pointing_msgs/action/TrackPass", ("azimuth",)),
            r"directive track: rf_pointing_msgs/action/TrackPass has no field azimuth$",
        ),
        (("x", "service", "x", "no_package/srv/Trigger", ()), "type no_package/srv/Trigger is not installed"),
        (("x", "service", "x", "std_srvs/srv/Nothing", ()), "type std_srvs/srv/Nothing is not installed"),
    ],
)
def test_a_row_that_cannot_be_sent_is_refused(
    make: Callable[..., DirectiveSender], row: tuple[str, str, str, str, tuple[str, ...]], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        make(row)


def test_a_service_gets_its_arguments_and_its_answer_is_the_response(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender, client = make(), graph.clients["antenna_servo/go_to"]
    sender.send(7, "go", {"azimuth": 1, "elevation": 0.5})
    sender.send(8, "park", {})
    ((request, answer),) = client.sent
    assert (request.azimuth, request.elevation) == (1.0, 0.5)
    sender.poll()
    assert graph.responses == [], "nothing has come back"
    answer.complete(GoTo.Response(success=False, message="behind the mask"))
    sender.poll()
    sender.poll()
    assert graph.responses == [(7, False, "behind the mask")]
    graph.clients["antenna_servo/park"].sent[0][1].complete(Trigger.Response(success=True, message="park accepted"))
    sender.poll()
    assert graph.responses[1:] == [(8, True, "park accepted")]


def test_a_service_without_success_has_received_it(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender = make()
    sender.send(1, "park", {})
    graph.clients["antenna_servo/park"].sent[0][1].complete(SimpleNamespace())
    sender.poll()
    assert graph.responses == [(1, True, "")]


def test_a_leased_service_is_called_with_the_key_of_the_station(
    graph: Graph, make: Callable[..., DirectiveSender], tmp_path: Any
) -> None:
    sender = make(key=str(tmp_path / "command.key"))
    sender.send(1, "park", {})
    ((call, _answer),) = graph.clients["antenna_servo/signed"].sent
    assert isinstance(call, SignedCall.Request)
    assert (call.service, call.caller) == ("/gs1/antenna_servo/park", "/gs1/station_executive")
    assert len(call.signature) == 32


def test_a_parameter_is_set_at_its_node(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender, client = make(), graph.clients["pass/ephemeris_publisher/set_parameters_atomically"]
    sender.send(3, "lead", {"value": 1.5})
    ((request, answer),) = client.sent
    (wanted,) = request.parameters
    assert (wanted.name, wanted.value.type, wanted.value.double_value) == (
        "publisher.lead_s", ParameterType.PARAMETER_DOUBLE, 1.5,
    )  # fmt: skip
    answer.complete(SimpleNamespace(result=SimpleNamespace(successful=False, reason="lead_s=1.5 must be <= 1")))
    sender.poll()
    assert graph.responses == [(3, False, "lead_s=1.5 must be <= 1")]
    sender.send(4, "lead", {})
    assert graph.responses[1:] == [(4, False, "directive lead needs value")]


@pytest.mark.parametrize(("status", "succeeded"), [(4, True), (5, False), (6, False)])
def test_an_action_is_accepted_and_ends_with_the_plain_fields_of_its_result(
    graph: Graph, make: Callable[..., DirectiveSender], status: int, succeeded: bool
) -> None:
    sender, client = make(), graph.clients["track_pass"]
    sender.send(9, "track", {"sensor": "monopulse"})
    ((goal, offered),) = client.sent
    assert goal.sensor == "monopulse"
    over = Pending()
    offered.complete(SimpleNamespace(accepted=True, get_result_async=lambda: over))
    sender.poll()
    assert graph.responses == [(9, True, "")]
    sender.poll()
    assert graph.ends == []
    over.complete(SimpleNamespace(status=status, result=TrackPass.Result(message="over", seconds_tracked=310.5)))
    sender.poll()
    ((number, name, success, fields),) = graph.ends
    assert (number, name, success) == (9, "track", succeeded)
    assert (fields["message"], fields["seconds_tracked"]) == ("over", 310.5)


def test_a_refused_goal_has_no_end(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender = make()
    sender.send(9, "track", {"sensor": "monopulse"})
    graph.clients["track_pass"].sent[0][1].complete(SimpleNamespace(accepted=False))
    sender.poll()
    sender.poll()
    assert (graph.responses, graph.ends) == ([(9, False, "the goal was refused")], [])


@pytest.mark.parametrize(
    ("name", "address", "words"),
    [("park", "antenna_servo/park", "service antenna_servo/park"), ("track", "track_pass", "action track_pass")],
)
def test_what_nobody_offers_is_refused_at_once(
    graph: Graph, make: Callable[..., DirectiveSender], name: str, address: str, words: str
) -> None:
    sender = make()
    graph.clients[address].ready = False
    sender.send(2, name, {})
    assert graph.responses == [(2, False, f"{words} is not offered")]
    assert graph.clients[address].sent == []


def test_the_executive_s_own_directive_answers_at_once(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender = make()
    sender.send(5, "note", {"text": "rain"})
    sender.send(6, "note", {"text": ""})
    assert graph.responses == [(5, True, "written: rain"), (6, False, "text='' must have a letter")]


def test_a_wrong_argument_is_the_response(graph: Graph, make: Callable[..., DirectiveSender]) -> None:
    sender = make()
    sender.send(5, "go", {"azimuth": "north"})
    sender.send(6, "track", {"speed": 1.0})
    assert graph.responses == [
        (5, False, "azimuth='north' is no float"),
        (6, False, "TrackPass_Goal has no field speed"),
    ]


def test_closed_clients_are_destroyed_and_nothing_comes_back(
    graph: Graph, make: Callable[..., DirectiveSender]
) -> None:
    sender = make()
    sender.send(1, "park", {})
    sender.close()
    assert all(client.destroyed for client in graph.clients.values())
    graph.clients["antenna_servo/park"].sent[0][1].complete(Trigger.Response(success=True))
    sender.poll()
    assert graph.responses == []
    sender.close()


def test_nested_fields_and_times_are_filled_from_plain_values() -> None:
    request = filled(SelectTarget.Request(), {"target": "ISS", "start": 1_151_384_000.25, "minimum_peak_elevation": 1})
    assert (request.target, request.minimum_peak_elevation) == ("ISS", 1.0)
    assert request.start == Time(sec=1_151_384_000, nanosec=250_000_000)
    assert filled(SelectTarget.Request(), {"start": Time(sec=5)}).start == Time(sec=5)
    assert filled(SelectTarget.Request(), {"start": "12.5"}).start == Time(sec=12, nanosec=500_000_000)
    wanted = {"target_pass": {"target": "ISS", "aos": 100, "peak_elevation": 0.5}, "sensor": "conscan"}
    goal = filled(TrackPass.Goal(), wanted)
    assert (goal.sensor, goal.target_pass.target, goal.target_pass.aos.sec) == ("conscan", "ISS", 100)
    assert goal.target_pass.peak_elevation == 0.5
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
    fields = plain_fields(PointingError(sensor="monopulse", valid=True, sequence=3, cross_elevation=math.pi))
    assert fields["sensor"] == "monopulse"
    assert (fields["valid"], fields["sequence"], fields["cross_elevation"]) == (True, 3, math.pi)
    assert not {"header", "covariance"} & set(fields)


def test_a_type_is_found_by_its_name() -> None:
    assert type_of("rf_pointing_msgs/srv/GoTo") is GoTo
    assert type_of("rf_pointing_msgs/action/TrackPass") is TrackPass
