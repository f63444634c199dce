"""Calls wait outside of the node: all are answered or refused, and an urgent service is not behind the others."""

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from rf_pointing.ros import service_door
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.qos import SERVICE
from rf_pointing.ros.service_door import ServiceDoor

# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


@pytest.fixture(params=[make_executor, SingleThreadedExecutor])
def graph(request: Any, ros_context: Any) -> Iterator[SimpleNamespace]:
    """A node with two doors, each in the loop of its executor, and a node that calls it."""
    server, caller = (rclpy.create_node(name, context=ros_context) for name in ("server", "caller"))
    work, look = request.param(context=ros_context), SingleThreadedExecutor(context=ros_context)
    work.add_node(server)
    look.add_node(caller)
    doors, log = [ServiceDoor(server), ServiceDoor(server)], list[str]()

    def offer(door: ServiceDoor, name: str) -> Any:
        def act(_request: Any, response: Any) -> Any:
            log.append(name)
            response.success, response.message = True, f"{name} done"
            return response

        return door.open(Trigger, name, act, SERVICE)

    services = [offer(doors[0], "act"), offer(doors[1], "halt")]

    def until(condition: Callable[[], bool], *, works: bool = True) -> None:
        deadline_s = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < deadline_s
            if works:
                work.spin_once(timeout_sec=0.0)
            look.spin_once(timeout_sec=0.0)

    def client(name: str) -> Any:
        # With room for every answer: on a busy machine a caller of the test may look late.
        made = caller.create_client(Trigger, name, qos_profile=SERVICE)
        until(made.service_is_ready)
        return made

    yield SimpleNamespace(doors=doors, services=services, until=until, client=client, log=log, server=server)
    for door in doors:
        door.close()
    work.shutdown()
    look.shutdown()
    for node in (server, caller):
        node.destroy_node()


def test_all_of_300_calls_are_answered_and_an_urgent_one_before_them(graph: SimpleNamespace) -> None:
    clients, halt = [graph.client("act") for _ in range(10)], graph.client("halt")
    answers = [clients[index % 10].call_async(Trigger.Request()) for index in range(300)]
    stopped = halt.call_async(Trigger.Request())
    graph.until(stopped.done)
    assert sum(each.done() for each in answers) < 300
    graph.until(lambda: all(each.done() for each in answers))
    assert {each.result().message for each in answers} == {"act done"}
    assert (graph.log.count("act"), stopped.result().message) == (300, "halt done")


def test_calls_that_are_too_many_for_a_busy_node_are_refused_at_once(
    graph: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service_door, "MOST_WAITING", 5)
    client = graph.client("act")
    answers = [client.call_async(Trigger.Request()) for _ in range(9)]
    # The node itself does nothing meanwhile.
    graph.until(lambda: sum(each.done() for each in answers) == 4, works=False)
    refused = {each.result().message for each in answers if each.done()}
    assert (refused, graph.log) == ({"5 calls wait; call again later"}, [])
    graph.until(lambda: all(each.done() for each in answers))
    assert graph.log == ["act"] * 5


def test_a_service_that_is_closed_answers_nobody(graph: SimpleNamespace) -> None:
    client = graph.client("act")
    answer = client.call_async(Trigger.Request())
    graph.doors[0].shut(graph.services[0])
    graph.until(lambda: not client.service_is_ready())
    assert (answer.done(), graph.log, graph.doors[0].services) == (False, [], [])


def test_a_graph_that_cannot_be_read_costs_an_answer_time_and_not_the_service(
    graph: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    client, look, failed = graph.client("act"), graph.server.get_publishers_info_by_topic, list[str]()

    def damaged(*where: Any) -> Any:
        if len(failed) < 3:
            failed.append(where[0])
            raise UnicodeDecodeError("utf-8", b"\xa1", 0, 1, "invalid start byte")
        return look(*where)

    monkeypatch.setattr(graph.server, "get_publishers_info_by_topic", damaged)
    answer = client.call_async(Trigger.Request())
    graph.until(answer.done)
    assert (answer.result().message, failed) == ("act done", ["rq/actRequest"] * 3)
