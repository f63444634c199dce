"""A station without processes: one node whose messages, services and actions a test sets, on its own wall clock."""

import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from rcl_interfaces.srv import GetParameters

from rf_pointing.commands import live_pass, station, station_run
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

    `services` maps a name to what answers its requests, `results` an action to its result (None:
    the goal is refused), `events` are pairs of a time after the begin and what happens then.
    """

    def __init__(self, wall: Wall) -> None:
        self.wall, self.ready_s, self.answer_s, self.result_s = wall, 0.05, 0.05, 1.0
        self.services: dict[str, Callable[[Any], Any]] = {
            "antenna_servo/get_parameters": lambda _: GetParameters.Response()
        }
        self.results: dict[str, Any] = {}
        self.events: list[tuple[float, Callable[[], None]]] = []
        self.calls: list[tuple[str, Any]] = []
        self.goals: list[tuple[str, Any]] = []
        self.topics: dict[str, tuple[Any, Callable[[Any], None], Any]] = {}
        self.feedback: Callable[[Any], None] | None = None
        self.cancelled_s: list[float] = []
        self.handlers: dict[int, Callable[..., None]] = {}
        self.life: list[str] = []
        self.name = self.namespace = ""
        self._nodes: list[Any] = []
        self._spins = 0
        self.graphs: list[FakeGraph] = []
        self.recorders: list[FakeRecorder] = []
        self.recorder: Any = None

    def publish(self, at_s: float, topic: str, message: Any) -> None:
        """Publish a message at a time after the begin."""
        self.at(at_s, lambda: self.topics[topic][1](message))

    def at(self, after_s: float, happens: Callable[[], None]) -> None:
        self.events.append((BEGIN_S + after_s, happens))

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
            return Answer(self.wall, self.wall.now_s + self.answer_s, self.services[name](request))

        return SimpleNamespace(service_is_ready=lambda: name in self.services and self.offered(), call_async=call_async)

    def action_client(self, _node: Any, _kind: Any, name: str) -> Any:
        def send_goal_async(goal: Any, feedback_callback: Any = None) -> Answer:
            assert self.offered(), f"{name} gets a goal before it is there"
            self.goals.append((name, goal))
            self.feedback = feedback_callback
            result = self.results[name]
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


def make_station(monkeypatch: pytest.MonkeyPatch) -> FakeStation:
    """Put a station in the place of the network, the clock and the signals."""
    wall = Wall()
    fake = FakeStation(wall)
    for module in (station, station_run, live_pass):
        monkeypatch.setattr(module, "time", wall)
    for module in (station, live_pass):
        monkeypatch.setattr(module, "ActionClient", fake.action_client)
    library = SimpleNamespace(
        init=lambda **_: fake.life.append("begun"), try_shutdown=lambda: fake.life.append("over"),
        create_node=fake.create_node, signals=rclpy.signals,
    )  # fmt: skip
    monkeypatch.setattr(station_run, "rclpy", library)
    monkeypatch.setattr(station_run, "make_executor", lambda: fake)
    kept = {name: getattr(signal, name) for name in ("SIGINT", "SIGTERM")}
    monkeypatch.setattr(station_run, "signal", SimpleNamespace(**kept, signal=fake.handlers.__setitem__))
    return fake


class FakeGraph:
    """The processes of a run, as `ManagedGraph`: `steps` are what was done with them, each with its time."""

    made: list["FakeGraph"]

    def __init__(
        self, _node: Any, namespace: str, files: list[Path], logs: Path, spin: Any, *, patience_s: float, on_time: Any
    ) -> None:
        self.namespace, self.files, self.logs, self.patience_s, self.on_time = (
            namespace,
            files,
            logs,
            patience_s,
            on_time,
        )
        self.steps: list[tuple[Any, ...]] = []
        self.checks, self.ended = 0, ""
        self._spin = spin
        self.made.append(self)

    def start(self, names: Any, simulated_time: bool) -> None:
        self.steps.append(("start", tuple(names), simulated_time))

    def configure(self, names: Any) -> None:
        self.steps.append(("configure", tuple(names)))

    def activate(self, names: Any) -> None:
        self.steps.append(("activate", tuple(names)))

    def change(self, names: Any, transition: str) -> None:
        self.steps.append((transition, tuple(names)))

    def wait(self, duration_s: float) -> None:
        self._spin(duration_s)
        self.steps.append(("wait", duration_s))

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        for _ in range(1000):
            if condition():
                self.steps.append(("until", what))
                return
            self._spin(0.02)
        raise TimeoutError(f"{what} not seen")

    def check(self) -> None:
        self.checks += 1
        if self.ended:
            raise NotStartedError(self.ended)

    def complaint(self, name: str) -> str:
        return f"the last line of {name}"

    def stop(self) -> None:
        self.steps.append(("stop",))


class FakeRecorder:
    """A recorder whose topics are all matched `ready_s` after the begin, and which ends with `result`."""

    made: list["FakeRecorder"]
    wall: Wall
    ready_s = 0.0
    result: Any = SimpleNamespace(problem="", lost=())

    def __init__(self, _node: Any, namespace: str, path: Path, topics: Any, notes: dict[str, str]) -> None:
        self.namespace, self.path, self.topics, self.notes, self.closed = namespace, path, topics, notes, False
        self.made.append(self)

    def unmatched(self) -> list[str]:
        return [] if self.wall.passed_s >= self.ready_s else ["antenna_status"]

    def close(self) -> Any:
        self.closed = True
        return self.result


def make_run(monkeypatch: pytest.MonkeyPatch) -> FakeStation:
    """Put fakes in the place of everything that a run of a whole station starts."""
    fake = make_station(monkeypatch)
    graph, recorder = type("Graph", (FakeGraph,), {"made": []}), type("Bag", (FakeRecorder,), {"made": []})
    recorder.wall = fake.wall
    fake.graphs, fake.recorders, fake.recorder = graph.made, recorder.made, recorder
    monkeypatch.setattr(station_run, "ManagedGraph", graph)
    monkeypatch.setattr(station_run, "Recorder", recorder)
    monkeypatch.setattr(station_run, "settle_garbage", lambda: fake.life.append("settled"))
    return fake
