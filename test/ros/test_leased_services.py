"""While a signed commander has the antenna its services are closed; who has the key signs its calls."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rf_pointing_msgs.srv import SignedCall
from std_srvs.srv import Trigger

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import LEASE_S, LEASED, Caller, LeasedServices

NOW_S = 1_200_000_000.0
# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


class Node:
    """A node without ROS; `served` are its services by name."""

    def __init__(self) -> None:
        self.t_s = NOW_S
        self.served: dict[str, Any] = {}
        self.logged: list[str] = []

    def now_s(self) -> float:
        return self.t_s

    def serve_action(self, _kind: Any, name: str, act: Any) -> None:
        self.served[name] = act

    def resolve_service_name(self, name: str) -> str:
        return f"/gs1/{name.replace('~', 'antenna_servo')}"

    def get_fully_qualified_name(self) -> str:
        return "/gs1/operator_page"

    def log_once(self, _subject: str, words: str) -> None:
        self.logged.append(words)

    def create_client(self, kind: Any, name: str) -> tuple[Any, str]:
        return kind, name


def leased(node: Node, signed: bool = True) -> LeasedServices:
    return LeasedServices(node, SimpleNamespace(signed=signed, path="/etc/key"))  # type: ignore[arg-type]


EIGHTHS = st.integers(-40, 40).map(lambda count: count / 8.0)


@given(st.lists(st.tuples(st.sampled_from(["one", "two"]), EIGHTHS), max_size=5), EIGHTHS)
def test_the_newest_stamp_holds_the_antenna_for_two_seconds(commands: list[tuple[str, float]], after_s: float) -> None:
    node = Node()
    services = leased(node)
    newest, holder = float("-inf"), ""
    for name, stamp_s in commands:
        services.note(name, NOW_S + stamp_s)
        # One far ahead of the clock, as after a step back, gives way to any.
        if stamp_s > newest or newest > LEASE_S:
            newest, holder = stamp_s, name
    node.t_s = NOW_S + after_s
    assert services.holder == (holder if abs(after_s - newest) <= LEASE_S else "")
    assert services.values()["lease"] == services.holder


def test_a_call_without_a_signature_is_refused_and_counted_while_there_is_a_commander() -> None:
    node, calls = Node(), list[Any]()
    services = leased(node)
    services.serve(Trigger, "park", lambda request: calls.append(request) or "park accepted")
    assert node.served["~/park"](1) == "park accepted"
    services.note("/gs1/pointing_controller", NOW_S)
    for _ in range(2):
        with pytest.raises(ValueError, match="/gs1/antenna_servo/park is refused: /gs1/pointing_controller commands"):
            node.served["~/park"](2)
    assert calls == [1]
    assert services.values() == {
        "lease": "/gs1/pointing_controller", "calls_refused": 2, "last_call_refused": node.logged[0]
    }  # fmt: skip


def test_a_signed_call_reaches_its_service_and_another_one_is_refused(tmp_path: Path) -> None:
    node, key = Node(), CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "key")))
    services, caller = LeasedServices(node, key), Caller(node, key)  # type: ignore[arg-type]
    services.serve(Trigger, "park", lambda request: f"{type(request).__name__} accepted")
    signed = node.served["~/signed"]
    assert signed(caller.request("antenna_servo/park", Trigger.Request())) == "Trigger_Request accepted"
    with pytest.raises(ValueError, match="service='/gs1/antenna_servo/stow' must be one of /gs1/antenna_servo/park"):
        signed(caller.request("antenna_servo/stow", Trigger.Request()))
    assert services.values()["calls_refused"] == 0
    with pytest.raises(ValueError, match="/gs1/antenna_servo/park is refused: a call in the name of nobody"):
        signed(SignedCall.Request(service="/gs1/antenna_servo/park"))
    assert services.values()["calls_refused"] == 1


@pytest.mark.parametrize("name", [LEASED[0], "antenna_servo/stop", "ephemeris_publisher/select_target"])
@pytest.mark.parametrize("signed", [True, False])
def test_what_has_a_lease_is_called_by_the_signed_service_where_there_is_a_key(
    tmp_path: Path, name: str, signed: bool
) -> None:
    caller = Caller(Node(), CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "key") if signed else "")))  # type: ignore[arg-type]
    by_key = signed and name in LEASED
    assert caller.client(Trigger, name) == ((SignedCall, "antenna_servo/signed") if by_key else (Trigger, name))
    request = Trigger.Request()
    assert (caller.request(name, request) is request) != by_key
