"""The processes of a graph, their lifecycle, and what ends them, without a network."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

from rf_pointing.ros import managed_graph
from rf_pointing.ros.main_loop import DEAF
from rf_pointing.ros.managed_graph import ManagedGraph, NodeProcesses, NotStartedError
from test.ros.fake_station import Answer, Wall


class Process:
    """A process that takes `ends_s` of the wall to end by the signals in `obeys`."""

    def __init__(self, wall: Wall, arguments: list[str], options: dict[str, Any]) -> None:
        self.wall, self.arguments, self.options = wall, arguments, options
        self.pid = 4000
        self.code: int | None = None
        self.obeys, self.ends_s, self.end_s = {signal.SIGINT}, 0.5, math.inf
        self.signals: list[tuple[int, float]] = []
        self.bounds_s: list[float] = []

    def poll(self) -> int | None:
        if self.wall.now_s >= self.end_s:
            self.code = 0
        return self.code

    def send_signal(self, sign: int) -> None:
        self.signals.append((sign, self.wall.passed_s))
        if sign in self.obeys:
            self.end_s = self.wall.now_s + self.ends_s

    def wait(self, timeout: float) -> int:
        self.bounds_s.append(timeout)
        if self.wall.now_s + timeout < self.end_s:
            self.wall.now_s += timeout
            raise subprocess.TimeoutExpired("node", timeout)
        self.wall.now_s = max(self.wall.now_s, self.end_s)
        return 0


class Machine:
    """Where the processes run; `holders` are those that hold a name, all of ours where it is None."""

    def __init__(self) -> None:
        self.wall = Wall()
        self.made: list[Process] = []
        self.holders: dict[str, int] = {}

    def start(self, arguments: list[str], **options: Any) -> Process:
        process = Process(self.wall, arguments, options)
        process.pid += len(self.made)
        self.made.append(process)
        options["stdout"].write(b"starts\n")
        return process

    def __getitem__(self, name: str) -> Process:
        """Return the newest process of an executable."""
        return next(each for each in reversed(self.made) if each.arguments[0] == f"/prefix/lib/rf_pointing/{name}")


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    machine.wall.rule(monkeypatch)
    fake = SimpleNamespace(
        Popen=machine.start, DEVNULL=subprocess.DEVNULL, STDOUT=subprocess.STDOUT,
        TimeoutExpired=subprocess.TimeoutExpired,
    )  # fmt: skip
    monkeypatch.setattr(managed_graph, "subprocess", fake)
    monkeypatch.setattr(managed_graph, "get_package_prefix", lambda _: "/prefix")
    monkeypatch.setattr(managed_graph, "last_holder", lambda name: machine.holders.get(name))
    return machine


# Processes


SLEEPER = "#!/bin/sh\nexec sleep 60\n"


@pytest.fixture
def sleepers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Install executables that sleep, and return their names."""
    names = ["antenna_servo", "rf_receiver"]
    folder = tmp_path / "lib" / "rf_pointing"
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_text(SLEEPER)
        (folder / name).chmod(0o755)
    monkeypatch.setattr(managed_graph, "get_package_prefix", lambda _: str(tmp_path))
    return names


def test_what_is_not_on_time_runs_in_the_background_and_nothing_in_the_group_of_the_terminal(
    sleepers: list[str], tmp_path: Path
) -> None:
    own = os.getpriority(os.PRIO_PROCESS, 0)
    for on_time, niceness in (((), (0, 0)), (("antenna_servo",), (0, managed_graph.NICENESS))):
        processes = NodeProcesses("/gs1", [], tmp_path, on_time)
        processes.start(sleepers)
        ids = [processes.process_id(name) for name in sleepers]
        assert [os.getpriority(os.PRIO_PROCESS, each) for each in ids] == [min(own + more, 19) for more in niceness]
        assert [os.getpgid(each) for each in ids] == ids, "Ctrl-C would reach it"
        processes.stop()


def test_nodes_of_one_process_are_started_found_and_ended_together(machine: Machine, tmp_path: Path) -> None:
    names = ["simulation_clock", "antenna_servo", "conscan_tracker", "monopulse_tracker"]
    processes = NodeProcesses("/gs1", [Path("a.yaml")], tmp_path, ["antenna_servo"], processes=2)
    processes.start(names)
    assert [each.arguments[:3] for each in machine.made] == [
        ["/prefix/lib/rf_pointing/station_process", *room] for room in (names[:2], names[2:])
    ]
    # The clock's process takes its time for its other nodes.
    assert all("use_sim_time:=true" in each.arguments for each in machine.made)
    assert [processes.process_id(name) for name in names] == [4000, 4000, 4001, 4001]
    log = processes.log("monopulse_tracker")
    log.write_text("[ERROR] [gs1.monopulse_tracker]: no beam\n[INFO] [gs1.conscan_tracker]: begins\n")
    assert processes.complaint("monopulse_tracker") == "[ERROR] [gs1.monopulse_tracker]: no beam"
    machine.made[1].code = -9
    assert processes.ended() == {"conscan_tracker": -9, "monopulse_tracker": -9}
    processes.stop()
    assert [len(each.signals) for each in machine.made] == [1, 0]


def test_a_node_ends_with_the_process_that_has_started_it(sleepers: list[str], tmp_path: Path) -> None:
    code = (
        "import os, sys; from rf_pointing.ros import managed_graph as m; "
        "m.get_package_prefix = lambda _: sys.argv[1]; from pathlib import Path; "
        "nodes = m.NodeProcesses('/gs1', [], Path(sys.argv[1])); nodes.start(['antenna_servo']); "
        "print(nodes.process_id('antenna_servo'), flush=True); os._exit(1)"
    )
    started = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True, check=False
    )
    node = Path(f"/proc/{int(started.stdout)}/stat")
    deadline_s = time.monotonic() + 30.0
    while node.exists() and node.read_text().split()[2] != "Z":
        assert time.monotonic() < deadline_s
        os.sched_yield()


def test_processes_end_by_the_mildest_signal_that_does_it(machine: Machine, tmp_path: Path) -> None:
    """SIGINT and 4 s, SIGTERM and 2 s, SIGKILL; together, not one after the other."""
    processes = NodeProcesses("/gs1", [], tmp_path)
    processes.start(["quick", "slow", "stubborn", "deaf", "over"])
    machine["slow"].ends_s = 3.0
    machine["stubborn"].obeys = {signal.SIGTERM}
    machine["deaf"].obeys = {signal.SIGKILL}
    machine["over"].code = 1
    processes.stop()
    assert [[sign for sign, _ in each.signals] for each in machine.made] == [
        [signal.SIGINT], [signal.SIGINT], [signal.SIGINT, signal.SIGTERM],
        [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], [],
    ]  # fmt: skip
    assert [round(at_s, 2) for _, at_s in machine["deaf"].signals] == pytest.approx([0.0, 4.0, 6.0], abs=0.05)
    assert all(bound_s > 0.0 for each in machine.made for bound_s in each.bounds_s), "zero would not wait at all"
    assert machine.wall.passed_s == pytest.approx(6.5, abs=0.05)
    assert processes.ended() == {}, "nothing of it is known any longer"


# Lifecycle


class Network:
    """The lifecycle services of a graph; `refusing` nodes refuse the transition so many times."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.ready_s, self.answer_s = machine, 0.1, 0.05
        self.refusing: dict[str, float] = {}
        self.lost: set[str] = set()
        self.late_s: dict[str, float] = {}
        self.states: dict[str, int] = {}
        self.requests: list[tuple[str, int, float]] = []
        self.spins = 0
        self.happens: Callable[[], None] = lambda: None

    def spin(self, timeout_s: float) -> None:
        self.spins += 1
        self.machine.wall.now_s += timeout_s
        self.happens()

    def create_client(self, kind: Any, name: str) -> Any:
        wall = self.machine.wall
        space, node, service = name.rsplit("/", 2)
        assert space == "/gs1"
        assert service == {ChangeState: "change_state", GetState: "get_state"}[kind]

        def call_async(request: Any) -> Answer:
            at_s = wall.now_s + self.answer_s
            if kind is GetState:
                state = State(id=self.states.get(node, State.PRIMARY_STATE_UNCONFIGURED))
                return Answer(wall, at_s, GetState.Response(current_state=state))
            self.requests.append((node, request.transition.id, wall.passed_s))
            left = self.refusing.get(node, 0)
            self.refusing[node] = left - 1
            answered_s = math.inf if node in self.lost else at_s + self.late_s.get(node, 0.0)
            return Answer(wall, answered_s, ChangeState.Response(success=left <= 0))

        return SimpleNamespace(
            service_is_ready=lambda: wall.passed_s >= self.ready_s, call_async=call_async,
            remove_pending_request=lambda _: None,
        )  # fmt: skip


NODES = ["antenna_servo", "rf_receiver"]


@pytest.fixture
def network(machine: Machine) -> Network:
    return Network(machine)


@pytest.fixture
def graph(machine: Machine, network: Network, tmp_path: Path) -> ManagedGraph:
    """Return a started graph of two nodes that hold their names."""
    graph = ManagedGraph(network, "/gs1", [], tmp_path, network.spin, patience_s=20.0)
    graph.start(NODES)
    machine.holders = {f"/gs1/{name}": machine[name].pid for name in NODES}
    return graph


def complain(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / f"{name}.log").write_text(f"begin\n{text}\n")


def test_a_graph_is_configured_when_its_nodes_hold_their_names(
    machine: Machine, network: Network, graph: ManagedGraph
) -> None:
    network.ready_s = 3.0
    machine.holders["/gs1/rf_receiver"] = 1

    def take_over() -> None:
        if machine.wall.passed_s > 5.0:
            machine.holders["/gs1/rf_receiver"] = machine["rf_receiver"].pid

    network.happens = take_over
    graph.configure(NODES)
    assert [request[:2] for request in network.requests] == [(name, Transition.TRANSITION_CONFIGURE) for name in NODES]
    assert [at_s for _, _, at_s in network.requests] == pytest.approx([5.0, 5.0], abs=0.1)


def test_a_node_that_refuses_is_named_with_its_reason(
    machine: Machine, network: Network, graph: ManagedGraph, tmp_path: Path
) -> None:
    network.refusing = {"rf_receiver": 1}
    complain(tmp_path, "rf_receiver", "band=Q must be one of S, X")
    with pytest.raises(NotStartedError, match="^could not configure rf_receiver: band=Q must be one of S, X$"):
        graph.configure(NODES)


def test_a_process_that_ends_meanwhile_ends_the_wait_at_once(
    machine: Machine, network: Network, graph: ManagedGraph, tmp_path: Path
) -> None:
    complain(tmp_path, "rf_receiver", "no such band")

    def crash() -> None:
        machine["rf_receiver"].code = 1 if machine.wall.passed_s > 1.0 else None

    network.happens, network.ready_s = crash, math.inf
    with pytest.raises(NotStartedError, match="^rf_receiver ended: no such band$"):
        graph.configure(NODES)
    assert machine.wall.passed_s == pytest.approx(1.0, abs=0.1)
    with pytest.raises(NotStartedError, match="rf_receiver ended"):
        graph.waiting.until(lambda: False, "anything not seen")


@pytest.mark.parametrize(
    ("state", "refused"), [(State.PRIMARY_STATE_INACTIVE, False), (State.PRIMARY_STATE_UNCONFIGURED, True)]
)
def test_where_an_answer_is_lost_the_state_of_the_node_counts(
    network: Network, graph: ManagedGraph, tmp_path: Path, state: int, refused: bool
) -> None:
    network.lost, network.states = {"rf_receiver"}, {"rf_receiver": state}
    complain(tmp_path, "rf_receiver", "busy")
    if refused:
        with pytest.raises(NotStartedError, match="could not configure rf_receiver: busy"):
            graph.configure(NODES)
    else:
        graph.configure(NODES)


def test_a_node_that_tells_its_state_before_it_takes_the_change_has_not_refused(
    machine: Machine, network: Network, graph: ManagedGraph
) -> None:
    """On a busy computer: its state is still the old one after 5 s, and the change succeeds after 8 s."""
    network.late_s = {"rf_receiver": 8.0}
    graph.configure(NODES)
    assert machine.wall.passed_s == pytest.approx(8.1, abs=0.1)


def test_an_activation_is_repeated_for_the_nodes_that_refuse_it(
    machine: Machine, network: Network, graph: ManagedGraph
) -> None:
    """The held time reaches one node after the other; each gets the request again after 0.1 s."""
    graph.configure(NODES)
    network.requests.clear()
    network.refusing = {"rf_receiver": 3}
    begin_s = machine.wall.passed_s
    graph.activate(NODES)
    assert [name for name, _, _ in network.requests] == [*NODES, *["rf_receiver"] * 3]
    assert {wanted for _, wanted, _ in network.requests} == {Transition.TRANSITION_ACTIVATE}
    # Each answer takes 0.05 s, which is seen at most 0.02 s later, and so is the end of the wait.
    assert 4 * 0.05 + 3 * 0.1 <= machine.wall.passed_s - begin_s < 4 * 0.07 + 3 * 0.12


def test_a_deaf_node_starts_again_and_activates_itself(machine: Machine, graph: ManagedGraph) -> None:
    graph.check()
    assert len(machine.made) == 2
    first = machine["rf_receiver"]
    first.code = DEAF
    graph.check()
    again = machine["rf_receiver"]
    assert len(machine.made) == 3
    assert again is not first
    assert again.arguments[-2:] == ["-p", "lifecycle.autostart:=true"]
    assert "use_sim_time:=true" in again.arguments
    graph.check()
    assert len(machine.made) == 3
