"""A signed commander has the antenna for two seconds after its newest command; who has the key signs its calls."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rf_pointing_msgs.srv import SignedCall
from std_srvs.srv import Trigger

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import LEASED, Caller, LeasedServices

NOW_S = 1_200_000_000.0
# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


class Node:
    """A node without ROS; `served` are its services by name."""

    def __init__(self) -> None:
        self.t_s = NOW_S
        self.served: dict[str, tuple[Any, Any]] = {}
        self.logged: list[tuple[str, str]] = []

    def now_s(self) -> float:
        return self.t_s

    def serve_action(self, kind: Any, name: str, act: Any) -> None:
        self.served[name] = (kind, act)

    def resolve_service_name(self, name: str) -> str:
        return name.replace("~", "/gs1/antenna_servo")

    def log_once(self, subject: str, words: str) -> None:
        self.logged.append((subject, words))

    def create_client(self, kind: Any, name: str) -> tuple[Any, str]:
        return kind, name


@pytest.fixture
def node() -> Node:
    return Node()


def leased(node: Node, signed: bool = True) -> LeasedServices:
    return LeasedServices(node, SimpleNamespace(signed=signed, path="/etc/key"))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("after_s", "holder"), [(0.0, "one"), (1.9, "one"), (2.0, "one"), (2.1, ""), (-1.9, "one"), (-2.1, "")]
)
def test_a_lease_ends_two_seconds_after_the_stamp_of_the_command(node: Node, after_s: float, holder: str) -> None:
    services = leased(node)
    assert services.holder == ""
    services.note("one", NOW_S)
    node.t_s = NOW_S + after_s
    assert services.holder == holder
    assert services.values() == {"lease": holder, "calls_refused": 0, "last_call_refused": ""}


def test_after_a_step_back_of_the_clock_older_stamps_are_new(node: Node) -> None:
    services = leased(node)
    services.note("one", NOW_S)
    services.note("late", NOW_S - 0.5)
    assert services.holder == "one"
    node.t_s = NOW_S - 1.0
    services.note("late", NOW_S - 1.0)
    assert services.holder == "one", "within the lease"
    node.t_s = NOW_S - 60.0
    services.note("two", NOW_S - 60.0)
    assert services.holder == "two"


def test_without_a_key_nobody_has_the_antenna(node: Node) -> None:
    services = leased(node, signed=False)
    services.note("one", NOW_S)
    assert services.holder == ""


def test_a_call_without_a_signature_is_refused_and_counted_while_there_is_a_commander(node: Node) -> None:
    services, calls = leased(node), []
    services.serve(Trigger, "park", lambda request: calls.append(request) or "park accepted")
    assert set(node.served) == {"~/signed", "~/park"}
    kind, act = node.served["~/park"]
    assert (kind, act(1)) == (Trigger, "park accepted")
    services.note("/gs1/pointing_controller", NOW_S)
    for _ in range(2):
        with pytest.raises(ValueError, match="/gs1/antenna_servo/park is refused: /gs1/pointing_controller commands"):
            act(2)
    assert calls == [1]
    values = services.values()
    assert values["calls_refused"] == len(node.logged) == 2
    assert values["last_call_refused"] == node.logged[0][1]


def test_a_signed_call_reaches_its_service_and_another_one_is_refused(node: Node, tmp_path: Path) -> None:
    key = CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "key")))
    services = LeasedServices(node, key)  # type: ignore[arg-type]
    services.serve(Trigger, "park", lambda request: f"{type(request).__name__} accepted")
    _, signed = node.served["~/signed"]
    caller = Caller(_Caller(), key)  # type: ignore[arg-type]
    assert signed(caller.request("antenna_servo/park", Trigger.Request())) == "Trigger_Request accepted"
    with pytest.raises(ValueError, match="service='/gs1/antenna_servo/stow' must be one of /gs1/antenna_servo/park"):
        signed(caller.request("antenna_servo/stow", Trigger.Request()))
    assert services.values()["calls_refused"] == 0
    with pytest.raises(ValueError, match="/gs1/antenna_servo/park is refused: a call in the name of nobody"):
        signed(SignedCall.Request(service="/gs1/antenna_servo/park"))
    assert services.values()["calls_refused"] == 1


class _Caller(Node):
    def resolve_service_name(self, name: str) -> str:
        return f"/gs1/{name}"

    def get_fully_qualified_name(self) -> str:
        return "/gs1/operator_page"


@pytest.mark.parametrize("name", [LEASED[0], "antenna_servo/stop", "ephemeris_publisher/select_target"])
@pytest.mark.parametrize("signed", [True, False])
def test_what_has_a_lease_is_called_by_the_signed_service_where_there_is_a_key(
    tmp_path: Path, name: str, signed: bool
) -> None:
    caller = Caller(_Caller(), CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "key") if signed else "")))  # type: ignore[arg-type]
    by_key = signed and name in LEASED
    expected = (SignedCall, "antenna_servo/signed") if by_key else (Trigger, name)
    assert caller.client(Trigger, name) == expected
    request = Trigger.Request()
    sent = caller.request(name, request)
    assert (sent is request) != by_key
