"""A station without processes or a network: one node whose messages, services and actions a test sets, on a wall clock
that goes on where somebody waits."""

import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import GetParameters

from rf_pointing.ros import (
    campaign_run,
    experiment_run,
    live_pass,
    managed_graph,
    repeated_call,
    station_client,
    station_run,
)
from rf_pointing.ros.managed_graph import NotStartedError

BEGIN_S = 1000.0
MOST_LOOKS = 100_000
"""At the wall or at one answer; a loop that ends later would not end at all."""


class Wall:
    """Wall time that goes on where somebody waits; each look at it takes a microsecond."""

    def __init__(self) -> None:
        self.now_s, self._looks = BEGIN_S, 0

    def monotonic(self) -> float:
        self._looks += 1
        assert self._looks < MOST_LOOKS, "nobody waits"
        self.now_s += 1e-6
        return self.now_s

    time = monotonic

    @property
    def passed_s(self) -> float:
        return self.now_s - BEGIN_S

    def rule(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Give every client this time."""
        for module in (managed_graph, repeated_call, station_run, live_pass, station_client):
            monkeypatch.setattr(module, "time", self)
        monkeypatch.setattr(experiment_run, "time", self)


class Answer:
    """A future that is done at a time of the wall."""

    def __init__(self, wall: Wall, at_s: float, value: Any) -> None:
        self._wall, self._at_s, self._value, self._looks = wall, at_s, value, 0

    def done(self) -> bool:
        self._looks += 1
        assert self._looks < MOST_LOOKS, "nobody waits"
        return self._wall.now_s >= self._at_s

    def result(self) -> Any:
        assert self.done(), "read before it is there"
        return self._value


class FakeStation:
    """What is outside the program: everything takes 0.05 s unless a test changes it.

    `services` maps a name to what answers its requests, `results` an action to its result (None: the goal is refused;
    a list: one goal after the other), `events` are pairs of a time after the begin and what happens then.  `log` has
    calls, goals and steps of the processes in their order.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall, self.ready_s, self.answer_s, self.result_s = Wall(), 0.05, 0.05, 1.0
        self.services: dict[str, Callable[[Any], Any]] = {
            "antenna_servo/get_parameters": lambda _: GetParameters.Response(),
            "pointing_controller/get_state": lambda _: GetState.Response(current_state=State(label=self.state)),
        }
        self.state = "inactive"
        self.results: dict[str, Any] = {}
        self.events: list[tuple[float, Callable[[], None]]] = []
        self.calls: list[tuple[str, Any]] = []
        self.goals: list[tuple[str, Any]] = []
        self.log: list[Any] = []
        self.topics: dict[str, tuple[Any, Callable[[Any], None], Any]] = {}
        self.publishers: dict[str, int] = {}
        self.warnings: list[str] = []
        self.feedback: Callable[[Any], None] = lambda _: None
        self.cancelled_s: list[float] = []
        self.handlers: dict[int, Any] = {}
        self.life: list[str] = []
        self.name = self.namespace = ""
        self.graph: Any = None
        self.recorder = SimpleNamespace(
            ready_s=0.0, given=(), closed=False, result=SimpleNamespace(problem="", lost=())
        )
        self._nodes: list[Any] = []
        self._spins = 0
        self.wall.rule(monkeypatch)
        for module in (live_pass, station_client, campaign_run, experiment_run):
            monkeypatch.setattr(module, "ActionClient", self.action_client)
        library = SimpleNamespace(
            init=lambda **_: self.life.append("begun"), try_shutdown=lambda: self.life.append("over"),
            create_node=self.create_node, signals=rclpy.signals,
        )  # fmt: skip
        monkeypatch.setattr(station_run, "rclpy", library)
        monkeypatch.setattr(station_run, "make_executor", lambda: self)
        monkeypatch.setattr(station_run, "settle_garbage", lambda: None)
        kept = {name: getattr(signal, name) for name in ("SIGINT", "SIGTERM")}
        monkeypatch.setattr(station_run, "signal", SimpleNamespace(**kept, signal=self._handle))
        for module in (station_run, experiment_run):
            monkeypatch.setattr(module, "ManagedGraph", self._begin)
        for module in (station_run, station_client):
            monkeypatch.setattr(module, "Recorder", self._record)

    def publish(self, at_s: float, topic: str, message: Any) -> None:
        """Publish a message at a time after the begin."""
        self.at(at_s, lambda: self.topics[topic][1](message))

    def at(self, after_s: float, happens: Callable[[], Any]) -> None:
        self.events.append((BEGIN_S + after_s, happens))

    def _handle(self, sign: int, handler: Any) -> Any:
        before = self.handlers.get(sign, "of before")
        self.handlers[sign] = handler
        return before

    # rclpy and its executor

    def create_node(self, name: str, namespace: str = "") -> Any:
        self.name, self.namespace = name, namespace
        return self

    def destroy_node(self) -> None:
        self.life.append("destroyed")

    def add_node(self, node: Any) -> None:
        self._nodes.append(node)

    def spin_once(self, timeout_sec: float) -> None:
        self._spins += 1
        assert self._spins < MOST_LOOKS, "nobody looks at the wall"
        self.wall.now_s += timeout_sec
        due = [event for event in self.events if event[0] <= self.wall.now_s and self._nodes]
        self.events = [event for event in self.events if event not in due]
        for _, happens in due:
            happens()

    def shutdown(self) -> None:
        self.life.append("executor shut down")

    # The node

    def create_subscription(self, kind: Any, name: str, callback: Callable[[Any], None], qos: Any) -> None:
        self.topics[name] = kind, callback, qos

    def count_publishers(self, topic: str) -> int:
        return self.publishers.get(topic, 0)

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.warnings.append(text))

    def resolve_service_name(self, name: str) -> str:
        return f"{self.namespace}/{name}"

    def get_fully_qualified_name(self) -> str:
        return f"{self.namespace}/{self.name}"

    def offered(self) -> bool:
        return self.wall.now_s >= BEGIN_S + self.ready_s

    def create_client(self, kind: Any, name: str) -> Any:
        def call_async(request: Any) -> Answer:
            assert self.offered(), f"{name} is called before it is there"
            assert isinstance(request, kind.Request)
            self.calls.append((name, request))
            self.log.append(name)
            return Answer(self.wall, self.wall.now_s + self.answer_s, self.services[name](request))

        return SimpleNamespace(service_is_ready=lambda: name in self.services and self.offered(), call_async=call_async)

    def action_client(self, _node: Any, _kind: Any, name: str) -> Any:
        def send_goal_async(goal: Any, feedback_callback: Any = None) -> Answer:
            assert self.offered(), f"{name} gets a goal before it is there"
            self.goals.append((name, goal))
            self.log.append(name)
            self.feedback = feedback_callback
            result = self.results[name].pop(0) if isinstance(self.results[name], list) else self.results[name]
            sent_s = self.wall.now_s + self.answer_s
            handle = SimpleNamespace(
                accepted=result is not None,
                get_result_async=lambda: Answer(self.wall, sent_s + self.result_s, SimpleNamespace(result=result)),
                cancel_goal_async=lambda: self.cancelled_s.append(self.wall.passed_s),
            )
            return Answer(self.wall, sent_s, handle)

        return SimpleNamespace(
            server_is_ready=lambda: name in self.results and self.offered(), send_goal_async=send_goal_async
        )

    # What a run starts

    def _begin(self, _node: Any, namespace: str, files: Any, logs: Path, _spin: Any, **given: Any) -> Any:
        self.graph = FakeGraph(self, namespace, list(files), logs, given)
        return self.graph

    def _record(self, _node: Any, namespace: str, path: Path, *rest: Any, simulated: bool = False) -> Any:
        self.recorder.given = namespace, path, *(rest or (None, None, simulated))
        path.mkdir(parents=True)

        def close() -> Any:
            self.recorder.closed = True
            self.log.append("bag closed")
            return SimpleNamespace(path=path, **vars(self.recorder.result))

        unmatched = lambda: [] if self.wall.passed_s >= self.recorder.ready_s else ["antenna_status"]  # noqa: E731
        return SimpleNamespace(unmatched=unmatched, close=close)


class FakeGraph:
    """The processes of a run, as `ManagedGraph`; what is done with them is in the log of the station."""

    def __init__(self, station: FakeStation, namespace: str, files: list[Path], logs: Path, given: Any) -> None:
        self.namespace, self.files, self.logs, self.on_time = namespace, files, logs, given.get("on_time", ())
        self.processes = given.get("processes", 8)
        self._log = station.log
        self.checks, self.ended = 0, ""

    def start(self, names: Any, simulated_time: bool = True) -> None:
        self._log.append(("start", tuple(names), simulated_time))

    def configure(self, names: Any) -> None:
        self._log.append(("configure", tuple(names)))

    def activate(self, names: Any) -> None:
        self._log.append(("activate", tuple(names)))

    def change(self, names: Any, transition: str) -> None:
        self._log.append((transition, tuple(names)))

    def check(self) -> None:
        self.checks += 1
        if self.ended:
            raise NotStartedError(self.ended)

    def complaint(self, name: str) -> str:
        return f"the last line of {name}"

    def stop(self) -> None:
        self._log.append("stop")


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeStation:
    """Return a station in the place of the network, the processes, the clock and the signals."""
    return FakeStation(monkeypatch)
